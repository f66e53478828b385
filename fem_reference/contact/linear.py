"""Contact forces between a linear elastic body and rigid tools.

The response of the body is a superposition of its solutions for unit contact forces. The gaps and
normals of a sphere depend on the displacement; a sequence of linear complementarity problems,
linearised about the last displacement, converges to the contact forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, hstack, kron

from fem_reference.contact.law import ComplementarityProblem, frictional_forces, frictionless_forces
from fem_reference.contact.patch import Gaps, Patch, directions
from study.problem.rigid import RigidTool

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ITERATIONS = 60
HALVED_AFTER = 12
"""Iterations after which the step is halved, and halved again after as many more."""
ROUNDING = 1e-14
"""[m]"""
CONVERGED = 1e-6
"""Change of the forces relative to the largest, at convergence."""
ACCEPTED = 1e-3
"""The same at the last iteration, up to which the forces are accepted."""


class ContactNotConvergedError(ValueError):
    """The iteration for the contact forces did not converge."""


@dataclass(frozen=True, eq=False)
class SurfaceResponse:
    """Linear response of the surface nodes to contact forces.

    `base` [m] (3 s,): displacement of the surface nodes without contact; `influence` [m/N] (3 s,
    c): displacement per unit of each force; `compliance` [m/N] (c, c): its weighted means at the
    vertices.
    """

    base: Floats
    influence: Floats
    compliance: Floats


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """Contact forces [N] (c,) and the weighted mean displacements [m] (c,) at a time [s]."""

    force: Floats
    mean: Floats
    time: float


@dataclass(frozen=True, eq=False)
class LinearContact:
    """Contact patches of a linear elastic body; forces are numbered by patch, vertex and direction.

    `nodes` (s,): surface nodes with a shape function on a patch.
    """

    patches: tuple[Patch, ...]
    nodes: NDArray[np.int64]

    @classmethod
    def of(cls, patches: Sequence[Patch]) -> LinearContact:
        """The contact of some patches, with all nodes that have a shape function on them."""
        seen = [np.flatnonzero(np.diff(one.shapes.tocsc().indptr)) for one in patches]
        return cls(tuple(patches), np.unique(np.concatenate(seen)))

    @cached_property
    def frictional(self) -> bool:
        """Whether any tool has friction."""
        return any(one.tool.friction > 0.0 for one in self.patches)

    def directions(self, tool: RigidTool) -> Floats:
        """Directions (d, 3) of a tool's forces."""
        return np.eye(3) if self.frictional else directions(tool)

    @cached_property
    def slices(self) -> list[slice]:
        """Range of the forces of each patch."""
        sizes = [one.count * len(self.directions(one.tool)) for one in self.patches]
        ends = np.cumsum([0, *sizes])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def nodal_forces(self) -> csr_array:
        """Nodal forces (3 nodes, c) per unit of each force; transposed, the weighted means."""
        parts = [kron(one.spread, csr_array(self.directions(one.tool).T)) for one in self.patches]
        return csr_array(hstack(parts, format="csr"))

    @cached_property
    def means(self) -> csr_array:
        """Weighted means (c, 3 s) of the displacements of the surface nodes."""
        return csr_array(self.nodal_forces.T)[:, self.unknowns]

    @cached_property
    def unknowns(self) -> NDArray[np.int64]:
        """Unknowns of the body (3 s,) at the surface nodes."""
        return np.asarray((3 * self.nodes[:, None] + np.arange(3)).ravel())

    @cached_property
    def _restricted(self) -> tuple[Patch, ...]:
        """The patches restricted to the surface nodes."""
        return tuple(one.restricted_to(self.nodes) for one in self.patches)

    def tool_forces(self, force: Floats) -> Floats:
        """Force [N] (tools, 3) of the body on each tool for contact forces (c,)."""
        found = [
            -(force[part].reshape(one.count, -1).sum(axis=0) @ self.directions(one.tool))
            for one, part in zip(self.patches, self.slices, strict=True)
        ]
        return np.array(found)

    def penetration(self, surface: Floats, time: float) -> float:
        """Largest penetration [m] of a point into a tool that is not bonded."""
        moved = surface.reshape(-1, 3)
        return max(
            (one.penetration(moved, time) for one in self._restricted if not one.tool.bonded),
            default=0.0,
        )

    def solve(
        self, response: SurfaceResponse, start: ContactSolution, time: float
    ) -> ContactSolution:
        """Contact forces at a time [s], from those at the time before.

        ContactNotConvergedError if the iteration does not converge.
        """
        force, change = start.force, np.inf
        # Smaller forces cause displacements below rounding.
        least = ROUNDING / max(float(response.compliance.diagonal().max()), 1e-300)
        for k in range(ITERATIONS):
            step = self._linearised(response, force, start, time) - force
            largest = max(float(np.abs(force + step).max(initial=0.0)), least)
            change = float(np.abs(step).max(initial=0.0)) / largest
            force = force + 0.5 ** (k // HALVED_AFTER) * step
            if change <= CONVERGED or change * largest <= least:
                break
        if change > ACCEPTED and change * largest > least:
            raise ContactNotConvergedError(
                f"the contact forces do not converge at {time:.4g} s; reduce tool.displacement, or "
                "reference.element_size"
            )
        return ContactSolution(
            force, self.means @ (response.base + response.influence @ force), time
        )

    def _linearised(
        self, response: SurfaceResponse, force: Floats, start: ContactSolution, time: float
    ) -> Floats:
        """Forces of the complementarity problem linearised about the displacement under `force`."""
        surface = response.base + response.influence @ force
        gaps = [one.gaps(surface.reshape(-1, 3), time) for one in self._restricted]
        moved = response.compliance @ force
        mean = self.means @ surface - moved
        if self.frictional:
            return self._frictional_forces(response, force, gaps, mean, start, time)
        frame = np.concatenate(list(map(self._frame, self.patches, gaps)))
        rows = np.add.reduceat(response.compliance * frame, self._first_components, axis=1)
        among = np.add.reduceat(rows * frame[:, None], self._first_components, axis=0)
        pushed = np.add.reduceat(frame * moved, self._first_components)
        offset = self._offsets(gaps, mean, time) - np.where(self._bonded, 0.0, pushed)
        guess = np.add.reduceat(frame * force, self._first_components)
        found = frictionless_forces(ComplementarityProblem(among, offset, self._bonded), guess)
        return np.asarray(frame * np.repeat(found, np.diff([*self._first_components, len(force)])))

    @cached_property
    def _bonded(self) -> Bools:
        """Which unknowns are forces of bonded tools."""
        counts = [one.count * (3 if one.tool.bonded else 1) for one in self.patches]
        return np.repeat([one.tool.bonded for one in self.patches], counts)

    @cached_property
    def _first_components(self) -> NDArray[np.int64]:
        """First of the force components of each unknown, a normal force or a single component."""
        parts = [
            np.arange(part.start, part.stop, self._components_per_unknown(one))
            for one, part in zip(self.patches, self.slices, strict=True)
        ]
        return np.concatenate(parts)

    def _components_per_unknown(self, one: Patch) -> int:
        """Number of force components per unknown."""
        return 1 if one.tool.bonded else len(self.directions(one.tool))

    def _frame(self, one: Patch, gaps: Gaps) -> Floats:
        """Ratio of each force component of a patch to its unknown."""
        if self._components_per_unknown(one) == 1:
            return np.ones(one.count * len(self.directions(one.tool)))
        return gaps.normal.ravel()

    def _offsets(self, gaps: list[Gaps], mean: Floats, time: float) -> Floats:
        """Gaps [m], or displacements [m] relative to a bonded tool, without contact forces."""
        found = []
        for one, part, gap in zip(self.patches, self.slices, gaps, strict=True):
            if one.tool.bonded:
                travel = np.tile(one.tool.travel(np.array([time]))[0], one.count)
                found.append(mean[part] - travel)
            else:
                found.append(gap.distance)
        return np.concatenate(found)

    def _frictional_forces(
        self,
        response: SurfaceResponse,
        force: Floats,
        gaps: list[Gaps],
        mean: Floats,
        start: ContactSolution,
        time: float,
    ) -> Floats:
        """Forces with friction, solved in a frame of the normal and two tangents per vertex."""
        normals, offsets, friction = [], [], []
        moved = response.compliance @ force
        for one, part, gap in zip(self.patches, self.slices, gaps, strict=True):
            now, before = one.tool.travel(np.array([time, start.time]))
            axes = _axes(gap.normal)
            slip = (mean[part] - start.mean[part]).reshape(-1, 3) - (now - before)
            if one.tool.bonded:
                slip = mean[part].reshape(-1, 3) - now
            own = np.einsum("vik,vi->vk", axes, slip)
            if not one.tool.bonded:
                pushed = np.einsum("vi,vi->v", gap.normal, moved[part].reshape(-1, 3))
                own[:, 0] = gap.distance - pushed
            normals.append(axes)
            offsets.append(own)
            coefficient = np.inf if one.tool.bonded else one.tool.friction
            friction.append(np.full(one.count, coefficient))
        axes = np.concatenate(normals)
        count = len(axes)
        blocks = response.compliance.reshape(count, 3, count, 3)
        turned = np.einsum("vik,viwj,wjl->vkwl", axes, blocks, axes, optimize=True)
        guess = np.einsum("vik,vi->vk", axes, force.reshape(-1, 3))
        found = frictional_forces(
            turned.reshape(3 * count, 3 * count),
            np.concatenate(offsets),
            np.concatenate(friction),
            guess,
        )
        return np.asarray(np.einsum("vik,vk->vi", axes, found).ravel())


def _axes(normals: Floats) -> Floats:
    """Normal and two tangents as columns, (v, 3, 3)."""
    smallest = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, smallest)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([normals, first, np.cross(normals, first)], axis=2)
