"""External loads of a lattice: further loads, gravity, attached weights and rigid tools."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.kernel import inner_kernel
from msm.lattice import LatticeMesh
from msm.tool_contact import ACTIVATION_GAP, BEYOND, Contact, resolve_contact
from study.mesh.quadrature import SurfaceRule
from study.problem.rigid import PLATE, RigidTool

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TIP_COLUMNS = 6
"""Columns of a tool in a step: displacement of its tip at the end, then at the start."""


class ExternalArrays(NamedTuple):
    """External loads as the kernels read them, and the contact that they work on.

    `place` (n,): of each node in the arrays of the motion; `dead` [N] (n, 3): the constant load;
    `loads` [N] (loads, n, 3). A stage of a step reads its row of factors from column
    `first` + stage * `width` on: one factor per load, then TIP_COLUMNS per tool.
    """

    place: Ints
    dead: Floats
    loads: Floats
    first: int
    width: int
    contact: Contact | None


@inner_kernel()
def add_external_forces(
    external: ExternalArrays | None, row: Floats, stage: int, force: Floats
) -> None:
    """Add the dead load and the further loads [N] to the force (3, m)."""
    if external is None:
        return
    at = external.first + stage * external.width
    for i in range(external.place.shape[0]):
        for d in range(3):
            total = external.dead[i, d]
            for k in range(external.loads.shape[0]):
                total += row[at + k] * external.loads[k, i, d]
            force[d, external.place[i]] += total


@inner_kernel()
def apply_tool_contact(
    external: ExternalArrays | None, row: Floats, dt: float, u: Floats, v: Floats
) -> None:
    """Correct displacement and velocity (3, m) for contact with tools in a step of dt [s]."""
    if external is None:
        return
    resolve_contact(external.contact, row[external.first + external.loads.shape[0] :], dt, u, v)


@dataclass(frozen=True, eq=False)
class ExternalLoads:
    """Loads on the nodes of a lattice beside its first load.

    `dead` [N] (n, 3): gravity on nodes and weights; `attached_mass` [kg] (n,): mass of the weights,
    on which nodal damping does not act; `loads` [N] (loads, n, 3), each with one of `factors` over
    time [s]. `tools` may touch the points of `surface`. With `given_loaded` the given nodes are in
    equilibrium under `dead`.
    """

    dead: Floats
    attached_mass: Floats
    loads: Floats
    factors: tuple[Callable[[Floats], Floats], ...] = ()
    tools: tuple[RigidTool, ...] = ()
    surface: SurfaceRule | None = None
    given_loaded: bool = False

    def factor_rows(self, starts: Floats, dt: float, stages: Sequence[float]) -> Floats:
        """Factors and tip displacements (steps, stages * width) of steps of dt [s].

        `starts` [s] (steps,): start of each step; `stages`: fractions of the step.
        """
        columns = []
        for fraction in stages:
            times = starts + fraction * dt
            columns += [factor(times)[:, None] for factor in self.factors]
            for tool in self.tools:
                columns += [tool.travel(times), tool.travel(starts)]
        return np.hstack(columns) if columns else np.zeros((len(starts), 0))

    @property
    def width(self) -> int:
        """Columns of one stage of a step."""
        return len(self.factors) + TIP_COLUMNS * len(self.tools)


def external_arrays(
    external_loads: ExternalLoads,
    lattice: LatticeMesh,
    mass: Floats,
    gamma_0: Floats,
    gamma_1: Floats,
    stages: int,
) -> ExternalArrays:
    """The arrays of the kernels, for an integrator with load factors at so many `stages`.

    `mass` [kg], `gamma_0`, `gamma_1` (n,) as in `msm.network.Network`.
    """
    place = np.arange(len(mass))
    contact = None
    if external_loads.tools:
        contact = _contact(external_loads, lattice, mass, gamma_0, gamma_1)
    return ExternalArrays(
        place, external_loads.dead, external_loads.loads, stages, external_loads.width, contact
    )


def renumbered(external: ExternalArrays, place: Ints) -> ExternalArrays:
    """The loads for arrays of the motion that have the nodes at other places (n,)."""
    contact = external.contact
    moved = None if contact is None else contact._replace(place=place)
    return external._replace(place=place, contact=moved)


def _contact(
    external_loads: ExternalLoads,
    lattice: LatticeMesh,
    mass: Floats,
    gamma_0: Floats,
    gamma_1: Floats,
) -> Contact:
    """Contact of the surface with the tools. ValueError without a surface."""
    surface, tools = external_loads.surface, external_loads.tools
    if surface is None:
        raise ValueError("rigid tools need the surface that they meet; give it with them")
    candidates = [_candidate_points(tool, surface) for tool in tools]
    which = np.concatenate(candidates)
    of_tool = np.repeat(np.arange(len(tools)), [len(points) for points in candidates])
    points = surface.points[which]
    weights, _ = lattice.interpolation(points)
    bonded = np.array([tool.bonded for tool in tools], dtype=bool)[of_tool]
    return Contact(
        tool=of_tool.astype(np.int64),
        rest=points,
        row=weights.indptr.astype(np.int64),
        node=weights.indices.astype(np.int64),
        weight=weights.data.astype(np.float64),
        bonded=bonded,
        weight_sum=float(np.abs(weights).sum(axis=1).max(initial=0.0)),
        place=np.arange(len(mass)),
        mass=mass,
        gamma_0=gamma_0,
        gamma_1=gamma_1,
        shape=np.array([tool.shape for tool in tools], dtype=np.int64),
        radius=np.array([tool.radius for tool in tools]),
        tip=np.array([tool.tip for tool in tools]),
        axis=np.array([tool.axis for tool in tools]),
        friction=np.array([tool.friction for tool in tools]),
        activation_gap=ACTIVATION_GAP * lattice.spacing,
        **_zero_arrays(len(points), len(mass), len(tools)),
    )


def _zero_arrays(points: int, nodes: int, tools: int) -> dict[str, Any]:
    """State and work arrays of a contact, zero until `reset_contact` and the first step."""
    return {
        "anchor": np.zeros((points, 3)),
        "body_force": np.zeros((points, 3)),
        "previous_gap": np.zeros(points),
        "wake_travel": np.zeros(points),
        "totals": np.zeros(2),
        "tool_force": np.zeros((tools, 3)),
        "active": np.zeros(points, dtype=np.int64),
        "normal": np.zeros((points, 3)),
        "free_velocity": np.zeros((points, 3)),
        "impulse": np.zeros((points, 3)),
        "bias": np.zeros(points),
        "inverse_effective_mass": np.zeros(points),
        "inverse_mass": np.zeros(nodes),
        "velocity_change": np.zeros((nodes, 3)),
    }


def _candidate_points(tool: RigidTool, surface: SurfaceRule) -> Ints:
    """Numbers of the points that a tool may touch or is bonded to.

    ValueError for a bonded tool without a point.
    """
    if not tool.bonded:
        return np.arange(len(surface.points))
    bonded = np.flatnonzero(tool.holds(surface.points, surface.normals))
    if not bonded.size:
        raise ValueError(f"{tool.name}: is bonded to no surface that faces it; move or enlarge it")
    return bonded


def reset_contact(contact: Contact, tools: Sequence[RigidTool], u: Floats) -> None:
    """Set the points of a contact to those of nodes displaced by u [m] (n, 3), without force."""
    for p in range(len(contact.tool)):
        part = slice(contact.row[p], contact.row[p + 1])
        contact.anchor[p] = contact.weight[part] @ u[contact.node[part]]
    position = contact.rest + contact.anchor
    for number, tool in enumerate(tools):
        of_tool = contact.tool == number
        gap, _ = tool.gap(position[of_tool], 0.0)
        too_deep = gap < -(contact.activation_gap if tool.shape == PLATE else tool.radius)
        contact.previous_gap[of_tool] = np.where(too_deep, BEYOND, gap)
    for array in (contact.body_force, contact.wake_travel, contact.totals, contact.tool_force):
        array[:] = 0.0
