"""Balance of forces of a body at large strain that rigid tools touch.

    inertia M u + f(u, p) = load + G^T force,   0 <= gaps(u) _|_ force >= 0,   G = d gaps / du

with the volumes of `fem_reference.mixed_strain`. Newton's method keeps the factors of one tangent
for as long as it converges with them, and takes those of the state where it does not. In each
iteration the forces under the tools follow from their compliance by a primal-dual active set, or
with friction by relaxation (`fem_reference.contact.law`), so that neither penalty nor softening
takes part: what is left of a gap that should be closed, of a slip that should not be, and of the
balance, is below a tolerance when a state is handed out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csc_array, csr_array

from fem_reference.contact.finite import Before, Configuration, FiniteContact
from fem_reference.direct import symmetric_factors
from fem_reference.mixed_strain import MixedSolid

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

TOLERANCE = 1e-5
"""Of the unbalanced forces relative to those of tools and loads."""
LEAST = 1e-5
"""Of the shear modulus times the body's size squared, a force below which none counts."""
CLOSED = 1e-7
"""Of the body's size, how far a vertex may be off the tool that pushes it."""
SLOW = 0.5
"""Share of the residual left by an iteration for which it is worth while to factor anew."""
SAME = 1e-6
"""Of steps whose length differs by rounding."""
MOST_FACTORED = 6
"""Tangents for one state, which halves of a step find sooner than more of them would."""
SHORTEST_STEP = 1 / 64
SLACK = 1e-3
"""Of the body's size, how near a vertex is whose answer is found before it touches."""


class UnbalancedError(ValueError):
    """A state that is not found."""


class Balanced(NamedTuple):
    """Displacements and pressures w, and the forces [N] (c,) under the tools."""

    w: Floats
    force: Floats


class Demand(NamedTuple):
    """What is to balance at a time [s]: `inertia` [1/s^2] times the mass, and a `load` [N] (n,).

    `before`: the state that was balanced last; without one the given shape at the start.
    """

    time: float
    inertia: float
    load: Floats
    before: Before | None = None


@dataclass(frozen=True, eq=False)
class TouchedBody:
    """A body that tools may touch.

    `mass` [kg] (n, n); `free` (n + pressures,): unknowns that are not fixed; `origin` [m] (n,):
    displacement of the given shape, to which the contact counts, from the one without stress.
    """

    solid: MixedSolid
    contact: FiniteContact
    mass: csc_array
    free: Bools
    origin: Floats

    def given(self, w: Floats) -> Floats:
        """Displacement [m] (n,) from the given shape."""
        return np.asarray(w[: self.solid.size] - self.origin)

    def off(self, state: Balanced, demand: Demand, pushed: csr_array) -> Floats:
        """What does not balance, of forces [N] and of volumes [m^3], the derivative `pushed` G."""
        n = self.solid.size
        left = -self.solid.gradient(state.w)
        left[:n] += demand.load + pushed.T @ state.force
        left[:n] -= demand.inertia * (self.mass @ state.w[:n])
        left[~self.free] = 0.0
        return left

    def met(self, w: Floats, demand: Demand) -> Configuration:
        """Where a state has the body, and a time the tools."""
        return self.contact.at(self.given(w), demand.time, demand.before)

    def tangent(self, state: Balanced, demand: Demand, met: Configuration) -> csc_array:
        """Derivative of what the body itself and the shape of the tools do, in the order of w."""
        bend = met.curvature(state.force)
        own = csc_array(demand.inertia * self.mass - bend)
        pressures = csc_array((self.solid.pressures, self.solid.pressures))
        whole = self.solid.tangent(state.w) + block_diag([own, pressures], format="csc")
        return csc_array(whole) if self.free.all() else csc_array(whole[self.free][:, self.free])


class Answers:
    """Factors of a tangent, and what the body does under unit forces at vertices, when asked."""

    def __init__(self, matrix: csc_array, free: Bools, pushed: csr_array, inertia: float) -> None:
        self.free, self.pushed, self.inertia = free, pushed, inertia
        self.factors: Any = symmetric_factors(matrix)
        if self.factors is None:
            raise UnbalancedError("the tangent is singular: nothing holds the body")
        self._columns: dict[int, Floats] = {}

    def solve(self, right: Floats) -> Floats:
        """Answer to forces and volumes, in the order of w."""
        found = np.zeros_like(right)
        found[self.free] = self.factors.solve(right[self.free])
        return found

    def to(self, chosen: Ints) -> Floats:
        """Answers (n + pressures, k) to unit forces of the constraints that are chosen."""
        new = np.array([j for j in chosen if j not in self._columns], dtype=np.int64)
        if len(new):
            right = np.zeros((len(self.free), len(new)))
            right[: self.pushed.shape[1]] = self.pushed[new].toarray().T
            self._columns |= dict(zip(new.tolist(), self.solve(right).T, strict=True))
        found = np.empty((len(self.free), len(chosen)))
        for k, j in enumerate(chosen.tolist()):
            found[:, k] = self._columns[j]
        return found


