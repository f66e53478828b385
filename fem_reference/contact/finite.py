"""Contact at large displacement: gaps of vertices, their derivatives, and the forces they pass on.

The gap of a vertex is the mean distance from a rigid tool of the points of the surface round it,
where the body has moved them, as in `fem_reference.contact.patch`; its derivative says how a force
between vertex and tool is shared out to the nodes. So the forces on body and tool are in balance,
and the work of a frictionless force is that of the tool, whatever the displacement. Friction acts
where the normal force does, on the mean over the same points of how far they have slipped along the
tool since the state before, in the plane across the mean normal.

A punch is flat up to its edge and free beside it: it meets the points that were within its radius
in the state before, and not behind its face, so that they do not change while a balance is sought.
Tissue that rises beside it passes its side without a force.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, vstack

from fem_reference.contact.law import Areas, dragged, forces, off_law
from fem_reference.contact.patch import LEAST_SHARE, Patch
from study.problem.rigid import PUNCH, SPHERE, RigidTool

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


NEAR = 0.05
"""Of a tool's radius, up to where the distance of a point counts."""

BESIDE = -0.2
"""Of the cosine between the normals of a tool and a surface in it, which are opposed, -1, where it
is pushed back, and 0 where it passes the tool's middle."""

BEHIND = 0.25
"""Of its radius, how far behind the face of a punch a point is that has passed it at the side."""

SLIPPING = 1e-4
"""Of the limit of friction, how near to it what sticks is taken to slip."""

NEARLY_BACK = 1e-6
"""Least 1 + cos of the angle of a normal with a tool's axis by which tangents are turned."""

TINY = 1e-300


class Before(NamedTuple):
    """A displacement u [m] (n,) at a time [s]: slips and a punch's edge count from it."""

    u: Floats
    time: float


class Touching(NamedTuple):
    """Distances [m] (q,) of points from a tool, and its normals (q, 3) there.

    `counted` [m]: the distance, but no more than is near; its first and second derivative by the
    distance, `slope` and `bend` [1/m]. `shares` (v, q): of the points in the mean at a vertex, none
    where it is not `under` (v,) the tool. `axes` (v, 3, 2): two tangents across the mean normal;
    `slip` [m] (q, 3): of the points along the tool since the state before.
    """

    distance: Floats
    normal: Floats
    counted: Floats
    slope: Floats
    bend: Floats
    shares: csr_array
    under: Bools
    axes: Floats
    slip: Floats


