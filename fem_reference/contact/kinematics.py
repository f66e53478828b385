"""Kinematics of contact at large displacement: gaps, slips and their derivatives.

The gap of a vertex is the weighted mean distance of the surface points around it from a rigid tool,
in the deformed configuration, as in `fem_reference.contact.patch`. The transposed derivative of the
gaps distributes a contact force to the nodes, so that the forces on body and tool are equal and
opposite, and a frictionless force does the work of the tool at any displacement. Slip is the
weighted mean relative displacement of the same points since the previous state, in the plane across
the mean normal.

A punch is a flat disc. Its contact points are those within its radius, and not behind its face, in
the previous state, so that they do not change during an iteration. Tissue beside it passes its side
without a force.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, vstack

from fem_reference.contact.law import (
    ComplementarityProblem,
    frictional_forces,
    frictionless_forces,
    law_residual,
)
from fem_reference.contact.patch import LEAST_SHARE, Patch
from study.problem.rigid import PUNCH, SPHERE, RigidTool

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


NEAR = 0.05
"""Distance, relative to the tool's radius, at which the limited distance levels off."""

BESIDE = -0.2
"""Cosine between the normals of a tool and of the surface inside it, above which the tool has
passed through: -1 where the surface is pushed back, 0 at the middle of the tool."""

BEHIND = 0.25
"""Depth behind the face of a punch, relative to its radius, of points that have passed its side."""

SLIPPING = 1e-4
"""Relative distance from the limit of friction below which a point slips."""

NEARLY_BACK = 1e-6
"""Least 1 + cos of the angle between a normal and a tool's axis in the rotation of tangents."""

TINY = 1e-300


class PreviousState(NamedTuple):
    """Displacement u [m] (n,) at a time [s], the reference of slips and of a punch's edge."""

    u: Floats
    time: float


class PatchKinematics(NamedTuple):
    """Distances [m] (q,) of points from a tool, and its normals (q, 3) there.

    `limited` [m]: the distance, smoothly limited outside the tool; `slope` and `bend` [1/m]: its
    first and second derivative by the distance. `shares` (v, q): weights of the points in the mean
    at a vertex, zero unless it is `under` (v,) the tool. `axes` (v, 3, 2): two tangents across the
    mean normal; `slip` [m] (q, 3): displacement of the points relative to the tool since the
    previous state.
    """

    distance: Floats
    normal: Floats
    limited: Floats
    slope: Floats
    bend: Floats
    shares: csr_array
    under: Bools
    axes: Floats
    slip: Floats


