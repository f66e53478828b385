"""Model reduction of a body in contact: a Krylov subspace with static residual modes.

The subspace is a block Krylov space of the loads and of those contact force patterns that move most
of the mass. The part of the static response outside the subspace, the local indentation, is treated
without inertia: it follows the forces at once, or with the delay of stiffness-proportional damping.
No mass is then at the contact surface, which prevents spurious oscillations after impacts: Khenous,
Laborde and Renard (2008), Eur. J. Mech. A 27:918. The static residuals are those of Craig and Chang
(1977), AIAA 77-405.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array

from fem_reference.contact.linear import (
    ContactNotConvergedError,
    ContactSolution,
    LinearContact,
    SurfaceResponse,
)
from fem_reference.contact.patch import on_free_nodes, patch
from fem_reference.direct import Solve
from fem_reference.elasticity import Body
from fem_reference.memory import factors_fit
from fem_reference.solvers import by_factors, solver
from fem_reference.subspace import Subspace, empty, extended
from study.problem.rigid import PLATE, PUNCH, RigidTool

Floats = NDArray[np.float64]

MARGIN = {PUNCH: 1.0, PLATE: 0.2}
"""Margin of the patch around a tool, relative to its radius, for a plate to its travel."""
ROUND_SPHERE = 0.15
WIDENED = 4
"""How often a margin that is too small may be doubled."""
OVERLOOKED = 0.02
"""Admissible penetration of the surface outside a patch, relative to the tool's travel."""
LOOKS = 33
"""Positions of a tool on its path at which the patch is determined."""
MOST_VERTICES = 900
DIRECT = 12
"""Number of solutions above which a direct solver is faster."""
PRECISE = 1e-9
PATTERNS, LEAST_PATTERN = 6, 3e-3
"""Largest number of force patterns per tool, and smallest relative mass norm of their response."""
INSIDE = 1e-6
"""Mass norm of the part of a vector outside the subspace, relative to the vector, below which it
is dependent."""


@dataclass(frozen=True, eq=False)
class ContactResponse:
    """Static response [m/N] (n, c) of a body to unit contact forces, and its solver."""

    body: Body
    contact: LinearContact
    solve: Solve
    responses: Floats

    @cached_property
    def influence(self) -> Floats:
        """Response [m/N] (3 s, c) of the surface nodes."""
        return self.responses[self.contact.unknowns]

    @cached_property
    def compliance(self) -> Floats:
        """Response [m/N] (c, c) in the weighted means at the vertices."""
        found = np.asarray(self.contact.means @ self.influence)
        return np.asarray(0.5 * (found + found.T))

    @cached_property
    def of_loads(self) -> Floats:
        """Static displacements [m] (n, k) under each load in full."""
        loads = self.body.loads.T
        return np.column_stack([self.solve(one) if one.any() else one for one in loads])

    def at_rest(
        self, displacement: Floats, start: ContactSolution, times: Floats
    ) -> ContactSolution:
        """Static contact forces at the last of times [s] along the path of the tools.

        `displacement` [m] (n,): static displacement without tools, under all other loads.
        """
        response = SurfaceResponse(
            displacement[self.contact.unknowns], self.influence, self.compliance
        )
        solution = start
        for time in times:
            solution = self.contact.solve(response, solution, float(time))
        return solution

    def moved(self, displacement: Floats, solution: ContactSolution) -> Floats:
        """Displacement [m] (n,) with contact forces added."""
        return np.asarray(displacement + self.responses @ solution.force)

    @property
    def free(self) -> ContactSolution:
        """Zero contact forces at time zero."""
        count = self.responses.shape[1]
        return ContactSolution(np.zeros(count), np.zeros(count), 0.0)


