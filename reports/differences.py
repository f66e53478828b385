"""Differences of the whole field, beside the error of the field that they are taken from."""

from __future__ import annotations

from reports.digits import percent, percent_known
from study.results import Results
from study.results.records import ModelRecord

ELEMENTS = ("fem", "hyperelastic")
"""References of finite elements, of which a run compares with the first that it has."""


def finite_elements(results: Results) -> ModelRecord | None:
    """Record of the finite-element reference, None for a run without one."""
    found = {model.name: model for model in results.record.models}
    return next((found[name] for name in ELEMENTS if name in found), None)


def elements(results: Results) -> str:
    """Name of the finite-element reference, of the linear one in a run without any."""
    model = finite_elements(results)
    return ELEMENTS[0] if model is None else model.name


def field_errors(results: Results) -> dict[tuple[str, str], dict[str, float]]:
    """Differences of the whole field by (model, reference) and quantity."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for row in results.field_differences:
        found.setdefault((row.model, row.reference), {})[row.quantity] = row.value
    return found


def own_error(results: Results, reference: str | None = None) -> float | None:
    """Estimated error by its mesh of a reference's field at the peak, relative L2.

    Of the finite elements by default; None where it has none or none was estimated.
    """
    errors = {model.name: model.mesh_error for model in results.record.models}
    found = errors.get(reference or elements(results))
    return None if found is None else found.field_peak


def resolved(share: float, error: float | None) -> str:
    """A difference in per cent to the digits of the reference's error, or that this hides it."""
    if error is not None and abs(share) < error:
        return f"not resolved (< {percent(error)})"
    return percent_known(share, error)
