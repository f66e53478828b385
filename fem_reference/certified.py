"""A certified bound of the error of a motion in a subspace against that of all unknowns.

The finite-element motion M u'' + C u' + K u = f s(t), C = a M + b K, is compared with a motion u_V
in a subspace by means of a third one, in a larger Krylov space of the same load. The vectors of
that space are solved to rounding, so its residual has a single direction w. The distance of the
third motion to u_V is computed and its own error bounded. Its modes of low frequency, the head,
keep their residual; those of high frequency, the tail, are dropped and their motion is bounded by
its energy.

- In the head the residual is c(t) w. With e_s = K^-1 w c the state (e - e_s, e') obeys the free
  equation of motion, driven by -e_s' in its displacement.
- In the tail a load linear in time has the particular solution z s - (a K^-1 M z + b z) s' for the
  static displacement z; the remainder is a free motion from the start and from each kink of s.

Free motion decays in the norm of `fem_reference.free_motion`. The bound is the least over all
divisions into head and tail and over several rates of decay. The bound of reduced-basis errors by
the dual norm of the residual is due to Prud'homme et al. (2002), J. Fluids Eng. 124:70; that by the
decay of energy instead of Gronwall's lemma to Stahl (2022), arXiv:2204.05010.

The bound covers rounding of residuals and solutions. It does not cover the error of the mesh, nor
that of a load that is not linear over the steps.
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
    """Bounds of the error in the energy norm [sqrt(J)] and at the control points [m] (p,).

    The energy norm is the square root of u K u, twice the strain energy.
    """

    energy: float
    displacement: Floats


class CertifiedMotion:
    """Motion from rest in a subspace and in the Krylov space, with the error bound of the former.

    The load is that of the body times `factor` at the ends of each `step` [s], linear between them.
    `bound` and `time` [s] are those after the steps taken. The cost of a step grows with the square
    of the dimension of the Krylov space and does not depend on the size of the body.
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
        # Bounds of the norm N of the unknown motion, by number of head modes and rate of decay.
        self._tail = abs(self.load) * _tail_by_load(given, self._decay)
        self._head = self._quasi_static(self._forces())[:, None] * self._decay.lift
        self.bound = Bound(0.0, np.zeros(len(given.probes.compliance)))

    @property
    def energy_norm(self) -> float:
        """Energy norm [sqrt(J)] of the motion in the subspace after the steps taken."""
        return float(np.sqrt(self.given.own_squares @ self._own.state[:, 0] ** 2))

    def take_step(self) -> None:
        """Advance by one step and update the bound."""
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
        """Minus acceleration and mass damping of each mode (M,), proportional to its residual."""
        given, (q, p) = self.given, self._long.state.T
        return np.asarray(given.squares * (q + self.damping.stiffness * p) - given.load * self.load)

    def _quasi_static(self, forces: Floats) -> Floats:
        """Energy norm of K^-1 times the residual of each head, (divisions,)."""
        along = self.given.norm * np.abs(_heads(self.given.last * forces))
        return np.asarray(along + self._defect(forces))

    def _defect(self, forces: Floats) -> Floats:
        """Contribution of rounding to `_quasi_static`, (divisions,)."""
        given = self.given
        rounding = given.defect * np.sqrt(_heads(forces**2))
        return np.asarray(rounding + given.static_defect * abs(self.load))

    def _driven(self, slope: float) -> Floats:
        """Upper bound of the integral over a step of the rate of `_quasi_static`, (divisions,).

        By the Cauchy-Schwarz inequality; within a step the rates of the forces are free motions.
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
        """Rate of `_forces` after a kink, and its own rate over the frequency, (M, 2)."""
        given, a, b = self.given, self.damping.mass, self.damping.stiffness
        squares, (q, p) = given.squares, self._long.state.T
        drag = a + b * squares
        acceleration = given.load * self.load - squares * q - drag * p
        jerk = given.load * slope - squares * p - drag * acceleration
        rate = squares * (p + b * acceleration) - given.load * slope
        return np.column_stack([rate, np.sqrt(squares) * (acceleration + b * jerk)])

    def _least(self) -> Bound:
        """The least bound over all divisions into head and tail."""
        forces, given = self._forces(), self.given
        parts, along = self._difference(), self._along(forces)
        unknown = self._unknown(forces)
        energy = _distance(given, parts, along, self._own.state[:, 0]) + unknown
        points = _probe_distance(given, parts, along, self._own.state[:, 0])
        points = points + given.probes.compliance[:, None] * unknown
        return Bound(float(energy.min()), points.min(axis=1))

    def _difference(self) -> tuple[Floats, Floats]:
        """Difference of each mode to the subspace's motion, as part of the head and of the tail."""
        given, damping = self.given, self.damping
        inside = given.inside @ self._own.state[:, 0]
        late = self._slope * (damping.mass / given.squares + damping.stiffness)
        return self._long.state[:, 0] - inside, given.rest * (self.load - late) - inside

    def _along(self, forces: Floats) -> Floats:
        """Coefficient of K^-1 w in the error, (divisions,)."""
        given, late = self.given, self._slope * self.damping.mass
        return _heads(given.last * forces) - late * _tails(given.last * given.rest)

    def _unknown(self, forces: Floats) -> Floats:
        """Bound of the energy norm of the unknown error, free motion and rounding, (divisions,)."""
        given, late = self.given, abs(self._slope) * self.damping.mass
        share = np.sqrt(self._decay.margin)
        free = (self._head / share).min(axis=1) + (self._tail / share).min(axis=1)
        rounding = late * given.defect * np.sqrt(_tails(given.rest**2))
        return np.asarray(free + self._defect(forces) + rounding)


