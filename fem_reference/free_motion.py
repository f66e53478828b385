"""Free motion of a damped body: how fast it dies down at least, and its products over a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from study.problem.damping import RayleighDamping

Floats = NDArray[np.float64]

RATES = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0])
"""Of the fastest decay that is tried."""
LEAST_MARGIN = 0.05
"""Of what a rate leaves of the strain energy."""
TERMS = 24
"""Of Taylor's series of a step over which no product changes by more than a factor e."""


class Decay(NamedTuple):
    """Rates r [1/s] (rates,) at which the norm N of any free motion decays at least.

    N(x, v)^2 = |v + r x|_M^2 + (1 - b r) |x|_K^2 - r (a - r) |x|_M^2 for displacement x and
    velocity v under damping a M + b K. `margin`: least N^2 over |x|_K^2; `lift`: largest N over
    |x|_K at v = 0.
    """

    rates: Floats
    margin: Floats
    lift: Floats
    damping: RayleighDamping

    def squared(self, x: Floats, v: Floats, squares: Floats) -> Floats:
        """N^2 of each mode's displacement and velocity, (rates, modes).

        `squares` [1/s^2] (modes,): squared angular frequencies of modes of unit mass.
        """
        r, a, b = self.rates[:, None], self.damping.mass, self.damping.stiffness
        return np.asarray((v + r * x) ** 2 + ((1.0 - b * r) * squares - r * (a - r)) * x**2)


def decay(damping: RayleighDamping, lowest: float) -> Decay:
    """Rates up to the fastest that is proven, where no eigenvalue is below `lowest` [1/s^2].

    With w = v + r x the equation of motion gives N N' <= -r N^2 for any r <= (a + b l) / 2: the
    energy in coordinates that turn as they decay for light damping, where r is a / 2; for heavy
    damping r is near l / a. Without damping r is 0 and N the energy.
    """
    a, b = damping.mass, damping.stiffness
    tried = 0.5 * (a + b * lowest) * np.geomspace(1e-6, 1.0, 400)
    within = tried[_margin(tried, damping, lowest) >= LEAST_MARGIN]
    rates = RATES * (within.max() if len(within) else 0.0)
    lift = 1.0 - b * rates + np.maximum(rates * (2.0 * rates - a), 0.0) / lowest
    return Decay(rates, _margin(rates, damping, lowest), np.sqrt(lift), damping)


def _margin(rates: Floats, damping: RayleighDamping, lowest: float) -> Floats:
    slow = np.maximum(rates * (damping.mass - rates), 0.0) / lowest
    return np.asarray(1.0 - damping.stiffness * rates - slow)


def free_products(squares: Floats, damping: RayleighDamping, step: float) -> Floats:
    """Integrals over a step [s] of products of two modes' free displacements, (M, 2, M, 2).

    As forms of displacement, and velocity over frequency, at its start; `squares` [1/s^2] (M,). A
    short step by Taylor's series, doubled until it is the whole: sums of positive terms, whatever
    the damping.
    """
    rate = _rate(squares, damping)
    fastest = 4.0 * step * float(np.abs(rate).sum(axis=2).max())
    doublings = max(0, int(np.ceil(np.log2(fastest))))
    short = step * 0.5**doublings
    found, moved = _short_products(rate, short), expm(short * rate)
    for _ in range(doublings):
        found = found + np.einsum("iba,ibjc,jcd->iajd", moved, found, moved, optimize=True)
        moved = moved @ moved
    return found


def _rate(squares: Floats, damping: RayleighDamping) -> Floats:
    """Of displacement, and velocity over frequency, of each mode (M, 2, 2)."""
    frequency, found = np.sqrt(squares), np.zeros((len(squares), 2, 2))
    found[:, 0, 1], found[:, 1, 0] = frequency, -frequency
    found[:, 1, 1] = -(damping.mass + damping.stiffness * squares)
    return found


def _short_products(rate: Floats, step: float) -> Floats:
    term = np.zeros((len(rate), 2, len(rate), 2))
    term[:, 0, :, 0] = step
    found = np.zeros_like(term)
    for k in range(2, TERMS + 2):
        found += term
        grown = np.einsum("iba,ibjd->iajd", rate, term) + np.einsum("iajb,jbd->iajd", term, rate)
        term = grown * (step / k)
    return found
