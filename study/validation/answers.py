"""What each kind of model answers to a specimen: displacements and the force, along a path.

All are at rest. The two finite-element models have the same quadratic elements with a pressure of
their own, linear and neo-Hookean. The lattices follow their deformation: linear springs with
Poisson's ratio 1/4, the same with the volume term that gives the material's, and springs of the
Basafa benchmark in proportion to the material's modulus.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from fem_reference.driven import Drive, DrivenState, solve_driven, solve_linear
from fem_reference.elasticity import Outline
from fem_reference.grid import curved, straight
from fem_reference.mixed_strain import MixedSolid, mixed_solid
from fem_reference.observation import evaluation
from msm import lattice as cells
from msm.calibration import SPRING_POISSON_RATIO, reference_stiffness
from msm.damping import UNDAMPED
from msm.driven import move_driven
from msm.laws import Hooke, Law
from msm.laws.basafa import in_proportion
from msm.network import network
from msm.springs import connect
from msm.volume import none, volume_term
from study.problem.tissue import Tissue
from study.scene import BasafaConstants, Lattice
from study.validation.specimen import Specimen

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Answer:
    """States at the `factors` (k,) that were reached; `failure` says why there are no more.

    `displacement` [m] (k, q, 3) at the points watched; `force` [N] (k,) of the whole body on the
    plane whose reaction is read, along its axis; `unknowns`: displacements and pressures.
    """

    factors: Floats
    displacement: Floats
    force: Floats
    unknowns: int
    failure: str = ""


Solve = Callable[[Specimen, int, float, tuple[float, ...]], Answer]
"""From a specimen, the number of its mesh or spacing, Young's modulus [Pa] and the factors."""


def neo_hookean(
    specimen: Specimen, level: int, modulus: float, factors: tuple[float, ...]
) -> Answer:
    """Finite elements at large strain."""
    solid, drive, watched = _elements(specimen, level, modulus)
    path = solve_driven(solid, drive, factors)
    return _told(specimen, solid, watched, path.states, path.failure)


def linear(specimen: Specimen, level: int, modulus: float, factors: tuple[float, ...]) -> Answer:
    """Finite elements of linear elasticity: one solution, in proportion."""
    solid, drive, watched = _elements(specimen, level, modulus)
    whole = _told(specimen, solid, watched, (solve_linear(solid, drive),), "")
    share = np.array(factors)
    return Answer(
        share,
        share[:, None, None] * whole.displacement,
        share * whole.force,
        whole.unknowns,
    )


def _elements(
    specimen: Specimen, level: int, modulus: float
) -> tuple[MixedSolid, Drive, csr_array]:
    chosen = specimen.meshes[level]
    mesh, project = chosen.mesh(), chosen.project
    grid = straight(mesh) if project is None else curved(mesh, project)
    solid = mixed_solid(grid, Tissue(youngs_modulus=modulus, poisson_ratio=specimen.poisson_ratio))
    outline = Outline(mesh, "taylor-hood", solid.nodes, solid.size + solid.pressures)
    load = solid.weight(specimen.acceleration, specimen.density)
    if len(specimen.at):
        load += (evaluation(outline, specimen.at).T @ specimen.forces).ravel()
    watched = evaluation(outline, specimen.watched) if len(specimen.watched) else _nothing(solid)
    return solid, Drive(specimen.prescribed(solid.points), load), watched


def _nothing(solid: MixedSolid) -> csr_array:
    return csr_array((0, len(solid.points)))


def _told(
    specimen: Specimen,
    solid: MixedSolid,
    watched: csr_array,
    states: tuple[DrivenState, ...],
    failure: str,
) -> Answer:
    face, axis = specimen.face(solid.points), specimen.along[0]
    moved = [watched @ state.displacement for state in states]
    force = [specimen.parts * state.reaction[face, axis].sum() for state in states]
    return Answer(
        np.array([state.factor for state in states]),
        np.reshape(moved, (len(states), watched.shape[0], 3)),
        np.array(force),
        solid.size + solid.pressures,
        failure,
    )


def springs(specimen: Specimen, level: int, modulus: float, factors: tuple[float, ...]) -> Answer:
    """A lattice of linear springs alone, whose Poisson's ratio is 1/4."""
    law = Hooke(reference_stiffness(modulus, specimen.spacings[level]))
    return _lattice(specimen, level, law, None, factors)


def springs_and_volume(
    specimen: Specimen, level: int, modulus: float, factors: tuple[float, ...]
) -> Answer:
    """The same with the volume term that makes up for the material's Poisson's ratio."""
    k = reference_stiffness(modulus, specimen.spacings[level], specimen.poisson_ratio)
    law = Hooke(k)
    return _lattice(specimen, level, law, modulus, factors)


def basafa(specimen: Specimen, level: int, modulus: float, factors: tuple[float, ...]) -> Answer:
    """Springs of the benchmark's law with its own ratio of constants, at the modulus given."""
    table, k = BasafaConstants(), reference_stiffness(modulus, specimen.spacings[level])
    law = in_proportion(k, table.k2 / table.k1, table.x_c)
    return _lattice(specimen, level, law, None, factors)


def _lattice(
    specimen: Specimen,
    level: int,
    law: Law,
    modulus: float | None,
    factors: tuple[float, ...],
) -> Answer:
    """Rests of a lattice, with the volume term of a modulus [Pa] if there is one."""
    spacing = specimen.spacings[level]
    lattice = cells.build(specimen.body, specimen.lower, specimen.upper, spacing)
    nodes, mass = lattice.nodes, specimen.density * cells.node_volumes(lattice)
    load = mass[:, None] * specimen.acceleration
    if len(specimen.at):
        load += lattice.interpolation(specimen.at)[0].T @ specimen.forces
    nu = specimen.poisson_ratio
    with_term = modulus is not None and nu > SPRING_POISSON_RATIO
    volume = volume_term(lattice, modulus, nu) if with_term and modulus else none(spacing)
    # The scene's default layout of springs.
    chosen = connect(lattice, Lattice().flexion)
    unheld = csr_array((len(nodes), len(nodes)))
    net = network(chosen, mass, unheld, load, volume, UNDAMPED)
    found = move_driven(law, net, specimen.prescribed(nodes), factors)
    face, axis = specimen.face(nodes), specimen.along[0]
    watched, _ = lattice.interpolation(specimen.watched)
    moved = [watched @ rest.displacement for rest in found.rests]
    force = [specimen.parts * rest.reaction[face, axis].sum() for rest in found.rests]
    return Answer(
        np.array([rest.factor for rest in found.rests]),
        np.reshape(moved, (len(found.rests), len(specimen.watched), 3)),
        np.array(force),
        3 * len(nodes),
        found.failure,
    )


@dataclass(frozen=True)
class Kind:
    """A kind of model: how it is called in tables, and its answer; `elements` or a lattice."""

    label: str
    solve: Solve
    elements: bool


KINDS: dict[str, Kind] = {
    "linear": Kind("linear FE", linear, elements=True),
    "neo-hookean": Kind("neo-Hookean FE", neo_hookean, elements=True),
    "springs": Kind("springs alone", springs, elements=False),
    "volume": Kind("springs and volume term", springs_and_volume, elements=False),
    "basafa": Kind("Basafa's law, scaled", basafa, elements=False),
}
"""Kinds of models by name, as the command and the tables have them."""
