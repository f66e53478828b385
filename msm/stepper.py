"""A lattice at rest that takes steps under its load, one or many at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material, arrays
from msm.grid import Grid, grid_of
from msm.integrators import INTEGRATORS
from msm.lattice import LatticeMesh
from msm.laws import force_law_of
from msm.linearised import farthest
from msm.network import Network
from msm.stability import DEFAULT, Follower
from msm.timestep import LOOK

Floats = NDArray[np.float64]


class LatticeStepper:
    """The motion of a lattice, from rest, under the load times `factor` of the time [s].

    `u` [m] and `v` [m/s] (n, 3): where it is, at the time `t` [s]; `limit_at_rest` [s]: the
    critical step there. `linear`: forces of small displacements; `single`: in single precision.
    Everything is compiled once it exists. ValueError if the integrator does not suit the springs or
    their damping, or the lattice or the integrator single precision.
    """

    def __init__(
        self,
        assembly: Assembly,
        material: Material,
        factor: Callable[[Floats], Floats],
        integrator: str = DEFAULT,
        *,
        linear: bool = False,
        single: bool = False,
    ) -> None:
        refuse_unfit(integrator, material)
        self.method = INTEGRATORS[integrator]
        self.law, self.factor = material.law, factor
        self.net = arrays(assembly, material, linear=linear)
        self.grid = grid_for(assembly.lattice, self.net, integrator, single=single)
        self.follower = Follower(self.law, self.net, self.method)
        self.u, self.v = np.zeros_like(self.net.load), np.zeros_like(self.net.load)
        self.t, self.unseen = 0.0, 0
        self.limit_at_rest = self.follower.limit(self.u)
        self.advance(0, 1.0)

    def advance(self, count: int, dt: float) -> None:
        """Take so many steps of dt [s] and nothing else."""
        starts = np.asarray(self.t + dt * np.arange(count), dtype=np.float64)
        factors = np.stack([self.factor(starts + at * dt) for at in self.method.at], axis=1)
        if self.method.on_grid is not None and self.grid is not None:
            self.method.on_grid(self.law, self.grid, factors, dt, self.u, self.v)
        else:
            self.method.advance(self.law, self.net, factors, dt, self.u, self.v)
        self.t += count * dt
        self.unseen += count

    def take_step(self, dt: float) -> None:
        """Take one step of dt [s] with what a run does between steps: every LOOK it looks."""
        self.advance(1, dt)
        if self.unseen >= LOOK:
            self.farthest()
            self.limit()

    def farthest(self) -> tuple[float, int]:
        """Largest component [m] of u and its node; NaN and infinity count as infinite."""
        return farthest(self.u)

    def limit(self) -> float:
        """Look at the critical step [s] at u, which must be finite."""
        self.unseen = 0
        return self.follower.limit(self.u)

    def restart(self) -> None:
        """Put the lattice at rest again, at the time zero."""
        self.u[:], self.v[:] = 0.0, 0.0
        self.t, self.unseen = 0.0, 0


def grid_for(lattice: LatticeMesh, net: Network, integrator: str, *, single: bool) -> Grid | None:
    """The grid that an integrator steps on, None if it steps over the list of springs.

    ValueError for single precision where there is none.
    """
    on_grid = INTEGRATORS[integrator].on_grid is not None
    grid = grid_of(lattice, net, single=single) if on_grid else None
    if single and grid is None:
        raise ValueError(
            "single precision is for explicit integrators on a cubic lattice whose foundation "
            "couples neighbouring nodes only; set lattice.precision to double"
        )
    return grid


def refuse_unfit(integrator: str, material: Material) -> None:
    """ValueError if an integrator does not suit the springs or their damping."""
    method = INTEGRATORS[integrator]
    if method.linear_only and not force_law_of(material.law).linear:
        raise ValueError(f"the integrator {integrator} takes linear springs only; choose another")
    if material.damping.beta > 0.0 and not method.stiffness_damping:
        raise ValueError(
            f"the integrator {integrator} has no stiffness part of Rayleigh damping; set "
            "damping.stiffness to 0 or choose another"
        )