@dataclass(frozen=True, eq=False)
class FiniteContact:
    """Patches of a body of n displacements under tools.

    Constraints are numbered patch by patch, vertex by vertex: of a bonded tool three components of
    the mean displacement from where the tool holds it; of a sliding one the gap, and if any tool
    has friction, the slip along two tangents.
    """

    patches: tuple[Patch, ...]
    size: int

    @cached_property
    def rubs(self) -> bool:
        """Whether any tool drags what it touches."""
        return any(one.tool.friction > 0.0 and not one.tool.bonded for one in self.patches)

    @cached_property
    def friction(self) -> Floats:
        """Coulomb's coefficient of each vertex (v,), infinite where it is bonded."""
        each = [np.inf if one.tool.bonded else one.tool.friction for one in self.patches]
        return np.repeat(np.array(each, dtype=np.float64), [one.count for one in self.patches])

    @cached_property
    def held(self) -> Bools:
        """Which constraints are those of bonded tools, (c,)."""
        bonded = np.array([one.tool.bonded for one in self.patches], dtype=np.bool_)
        return np.repeat(bonded, self._counts)

    @cached_property
    def firsts(self) -> Ints:
        """The first constraint of each, (c,): the gap, of a vertex that may slip."""
        numbers = np.arange(len(self.held))
        return numbers - numbers % 3 if self.rubs else numbers

    @cached_property
    def _counts(self) -> list[int]:
        return [one.count * self._width(one.tool) for one in self.patches]

    def _width(self, tool: RigidTool) -> int:
        return 3 if tool.bonded or self.rubs else 1

    @cached_property
    def parts(self) -> list[slice]:
        """Of the constraints of each patch."""
        ends = np.cumsum([0, *self._counts])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def nodes(self) -> list[Ints]:
        """Nodes that each patch sees."""
        return [np.unique(one.shapes.indices).astype(np.int64) for one in self.patches]

    @cached_property
    def seeing(self) -> list[Patch]:
        """The patches with shape functions of these alone."""
        return [one.seeing(n) for one, n in zip(self.patches, self.nodes, strict=True)]

    def at(self, u: Floats, time: float, before: Before | None = None) -> Configuration:
        """The body displaced by u [m] (n,) from its given shape, and the tools at a time [s].

        `before`: the state that was balanced last; without one the given shape at the start.
        """
        return Configuration(self, u, time, before or Before(np.zeros(self.size), 0.0))

    def answered(self, compliance: Floats, gaps: Floats, chosen: Ints, old: Floats) -> Floats:
        """Forces [N] of the chosen constraints that meet the law of contact, sought from old ones.

        `compliance` [m/N]: of the body among them; `gaps` [m]: of the chosen, under the old forces.
        """
        offset = gaps - compliance @ old
        if not self.rubs:
            return forces(Areas(compliance, offset, self.held[chosen]), old)
        friction = self.friction[chosen[::3] // 3]
        return dragged(compliance, offset.reshape(-1, 3), friction, old.reshape(-1, 3)).ravel()

    def off_law(self, gaps: Floats, force: Floats, stiffness: float) -> float:
        """How far [m] gaps and forces [N] are from meeting the law, a `stiffness` [N/m] apart."""
        if not self.rubs:
            held = self.held | (force > 0.0)
            return float(np.where(held, np.abs(gaps), np.maximum(-gaps, 0.0)).max(initial=0.0))
        return off_law(gaps.reshape(-1, 3), force.reshape(-1, 3), self.friction, stiffness)

    def closed(self, force: Floats) -> Bools:
        """Which constraints hold (c,) under forces [N]: gaps that are shut, and what sticks."""
        pushed = (force > 0.0)[self.firsts]
        if not self.rubs:
            return np.asarray(self.held | pushed)
        each = force.reshape(-1, 3)
        drag = np.hypot(each[:, 1], each[:, 2])
        sticks = drag < (1.0 - SLIPPING) * self.friction * np.maximum(each[:, 0], TINY)
        holds = np.column_stack([np.ones_like(sticks), sticks, sticks]).ravel()
        return np.asarray(self.held | (pushed & holds))


@dataclass(frozen=True, eq=False)
class Configuration:
    """Where a body is and where the tools are: gaps, their derivatives, and what forces do."""

    contact: FiniteContact
    u: Floats
    time: float
    before: Before

    @cached_property
    def gaps(self) -> Floats:
        """Gaps [m] (c,), negative inside a tool, infinite beside a punch; and slips."""
        found = []
        for k, patch in enumerate(self.contact.patches):
            if patch.tool.bonded:
                off = self._moved(k, self.u) - patch.tool.travel(np.array([self.time]))[0]
                found.append((patch.shares @ off).ravel())
                continue
            touch = self._touches[k]
            gap = np.where(touch.under, touch.shares @ touch.counted, np.inf)
            if self.contact.rubs:
                mean = touch.shares @ (touch.slope[:, None] * touch.slip)
                slip = np.einsum("vi,vik->vk", mean, touch.axes)
                gap = np.column_stack([gap, slip]).ravel()
            found.append(gap)
        return np.concatenate([np.zeros(0), *found])

    @cached_property
    def derivative(self) -> csr_array:
        """Of the gaps by the displacement, (c, n): of slips, that their force is shared out by."""
        parts = [self._rows(k) for k in range(len(self.contact.patches))]
        return csr_array(vstack([csr_array((0, self.contact.size)), *parts]))

    def curvature(self, force: Floats) -> csc_array:
        """Second derivative [N/m] (n, n) of the gaps times forces [N] (c,), without the slips."""
        contact = self.contact
        rows, columns, entries = [], [], []
        for k, patch in enumerate(contact.patches):
            if patch.tool.bonded:
                continue
            touch, own_force = self._touches[k], force[contact.parts[k]]
            pressure = own_force[:: 3 if contact.rubs else 1] @ touch.shares
            across = np.zeros_like(pressure)
            if patch.tool.shape == SPHERE:
                across = pressure * touch.slope / (touch.distance + patch.tool.radius)
            along = pressure * touch.bend - across
            shapes, nodes, normal = contact.seeing[k].shapes, contact.nodes[k], touch.normal
            for i in range(3):
                for j in range(3):
                    bend = along * normal[:, i] * normal[:, j] + (across if i == j else 0.0)
                    own = coo_array(shapes.T @ shapes.multiply(bend[:, None]))
                    rows.append(3 * nodes[own.row] + i)
                    columns.append(3 * nodes[own.col] + j)
                    entries.append(own.data)
        size = contact.size
        if not entries:
            return csc_array((size, size))
        places = (np.concatenate(rows), np.concatenate(columns))
        return csc_array(coo_array((np.concatenate(entries), places), shape=(size, size)))

    def on_tools(self, force: Floats) -> Floats:
        """What the body does to each tool [N] (tools, 3) under the forces [N] (c,)."""
        found = [
            -(self._rows(k).T @ force[part]).reshape(-1, 3).sum(axis=0)
            for k, part in enumerate(self.contact.parts)
        ]
        return np.array(found).reshape(-1, 3)

    @property
    def through(self) -> bool:
        """Whether some of the surface in a tool is about to pass its middle, or has passed it.

        Beyond, the tool would push along the normal out of the body. Against its own axis alone it
        may push: what a sphere has sunk in closes round it.
        """
        for k, touch in self._touches.items():
            nodes = self.contact.nodes[k]
            outward = self.contact.seeing[k].outward(self.u.reshape(-1, 3)[nodes])
            along = (touch.normal * outward).sum(axis=1)
            if (along[touch.distance < 0.0] > BESIDE).any():
                return True
        return False

    @property
    def penetration(self) -> float:
        """How deep [m] any point of the patches is inside a tool that it slides on."""
        deepest = (-float(touch.distance.min()) for touch in self._touches.values())
        return max([0.0, *deepest])

    def _moved(self, k: int, u: Floats) -> Floats:
        """Displacement [m] (q, 3) of the points of a patch."""
        return np.asarray(self.contact.seeing[k].shapes @ u.reshape(-1, 3)[self.contact.nodes[k]])

    @cached_property
    def _touches(self) -> dict[int, Touching]:
        """Of the patches of tools that slide, by their numbers."""
        patches = enumerate(self.contact.patches)
        return {k: self._touch(k) for k, one in patches if not one.tool.bonded}

    def _touch(self, k: int) -> Touching:
        patch, moved = self.contact.patches[k], self._moved(k, self.u)
        tool, shares = patch.tool, patch.shares
        under = np.ones(patch.count, dtype=np.bool_)
        distance, normal = tool.gap(patch.points + moved, self.time)
        if tool.shape == PUNCH:  # whose gap ends at its radius now, not where it was
            faced = self._faced(k)
            tip = tool.tip + tool.travel(np.array([self.time]))[0]
            along = (patch.points + moved - tip) @ tool.axis
            distance, (shares, under) = np.where(faced, along, np.inf), _among(shares, faced)
        reach = NEAR * tool.radius
        level = np.tanh(np.maximum(distance, 0.0) / reach)
        slope = 1.0 - level**2
        counted = np.where(distance > 0.0, reach * level, distance)
        axes, slip = np.zeros((patch.count, 3, 2)), np.zeros_like(moved)
        if self.contact.rubs:
            axes = _tangents(tool.axis, shares @ (slope[:, None] * normal))
            now, then = tool.travel(np.array([self.time, self.before.time]))
            slip = moved - self._moved(k, self.before.u) - (now - then)
        bend = -2.0 / reach * level * slope
        return Touching(distance, normal, counted, slope, bend, shares, under, axes, slip)

    def _faced(self, k: int) -> Bools:
        """Which points (q,) are before the face of a punch, or in it by less than at its side."""
        patch, before = self.contact.patches[k], self.before
        places = patch.points + self._moved(k, before.u)
        distance = patch.tool.gap(places, before.time)[0]
        return np.isfinite(distance) & (distance > -BEHIND * patch.tool.radius)

    def _rows(self, k: int) -> csr_array:
        contact = self.contact
        patch, shapes, nodes = contact.patches[k], contact.seeing[k].shapes, contact.nodes[k]
        if patch.tool.bonded:
            mean = coo_array(patch.shares @ shapes)
            parts = [(3 * mean.row + i, mean.col, i, mean.data) for i in range(3)]
        else:
            touch, parts = self._touches[k], []
            pushed = touch.slope[:, None] * touch.normal
            width = 3 if contact.rubs else 1
            for i in range(3):
                along = coo_array(touch.shares @ shapes.multiply(pushed[:, i : i + 1]))
                parts.append((width * along.row, along.col, i, along.data))
            if contact.rubs:
                mean = coo_array(touch.shares @ shapes.multiply(touch.slope[:, None]))
                parts += [
                    (3 * mean.row + 1 + j, mean.col, i, mean.data * touch.axes[mean.row, i, j])
                    for i in range(3)
                    for j in range(2)
                ]
        rows, columns, data = (
            np.concatenate(one)
            for one in zip(*((r, 3 * nodes[c] + i, d) for r, c, i, d in parts), strict=True)
        )
        part = contact.parts[k]
        shape = (part.stop - part.start, contact.size)
        return csr_array(coo_array((data, (rows, columns)), shape=shape))


def _among(shares: csr_array, chosen: Bools) -> tuple[csr_array, Bools]:
    """Shares (v, q) of chosen points (q,) alone, and which vertices have enough of them."""
    seen = shares @ chosen.astype(np.float64)
    under = seen > LEAST_SHARE
    kept = np.where(under, 1.0 / np.maximum(seen, TINY), 0.0)
    return csr_array(diags_array(kept) @ shares @ diags_array(chosen.astype(np.float64))), under


def _tangents(axis: Floats, normals: Floats) -> Floats:
    """Two unit vectors (v, 3, 2) across each of the normals (v, 3), which may be of any length.

    Those across the axis, turned with it to the normal by the shortest way: they change smoothly
    with the normal wherever it does not point back along the axis.
    """
    least = np.eye(3)[np.abs(axis).argmin()]
    first = np.cross(axis, least) / np.linalg.norm(np.cross(axis, least))
    size = np.linalg.norm(normals, axis=1)
    unit = np.where(size[:, None] > TINY, normals / np.maximum(size, TINY)[:, None], axis)
    turned = []
    for one in (first, np.cross(axis, first)):
        half = (unit @ one) / np.maximum(1.0 + unit @ axis, NEARLY_BACK)
        turned.append(one - half[:, None] * (unit + axis))
    return np.stack(turned, axis=2)