class _Modes:
    """Displacement and velocity of modes, the columns of `state` (m, 2), under a stepwise load."""

    def __init__(
        self, squares: Floats, load: Floats, damping: RayleighDamping, step: float
    ) -> None:
        self.state, self._load = np.zeros((len(squares), 2)), load
        self._moved = transitions(squares, damping, step)[:, :2]

    def advance(self, before: float, slope: float) -> None:
        """Advance by one step under a load of given start value and slope."""
        whole = np.column_stack([self.state, self._load * before, self._load * slope])
        self.state = np.einsum("mij,mj->mi", self._moved, whole)


def _distance(
    given: Certificate, parts: tuple[Floats, Floats], along: Floats, own: Floats
) -> Floats:
    """Energy norm of the computed part of the error, (divisions,)."""
    head, tail = (given.squares * part**2 for part in parts)
    beside = np.column_stack([along, np.broadcast_to(-own, (len(along), len(own)))])
    outside = np.einsum("ki,ij,kj->k", beside, given.outside, beside)
    return np.asarray(np.sqrt(np.maximum(_heads(head) + _tails(tail) + outside, 0.0)))


def _probe_distance(
    given: Certificate, parts: tuple[Floats, Floats], along: Floats, own: Floats
) -> Floats:
    """Computed part [m] of the error at the control points, (p, divisions)."""
    head, tail = (given.probes.modes * part for part in parts)
    beside = given.probes.solution[..., None] * along - (given.probes.outside @ own)[..., None]
    return np.asarray(np.linalg.norm(_heads(head) + _tails(tail) + beside, axis=1))


def _tail_by_kink(given: Certificate, found: Decay) -> Floats:
    """N of the free motion of each tail after a unit change of load slope, (divisions, rates)."""
    a, rest = found.damping.mass, given.rest
    late = rest * (a / given.squares + found.damping.stiffness)
    own = _tails(found.squared(-late, rest, given.squares)).T
    along = given.norm * np.abs(_tails(given.last * rest))
    beside = a * (along + given.defect * np.sqrt(_tails(rest**2)))
    return np.asarray(np.sqrt(np.maximum(own, 0.0)) + beside[:, None] * found.lift)


def _tail_by_load(given: Certificate, found: Decay) -> Floats:
    """N of the free motion of each tail after a unit initial load, (divisions, rates)."""
    own = _tails(found.squared(given.rest, np.zeros_like(given.rest), given.squares)).T
    return np.asarray(np.sqrt(np.maximum(own, 0.0)))


def _heads(values: Floats) -> Floats:
    """Sums of the first 0, 1, ... M entries of the last axis."""
    start = np.zeros((*values.shape[:-1], 1))
    return np.concatenate([start, np.cumsum(values, axis=-1)], axis=-1)


def _tails(values: Floats) -> Floats:
    """Sums of the last M, M - 1, ... 0 entries of the last axis."""
    return np.asarray(_heads(values[..., ::-1])[..., ::-1])


def _leading_products(products: Floats) -> Floats:
    """Increments of the quadratic form by each mode, (2 M, 2 M), from forms (M, 2, M, 2)."""
    count = len(products)
    twice = np.tril(np.full((count, count), 2.0), -1) + np.eye(count)
    return np.asarray((products * twice[:, None, :, None]).reshape(2 * count, 2 * count))
