"""A bound, not an estimate, of how far a subspace's motion is from that of all unknowns.

The finite elements M u'' + C u' + K u = f s(t), C = a M + b K, are compared with a motion u_V in a
subspace. Between the two stands a third, in a longer Krylov space of the same load, whose residual
has one direction w, since its vectors are solved to rounding. Its distance to u_V is computed; its
own error is bounded. Its modes of low frequency, the head, keep their residual; those of high
frequency, the tail, are dropped, and what they would do is bounded by their energy.

- In the head the residual is c(t) w. With e_s = K^-1 w c the state (e - e_s, e') obeys the free
  equation of motion, driven by -e_s' in its displacement.
- In the tail a load linear in time has the particular solution z s - (a K^-1 M z + b z) s' for a
  displacement z at rest; what is left moves freely from the start and from each kink of the load.

Free motion decays in the norm of `fem_reference.free_motion`. Where head and tail part, and how
fast motion decays, is tried in all ways at once, and the least bound taken. That residuals in a
dual norm bound the error of a reduced basis is due to Prud'homme et al. (2002), J. Fluids Eng.
124:70; by the decay of energy, not by Gronwall's lemma, to Stahl (2022), arXiv:2204.05010.

Not covered: the error of the mesh, and of a load that is not linear over the steps. Rounding of
residuals and solutions is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.certificate import Certificate
from fem_reference.direct import EPSILON
from fem_reference.free_motion import Decay, decay, free_products
from fem_reference.subspace import transitions
from study.problem.damping import RayleighDamping

Floats = NDArray[np.float64]


class Bound(NamedTuple):
    """Of the error's energy norm [sqrt(J)], and at the control points of its length [m] (p,).

    The energy norm is the square root of u K u, twice the strain energy.
    """

    energy: float
    displacement: Floats


class CertifiedMotion:
    """Motion from rest in a subspace and in the Krylov space, and the bound of the first's error.

    The load is the share `factor` of the body's at the ends of each `step` [s], linear between
    them. `bound` and `time` [s] are those after the steps taken. A step costs some multiple of the
    square of the Krylov space's size, whatever the body's.
    """

    def __init__(
        self,
        given: Certificate,
        damping: RayleighDamping,
        factor: Callable[[Floats], Floats],
        step: float,
    ) -> None:
        self.given, self.damping, self.factor, self.step = given, damping, factor, step
        self.time, self.load, self._slope = 0.0, float(factor(np.zeros(1))[0]), 0.0
        self._long = _Modes(given.squares, given.load, damping, step)
        self._own = _Modes(given.own_squares, given.own_load, damping, step)
        products = free_products(given.squares, damping, step)
        self._own_products = np.einsum("iaib->iab", products)
        self._leading = _leading_products(products)
        self._decay = decay(damping, given.lowest)
        self._fade = np.exp(-self._decay.rates * step)
        self._by_kink = _tail_by_kink(given, self._decay)
        # N of the motion not known, of each number of modes in the head and each rate of decay.
        self._tail = abs(self.load) * _tail_by_load(given, self._decay)
        self._head = self._quasi_static(self._forces())[:, None] * self._decay.lift
        self.bound = Bound(0.0, np.zeros(len(given.seen.compliance)))

    @property
    def energy_norm(self) -> float:
        """Of the motion in the subspace [sqrt(J)], after the steps taken."""
        return float(np.sqrt(self.given.own_squares @ self._own.state[:, 0] ** 2))

    def take_step(self) -> None:
        """Go one step on, to the bound there."""
        after = float(self.factor(np.array([self.time + self.step]))[0])
        slope = (after - self.load) / self.step
        driven = self._driven(slope)[:, None] * self._decay.lift
        self._head = self._fade * self._head + driven
        self._tail = self._fade * (self._tail + abs(slope - self._slope) * self._by_kink)
        for modes in (self._long, self._own):
            modes.advance(self.load, slope)
        self.time, self.load, self._slope = self.time + self.step, after, slope
        self.bound = self._least()

    def _forces(self) -> Floats:
        """Minus acceleration and mass damping of each mode (M,), by which its residual goes."""
        given, (q, p) = self.given, self._long.state.T
        return np.asarray(given.squares * (q + self.damping.stiffness * p) - given.load * self.load)

    def _quasi_static(self, forces: Floats) -> Floats:
        """Energy norm of K^-1 times the residual of each head, (cuts,)."""
        along = self.given.norm * np.abs(_heads(self.given.last * forces))
        return np.asarray(along + self._defect(forces))

    def _defect(self, forces: Floats) -> Floats:
        """What of it is rounding."""
        given = self.given
        wrong = given.defect * np.sqrt(_heads(forces**2))
        return np.asarray(wrong + given.static_defect * abs(self.load))

    def _driven(self, slope: float) -> Floats:
        """Integral over a step of the norm of the rate of that, (cuts,), or more.

        By Schwarz's inequality; within a step the forces' rates move freely.
        """
        given, rates = self.given, self._force_rates(slope)
        own = np.maximum(np.einsum("ia,iab,ib->i", rates, self._own_products, rates), 0.0)
        part = (given.last[:, None] * rates).ravel()
        products = (part * (self._leading @ part)).reshape(-1, 2).sum(axis=1)
        rounding = EPSILON * len(own) * _heads(given.last**2 * own)
        along = np.sqrt(np.maximum(_heads(products), 0.0) + rounding)
        whole = given.norm * along + given.defect * np.sqrt(_heads(own))
        return np.asarray(np.sqrt(self.step) * whole + given.static_defect * self.step * abs(slope))

    def _force_rates(self, slope: float) -> Floats:
        """Rate of `_forces` after a kink, and over frequency the rate of that, (M, 2)."""
        given, a, b = self.given, self.damping.mass, self.damping.stiffness
        squares, (q, p) = given.squares, self._long.state.T
        drag = a + b * squares
        acceleration = given.load * self.load - squares * q - drag * p
        jerk = given.load * slope - squares * p - drag * acceleration
        rate = squares * (p + b * acceleration) - given.load * slope
        return np.column_stack([rate, np.sqrt(squares) * (acceleration + b * jerk)])

    def _least(self) -> Bound:
        """The least of all cuts."""
        forces, given = self._forces(), self.given
        parts, along = self._difference(), self._along(forces)
        unknown = self._unknown(forces)
        energy = _distance(given, parts, along, self._own.state[:, 0]) + unknown
        points = _moved(given, parts, along, self._own.state[:, 0])
        points = points + given.seen.compliance[:, None] * unknown
        return Bound(float(energy.min()), points.min(axis=1))

    def _difference(self) -> tuple[Floats, Floats]:
        """From the subspace's motion to that of a mode in the head, and of one in the tail (M,)."""
        given, damping = self.given, self.damping
        inside = given.inside @ self._own.state[:, 0]
        late = self._slope * (damping.mass / given.squares + damping.stiffness)
        return self._long.state[:, 0] - inside, given.rest * (self.load - late) - inside

    def _along(self, forces: Floats) -> Floats:
        """How much of K^-1 w there is beside, (cuts,)."""
        given, late = self.given, self._slope * self.damping.mass
        return _heads(given.last * forces) - late * _tails(given.last * given.rest)

    def _unknown(self, forces: Floats) -> Floats:
        """Largest energy norm of what is not known, free motion and rounding, (cuts,)."""
        given, late = self.given, abs(self._slope) * self.damping.mass
        share = np.sqrt(self._decay.margin)
        free = (self._head / share).min(axis=1) + (self._tail / share).min(axis=1)
        rounding = late * given.defect * np.sqrt(_tails(given.rest**2))
        return np.asarray(free + self._defect(forces) + rounding)


