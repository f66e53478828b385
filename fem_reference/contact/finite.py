"""Contact at large displacement: gaps of vertices, their derivatives, and the forces they pass on.

The gap of a vertex is the mean distance from a rigid tool of the points of the surface round it,
where the body has moved them, as in `fem_reference.contact.patch`; its derivative says how a force
between vertex and tool is shared out to the nodes. So the forces on body and tool are in balance,
and the work of a frictionless force is that of the tool, whatever the displacement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, vstack

from fem_reference.contact.patch import Patch
from study.problem.rigid import PUNCH, SPHERE, RigidTool

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


NEAR = 0.05
"""Of a tool's radius, up to where the distance of a point counts."""

BESIDE = -0.2
"""Of the cosine between the normals of a tool and a surface in it, which are opposed, -1, where it
is pushed back, and 0 where it passes the tool's middle."""


class Touching(NamedTuple):
    """Distances [m] (q,) of points from a tool, and its normals (q, 3) there.

    `counted` [m]: the distance, but no more than is near; its first and second derivative by the
    distance, `slope` and `bend` [1/m].
    """

    distance: Floats
    normal: Floats
    counted: Floats
    slope: Floats
    bend: Floats


@dataclass(frozen=True, eq=False)
class FiniteContact:
    """Patches of a body of n displacements under tools.

    Constraints are numbered patch by patch: of a sliding tool the gap of each vertex, of a bonded
    one three components of the mean displacement of each vertex from where the tool holds it.
    """

    patches: tuple[Patch, ...]
    size: int

    @staticmethod
    def refuse(tools: Sequence[RigidTool]) -> None:
        """ValueError for a tool that cannot be followed."""
        for tool in (one for one in tools if not one.bonded):
            if tool.friction > 0.0:
                raise ValueError(
                    f"{tool.name}.friction: at large strain a tool slides without friction only; "
                    "set it to 0, or leave hyperelastic out of models"
                )
            if tool.shape == PUNCH:
                raise ValueError(
                    f"{tool.name}.shape: at large strain the sharp edge of a sliding punch is not "
                    "worked out; make it a sphere, a plate or bonded, or leave hyperelastic out "
                    "of models"
                )

    @cached_property
    def held(self) -> Bools:
        """Which constraints are those of bonded tools, (c,)."""
        bonded = np.array([one.tool.bonded for one in self.patches], dtype=np.bool_)
        return np.repeat(bonded, self._counts)

    @cached_property
    def _counts(self) -> list[int]:
        return [one.count * (3 if one.tool.bonded else 1) for one in self.patches]

    @cached_property
    def _parts(self) -> list[slice]:
        ends = np.cumsum([0, *self._counts])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def nodes(self) -> list[Ints]:
        """Nodes that each patch sees."""
        return [np.unique(one.shapes.indices).astype(np.int64) for one in self.patches]

    @cached_property
    def _seeing(self) -> list[Patch]:
        """The patches with shape functions of these alone."""
        return [one.seeing(n) for one, n in zip(self.patches, self.nodes, strict=True)]

    @cached_property
    def _shapes(self) -> list[csr_array]:
        """Shape functions of these alone, at the points of each patch."""
        return [one.shapes for one in self._seeing]

    def gaps(self, u: Floats, time: float) -> Floats:
        """Gaps [m] (c,) of a displacement u [m] (n,), negative inside a tool, at a time [s]."""
        found = []
        for k, patch in enumerate(self.patches):
            if patch.tool.bonded:
                off = self._moved(k, u) - patch.tool.travel(np.array([time]))[0]
                found.append((patch.shares @ off).ravel())
            else:
                found.append(patch.shares @ self._touch(k, u, time).counted)
        return np.concatenate([np.zeros(0), *found])

    def derivative(self, u: Floats, time: float) -> csr_array:
        """Of the gaps by the displacement, (c, n)."""
        parts = [self._rows(k, u, time) for k in range(len(self.patches))]
        return csr_array(vstack([csr_array((0, self.size)), *parts]))

    def curvature(self, u: Floats, time: float, force: Floats) -> csc_array:
        """Second derivative [N/m] (n, n) of the gaps times forces [N] (c,)."""
        rows, columns, entries = [], [], []
        for k, patch in enumerate(self.patches):
            if patch.tool.bonded:
                continue
            touch, pressure = self._touch(k, u, time), force[self._parts[k]] @ patch.shares
            across = np.zeros_like(pressure)
            if patch.tool.shape == SPHERE:
                across = pressure * touch.slope / (touch.distance + patch.tool.radius)
            along = pressure * touch.bend - across
            shapes, nodes, normal = self._shapes[k], self.nodes[k], touch.normal
            for i in range(3):
                for j in range(3):
                    bend = along * normal[:, i] * normal[:, j] + (across if i == j else 0.0)
                    own = coo_array(shapes.T @ shapes.multiply(bend[:, None]))
                    rows.append(3 * nodes[own.row] + i)
                    columns.append(3 * nodes[own.col] + j)
                    entries.append(own.data)
        if not entries:
            return csc_array((self.size, self.size))
        places = (np.concatenate(rows), np.concatenate(columns))
        found = coo_array((np.concatenate(entries), places), shape=(self.size, self.size))
        return csc_array(found)

    def on_tools(self, u: Floats, time: float, force: Floats) -> Floats:
        """What the body does to each tool [N] (tools, 3) under the forces [N] (c,)."""
        found = []
        for k, (patch, part) in enumerate(zip(self.patches, self._parts, strict=True)):
            if patch.tool.bonded:
                found.append(-force[part].reshape(-1, 3).sum(axis=0))
            else:
                touch = self._touch(k, u, time)
                found.append(-((force[part] @ patch.shares) * touch.slope) @ touch.normal)
        return np.array(found).reshape(-1, 3)

    def through(self, u: Floats, time: float) -> bool:
        """Whether some of the surface in a tool is about to pass its middle, or has passed it.

        Beyond, the tool would push along the normal out of the body. Against its own axis alone it
        may push: what a sphere has sunk in closes round it.
        """
        for k, patch in enumerate(self.patches):
            if patch.tool.bonded:
                continue
            touch = self._touch(k, u, time)
            outward = self._seeing[k].outward(u.reshape(-1, 3)[self.nodes[k]])
            along = (touch.normal * outward).sum(axis=1)
            if (along[touch.distance < 0.0] > BESIDE).any():
                return True
        return False

    def penetration(self, u: Floats, time: float) -> float:
        """How deep [m] any point of the patches is inside a tool that it slides on."""
        return max(
            (
                float(max(0.0, -self._touch(k, u, time).distance.min()))
                for k, patch in enumerate(self.patches)
                if not patch.tool.bonded
            ),
            default=0.0,
        )

    def _moved(self, k: int, u: Floats) -> Floats:
        """Displacement [m] (q, 3) of the points of a patch."""
        return np.asarray(self._shapes[k] @ u.reshape(-1, 3)[self.nodes[k]])

    def _touch(self, k: int, u: Floats, time: float) -> Touching:
        patch = self.patches[k]
        distance, normal = patch.tool.gap(patch.points + self._moved(k, u), time)
        reach = NEAR * patch.tool.radius
        level = np.tanh(np.maximum(distance, 0.0) / reach)
        slope = 1.0 - level**2
        counted = np.where(distance > 0.0, reach * level, distance)
        return Touching(distance, normal, counted, slope, -2.0 / reach * level * slope)

    def _rows(self, k: int, u: Floats, time: float) -> csr_array:
        patch, shapes, nodes = self.patches[k], self._shapes[k], self.nodes[k]
        if patch.tool.bonded:
            mean = coo_array(patch.shares @ shapes)
            parts = [(3 * mean.row + i, mean.col, i, mean.data) for i in range(3)]
        else:
            touch, parts = self._touch(k, u, time), []
            pushed = touch.slope[:, None] * touch.normal
            for i in range(3):
                along = coo_array(patch.shares @ shapes.multiply(pushed[:, i : i + 1]))
                parts.append((along.row, along.col, i, along.data))
        rows, columns, data = (
            np.concatenate(one)
            for one in zip(*((r, 3 * nodes[c] + i, d) for r, c, i, d in parts), strict=True)
        )
        shape = (self._counts[k], self.size)
        return csr_array(coo_array((data, (rows, columns)), shape=shape))
