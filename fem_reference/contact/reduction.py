"""A body reduced to what tools and loads make of it: few vectors, and the rest at once.

The subspace is a block Krylov space of the loads and of the forces under the tools that move most
of the mass. What is left of the answers to forces under tools is their local dent, whose inertia is
left out: its displacement follows the forces at once, or with the delay of stiffness-proportional
damping. So no mass sits where the body touches, and impacts set nothing into oscillation there:
Khenous, Laborde and Renard (2008), Eur. J. Mech. A 27:918; static residuals as in Craig and Chang
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

from fem_reference.contact.patch import patch
from fem_reference.contact.touch import Answer, Grip, Touch, UnsettledError
from fem_reference.direct import Solve
from fem_reference.elasticity import Body
from fem_reference.memory import factors_fit
from fem_reference.solvers import by_factors, solver
from fem_reference.subspace import Subspace, empty, extended
from study.problem.rigid import PLATE, PUNCH, RigidTool

Floats = NDArray[np.float64]

MARGIN = {PUNCH: 1.0, PLATE: 0.2}
"""Round what a tool would meet of the surface at rest, over its radius, of a plate its travel."""
ROUND_SPHERE = 0.15
WIDENED = 4
"""How often a margin is doubled that turns out too small."""
OVERLOOKED = 0.02
"""Share of the travel that a surface beside a patch may enter a tool."""
LOOKS = 33
"""Places of a tool on its way at which the surface is looked at."""
MOST_VERTICES = 900
DIRECT = 12
"""Solutions that repay factors."""
PRECISE = 1e-9
PATTERNS, LEAST_PATTERN = 6, 3e-3
"""Of forces under each tool: at most, and the smallest share of the mass's motion."""
INSIDE = 1e-6
"""Share of a vector outside of the subspace, in the mass, below which it adds nothing."""


@dataclass(frozen=True, eq=False)
class Answered:
    """A body's answers [m/N] (n, c) to unit forces under tools, and what solves for more."""

    body: Body
    touch: Touch
    solve: Solve
    answers: Floats

    @cached_property
    def lever(self) -> Floats:
        """The answers of the surface nodes (3 s, c)."""
        return self.answers[self.touch.unknowns]

    @cached_property
    def compliance(self) -> Floats:
        """Answers in the means (c, c)."""
        found = np.asarray(self.touch.means @ self.lever)
        return np.asarray(0.5 * (found + found.T))

    @cached_property
    def of_loads(self) -> Floats:
        """Answers [m] (n, k) to the loads in full, nought where one is."""
        loads = self.body.loads.T
        return np.column_stack([self.solve(one) if one.any() else one for one in loads])

    def at_rest(self, displacement: Floats, start: Grip, times: Floats) -> Grip:
        """Forces at the last of times [s] on the way of the tools, without motion.

        `displacement` [m] (n,): without tools, under all other loads.
        """
        answer = Answer(displacement[self.touch.unknowns], self.lever, self.compliance)
        grip = start
        for time in times:
            grip = self.touch.settled(answer, grip, float(time))
        return grip

    def moved(self, displacement: Floats, grip: Grip) -> Floats:
        """Displacement [m] (n,) under forces."""
        return np.asarray(displacement + self.answers @ grip.force)

    @property
    def free(self) -> Grip:
        """No forces, at the start."""
        count = self.answers.shape[1]
        return Grip(np.zeros(count), np.zeros(count), 0.0)


