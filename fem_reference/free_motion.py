"""Free motion of a damped body: guaranteed rates of decay, and products integrated over a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from study.problem.damping import RayleighDamping

Floats = NDArray[np.float64]

RATES = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0])
"""Rates that the bound is evaluated for, relative to the fastest proven one."""
LEAST_MARGIN = 0.05
"""Smallest admissible share of the strain energy in the norm of a rate."""
TERMS = 24
"""Terms of the Taylor series over a step in which no product changes by more than a factor e."""


class Decay(NamedTuple):
    """Rates r [1/s] (rates,) of decay, at least, of the norm N of any free motion.

    N(x, v)^2 = |v + r x|_M^2 + (1 - b r) |x|_K^2 - r (a - r) |x|_M^2 for displacement x and
    velocity v under damping a M + b K. `margin` (rates,): smallest N^2 over |x|_K^2; `lift`
    (rates,): largest N over |x|_K for v = 0.
    """

    rates: Floats
    margin: Floats
    lift: Floats
    damping: RayleighDamping

    def squared(self, x: Floats, v: Floats, squares: Floats) -> Floats:
        """N^2 (rates, modes) of displacement and velocity of each mode.

        `squares` [1/s^2] (modes,): squared angular frequencies of modes of unit mass.
        """
        r, a, b = self.rates[:, None], self.damping.mass, self.damping.stiffness
        return np.asarray((v + r * x) ** 2 + ((1.0 - b * r) * squares - r * (a - r)) * x**2)


def decay(damping: RayleighDamping, lowest: float) -> Decay:
    """Proven rates of decay where no eigenvalue is below `lowest` l [1/s^2].

    With w = v + r x the equation of motion gives N N' <= -r N^2 for any r <= (a + b l) / 2. Under
    light damping r is a / 2 and N the energy in decaying, rotating coordinates; under heavy damping
    r is near l / a. Without damping r is 0 and N the energy norm.
    """
    a, b = damping.mass, damping.stiffness
    trial = 0.5 * (a + b * lowest) * np.geomspace(1e-6, 1.0, 400)
    proven = trial[_margin(trial, damping, lowest) >= LEAST_MARGIN]
    rates = RATES * (proven.max() if len(proven) else 0.0)
    lift = 1.0 - b * rates + np.maximum(rates * (2.0 * rates - a), 0.0) / lowest
    return Decay(rates, _margin(rates, damping, lowest), np.sqrt(lift), damping)


def _margin(rates: Floats, damping: RayleighDamping, lowest: float) -> Floats:
    slow = np.maximum(rates * (damping.mass - rates), 0.0) / lowest
    return np.asarray(1.0 - damping.stiffness * rates - slow)


def free_products(squares: Floats, damping: RayleighDamping, step: float) -> Floats:
    """Integrals over a step [s] of products of the free displacements of two modes, (M, 2, M, 2).

    They are bilinear forms of the displacement and of the velocity over frequency at the start of
    the step; `squares` [1/s^2] (M,). A Taylor series over a short step is doubled until it covers
    the step, which avoids cancellation for any damping.
    """
    rate = _rate(squares, damping)
    fastest = 4.0 * step * float(np.abs(rate).sum(axis=2).max())
    doublings = max(0, int(np.ceil(np.log2(fastest))))
    short = step * 0.5**doublings
    found, transition = _short_products(rate, short), expm(short * rate)
    for _ in range(doublings):
        found = found + np.einsum(
            "iba,ibjc,jcd->iajd", transition, found, transition, optimize=True
        )
        transition = transition @ transition
    return found


def _rate(squares: Floats, damping: RayleighDamping) -> Floats:
    """Rate matrices (M, 2, 2) of displacement, and velocity over frequency, of each mode."""
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
