"""Stiffness estimates by a fuzzy system of the user's, which a scene names by its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.stiffness import StiffnessEstimate
from fuzzy.systems.files import read_rule_base
from fuzzy.systems.inference import Inferred, infer
from fuzzy.systems.kinds import check_kind
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.system import FuzzySystem
from study.scene import Scene
from study.scene.answer_units import UNITS

Floats = NDArray[np.float64]

FINER = 10
"""Factor on the number of samples that estimates the sampling error of an answer."""
SOFTEST, STIFFEST = 10.0, 1e7
"""[Pa] Beyond which an answer is no stiffness of soft tissue in the unit that is stated."""


def system_of(scene: Scene) -> FuzzySystem:
    """The fuzzy system in the scene's file. ValueError if there is none that can be read."""
    path = Path(str(scene.fuzzy.rule_base))
    if not path.is_file():
        raise ValueError(f"fuzzy.rule_base: {path} is no file; name a .fis or .json file")
    try:
        return read_rule_base(path)
    except ValueError as error:
        raise ValueError(f"fuzzy.rule_base: {error}") from error


def user_estimates(scene: Scene) -> dict[str, StiffnessEstimate]:
    """The estimate by each kind of system that the scene names.

    ValueError naming the key: for readings that are not the inputs of the system, for a kind of
    inference that it does not support, and for an answer that is no stiffness of soft tissue.
    """
    system = system_of(scene)
    row = _row(system, scene.fuzzy.inputs)
    for kind in scene.fuzzy.systems:
        try:
            check_kind(system, kind)
        except ValueError as error:
            raise ValueError(f"fuzzy.systems: {error}") from error
    return {name: _estimate(scene, system, row, name) for name in scene.fuzzy.systems}


def _row(system: FuzzySystem, given: Mapping[str, float]) -> Floats:
    names = [one.name for one in system.inputs]
    missing, unknown = [n for n in names if n not in given], sorted(given.keys() - set(names))
    if missing or unknown:
        faults = [f"{', '.join(missing)} missing"] if missing else []
        faults += [f"{', '.join(unknown)} unknown"] if unknown else []
        raise ValueError(
            f"fuzzy.inputs: {' and '.join(faults)}; fuzzy.rule_base takes {', '.join(names)}"
        )
    return np.array([[float(given[name]) for name in names]])


def _estimate(scene: Scene, system: FuzzySystem, row: Floats, kind: str) -> StiffnessEstimate:
    asked = asdict(scene.fuzzy)
    options = InferenceOptions(**{one.name: asked[one.name] for one in fields(InferenceOptions)})
    finer = replace(options, samples=FINER * (options.samples - 1) + 1)
    try:
        found = infer(system, row, kind, options)
        again = infer(system, row, kind, finer)
    except ValueError as error:
        raise ValueError(f"fuzzy.rule_base: {error}") from error
    factor = UNITS[scene.fuzzy.unit]
    modulus = factor * float(found.value[0])
    if not SOFTEST <= modulus <= STIFFEST:
        raise ValueError(
            f"fuzzy.rule_base: {kind} answers {found.value[0]:g} {scene.fuzzy.unit}, which is no "
            "stiffness of soft tissue; correct fuzzy.unit or fuzzy.inputs"
        )
    return StiffnessEstimate(
        system=kind,
        estimate=modulus,
        interval=_interval(found, factor),
        quadrature_error=factor * abs(float(found.value[0] - again.value[0])),
        notes=tuple(found.notes),
        method=found.method,
    )


def _interval(found: Inferred, factor: float) -> tuple[float, float] | None:
    if found.interval is None:
        return None
    low, high = found.interval[0]
    return factor * float(low), factor * float(high)


def assumptions(scene: Scene) -> list[str]:
    """On the user's fuzzy system."""
    system = system_of(scene)
    given = ", ".join(f"{name} = {value:g}" for name, value in scene.fuzzy.inputs.items())
    return [
        f"The estimates are those of the fuzzy system {system.name or 'in fuzzy.rule_base'} with "
        f"{len(system.rules)} rules at {given}, its answer taken for Young's modulus in "
        f"{scene.fuzzy.unit}. Neither its sets nor its rules are checked against data."
    ]
