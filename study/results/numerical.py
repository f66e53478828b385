"""Numerical errors of the curves that a score compares, as far as they are estimated."""

from __future__ import annotations

from collections.abc import Sequence

from study.results.records import CurveErrors, ModelRecord


def numerical_errors(
    reference: ModelRecord, models: Sequence[ModelRecord], probe: str, curve: str
) -> list[float | None]:
    """Relative L2 errors of curves: time step and rounding, and mesh of the reference.

    The error by its mesh includes that by its subspace, which is stated alone where the former is
    not estimated.
    Their sum approximately bounds the change of a relative L2 score of these models, or of their
    difference; for other measures it is a yardstick. None stands for an error that is not
    estimated. A spring lattice is a model at its spacing, and has no discretisation error of its
    own here.
    """
    compared = [reference, *models]
    steps = [_of_curve(curve, model.time_step_errors.get(probe)) for model in compared]
    steps += [
        _of_curve(curve, model.lattice.rounding_errors.get(probe))
        for model in compared
        if model.lattice is not None and model.lattice.precision == "single"
    ]
    elements = reference.elements
    if elements is None:
        return steps
    mesh = elements.mesh_error
    by_mesh = None if mesh is None else _of_curve(curve, mesh.by_probe.get(probe))
    if by_mesh is not None:
        return [*steps, by_mesh]
    left = _of_curve(curve, elements.truncation)
    return [*steps, None, (elements.truncation_error if left is None else left) or 0.0]


def whole_error(parts: Sequence[float | None]) -> float | None:
    """Sum of errors, None unless all of them are known."""
    known = [part for part in parts if part is not None]
    return sum(known) if len(known) == len(parts) else None


def _of_curve(curve: str, errors: CurveErrors | None) -> float | None:
    """The error of a curve; the phase plane has the larger of its two."""
    if errors is None:
        return None
    found = {"displacement": errors.displacement, "velocity": errors.velocity}
    return found.get(curve, max(found.values()))