class _Modes:
    """Displacement and velocity of modes, the columns of `state` (m, 2), by steps of a load."""

    def __init__(
        self, squares: Floats, load: Floats, damping: RayleighDamping, step: float
    ) -> None:
        self.state, self._load = np.zeros((len(squares), 2)), load
        self._moved = transitions(squares, damping, step)[:, :2]

    def advance(self, before: float, slope: float) -> None:
        """Go one step on, under a load that is linear over it."""
        whole = np.column_stack([self.state, self._load * before, self._load * slope])
        self.state = np.einsum("mij,mj->mi", self._moved, whole)


def _distance(
    given: Certificate, parts: tuple[Floats, Floats], along: Floats, own: Floats
) -> Floats:
    """Energy norm of what is known of the error, (cuts,)."""
    head, tail = (given.squares * part**2 for part in parts)
    beside = np.column_stack([along, np.broadcast_to(-own, (len(along), len(own)))])
    outside = np.einsum("ki,ij,kj->k", beside, given.outside, beside)
    return np.asarray(np.sqrt(np.maximum(_heads(head) + _tails(tail) + outside, 0.0)))


def _moved(given: Certificate, parts: tuple[Floats, Floats], along: Floats, own: Floats) -> Floats:
    """Length [m] of what is known of the error at the control points, (p, cuts)."""
    head, tail = (given.seen.modes * part for part in parts)
    beside = given.seen.solution[..., None] * along - (given.seen.outside @ own)[..., None]
    return np.asarray(np.linalg.norm(_heads(head) + _tails(tail) + beside, axis=1))


def _tail_by_kink(given: Certificate, found: Decay) -> Floats:
    """N of each tail's free motion by a unit change of the load's slope, (cuts, rates)."""
    a, rest = found.damping.mass, given.rest
    late = rest * (a / given.squares + found.damping.stiffness)
    own = _tails(found.squared(-late, rest, given.squares)).T
    along = given.norm * np.abs(_tails(given.last * rest))
    beside = a * (along + given.defect * np.sqrt(_tails(rest**2)))
    return np.asarray(np.sqrt(np.maximum(own, 0.0)) + beside[:, None] * found.lift)


def _tail_by_load(given: Certificate, found: Decay) -> Floats:
    """N of each tail's free motion by a unit load that is there from the start, (cuts, rates)."""
    own = _tails(found.squared(given.rest, np.zeros_like(given.rest), given.squares)).T
    return np.asarray(np.sqrt(np.maximum(own, 0.0)))


def _heads(values: Floats) -> Floats:
    """Sums of the first none, one, ... all of the last axis."""
    start = np.zeros((*values.shape[:-1], 1))
    return np.concatenate([start, np.cumsum(values, axis=-1)], axis=-1)


def _tails(values: Floats) -> Floats:
    """Sums of all, all but the first, ... none of the last axis."""
    return np.asarray(_heads(values[..., ::-1])[..., ::-1])


def _leading_products(products: Floats) -> Floats:
    """What each mode adds to the form of those before it, (2 M, 2 M), from forms (M, 2, M, 2)."""
    count = len(products)
    twice = np.tril(np.full((count, count), 2.0), -1) + np.eye(count)
    return np.asarray((products * twice[:, None, :, None]).reshape(2 * count, 2 * count))
