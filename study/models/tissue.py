"""The lattice with the tissue's own modulus: a baseline without patient and estimate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from msm.calibration import SPRING_POISSON_RATIO, reference_stiffness
from msm.lattice import LatticeMesh
from msm.laws import Hooke, Law, initial_stiffness
from msm.model import Material
from msm.volume import volume_term
from study.models.damping import lattice_poisson_ratio, nodal_damping
from study.models.lattice import SUPPORTED_FEATURES, LatticeModel, SpringMaterial
from study.models.lattice_assumptions import layout, springs
from study.models.model import Estimates, ModelKind
from study.scene import Scene

FRACTION = 0.8
"""Default time step over the critical one."""


def lacks_poisson_ratio(scene: Scene) -> bool:
    """Whether springs without a volume term cannot represent the tissue's Poisson ratio."""
    return scene.tissue.poisson_ratio > SPRING_POISSON_RATIO


def of_modulus(scene: Scene, mesh: LatticeMesh, *, modulus: float) -> SpringMaterial:
    """Springs of the scene's law for a modulus [Pa], with the volume term if the scene has it."""
    linear = elastic(mesh, modulus, lattice_poisson_ratio(scene))
    k = initial_stiffness(linear.law)
    law = spring_law(scene, k)
    material = replace(linear, law=law, damping=nodal_damping(scene, modulus))
    return SpringMaterial(modulus * (initial_stiffness(law) / k), material)


def elastic(mesh: LatticeMesh, modulus: float, nu: float) -> Material:
    """Linear springs of a modulus [Pa], with the volume term that raises nu above 1/4."""
    law = Hooke(reference_stiffness(modulus, mesh.spacing, nu))
    return Material(law, volume_term(mesh, modulus, nu) if nu > SPRING_POISSON_RATIO else None)


def spring_law(scene: Scene, k: float) -> Law:
    """Linear springs of eq. (1), k [N/m], or the scene's law scaled to that stiffness at rest."""
    law = scene.lattice.law
    return Hooke(k) if law is None else law.make(k)


def models(scene: Scene, _: Estimates) -> Iterator[LatticeModel]:
    """The one lattice of the tissue's modulus."""
    make = partial(of_modulus, modulus=scene.tissue.youngs_modulus)
    yield LatticeModel(name="tissue", label="MSM tissue modulus", scene=scene, make=make)


def assumptions(scene: Scene) -> list[str]:
    """On the layout of the springs, their law, calibration and damping."""
    return [*layout(scene), *springs(scene)]


KIND = ModelKind(
    models=models,
    assumptions=assumptions,
    follows_law=True,
    ignored_keys=("reference", "superposition", "basafa"),
    supported_features=SUPPORTED_FEATURES,
)
