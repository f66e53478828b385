"""Small lattices used by the stability cases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from msm import lattice as cells
from msm.assembly import Assembly, Material
from msm.calibration import SPRING_POISSON_RATIO, reference_stiffness
from msm.damping import UNDAMPED, NodalDamping
from msm.laws import Hooke
from msm.springs import connect
from msm.volume import volume_term
from study.known.pressed import DOWN
from study.organ.occupancy import Booleans
from study.problem.trajectory import Observation

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Boxes:
    """A union of boxes, each a lower and an upper corner [m], shape (b, 2, 3)."""

    corners: Floats

    def occupancy(self, x: Floats, y: Floats, z: Floats) -> Booleans:
        """Inside or outside on the grid of three axes, see `study.organ.occupancy.SolidShape`."""
        inside = np.zeros((x.size, y.size, z.size), dtype=np.bool_)
        for lower, upper in self.corners:
            along = [(a > lo) & (a < up) for a, lo, up in zip((x, y, z), lower, upper, strict=True)]
            inside |= along[0][:, None, None] & along[1][:, None] & along[2]
        return inside


def block(size: tuple[float, ...]) -> Boxes:
    """One box from the origin to `size` [m]."""
    return Boxes(np.array([[np.zeros(3), size]]))


@dataclass(frozen=True, kw_only=True)
class Make:
    """Settings of a small lattice, in SI units.

    `poisson_ratio`: None for springs alone; `gravity`: its weight, for a body that is `held` at its
    lowest nodes by springs of E h.
    """

    counts: tuple[int, int, int] = (3, 3, 3)
    spacing: float = 0.01
    youngs_modulus: float = 5e3
    poisson_ratio: float | None = None
    density: float = 1054.0
    gravity: float = 0.0
    held: bool = True
    damping: NodalDamping = UNDAMPED


def lattice_of(make: Make, body: Boxes | None = None) -> tuple[Assembly, Material]:
    """A block of whole cells, or another body, as a lattice with its material."""
    body = body or block(tuple(make.spacing * n for n in make.counts))
    lower, upper = body.corners[:, 0].min(axis=0), body.corners[:, 1].max(axis=0)
    lattice = cells.build(body, lower, upper, make.spacing)
    mass = make.density * cells.node_volumes(lattice)
    lowest = lattice.nodes[:, 2] < lower[2] + 1e-6 * make.spacing
    ground = np.where(lowest, make.youngs_modulus * make.spacing if make.held else 0.0, 0.0)
    load = np.outer(mass * make.gravity, DOWN)
    support = csr_array(diags_array(ground))
    return Assembly(lattice, connect(lattice), mass, support, load), _material(make, lattice)


def _material(make: Make, lattice: cells.CellLattice) -> Material:
    nu = make.poisson_ratio
    of_law = SPRING_POISSON_RATIO if nu is None else nu
    law = Hooke(reference_stiffness(make.youngs_modulus, make.spacing, of_law))
    term = None if nu is None else volume_term(lattice, make.youngs_modulus, nu)
    return Material(law, term, make.damping)


def watch(assembly: Assembly, seconds: float, samples: int) -> Observation:
    """Observation of all nodes at equally spaced times."""
    none = np.zeros((0, 3))
    times = np.linspace(0.0, seconds, samples)
    return Observation(times, assembly.lattice.nodes, (samples - 1,), none, none)
