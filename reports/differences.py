"""Differences of the whole field, beside the error of the field that they are taken from."""

from __future__ import annotations

from reports.digits import percent
from study.results.folder import Results
from study.results.records import ModelRecord


def finite_elements(results: Results) -> ModelRecord | None:
    """Record of the finite-element reference, None for a run without it."""
    return next((model for model in results.record.models if model.name == "fem"), None)


def field_errors(results: Results) -> dict[tuple[str, str], dict[str, float]]:
    """Differences of the whole field by (model, reference) and quantity."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for row in results.field_differences:
        found.setdefault((row.model, row.reference), {})[row.quantity] = row.value
    return found


def own_error(results: Results, reference: str = "fem") -> float | None:
    """Estimated error by its mesh of a reference's field at the peak, relative L2.

    None where it has none or none was estimated.
    """
    errors = {model.name: model.mesh_error for model in results.record.models}
    found = errors.get(reference)
    return None if found is None else found.field_peak


def resolved(share: float, error: float | None) -> str:
    """A difference as a percentage, or that the error of the reference hides it."""
    if error is not None and abs(share) < error:
        return f"not resolved (< {percent(error)})"
    return percent(share)
