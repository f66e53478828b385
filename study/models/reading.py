"""The plain baseline of the fuzzy estimates: springs with the elastography reading as modulus."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from study.models.control_point import PointSpring, oscillator_of
from study.models.estimates import readings
from study.models.lattice import SUPPORTED_FEATURES, LatticeModel
from study.models.lattice_assumptions import layout, springs
from study.models.model import Estimates, ModelKind
from study.models.tissue import of_modulus
from study.scene import Scene

NAME, LABEL = "reading", "MSM reading"


def modulus(scene: Scene) -> float:
    """Young's modulus [Pa]: the reading, or the geometric mean of several.

    ValueError without a reading.
    """
    given = list(readings(scene).values())
    if not given:
        raise ValueError(f"models: {NAME} needs a reading; give one in [patient] or leave it out")
    return float(np.exp(np.mean(np.log(given))))


def models(scene: Scene, _: Estimates) -> Iterator[LatticeModel]:
    """The one lattice of the reading."""
    make = partial(of_modulus, modulus=modulus(scene))
    yield LatticeModel(name=NAME, label=LABEL, scene=scene, make=make)


def on_point(scene: Scene, _: Estimates) -> Iterator[PointSpring]:
    """The one oscillator of the reading, by eqs. (1) and (2)."""
    make = partial(oscillator_of, modulus(scene), scene.damping.ratio)
    yield PointSpring(name=NAME, label=LABEL, make=make)


def assumptions(scene: Scene) -> list[str]:
    """On the springs, and on the use of the reading."""
    on_organ = [] if scene.is_point else layout(scene)
    return [
        *on_organ,
        *springs(scene),
        "MSM reading takes Young's modulus from the elastography reading without a fuzzy system, "
        "or from the geometric mean of several readings. It is the baseline of the fuzzy systems.",
    ]


KIND = ModelKind(
    models=models,
    on_point=on_point,
    assumptions=assumptions,
    patient_specific=True,
    follows_law=True,
    ignored_keys=("fuzzy", "reference", "superposition", "basafa"),
    supported_features=SUPPORTED_FEATURES,
)
