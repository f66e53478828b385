"""Predictions of each kind of model for a specimen: displacements and force along a load path.

All are at rest. The two finite-element models share mixed quadratic elements with a pressure field,
linear and neo-Hookean. The lattices are nonlinear in the displacement: linear springs with
Poisson's ratio 1/4, the same with the volume term that gives the material's ratio, and springs of
the Basafa benchmark scaled to the material's modulus.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from fem_reference import natural_frequency
from fem_reference.displacement_control import (
    EquilibriumState,
    Loading,
    equilibrium_path,
    solve_linear,
)
from fem_reference.elasticity import Outline
from fem_reference.grid import curved, straight
from fem_reference.mixed_strain import MixedSolid, mixed_solid
from fem_reference.observation import evaluation
from msm import displacement_control
from msm import lattice as cells
from msm.calibration import SPRING_POISSON_RATIO, reference_stiffness
from msm.damping import UNDAMPED
from msm.lattice import CellLattice
from msm.laws import Hooke, Law
from msm.laws.basafa import in_proportion
from msm.network import Network, network
from msm.springs import connect
from msm.volume import none, volume_term
from study.problem.tissue import Tissue
from study.scene import BasafaConstants, Lattice
from study.validation.specimen import Specimen

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """States at the load `factors` (k,) that were reached; `failure` states why there are no more.

    `displacement` [m] (k, q, 3) at the observed points; `force` [N] (k,): reaction of the whole
    body on the specimen's plane, along its axis; `unknowns`: number of displacements and pressures.
    """

    factors: Floats
    displacement: Floats
    force: Floats
    unknowns: int
    failure: str = ""


Solve = Callable[[Specimen, int, float, tuple[float, ...]], Prediction]
"""Predicts from a specimen, number of its mesh or spacing, Young's modulus [Pa], load factors."""


def neo_hookean(
    specimen: Specimen, level: int, modulus: float, factors: tuple[float, ...]
) -> Prediction:
    """Finite elements at large strain."""
    solid, loading, watched = _elements(specimen, level, modulus)
    path = equilibrium_path(solid, loading, factors)
    return _prediction(specimen, solid, watched, path.states, path.failure)


def linear(
    specimen: Specimen, level: int, modulus: float, factors: tuple[float, ...]
) -> Prediction:
    """Finite elements of linear elasticity: one solution, scaled."""
    solid, loading, watched = _elements(specimen, level, modulus)
    whole = _prediction(specimen, solid, watched, (solve_linear(solid, loading),), "")
    share = np.array(factors)
    return Prediction(
        share,
        share[:, None, None] * whole.displacement,
        share * whole.force,
        whole.unknowns,
    )


def neo_hookean_frequency(specimen: Specimen, level: int, modulus: float) -> float:
    """Frequency [Hz] of small vibrations about the loaded rest; nan if there is no rest."""
    solid, loading, _ = _elements(specimen, level, modulus)
    path = equilibrium_path(solid, loading)
    if not path.converged:
        return float("nan")
    return natural_frequency.lowest_frequency(solid, loading, specimen.density, path.states[-1])


def linear_frequency(specimen: Specimen, level: int, modulus: float) -> float:
    """Frequency [Hz] of vibrations of linear elasticity, which does not depend on the rest."""
    solid, loading, _ = _elements(specimen, level, modulus)
    return natural_frequency.lowest_frequency(solid, loading, specimen.density)


def _elements(
    specimen: Specimen, level: int, modulus: float
) -> tuple[MixedSolid, Loading, csr_array]:
    chosen = specimen.meshes[level]
    mesh, project = chosen.mesh(), chosen.project
    grid = straight(mesh) if project is None else curved(mesh, project)
    solid = mixed_solid(grid, Tissue(youngs_modulus=modulus, poisson_ratio=specimen.poisson_ratio))
    outline = Outline(mesh, "taylor-hood", solid.nodes, solid.size + solid.pressures)
    load = solid.weight(specimen.acceleration, specimen.density)
    if len(specimen.at):
        load += (evaluation(outline, specimen.at).T @ specimen.forces).ravel()
    watched = evaluation(outline, specimen.watched) if len(specimen.watched) else _nothing(solid)
    return solid, Loading(specimen.prescribed(solid.points), load), watched


def _nothing(solid: MixedSolid) -> csr_array:
    return csr_array((0, len(solid.points)))


def _prediction(
    specimen: Specimen,
    solid: MixedSolid,
    watched: csr_array,
    states: tuple[EquilibriumState, ...],
    failure: str,
) -> Prediction:
    face, axis = specimen.face(solid.points), specimen.along[0]
    moved = [watched @ state.displacement for state in states]
    force = [specimen.parts * state.reaction[face, axis].sum() for state in states]
    return Prediction(
        np.array([state.factor for state in states]),
        np.reshape(moved, (len(states), watched.shape[0], 3)),
        np.array(force),
        solid.size + solid.pressures,
        failure,
    )


