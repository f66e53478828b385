"""Time stepping of a lattice from rest under its loads, one or many steps at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material, arrays
from msm.dead_load import rest_under_dead_load, unloaded_network
from msm.external_loads import ExternalLoads, external_arrays, reset_contact
from msm.grid import Grids, grids_of
from msm.integrators import INTEGRATORS
from msm.lattice import LatticeMesh
from msm.laws import force_law_of
from msm.linearised import farthest, largest_vector_change
from msm.network import Network
from msm.stability import DEFAULT, CriticalStepTracker
from msm.timestep import LOOK
from msm.tool_contact import DEEPEST, ContactState, contact_state

Floats = NDArray[np.float64]

WITH_TOOL_CONTACT = ("symplectic-euler", "split-volume")
"""Integrators that correct the motion for contact with rigid tools at the end of a step."""


class State(NamedTuple):
    """Displacement [m] and velocity [m/s] (n, 3), and the state of the contact with tools."""

    u: Floats
    v: Floats
    contact_state: ContactState


class LatticeStepper:
    """Motion of a lattice from rest under its load times `factor` of the time [s].

    `u` [m] and `v` [m/s] (n, 3): displacement and velocity at the time `t` [s]; `limit_at_rest`
    [s]: critical time step at rest. `linear`: forces of small displacements; `single`: single
    precision. The constructor compiles every kernel. ValueError if the integrator does not support
    the spring law, its damping, rigid tools or single precision, or if the lattice does not support
    single precision.
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
        refuse_unfit(integrator, material, assembly.external_loads)
        self.method = INTEGRATORS[integrator]
        self.law, self.factor = material.law, factor
        self.external_loads = assembly.external_loads
        self.net, self.start = _initial_state(assembly, material, integrator, linear=linear)
        self.grids = grids_for(assembly.lattice, self.net, integrator, single=single)
        self.tracker = CriticalStepTracker(self.law, self.net, self.method)
        self.u, self.v = self.start.copy(), np.zeros_like(self.start)
        self.contact = None if self.net.external is None else self.net.external.contact
        self.contact_state = contact_state(self.contact)
        self.restart()
        self.limit_at_rest = self.tracker.limit(self.u)
        self._compile()

    def _compile(self) -> None:
        """Compile the kernels of a motion, so that the time of its steps is theirs alone."""
        self.advance(0, 1.0)
        self.farthest()
        largest_vector_change(self.tracker.net, self.u, self.u)

    def advance(self, count: int, dt: float) -> None:
        """Take `count` steps of dt [s] without checking the critical step."""
        starts = np.asarray(self.t + dt * np.arange(count), dtype=np.float64)
        factors = np.empty((count, len(self.method.at)))
        for stage, at in enumerate(self.method.at):
            factors[:, stage] = self.factor(starts + at * dt)
        if self.external_loads is not None:
            rows = self.external_loads.factor_rows(starts, dt, self.method.at)
            factors = np.hstack([factors, rows])
        if self.method.on_grid is not None and self.grids is not None:
            self.method.on_grid(self.law, self.grids, factors, dt, self.u, self.v)
        else:
            self.method.advance(self.law, self.net, factors, dt, self.u, self.v)
        self.t += count * dt
        self.unchecked += count

    def take_step(self, dt: float) -> None:
        """Take one step of dt [s]; every LOOK steps, update the critical step."""
        self.take_steps(1, dt)

    def take_steps(self, count: int, dt: float) -> None:
        """Take `count` steps of dt [s]; every LOOK steps, update the critical step."""
        while count > 0:
            taken = max(1, min(count, LOOK - self.unchecked))
            self.advance(taken, dt)
            count -= taken
            if self.unchecked >= LOOK:
                self.farthest()
                self.limit()

    def farthest(self) -> tuple[float, int]:
        """Largest component [m] of u in magnitude and its node; NaN counts as infinite."""
        return farthest(self.u)

    def limit(self) -> float:
        """Critical time step [s] at the displacement u, which must be finite."""
        self.unchecked = 0
        return self.tracker.limit(self.u)

    def state(self) -> State:
        """A copy of the state of the motion."""
        return State(self.u.copy(), self.v.copy(), self.contact_state.copy())

    def put_back(self, state: State) -> None:
        """Restore a state that `state` returned."""
        self.u[:], self.v[:] = state.u, state.v
        self.contact_state.restore(state.contact_state)

    @property
    def tool_force(self) -> Floats:
        """Force [N] (tools, 3) of the body on each rigid tool in the last step."""
        return self.contact_state.tool_force

    @property
    def overlap(self) -> float:
        """Deepest overlap [m] of body and tools since the start."""
        return float(self.contact_state.totals[DEEPEST])

    def restart(self) -> None:
        """Return the lattice to its initial state at time zero."""
        self.u[:], self.v[:] = self.start, 0.0
        self.t, self.unchecked = 0.0, 0
        if self.contact is not None and self.external_loads is not None:
            reset_contact(self.contact, self.external_loads.tools, self.u)


def grids_for(lattice: LatticeMesh, net: Network, integrator: str, *, single: bool) -> Grids | None:
    """Regular grids that an integrator steps on; None if it loops over the list of springs.

    ValueError for single precision without a grid.
    """
    on_grid = INTEGRATORS[integrator].on_grid is not None
    grids = grids_of(lattice, net, single=single) if on_grid else None
    if single and grids is None:
        raise ValueError(
            "single precision is for explicit integrators on a cubic lattice whose foundation "
            "couples neighbouring nodes only; set lattice.precision to double"
        )
    return grids


def _initial_state(
    assembly: Assembly, material: Material, integrator: str, *, linear: bool
) -> tuple[Network, Floats]:
    """Arrays of the kernels, and the displacement [m] (n, 3) at rest under the dead load."""
    net, loads = arrays(assembly, material, linear=linear), assembly.external_loads
    if loads is None:
        return net, np.zeros_like(net.load)
    if loads.given_loaded:
        (net, dead), start = (
            unloaded_network(material.law, net, loads.dead),
            np.zeros_like(net.load),
        )
        loads = replace(loads, dead=dead)
    else:
        start = rest_under_dead_load(material.law, net, loads.dead)
    nodes, stages = (net.mass, net.gamma_0, net.gamma_1), len(INTEGRATORS[integrator].at)
    return net._replace(external=external_arrays(loads, assembly.lattice, *nodes, stages)), start


def refuse_unfit(
    integrator: str, material: Material, external_loads: ExternalLoads | None = None
) -> None:
    """ValueError if an integrator does not support the springs, their damping or rigid tools."""
    if external_loads is not None and external_loads.tools and integrator not in WITH_TOOL_CONTACT:
        raise ValueError(
            f"the integrator {integrator} does not follow rigid tools that are moved; set "
            f"lattice.integrator to {' or '.join(WITH_TOOL_CONTACT)}"
        )
    method = INTEGRATORS[integrator]
    if method.linear_only and not force_law_of(material.law).linear:
        raise ValueError(f"the integrator {integrator} takes linear springs only; choose another")
    if material.damping.beta > 0.0 and not method.stiffness_damping:
        raise ValueError(
            f"the integrator {integrator} has no stiffness part of Rayleigh damping; set "
            "damping.stiffness to 0 or choose another"
        )
