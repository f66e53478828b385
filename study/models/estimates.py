"""Fuzzy estimates of the scene's stiffness, and the data of the systems for the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
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
from study.models.user_rule_base import system_of, user_estimates
from study.results.records import FuzzyRecord, StiffnessSet, SystemEstimate
from study.results.tables import SensitivityEntry
from study.scene import Scene

SURFACE_POINTS = 41
CURVE_POINTS = 401


def settings(scene: Scene) -> LiverSettings:
    """Settings of the fuzzy systems from the scene. ValueError naming the key that does not fit."""
    asked = asdict(scene.fuzzy)
    options = InferenceOptions(**{f.name: asked[f.name] for f in fields(InferenceOptions)})
    named = {f.name: asked[f.name] for f in fields(LiverSettings) if f.name != "options"}
    try:
        return LiverSettings(**named, options=options)
    except ValueError as error:
        raise ValueError(f"fuzzy.{error}") from error


def readings(scene: Scene) -> dict[str, float]:
    """The elastography readings [Pa] of the scene."""
    return {name: value for name, value in asdict(scene.patient).items() if value is not None}


def estimates(scene: Scene) -> dict[str, StiffnessEstimate]:
    """The estimate of each fuzzy system that the scene names, with the liver's rules or the user's.

    ValueError naming the key, for example where there is no reading.
    """
    if scene.fuzzy.rule_base is not None:
        return user_estimates(scene)
    if settings(scene).missing.silences and not readings(scene):
        raise ValueError(
            'patient: no reading to estimate from; give one, such as patient.hcv = "9.5 kPa", or '
            'set fuzzy.absent to "normal"'
        )
    return {
        name: stiffness.estimate(readings(scene), name, settings(scene))
        for name in scene.fuzzy.systems
    }


@dataclass(frozen=True)
class FuzzyResults:
    """Results of the fuzzy systems: estimates by system, and their part of the results folder."""

    estimates: dict[str, StiffnessEstimate] = field(default_factory=dict)
    record: FuzzyRecord = field(default_factory=lambda: FuzzyRecord(systems={}))
    sensitivity: tuple[SensitivityEntry, ...] = ()
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def run_fuzzy(scene: Scene) -> FuzzyResults:
    """Estimates, their sensitivity to every choice, and the data of the systems for the report."""
    found = estimates(scene)
    if scene.fuzzy.rule_base is not None:
        return _user_results(scene, found)
    chosen, given = settings(scene), readings(scene)
    entries, notes = _sensitivity(scene, chosen, given)
    modulus = scene.tissue.youngs_modulus
    record = FuzzyRecord(
        systems={name: _record(one, modulus) for name, one in found.items()},
        rule_count=stiffness.rule_count(chosen),
        stiffness_sets=tuple(StiffnessSet(**asdict(one)) for one in records_in_use(chosen)),
        surface_inputs=scene.fuzzy.surface,
    )
    arrays = drawings(chosen, scene.fuzzy.systems, given, scene.fuzzy.surface)
    return FuzzyResults(found, record, entries, arrays, notes)


def _user_results(scene: Scene, found: dict[str, StiffnessEstimate]) -> FuzzyResults:
    """Results of a user's fuzzy system, whose choices cannot be varied."""
    modulus = scene.tissue.youngs_modulus
    systems = {name: _record(one, modulus) for name, one in found.items()}
    return FuzzyResults(found, FuzzyRecord(systems=systems, rule_count=len(system_of(scene).rules)))


def _sensitivity(
    scene: Scene, chosen: LiverSettings, given: Mapping[str, float]
) -> tuple[tuple[SensitivityEntry, ...], tuple[str, ...]]:
    if not scene.fuzzy.sensitivity_readings:
        return (), ()
    found = sensitivity(given, chosen, scene.fuzzy.sensitivity_readings)
    notes = tuple(f"Sensitivity leaves out {left_out}." for left_out in found.left_out)
    entries = (
        SensitivityEntry(
            choice=row.choice,
            base=row.base,
            alternative=row.alternative,
            system=row.system,
            change_at_readings_pa=row.at_readings,
            rms_change_pa=row.rms,
            largest_change_pa=row.largest,
            readings=row.rows,
        )
        for row in found.rows
    )
    return tuple(entries), notes


def _record(found: StiffnessEstimate, youngs_modulus: float) -> SystemEstimate:
    return SystemEstimate(
        estimate_pa=found.estimate,
        relative_to_reference=found.estimate / youngs_modulus,
        quadrature_error_pa=found.quadrature_error,
        method=found.method,
        notes=tuple(found.notes),
        interval_pa=found.interval,
    )


def drawings(
    settings: LiverSettings,
    systems: Sequence[str],
    given: Mapping[str, float],
    over: tuple[str, str],
) -> dict[str, NDArray[Any]]:
    """Membership curves and output surfaces over two readings [Pa], and views of the rules.

    `given`: the readings [Pa] of the patient. The axes of curves and surfaces are in Pa; the views
    are in the unit of the system, which they name.
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