class _Springs(NamedTuple):
    """Law of the springs, and the modulus [Pa] of a volume term; None without the term."""

    law: Law
    modulus: float | None


Make = Callable[[Specimen, int, float], _Springs]


def springs(specimen: Specimen, level: int, modulus: float) -> _Springs:
    """Linear springs alone, whose Poisson's ratio is 1/4."""
    return _Springs(Hooke(reference_stiffness(modulus, specimen.spacings[level])), None)


def springs_and_volume(specimen: Specimen, level: int, modulus: float) -> _Springs:
    """Linear springs with the volume term that gives the material's Poisson's ratio."""
    k = reference_stiffness(modulus, specimen.spacings[level], specimen.poisson_ratio)
    return _Springs(Hooke(k), modulus)


def basafa(specimen: Specimen, level: int, modulus: float) -> _Springs:
    """Springs of the benchmark's law with its own ratio of constants, scaled to the modulus."""
    table, k = BasafaConstants(), reference_stiffness(modulus, specimen.spacings[level])
    return _Springs(in_proportion(k, table.k2 / table.k1, table.x_c), None)


def _network(specimen: Specimen, level: int, chosen: _Springs) -> tuple[CellLattice, Network]:
    """The lattice of a spacing over a specimen, with its load."""
    spacing, nu = specimen.spacings[level], specimen.poisson_ratio
    lattice = cells.build(specimen.body, specimen.lower, specimen.upper, spacing)
    mass = specimen.density * cells.node_volumes(lattice)
    load = mass[:, None] * specimen.acceleration
    if len(specimen.at):
        load += lattice.interpolation(specimen.at)[0].T @ specimen.forces
    volume = none(spacing)
    if chosen.modulus is not None and nu > SPRING_POISSON_RATIO:
        volume = volume_term(lattice, chosen.modulus, nu)
    layout = connect(lattice, Lattice().flexion)  # the default of a scene
    unheld = csr_array((len(mass), len(mass)))
    return lattice, network(layout, mass, unheld, load, volume, UNDAMPED)


def of_lattice(
    make: Make, specimen: Specimen, level: int, modulus: float, factors: tuple[float, ...]
) -> Prediction:
    """Rest states of a lattice."""
    chosen = make(specimen, level, modulus)
    lattice, net = _network(specimen, level, chosen)
    found = displacement_control.equilibrium_path(
        chosen.law, net, specimen.prescribed(lattice.nodes), factors
    )
    face, axis = specimen.face(lattice.nodes), specimen.along[0]
    watched, _ = lattice.interpolation(specimen.watched)
    moved = [watched @ rest.displacement for rest in found.states]
    force = [specimen.parts * rest.reaction[face, axis].sum() for rest in found.states]
    return Prediction(
        np.array([rest.factor for rest in found.states]),
        np.reshape(moved, (len(found.states), len(specimen.watched), 3)),
        np.array(force),
        3 * len(lattice.nodes),
        found.failure,
    )


def lattice_frequency(make: Make, specimen: Specimen, level: int, modulus: float) -> float:
    """Frequency [Hz] of small vibrations about the loaded rest; nan if there is no rest."""
    chosen = make(specimen, level, modulus)
    lattice, net = _network(specimen, level, chosen)
    prescribed = specimen.prescribed(lattice.nodes)
    found = displacement_control.equilibrium_path(chosen.law, net, prescribed)
    if found.failure:
        return float("nan")
    return displacement_control.lowest_frequency(
        chosen.law, net, prescribed, found.states[-1].displacement
    )


@dataclass(frozen=True)
class Kind:
    """A kind of model: its name in tables, its prediction, and its vibration.

    `elements`: whether it has finite elements or is a lattice. `frequency` [Hz]: lowest frequency
    about the loaded rest, by specimen, number of the mesh or spacing, and Young's modulus [Pa].
    """

    label: str
    solve: Solve
    frequency: Callable[[Specimen, int, float], float]
    elements: bool = False


def _lattice(label: str, make: Make) -> Kind:
    return Kind(label, partial(of_lattice, make), partial(lattice_frequency, make))


KINDS: dict[str, Kind] = {
    "linear": Kind("linear FE", linear, linear_frequency, elements=True),
    "neo-hookean": Kind("neo-Hookean FE", neo_hookean, neo_hookean_frequency, elements=True),
    "springs": _lattice("springs alone", springs),
    "volume": _lattice("springs and volume term", springs_and_volume),
    "basafa": _lattice("Basafa's law, scaled", basafa),
}
"""Kinds of models by name, as used by the command and the tables."""
