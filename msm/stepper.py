"""A lattice at rest that takes steps under its load, one or many at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm import outer as outers
from msm.assembly import Assembly, Material, arrays
from msm.grid import Grids, grids_of
from msm.integrators import INTEGRATORS
from msm.lattice import LatticeMesh
from msm.laws import force_law_of
from msm.linearised import farthest
from msm.network import Network
from msm.outer import Burden
from msm.settled import sagged, unloaded
from msm.stability import DEFAULT, Follower
from msm.timestep import LOOK
from msm.tools import DEEPEST, Standing, standing

Floats = NDArray[np.float64]


STOPPED = ("symplectic-euler", "split-volume")
"""Integrators at the end of whose steps rigid tools stop what entered them."""


class State(NamedTuple):
    """Displacement [m] and velocity [m/s] (n, 3), and how the body stands to tools."""

    u: Floats
    v: Floats
    standing: Standing


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
        refuse_unfit(integrator, material, assembly.burden)
        self.method = INTEGRATORS[integrator]
        self.law, self.factor = material.law, factor
        self.burden = assembly.burden
        self.net, self.start = _at_start(assembly, material, integrator, linear=linear)
        self.grids = grids_for(assembly.lattice, self.net, integrator, single=single)
        self.follower = Follower(self.law, self.net, self.method)
        self.u, self.v = self.start.copy(), np.zeros_like(self.start)
        self.contact = None if self.net.outer is None else self.net.outer.contact
        self.standing = standing(self.contact)
        self.restart()
        self.limit_at_rest = self.follower.limit(self.u)
        self.advance(0, 1.0)

    def advance(self, count: int, dt: float) -> None:
        """Take so many steps of dt [s] and nothing else."""
        starts = np.asarray(self.t + dt * np.arange(count), dtype=np.float64)
        factors = np.empty((count, len(self.method.at)))
        for stage, at in enumerate(self.method.at):
            factors[:, stage] = self.factor(starts + at * dt)
        if self.burden is not None:
            factors = np.hstack([factors, self.burden.drive(starts, dt, self.method.at)])
        if self.method.on_grid is not None and self.grids is not None:
            self.method.on_grid(self.law, self.grids, factors, dt, self.u, self.v)
        else:
            self.method.advance(self.law, self.net, factors, dt, self.u, self.v)
        self.t += count * dt
        self.unseen += count

    def take_step(self, dt: float) -> None:
        """Take one step of dt [s] with what a run does between steps: every LOOK it looks."""
        self.take_steps(1, dt)

    def take_steps(self, count: int, dt: float) -> None:
        """Take so many steps of dt [s], as many at once as there are between two looks."""
        while count > 0:
            taken = max(1, min(count, LOOK - self.unseen))
            self.advance(taken, dt)
            count -= taken
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

    def state(self) -> State:
        """A copy of where it is."""
        return State(self.u.copy(), self.v.copy(), self.standing.kept())

    def put_back(self, state: State) -> None:
        """Set where it is to a copy."""
        self.u[:], self.v[:] = state.u, state.v
        self.standing.put_back(state.standing)

    @property
    def tool_force(self) -> Floats:
        """What the body did to each rigid tool in the last step [N] (tools, 3)."""
        return self.standing.force

    @property
    def overlap(self) -> float:
        """Deepest overlap [m] of body and tools so far."""
        return float(self.standing.sums[DEEPEST])

    def restart(self) -> None:
        """Put the lattice at rest again, at the time zero."""
        self.u[:], self.v[:] = self.start, 0.0
        self.t, self.unseen = 0.0, 0
        if self.contact is not None and self.burden is not None:
            outers.start(self.contact, self.burden.tools, self.u)


def grids_for(lattice: LatticeMesh, net: Network, integrator: str, *, single: bool) -> Grids | None:
    """The grids that an integrator steps on, None if it steps over the list of springs.

    ValueError for single precision where there is none.
    """
    on_grid = INTEGRATORS[integrator].on_grid is not None
    grids = grids_of(lattice, net, single=single) if on_grid else None
    if single and grids is None:
        raise ValueError(
            "single precision is for explicit integrators on a cubic lattice whose foundation "
            "couples neighbouring nodes only; set lattice.precision to double"
        )
    return grids


def _at_start(
    assembly: Assembly, material: Material, integrator: str, *, linear: bool
) -> tuple[Network, Floats]:
    """What the kernels read, and the displacement [m] (n, 3) at rest under the dead load."""
    net, burden = arrays(assembly, material, linear=linear), assembly.burden
    if burden is None:
        return net, np.zeros_like(net.load)
    if burden.given_loaded:
        (net, dead), start = unloaded(material.law, net, burden.dead), np.zeros_like(net.load)
        burden = replace(burden, dead=dead)
    else:
        start = sagged(material.law, net, burden.dead)
    nodes, stages = (net.mass, net.gamma_0, net.gamma_1), len(INTEGRATORS[integrator].at)
    return net._replace(outer=outers.outer_of(burden, assembly.lattice, *nodes, stages)), start


def refuse_unfit(integrator: str, material: Material, burden: Burden | None = None) -> None:
    """ValueError if an integrator does not suit the springs, their damping or rigid tools."""
    if burden is not None and burden.tools and integrator not in STOPPED:
        raise ValueError(
            f"the integrator {integrator} does not follow rigid tools that are moved; set "
            f"lattice.integrator to {' or '.join(STOPPED)}"
        )
    method = INTEGRATORS[integrator]
    if method.linear_only and not force_law_of(material.law).linear:
        raise ValueError(f"the integrator {integrator} takes linear springs only; choose another")
    if material.damping.beta > 0.0 and not method.stiffness_damping:
        raise ValueError(
            f"the integrator {integrator} has no stiffness part of Rayleigh damping; set "
            "damping.stiffness to 0 or choose another"
        )
