"""The plain baseline of the fuzzy estimates: springs of the elastography reading as it is."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from study.models.control_point import PointSpring, oscillator_of
from study.models.estimates import readings
from study.models.lattice import FOLLOWED, LatticeModel
from study.models.lattice_assumptions import layout, springs
from study.models.model import Estimates, ModelKind
from study.models.tissue import of_modulus
from study.scene import Scene

NAME, LABEL = "reading", "MSM reading as is"


def modulus(scene: Scene) -> float:
    """Young's modulus [Pa]: the reading, of several their geometric mean. ValueError of none."""
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
    """On the springs, and on what the reading stands for."""
    on_organ = [] if scene.is_point else layout(scene)
    return [
        *on_organ,
        *springs(scene),
        "The model of the reading as it is takes Young's modulus from elastography without any "
        "fuzzy system, of several readings their geometric mean: what a fuzzy system must beat.",
    ]


KIND = ModelKind(
    models=models,
    on_point=on_point,
    assumptions=assumptions,
    of_patient=True,
    follows_law=True,
    blind_to=("fuzzy", "reference", "superposition", "basafa"),
    able=FOLLOWED,
)
