"""What acts on a lattice beside its first load: further loads, gravity, weights and rigid tools."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.kernel import inner_kernel
from msm.lattice import LatticeMesh
from msm.tools import CLOSE, NO_POINT, Contact, meet_tools
from study.mesh.quadrature import SurfaceRule
from study.problem.rigid import PLATE, RigidTool

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOVES = 6
"""What drives a tool in a step: displacement of its tip at the end, and at the start."""


class Outer(NamedTuple):
    """What the kernels read of it, and the contact that they work on.

    `place` (n,): of the nodes in the arrays of the motion; `dead` [N] (n, 3): what never changes;
    `loads` [N] (loads, n, 3). What drives a stage of a step stands in the columns of its row from
    `first` + stage * `width` on: a factor for each load, then MOVES for each tool.
    """

    place: Ints
    dead: Floats
    loads: Floats
    first: int
    width: int
    contact: Contact | None


@inner_kernel()
def add_outer_forces(outer: Outer | None, row: Floats, stage: int, force: Floats) -> None:
    """Add dead load and further loads [N] to the force (3, m)."""
    if outer is None:
        return
    at = outer.first + stage * outer.width
    for i in range(outer.place.shape[0]):
        for d in range(3):
            pushed = outer.dead[i, d]
            for k in range(outer.loads.shape[0]):
                pushed += row[at + k] * outer.loads[k, i, d]
            force[d, outer.place[i]] += pushed


@inner_kernel()
def stop_at_tools(outer: Outer | None, row: Floats, dt: float, u: Floats, v: Floats) -> None:
    """Let the tools stop what entered them in a step of dt [s]; the motion is (3, m)."""
    if outer is None:
        return
    meet_tools(outer.contact, row[outer.first + outer.loads.shape[0] :], dt, u, v)


@dataclass(frozen=True, eq=False)
class Burden:
    """What acts on the nodes of a lattice beside its first load.

    `dead` [N] (n, 3): gravity on nodes and weights; `attached` [kg] (n,): mass of weights, which
    the tissue does not damp; `loads` [N] (loads, n, 3) and the `factors` of each over time. `tools`
    meet the points of `surface`. With `given_loaded` the given nodes are at rest under `dead`.
    """

    dead: Floats
    attached: Floats
    loads: Floats
    factors: tuple[Callable[[Floats], Floats], ...] = ()
    tools: tuple[RigidTool, ...] = ()
    surface: SurfaceRule | None = None
    given_loaded: bool = False

    def drive(self, starts: Floats, dt: float, at: Sequence[float]) -> Floats:
        """Columns (steps, stages * width) of the steps of dt [s] from `starts` [s] (steps,)."""
        columns = []
        for share in at:
            times = starts + share * dt
            columns += [factor(times)[:, None] for factor in self.factors]
            for tool in self.tools:
                columns += [tool.travel(times), tool.travel(starts)]
        return np.hstack(columns) if columns else np.zeros((len(starts), 0))

    @property
    def width(self) -> int:
        """Columns that drive one stage of a step."""
        return len(self.factors) + MOVES * len(self.tools)


def outer_of(
    burden: Burden,
    lattice: LatticeMesh,
    mass: Floats,
    gamma_0: Floats,
    gamma_1: Floats,
    stages: int,
) -> Outer:
    """What kernels read, for an integrator of so many `stages` with load factors of their own.

    `mass` [kg], `gamma_0`, `gamma_1` (n,) as in `msm.network.Network`.
    """
    place = np.arange(len(mass))
    contact = None
    if burden.tools:
        contact = _contact(burden, lattice, mass, gamma_0, gamma_1)
    return Outer(place, burden.dead, burden.loads, stages, burden.width, contact)


def placed(outer: Outer, place: Ints) -> Outer:
    """The same, working on arrays in which the nodes stand at other places (n,)."""
    contact = outer.contact
    moved = None if contact is None else contact._replace(place=place)
    return outer._replace(place=place, contact=moved)


def _contact(
    burden: Burden, lattice: LatticeMesh, mass: Floats, gamma_0: Floats, gamma_1: Floats
) -> Contact:
    surface, tools = burden.surface, burden.tools
    if surface is None:
        raise ValueError("rigid tools need the surface that they meet; give it with them")
    met = [_met(tool, surface) for tool in tools]
    which = np.concatenate(met)
    of_tool = np.repeat(np.arange(len(tools)), [len(found) for found in met])
    points = surface.points[which]
    weights, _ = lattice.interpolation(points)
    count, nodes = len(points), len(mass)
    held = np.array([tool.bonded for tool in tools], dtype=bool)[of_tool]
    vectors, zeros = np.zeros((4, count, 3)), np.zeros((4, count))
    return Contact(
        tool=of_tool.astype(np.int64),
        rest=points,
        row=weights.indptr.astype(np.int64),
        node=weights.indices.astype(np.int64),
        weight=weights.data.astype(np.float64),
        held=held,
        anchor=vectors[0],
        spread=float(np.abs(weights).sum(axis=1).max(initial=0.0)),
        place=np.arange(nodes),
        mass=mass,
        gamma_0=gamma_0,
        gamma_1=gamma_1,
        shape=np.array([tool.shape for tool in tools], dtype=np.int64),
        radius=np.array([tool.radius for tool in tools]),
        tip=np.array([tool.tip for tool in tools]),
        axis=np.array([tool.axis for tool in tools]),
        friction=np.array([tool.friction for tool in tools]),
        close=CLOSE * lattice.spacing,
        push=vectors[1],
        before=zeros[0],
        due=zeros[1],
        sums=np.zeros(2),
        force=np.zeros((len(tools), 3)),
        active=np.zeros(count, dtype=np.int64),
        normal=vectors[2],
        free=vectors[3],
        impulse=np.zeros((count, 3)),
        short=zeros[2],
        give=zeros[3],
        ease=np.zeros(nodes),
        added=np.zeros((nodes, 3)),
    )


def _met(tool: RigidTool, surface: SurfaceRule) -> Ints:
    """Numbers of the points that a tool holds, or may touch. ValueError if it holds none."""
    if not tool.bonded:
        return np.arange(len(surface.points))
    held = np.flatnonzero(tool.holds(surface.points, surface.normals))
    if not held.size:
        raise ValueError(f"{tool.name}: is bonded to no surface that faces it; move or enlarge it")
    return held


def start(contact: Contact, tools: Sequence[RigidTool], u: Floats) -> None:
    """Put the points of a contact where the nodes displaced by u [m] (n, 3) put them, unpushed."""
    for p in range(len(contact.tool)):
        part = slice(contact.row[p], contact.row[p + 1])
        contact.anchor[p] = contact.weight[part] @ u[contact.node[part]]
    now = contact.rest + contact.anchor
    for number, tool in enumerate(tools):
        of_tool = contact.tool == number
        gap, _ = tool.gap(now[of_tool], 0.0)
        deep = gap < -(contact.close if tool.shape == PLATE else tool.radius)
        contact.before[of_tool] = np.where(deep, NO_POINT, gap)
    for changing in (contact.push, contact.due, contact.sums, contact.force):
        changing[:] = 0.0
