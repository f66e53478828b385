"""The block that the lattice and other engines are given, and what each of them is asked for."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.damping import NodalDamping
from msm.grid import grids_of
from msm.grid_explicit import symplectic_euler
from msm.integrators import INTEGRATORS
from msm.lattice import CellLattice
from msm.laws import Hooke
from msm.network import Network, network
from msm.stability import DEFAULT, largest_frequency, longest_step
from msm.volume import none
from tests.benchmarks import field_error

Floats = NDArray[np.float64]

LOAD = 0.02
"""Share of the load of `field_error`: the lattice departs from its linear self by 0.2 %."""
DAMPING = 40.0
"""Nodal damping over mass [1/s], a little below twice the lowest frequency of the block."""
FRACTION = 0.8
"""Of the longest stable step."""
IMMOVABLE = 1e30
"""Mass [kg] of held nodes: no force here moves it by as much as a rounding error."""


class Contender(NamedTuple):
    """An engine with the block in it; the first four fields are those of its row.

    `run(dt, count)` takes steps of dt [s] from rest under the full load, and returns the
    displacement [m] (n, 3) of the lattice's nodes. `step` [s] is the step to take; 0 until it has
    been found from `guess`, a first guess [s] of the longest stable one. `settings` are those of
    the engine, `objection` is what its maintainer would say to them, and to the comparison.
    """

    engine: str
    version: str
    precision: str
    nu: float
    run: Callable[[float, int], Floats]
    settings: str
    objection: str
    step: float = 0.0
    guess: float = 0.0


class Block(NamedTuple):
    """The block on one lattice: the arrays of the springs, and which nodes are held (n,)."""

    nu: float
    modulus: float
    lattice: CellLattice
    law: Hooke
    net: Network
    held: NDArray[np.bool_]

    @property
    def limit(self) -> float:
        """Longest stable step [s] of the lattice, as the engine predicts it."""
        omega, _ = largest_frequency(self.law, self.net, np.zeros_like(self.net.load))
        return longest_step(INTEGRATORS[DEFAULT], omega, 0.0)


def block(case: field_error.Case, spacing: float, nu: float, *, with_volume: bool) -> Block:
    """The block with its base held fast instead of by stiff springs, which would set the step."""
    found = field_error.lattice(case, spacing)
    material = field_error.material(case, found, nu, with_volume=with_volume)
    held = found.lattice.nodes[:, 2] < found.lattice.nodes[:, 2].min() + 0.5 * spacing
    mass = np.where(held, IMMOVABLE, found.mass)
    free = csr_array((len(held), len(held)))
    term = material.volume or none(spacing)
    net = network(found.springs, mass, free, LOAD * found.load, term, NodalDamping(DAMPING))
    return Block(nu, case.youngs_modulus, found.lattice, material.law, net, held)  # type: ignore[arg-type]


def lattice(body: Block) -> Contender:
    """The lattice under symplectic Euler, over the grid as in a run."""
    grid, limit = grids_of(body.lattice, body.net), body.limit

    def run(dt: float, count: int) -> Floats:
        u, v = np.zeros((2, *body.net.load.shape))
        symplectic_euler(body.law, grid, np.ones((count, 1)), dt, u, v)
        return u

    volume = len(body.net.cells) > 0
    kind = "springs and volume term" if volume else "springs"
    return Contender(
        *(f"lattice, {kind}", version("liver-study"), "float64", body.nu),
        run,
        f"{len(body.net.ends)} springs; damping implicit; limit {1e3 * limit:.3g} ms predicted",
        "no contact and one material; made for this comparison by those who make it"
        + ("" if volume else "; no tissue has Poisson ratio 1/4"),
        FRACTION * limit,
    )