def contact_response(
    body: Body, tools: tuple[RigidTool, ...], times: Floats, displacement: Floats, peak: float
) -> ContactResponse:
    """The static response of a body to contact with tools on their paths at times [s].

    `displacement` [m] (n,): displacement without tools; `peak` [s]: time at which the surface
    outside the patches is checked. Patches are widened where it penetrates a tool. ValueError for a
    tool that touches nothing, or too many vertices.
    """
    solve: Solve | None = None
    looked = times[:: max(1, len(times) // LOOKS)]
    looked = np.unique(np.append(looked, [times[-1], peak]))
    for k in range(WIDENED + 1):
        patches = [
            on_free_nodes(patch(body, one, looked, 2.0**k * _margin(one, times)), body.fixed)
            for one in tools
        ]
        contact = LinearContact.of(patches)
        columns = contact.nodal_forces.shape[1]
        _refuse_many(sum(one.count for one in patches))
        solve = solve or _solver(body, columns)
        found = ContactResponse(body, contact, solve, _solved(solve, contact.nodal_forces))
        way = np.linspace(0.0, peak, 9)
        try:
            solution = found.at_rest(displacement, found.free, way if peak > 0.0 else way[:1])
        except ContactNotConvergedError:
            break  # the motion will end where this happens
        deep = _beside(body, contact, found.moved(displacement, solution), peak)
        if deep <= OVERLOOKED * max(map(_travelled, tools, [times] * len(tools))):
            break
    return found


def _refuse_many(vertices: int) -> None:
    if vertices > MOST_VERTICES:
        raise ValueError(
            f"tool: may touch {vertices} vertices of the mesh, the limit is {MOST_VERTICES}; "
            "reduce tool.radius or shorten tool.path, or enlarge reference.element_size"
        )


def _margin(tool: RigidTool, times: Floats) -> float:
    if tool.shape == PLATE:
        return max(MARGIN[PLATE] * _travelled(tool, times), 1e-6)
    return MARGIN.get(tool.shape, ROUND_SPHERE) * tool.radius


def _travelled(tool: RigidTool, times: Floats) -> float:
    """Largest distance [m] of a tool from its start."""
    return float(np.linalg.norm(tool.travel(times), axis=1).max())


def _solver(body: Body, columns: int) -> Solve:
    if columns >= DIRECT and factors_fit(body.unknowns, body.element):
        return by_factors(body)
    return solver(body, PRECISE)


def _solved(solve: Solve, loads: csr_array) -> Floats:
    """Solutions (n, c) for the columns of a sparse matrix."""
    rows = csr_array(loads.T)
    return np.column_stack([solve(rows[[k]].toarray().ravel()) for k in range(rows.shape[0])])


def _beside(body: Body, contact: LinearContact, displacement: Floats, time: float) -> float:
    """Largest penetration [m] of surface nodes outside all patches into a tool not bonded."""
    boundary = np.unique(
        body.nodes.get_dofs(body.nodes.mesh.boundary_facets()).flatten()  # scikit-fem's
    )
    others = np.setdiff1d(boundary, contact.nodes)
    moved = (body.points + displacement.reshape(-1, 3))[others]
    return max(
        (
            float(max(0.0, -one.tool.gap(moved, time)[0].min(initial=np.inf)))
            for one in contact.patches
            if not one.tool.bonded
        ),
        default=0.0,
    )


@dataclass(frozen=True, eq=False)
class ReducedBody:
    """A body in the modes of a subspace, with the static residuals outside it.

    `squares` [1/s^2] (m,) and `shapes` (n, m) of the modes; `contact_modes` (c, m): their weighted
    mean displacements at the vertices; `loads` (m, k): modal loads; `residual` (n, c + k): static
    response outside the subspace to contact forces [m/N], then to the loads [m].
    """

    squares: Floats
    shapes: Floats
    contact_modes: Floats
    loads: Floats
    residual: Floats

    @property
    def size(self) -> int:
        """Number of vectors."""
        return len(self.squares)


def krylov(given: ContactResponse, generations: int) -> Subspace:
    """Block Krylov space of loads and contact force patterns, with so many blocks."""
    body = given.body
    block = np.column_stack([*_of_loads(given), _patterns(given)])
    found = empty(body.stiffness.size)
    for _ in range(generations):
        before = found.load.size
        for vector in block.T:
            found = _with(body, found, vector)
        new = found.vectors[:, before:]
        if not new.size:
            break
        block = np.column_stack([given.solve(body.mass @ one) for one in new.T])
    return found


def _of_loads(given: ContactResponse) -> list[Floats]:
    return [response for response in given.of_loads.T if response.any()]


def _patterns(given: ContactResponse) -> Floats:
    """Static responses (n, r) to the force patterns of each tool that move most of the mass."""
    found = []
    for part in given.contact.slices:
        own = given.responses[:, part]
        sizes, weights = np.linalg.eigh(own.T @ (given.body.mass @ own))
        best = [k for k in range(len(sizes))[::-1] if sizes[k] > LEAST_PATTERN**2 * sizes[-1]]
        found.append(own @ weights[:, best[:PATTERNS]])
    return np.column_stack(found)


def _with(body: Body, found: Subspace, vector: Floats) -> Subspace:
    """The subspace with one more vector, unless that is dependent."""
    outside = vector - found.vectors @ (found.vectors.T @ (body.mass @ vector))
    norms = [float(one @ (body.mass @ one)) for one in (outside, vector)]
    return found if norms[0] <= INSIDE**2 * norms[1] else extended(body, found, vector)


def reduced(given: ContactResponse, subspace: Subspace, highest: float) -> ReducedBody:
    """The body in the modes of a subspace up to the `highest` angular frequency [1/s].

    Modes above it respond statically, like the part outside the subspace. At least one mode is
    kept.
    """
    squares, modes = eigh(subspace.stiffness)
    kept = max(1, int(np.searchsorted(squares, highest**2)))
    squares, shapes = squares[:kept], subspace.vectors @ modes[:, :kept]
    contact_modes = np.asarray(given.contact.nodal_forces.T @ shapes)
    loads = shapes.T @ given.body.loads
    responses = np.column_stack([given.responses, given.of_loads])
    residual = responses - (shapes / squares) @ np.vstack([contact_modes, loads.T]).T
    return ReducedBody(squares, shapes, contact_modes, loads, residual)


Factors = Callable[[Floats], Floats]