def answered(
    body: Body, tools: tuple[RigidTool, ...], times: Floats, displacement: Floats, peak: float
) -> Answered:
    """A body where tools may touch it on their way at times [s].

    `displacement` [m] (n,): without tools; `peak` [s]: when the surface beside the patches is
    looked at, which are widened where it is inside a tool. ValueError for a tool that meets
    nothing, or takes too many vertices.
    """
    solve: Solve | None = None
    looked = times[:: max(1, len(times) // LOOKS)]
    looked = np.unique(np.append(looked, [times[-1], peak]))
    for k in range(WIDENED + 1):
        patches = [patch(body, one, looked, 2.0**k * _margin(one, times)) for one in tools]
        touch = Touch.of(patches)
        columns = touch.pushes.shape[1]
        _refuse_many(sum(one.count for one in patches))
        solve = solve or _solver(body, columns)
        found = Answered(body, touch, solve, _solved(solve, touch.pushes))
        way = np.linspace(0.0, peak, 9)
        try:
            grip = found.at_rest(displacement, found.free, way if peak > 0.0 else way[:1])
        except UnsettledError:
            break  # what comes of it shows where the motion ends
        deep = _beside(body, touch, found.moved(displacement, grip), peak)
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
    """How far [m] a tool goes from its start."""
    return float(np.linalg.norm(tool.travel(times), axis=1).max())


def _solver(body: Body, columns: int) -> Solve:
    if columns >= DIRECT and factors_fit(body.unknowns, body.element):
        return by_factors(body)
    return solver(body, PRECISE)


def _solved(solve: Solve, loads: csr_array) -> Floats:
    """Solutions (n, c) for the columns of a sparse matrix."""
    rows = csr_array(loads.T)
    return np.column_stack([solve(rows[[k]].toarray().ravel()) for k in range(rows.shape[0])])


def _beside(body: Body, touch: Touch, displacement: Floats, time: float) -> float:
    """How deep [m] surface nodes that no patch sees are inside a sliding tool."""
    boundary = np.unique(
        body.nodes.get_dofs(body.nodes.mesh.boundary_facets()).flatten()  # scikit-fem's
    )
    others = np.setdiff1d(boundary, touch.nodes)
    moved = (body.points + displacement.reshape(-1, 3))[others]
    return max(
        (
            float(max(0.0, -one.tool.gap(moved, time)[0].min(initial=np.inf)))
            for one in touch.patches
            if not one.tool.bonded
        ),
        default=0.0,
    )


@dataclass(frozen=True, eq=False)
class Reduced:
    """A body in a subspace, with what is left of the answers beside it.

    `squares` [1/s^2] (m,) and `shapes` (n, m) of its modes, `pushed` (c, m): displacement means of
    these, `loads` (m, k); `residual` [m/N] (n, c + k): of the answers to forces under tools, then
    of those to the loads.
    """

    squares: Floats
    shapes: Floats
    pushed: Floats
    loads: Floats
    residual: Floats

    @property
    def size(self) -> int:
        """Number of vectors."""
        return len(self.squares)


def krylov(given: Answered, generations: int) -> Subspace:
    """Block Krylov space of loads and of forces under tools, of so many generations."""
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


def _of_loads(given: Answered) -> list[Floats]:
    return [answer for answer in given.of_loads.T if answer.any()]


def _patterns(given: Answered) -> Floats:
    """Answers (n, r) to the forces under each tool that move most of the mass."""
    found = []
    for part in given.touch.slices:
        own = given.answers[:, part]
        sizes, weights = np.linalg.eigh(own.T @ (given.body.mass @ own))
        best = [k for k in range(len(sizes))[::-1] if sizes[k] > LEAST_PATTERN**2 * sizes[-1]]
        found.append(own @ weights[:, best[:PATTERNS]])
    return np.column_stack(found)


def _with(body: Body, found: Subspace, vector: Floats) -> Subspace:
    """One vector more, unless the subspace has it."""
    outside = vector - found.vectors @ (found.vectors.T @ (body.mass @ vector))
    norms = [float(one @ (body.mass @ one)) for one in (outside, vector)]
    return found if norms[0] <= INSIDE**2 * norms[1] else extended(body, found, vector)


def reduced(given: Answered, subspace: Subspace, highest: float) -> Reduced:
    """The body in the modes of a subspace below the `highest` angular frequency [1/s].

    Those above follow their forces, of loads as of tools, at once, as what is outside of the
    subspace does. At least one is kept.
    """
    squares, modes = eigh(subspace.stiffness)
    kept = max(1, int(np.searchsorted(squares, highest**2)))
    squares, shapes = squares[:kept], subspace.vectors @ modes[:, :kept]
    pushed = np.asarray(given.touch.pushes.T @ shapes)
    loads = shapes.T @ given.body.loads
    answers = np.column_stack([given.answers, given.of_loads])
    residual = answers - (shapes / squares) @ np.vstack([pushed, loads.T]).T
    return Reduced(squares, shapes, pushed, loads, residual)


Factors = Callable[[Floats], Floats]