class Balance:
    """Finds states of a body one after another, with factors that serve for as long as they can.

    `iterations` and `factored` count what was done so far.
    """

    def __init__(self, body: TouchedBody) -> None:
        self.body = body
        self.iterations = self.factored = 0
        self._answers: Answers | None = None
        solid = body.solid
        self._volume = np.where(
            np.arange(len(body.free)) < solid.size, 1.0, solid.typical_shear / solid.length
        )
        self._least = LEAST * solid.typical_shear * solid.length**2

    def found(self, guess: Balanced, demand: Demand, scale: float = 0.0) -> Balanced:
        """The state that balances, sought from a guess; `scale` [N] of forces at work.

        UnbalancedError where none is found.
        """
        state, before, begun = self._under(guess, demand), np.inf, self.factored
        while self.factored - begun <= MOST_FACTORED:
            met = self.body.met(state.w, demand)
            gaps, pushed = met.gaps, met.derivative
            off = self.body.off(state, demand, pushed)
            size = self._size(off, state, pushed, gaps, scale)
            if not np.isfinite(size):
                break
            if size <= 1.0:
                return state
            fresh = self._worn(demand, size, before)
            if fresh:
                self._answers = self._factor(state, demand, met)
            before = size
            try:
                state = self._next(state, off, gaps, pushed)
            except UnbalancedError:
                if fresh:
                    break
                before = 0.0  # with the factors of this state
            self.iterations += 1
        self._answers = None
        raise UnbalancedError("no balance of forces")

    def _under(self, guess: Balanced, demand: Demand) -> Balanced:
        """Without the forces of what is no longer under a tool."""
        contact, gaps = self.body.contact, self.body.met(guess.w, demand).gaps
        beside = np.isinf(gaps)[contact.firsts]
        return guess._replace(force=np.where(beside, 0.0, guess.force))

    def in_touch(self, state: Balanced, v: Floats, demand: Demand, since: float) -> Floats:
        """The velocity [m/s] (n,) nearest to another with which closed gaps stay closed.

        So that what sticks moves with its tool, too. Nearest by the last tangent. `since` [s]: a
        time shortly before that of the demand, by which tools are seen to move.
        """
        chosen, answers = np.flatnonzero(self.body.contact.closed(state.force)), self._answers
        if answers is None or not len(chosen):
            return v
        now, then = (self.body.met(state.w, demand._replace(time=t)) for t in (demand.time, since))
        closing = (now.gaps[chosen] - then.gaps[chosen]) / (demand.time - since)
        pushed = now.derivative[chosen]
        columns = answers.to(chosen)[: len(v)]
        impulse = np.linalg.lstsq(pushed @ columns, -(closing + pushed @ v))[0]
        return np.asarray(v + columns @ impulse)

    def _worn(self, demand: Demand, size: float, before: float) -> bool:
        """Whether the factors are of another system, or serve no longer."""
        known = self._answers
        if known is None or not math.isclose(known.inertia, demand.inertia, rel_tol=SAME):
            return True
        return size > SLOW * before

    def _factor(self, state: Balanced, demand: Demand, met: Configuration) -> Answers:
        self.factored += 1
        matrix = self.body.tangent(state, demand, met)
        return Answers(matrix, self.body.free, met.derivative, demand.inertia)

    def _size(
        self, off: Floats, state: Balanced, pushed: csr_array, gaps: Floats, scale: float
    ) -> float:
        """Of what is off, over what may be."""
        at_work = max(scale, float(np.linalg.norm(pushed.T @ state.force)), self._least)
        unbalanced = float(np.linalg.norm(self._volume * off)) / (TOLERANCE * at_work)
        length = self.body.solid.length
        stiffness = self.body.solid.typical_shear * length
        wrong = self.body.contact.off_law(gaps, state.force, stiffness)
        return max(unbalanced, wrong / (CLOSED * length))

    def _next(self, state: Balanced, off: Floats, gaps: Floats, pushed: csr_array) -> Balanced:
        """One iteration on."""
        answers, n, contact = self._answers, self.body.solid.size, self.body.contact
        assert answers is not None  # noqa: S101 - made before
        step = answers.solve(off)
        gaps = gaps + pushed @ step[:n]
        near = (state.force > 0.0) | (gaps < SLACK * self.body.solid.length)
        chosen = np.flatnonzero(contact.held | near[contact.firsts])
        columns = answers.to(chosen)
        compliance = answers.pushed[chosen] @ columns[:n]
        compliance = 0.5 * (compliance + compliance.T)
        old = state.force[chosen]
        try:
            change = contact.answered(compliance, gaps[chosen], chosen, old) - old
        except (np.linalg.LinAlgError, RuntimeError) as error:
            raise UnbalancedError("the body gives way under the tools") from error
        step = step + columns @ change
        length = self._length(state.w, step)
        force = state.force.copy()
        force[chosen] += length * change
        return Balanced(state.w + length * step, force)

    def _length(self, w: Floats, step: Floats) -> float:
        """Largest of 1, 1/2, 1/4, ... of a step that turns no element inside out."""
        length = 1.0
        while self.body.solid.volume_ratio(w + length * step).min() <= 0.0:
            length *= 0.5
            if length < SHORTEST_STEP:
                raise UnbalancedError("elements would turn inside out")
        return length
