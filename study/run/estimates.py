"""Fuzzy estimates of the scene's stiffness, and what the report draws of the systems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver import stiffness
from fuzzy.liver.sensitivity import sensitivity
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import StiffnessEstimate
from fuzzy.liver.system import records_in_use
from fuzzy.systems.explain import explain
from fuzzy.systems.explanation_arrays import drawing_arrays
from fuzzy.systems.options import InferenceOptions
from study.results.folder import Row
from study.scene import Scene

SURFACE_POINTS = 41
CURVE_POINTS = 401


def settings(scene: Scene) -> LiverSettings:
    """Settings of the fuzzy systems from the scene. ValueError naming the key that does not fit."""
    asked = asdict(scene.fuzzy)
    options = InferenceOptions(
        **{field.name: asked[field.name] for field in fields(InferenceOptions)}
    )
    named = {f.name: asked[f.name] for f in fields(LiverSettings) if f.name != "options"}
    try:
        return LiverSettings(**named, options=options)
    except ValueError as error:
        raise ValueError(f"fuzzy.{error}") from error


def readings(scene: Scene) -> dict[str, float]:
    """Elastography readings [Pa] that the scene gives."""
    return {name: value for name, value in asdict(scene.patient).items() if value is not None}


def estimates(scene: Scene) -> dict[str, StiffnessEstimate]:
    """Estimate of each fuzzy system that the scene names."""
    return {
        name: stiffness.estimate(readings(scene), name, settings(scene))
        for name in scene.fuzzy.systems
    }


@dataclass(frozen=True)
class FuzzySide:
    """What the fuzzy systems found: estimates by system, and their part of the results."""

    estimates: dict[str, StiffnessEstimate]
    numbers: dict[str, Any]
    sensitivity: list[Row]
    arrays: dict[str, NDArray[Any]]
    notes: list[str]


NONE = FuzzySide({}, {"stiffness": {}, "rule_count": None}, [], {}, [])


def run_fuzzy(scene: Scene) -> FuzzySide:
    """Estimates, their sensitivity to every choice, and what the report shows of the systems."""
    chosen, given = settings(scene), readings(scene)
    found = estimates(scene)
    rows, notes = _sensitivity(scene, chosen, given)
    modulus = scene.tissue.youngs_modulus
    numbers = {
        "stiffness": {name: _numbers(one, modulus) for name, one in found.items()},
        "rule_count": stiffness.rule_count(chosen),
        "stiffness_sets": [asdict(record) for record in records_in_use(chosen)],
        "surface_inputs": list(scene.fuzzy.surface),
    }
    arrays = drawings(chosen, scene.fuzzy.systems, given, scene.fuzzy.surface)
    return FuzzySide(found, numbers, rows, arrays, notes)


def _sensitivity(
    scene: Scene, chosen: LiverSettings, given: Mapping[str, float]
) -> tuple[list[Row], list[str]]:
    if not scene.fuzzy.sensitivity_readings:
        return [], []
    found = sensitivity(given, chosen, scene.fuzzy.sensitivity_readings)
    notes = [f"Sensitivity leaves out {left_out}." for left_out in found.left_out]
    columns = ("choice", "base", "alternative", "system", "at_readings", "rms", "largest", "rows")
    return [tuple(getattr(row, name) for name in columns) for row in found.rows], notes


def _numbers(estimate: StiffnessEstimate, youngs_modulus: float) -> dict[str, Any]:
    numbers: dict[str, Any] = {
        "estimate_pa": estimate.estimate,
        "relative_to_reference": estimate.estimate / youngs_modulus,
        "quadrature_error_pa": estimate.quadrature_error,
        "method": estimate.method,
        "notes": list(estimate.notes),
    }
    if estimate.interval is not None:
        numbers["interval_pa"] = list(estimate.interval)
    return numbers


def drawings(
    settings: LiverSettings,
    systems: Sequence[str],
    given: Mapping[str, float],
    over: tuple[str, str],
) -> dict[str, NDArray[Any]]:
    """Membership curves and output surfaces over two readings [Pa], and views of the rules.

    `given` are the readings [Pa] of the patient. Axes of curves and surfaces are in Pa; the views
    are in the systems' own unit, which they name.
    """
    arrays: dict[str, NDArray[Any]] = {}
    for variable, curves in stiffness.membership_curves(settings, CURVE_POINTS).items():
        arrays[f"{variable}.sets"] = np.array(curves.sets)
        for part in ("x", "principal", "lower", "upper"):
            arrays[f"{variable}.{part}"] = getattr(curves, part)
    system, row = stiffness.patient_system(given, settings), stiffness.liver_row(given)[0]
    for name in systems:
        x, y, z = stiffness.surface(
            name, *over, points=SURFACE_POINTS, settings=settings, base=given
        )
        arrays |= {"surface.x": x, "surface.y": y, f"surface.{name}": z}
        explanation = explain(system, row, name, settings.options, stiffness.UNIT)
        arrays |= drawing_arrays(explanation, stiffness.UNIT)
    return arrays
