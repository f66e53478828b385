"""Differences of the whole field, beside the error of the field that they are taken from."""

from __future__ import annotations

from reports.digits import percent
from study.results.folder import Results


def field_errors(results: Results) -> dict[tuple[str, str], dict[str, float]]:
    """Differences of the whole field by (model, reference) and quantity."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for model, reference, name, value in results.tables["errors"]:
        found.setdefault((str(model), str(reference)), {})[str(name)] = float(value)
    return found


def own_error(results: Results, reference: str = "fem") -> float | None:
    """Estimated error by its mesh of a reference's field at the peak, relative L2.

    None where it has none or none was estimated.
    """
    for record in results.numbers["models"]:
        if record["name"] == reference and record.get("mesh_error"):
            return float(record["mesh_error"]["field_peak"])
    return None


def resolved(share: float, error: float | None) -> str:
    """A difference as a percentage, or that the error of the reference hides it."""
    if error is not None and abs(share) < error:
        return f"not resolved (< {percent(error)})"
    return percent(share)