@dataclass(frozen=True, eq=False)
class FiniteContact:
    """Contact patches of a body with n displacements.

    Constraints are numbered by patch, then by vertex: for a bonded tool the three components of the
    mean displacement relative to it; for any other the gap and, if any tool has friction, the slip
    along two tangents.
    """

    patches: tuple[Patch, ...]
    size: int

    @cached_property
    def frictional(self) -> bool:
        """Whether any tool slides with friction."""
        return any(one.tool.friction > 0.0 and not one.tool.bonded for one in self.patches)

    @cached_property
    def friction(self) -> Floats:
        """Coefficient of friction of each vertex (v,), infinite where it is bonded."""
        each = [np.inf if one.tool.bonded else one.tool.friction for one in self.patches]
        return np.repeat(np.array(each, dtype=np.float64), [one.count for one in self.patches])

    @cached_property
    def bonded(self) -> Bools:
        """Which constraints (c,) are those of bonded tools."""
        bonded = np.array([one.tool.bonded for one in self.patches], dtype=np.bool_)
        return np.repeat(bonded, self._counts)

    @cached_property
    def normal_rows(self) -> Ints:
        """Index (c,) of the gap of the vertex that each constraint belongs to."""
        numbers = np.arange(len(self.bonded))
        return numbers - numbers % 3 if self.frictional else numbers

    @cached_property
    def _counts(self) -> list[int]:
        return [one.count * self._width(one.tool) for one in self.patches]

    def _width(self, tool: RigidTool) -> int:
        return 3 if tool.bonded or self.frictional else 1

    @cached_property
    def parts(self) -> list[slice]:
        """Range of the constraints of each patch."""
        ends = np.cumsum([0, *self._counts])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def nodes(self) -> list[Ints]:
        """Nodes with a shape function on each patch."""
        return [np.unique(one.shapes.indices).astype(np.int64) for one in self.patches]

    @cached_property
    def restricted(self) -> list[Patch]:
        """The patches restricted to these nodes."""
        return [one.restricted_to(n) for one, n in zip(self.patches, self.nodes, strict=True)]

    def at(self, u: Floats, time: float, previous: PreviousState | None = None) -> Configuration:
        """The configuration displaced by u [m] (n,) from the given shape, at a time [s].

        `previous`: the last equilibrium, without one the given shape at time zero.
        """
        return Configuration(self, u, time, previous or PreviousState(np.zeros(self.size), 0.0))

    def contact_forces(self, compliance: Floats, gaps: Floats, chosen: Ints, old: Floats) -> Floats:
        """Forces [N] (k,) of the chosen constraints that meet the law of contact, from old ones.

        `compliance` [m/N] (k, k): of the body at these constraints; `gaps` [m] (k,): under the old
        forces.
        """
        offset = gaps - compliance @ old
        if not self.frictional:
            return frictionless_forces(
                ComplementarityProblem(compliance, offset, self.bonded[chosen]), old
            )
        friction = self.friction[chosen[::3] // 3]
        return frictional_forces(
            compliance, offset.reshape(-1, 3), friction, old.reshape(-1, 3)
        ).ravel()

    def law_residual(self, gaps: Floats, force: Floats, stiffness: float) -> float:
        """Largest violation [m] of the law of contact by gaps [m] and forces [N] (c,).

        `stiffness` [N/m] converts forces of slipping vertices into displacements.
        """
        if not self.frictional:
            closed = self.bonded | (force > 0.0)
            return float(np.where(closed, np.abs(gaps), np.maximum(-gaps, 0.0)).max(initial=0.0))
        return law_residual(gaps.reshape(-1, 3), force.reshape(-1, 3), self.friction, stiffness)

    def closed(self, force: Floats) -> Bools:
        """Which constraints (c,) are active under forces [N] (c,): closed gaps, sticking slips."""
        pushed = (force > 0.0)[self.normal_rows]
        if not self.frictional:
            return np.asarray(self.bonded | pushed)
        each = force.reshape(-1, 3)
        drag = np.hypot(each[:, 1], each[:, 2])
        sticks = drag < (1.0 - SLIPPING) * self.friction * np.maximum(each[:, 0], TINY)
        holds = np.column_stack([np.ones_like(sticks), sticks, sticks]).ravel()
        return np.asarray(self.bonded | (pushed & holds))


@dataclass(frozen=True, eq=False)
class Configuration:
    """Gaps and contact forces of a body and tools in one configuration."""

    contact: FiniteContact
    u: Floats
    time: float
    previous: PreviousState

    @cached_property
    def gaps(self) -> Floats:
        """Gaps [m] (c,), negative inside a tool, infinite beside a punch; and slips."""
        found = []
        for k, patch in enumerate(self.contact.patches):
            if patch.tool.bonded:
                off = self._moved(k, self.u) - patch.tool.travel(np.array([self.time]))[0]
                found.append((patch.shares @ off).ravel())
                continue
            kinematics = self._kinematics[k]
            gap = np.where(kinematics.under, kinematics.shares @ kinematics.limited, np.inf)
            if self.contact.frictional:
                mean = kinematics.shares @ (kinematics.slope[:, None] * kinematics.slip)
                slip = np.einsum("vi,vik->vk", mean, kinematics.axes)
                gap = np.column_stack([gap, slip]).ravel()
            found.append(gap)
        return np.concatenate([np.zeros(0), *found])

    @cached_property
    def derivative(self) -> csr_array:
        """Derivative (c, n) of the gaps, and of the slips at constant tangents and weights."""
        parts = [self._rows(k) for k in range(len(self.contact.patches))]
        return csr_array(vstack([csr_array((0, self.contact.size)), *parts]))

    def curvature(self, force: Floats) -> csc_array:
        """Second derivative [N/m] (n, n) of the gaps times forces [N] (c,), without slips."""
        contact = self.contact
        rows, columns, entries = [], [], []
        for k, patch in enumerate(contact.patches):
            if patch.tool.bonded:
                continue
            kinematics, own_force = self._kinematics[k], force[contact.parts[k]]
            pressure = own_force[:: 3 if contact.frictional else 1] @ kinematics.shares
            across = np.zeros_like(pressure)
            if patch.tool.shape == SPHERE:
                across = pressure * kinematics.slope / (kinematics.distance + patch.tool.radius)
            along = pressure * kinematics.bend - across
            shapes, nodes, normal = (
                contact.restricted[k].shapes,
                contact.nodes[k],
                kinematics.normal,
            )
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

    def tool_forces(self, force: Floats) -> Floats:
        """Force [N] (tools, 3) of the body on each tool for contact forces (c,)."""
        found = [
            -(self._rows(k).T @ force[part]).reshape(-1, 3).sum(axis=0)
            for k, part in enumerate(self.contact.parts)
        ]
        return np.array(found).reshape(-1, 3)

    @property
    def passed_through(self) -> bool:
        """Whether part of the surface inside a tool is at its middle or beyond.

        Beyond, the tool would push along the outward normal of the body. Against its own axis it
        may push: tissue closes around a sphere that has sunk in.
        """
        for k, kinematics in self._kinematics.items():
            nodes = self.contact.nodes[k]
            outward = self.contact.restricted[k].outward(self.u.reshape(-1, 3)[nodes])
            along = (kinematics.normal * outward).sum(axis=1)
            if (along[kinematics.distance < 0.0] > BESIDE).any():
                return True
        return False

    @property
    def penetration(self) -> float:
        """Largest penetration [m] of a point into a tool that is not bonded."""
        deepest = (-float(kinematics.distance.min()) for kinematics in self._kinematics.values())
        return max([0.0, *deepest])

    def _moved(self, k: int, u: Floats) -> Floats:
        """Displacement [m] (q, 3) of the points of a patch."""
        return np.asarray(
            self.contact.restricted[k].shapes @ u.reshape(-1, 3)[self.contact.nodes[k]]
        )

    @cached_property
    def _kinematics(self) -> dict[int, PatchKinematics]:
        """Kinematics of the patches of tools that are not bonded, by patch number."""
        patches = enumerate(self.contact.patches)
        return {k: self._kinematics_of(k) for k, one in patches if not one.tool.bonded}

    def _kinematics_of(self, k: int) -> PatchKinematics:
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
        limited = np.where(distance > 0.0, reach * level, distance)
        axes, slip = np.zeros((patch.count, 3, 2)), np.zeros_like(moved)
        if self.contact.frictional:
            axes = _tangents(tool.axis, shares @ (slope[:, None] * normal))
            now, then = tool.travel(np.array([self.time, self.previous.time]))
            slip = moved - self._moved(k, self.previous.u) - (now - then)
        bend = -2.0 / reach * level * slope
        return PatchKinematics(distance, normal, limited, slope, bend, shares, under, axes, slip)

    def _faced(self, k: int) -> Bools:
        """Which points (q,) were in front of a punch, or no deeper in it than BEHIND."""
        patch, previous = self.contact.patches[k], self.previous
        places = patch.points + self._moved(k, previous.u)
        distance = patch.tool.gap(places, previous.time)[0]
        return np.isfinite(distance) & (distance > -BEHIND * patch.tool.radius)

    def _rows(self, k: int) -> csr_array:
        contact = self.contact
        patch, shapes, nodes = contact.patches[k], contact.restricted[k].shapes, contact.nodes[k]
        if patch.tool.bonded:
            mean = coo_array(patch.shares @ shapes)
            parts = [(3 * mean.row + i, mean.col, i, mean.data) for i in range(3)]
        else:
            kinematics, parts = self._kinematics[k], []
            pushed = kinematics.slope[:, None] * kinematics.normal
            width = 3 if contact.frictional else 1
            for i in range(3):
                along = coo_array(kinematics.shares @ shapes.multiply(pushed[:, i : i + 1]))
                parts.append((width * along.row, along.col, i, along.data))
            if contact.frictional:
                mean = coo_array(kinematics.shares @ shapes.multiply(kinematics.slope[:, None]))
                parts += [
                    (3 * mean.row + 1 + j, mean.col, i, mean.data * kinematics.axes[mean.row, i, j])
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
    """Shares (v, q) of the chosen points (q,) alone, and which vertices have enough of them."""
    seen = shares @ chosen.astype(np.float64)
    under = seen > LEAST_SHARE
    kept = np.where(under, 1.0 / np.maximum(seen, TINY), 0.0)
    return csr_array(diags_array(kept) @ shares @ diags_array(chosen.astype(np.float64))), under


def _tangents(axis: Floats, normals: Floats) -> Floats:
    """Two unit vectors (v, 3, 2) across each of the normals (v, 3), which may be of any length.

    They are those across the axis, rotated by the smallest rotation from the axis to the normal,
    which is smooth unless the normal is opposite to the axis.
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
