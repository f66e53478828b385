"""Identification of membership functions from their samples.

A flank of most kinds becomes a straight line by a transformation of its memberships, so that two
samples determine its parameters; a bell takes three. A kind is accepted if it reproduces all
samples.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from fuzzy.systems.sets import FORMS, Array, FuzzySet, Kind, Parameters, membership, root

TOLERANCE = 1e-8
"""Largest difference between a sample and the identified function."""

EDGE = 1e-9
"""Distance of a membership from 0 and 1 below which it is not on a flank."""


class _Line(NamedTuple):
    """A flank after its transformation, slope x + offset."""

    slope: float
    offset: float

    def at(self, level: float) -> float:
        """The position at which the line reaches a level."""
        return (level - self.offset) / self.slope


class _Samples(NamedTuple):
    """Samples mu (M,) at rising x (M,), and the first and last of the largest."""

    x: Array
    mu: Array
    first: int
    last: int

    @property
    def width(self) -> float:
        """Width of the universe."""
        return float(self.x[-1] - self.x[0])


def recognised(name: str, x: Array, mu: Array) -> FuzzySet:
    """The set with memberships mu (M,) at the ascending positions x (M,).

    Kinds: triangle, trapezoid, Gaussian, two-sided Gaussian, Z, S and pi spline, sigmoid, bell. The
    end of a flank outside the universe is arbitrary. ValueError if no kind fits.
    """
    if not np.isfinite(mu).all():
        raise ValueError(f"set {name!r}: has samples that are not finite; correct them")
    top = np.flatnonzero(mu >= mu.max() - EDGE)
    samples = _Samples(x, mu, int(top[0]), int(top[-1]))
    for kind, exact in _candidates(samples):
        parameters = tuple(float(f"{p:.10g}") for p in exact)  # without the rounding of the fit
        if not (np.isfinite(parameters).all() and _ordinary(kind, parameters)):
            continue
        one = FuzzySet(name, kind, parameters)
        if np.abs(membership(one, x) - mu).max() <= TOLERANCE:
            return one
    raise ValueError(
        f"set {name!r}: its samples are of no triangle, trapezoid, one- or two-sided Gaussian, "
        "bell, Z, S or pi spline and sigmoid; give it as one of these, or sample it more finely"
    )


def _ordinary(kind: Kind, parameters: Parameters) -> bool:
    """Whether the parameters are in canonical form, with a core."""
    form = FORMS[kind]
    return (
        form.valid(parameters) and form.plain(parameters) == parameters and form.peaks(parameters)
    )


def _candidates(samples: _Samples) -> Iterator[tuple[Kind, Parameters]]:
    yield from _trapezoids(samples)
    yield from _gaussians(samples)
    yield from _splines(samples)
    for left in (True, False):
        line = _line(samples, lambda mu: np.log(mu / (1.0 - mu)), left=left)
        if line is not None:
            yield "sigmf", (line.slope, line.at(0.0))
        bell = _bell(samples, left=left)
        if bell is not None:
            yield "gbellmf", bell


def _trapezoids(samples: _Samples) -> Iterator[tuple[Kind, Parameters]]:
    left, right = (_ends(samples, lambda mu: mu, left=side) for side in (True, False))
    if left is None or right is None:
        return
    if samples.first == 0 and right[1] <= samples.x[0] + EDGE * samples.width:
        left = (right[1], right[1])
    if samples.last == len(samples.x) - 1 and left[1] >= samples.x[-1] - EDGE * samples.width:
        right = (left[1], left[1])
    if abs(right[1] - left[1]) <= EDGE * samples.width:
        yield "trimf", (left[0], 0.5 * (left[1] + right[1]), right[0])
    yield "trapmf", (*left, right[1], right[0])


def _splines(samples: _Samples) -> Iterator[tuple[Kind, Parameters]]:
    left, right = (_ends(samples, _unsplined, left=side) for side in (True, False))
    if left is None or right is None:
        return
    if samples.first == 0:
        yield "zmf", right[::-1]
    if samples.last == len(samples.x) - 1:
        yield "smf", left
    yield "pimf", (*left, right[1], right[0])


def _unsplined(mu: Array) -> Array:
    return np.where(mu < 0.5, np.sqrt(0.5 * mu), 1.0 - np.sqrt(0.5 * (1.0 - mu)))


def _gaussians(samples: _Samples) -> Iterator[tuple[Kind, Parameters]]:
    low, high = samples.x[0] - samples.width, samples.x[-1] + samples.width
    left, right = (_half(samples, left=side) for side in (True, False))
    for one in (left, right):
        if one is not None:
            yield "gaussmf", one
    if left is not None and right is not None:
        yield "gauss2mf", (*left, *right)
    elif left is not None and samples.last == len(samples.x) - 1:
        yield "gauss2mf", (*left, left[0], high)
    elif right is not None and samples.first == 0:
        yield "gauss2mf", (right[0], low, *right)


def _half(samples: _Samples, *, left: bool) -> tuple[float, float] | None:
    """Width and centre of a Gaussian flank."""
    line = _line(samples, lambda mu: np.sqrt(-2.0 * np.log(mu)), left=left)
    return None if line is None else (1.0 / abs(line.slope), line.at(0.0))


def _bell(samples: _Samples, *, left: bool) -> Parameters | None:
    """Half-width, slope and centre of the bell with a flank.

    log(1 / mu - 1) is 2 slope (log |x - centre| - log half-width): the ratio of its two steps
    between three samples rises with the distance of the centre.
    """
    side = slice(0, samples.first) if left else slice(samples.last + 1, None)
    mu = samples.mu[side]
    on = np.flatnonzero((mu > EDGE) & (mu < 0.99))  # nearer to 1 the logarithm loses its digits
    if on.size < 3:
        return None
    three = on[[0, on.size // 2, -1]] if left else on[[-1, on.size // 2, 0]]
    places = samples.x[side][three] if left else -samples.x[side][three]
    steps = -np.diff(np.log(1.0 / mu[three] - 1.0))
    if not (steps > 0).all():
        return None

    def excess(distance: float) -> float:
        nearer = -np.diff(np.log(places[-1] + distance - places))
        return float(nearer[0] / nearer[1] - steps[0] / steps[1])

    centre = float(places[-1]) + root(excess, 1e-12 * samples.width, 1e3 * samples.width)
    slope = 0.5 * float(steps[0] / np.log((centre - places[0]) / (centre - places[1])))
    half_width = (centre - float(places[0])) / (1.0 / mu[three[0]] - 1.0) ** (0.5 / slope)
    return float(half_width), slope, centre if left else -centre


def _ends(
    samples: _Samples, transform: Callable[[Array], Array], *, left: bool
) -> tuple[float, float] | None:
    """Foot and top of a flank that rises from 0 to 1; beyond the universe if there is none."""
    line = _line(samples, transform, left=left)
    if line is not None:
        return line.at(0.0), line.at(1.0)
    x, mu = (samples.x, samples.mu) if left else (-samples.x[::-1], samples.mu[::-1])
    first = samples.first if left else len(x) - 1 - samples.last
    ends = _short(x, mu, first, samples.width)
    return ends if left or ends is None else (-ends[0], -ends[1])


def _short(x: Array, mu: Array, first: int, width: float) -> tuple[float, float] | None:
    """Foot and top of a left flank with at most one sample on it, as far as they are determined."""
    if first == 0:
        return float(x[0] - 2.0 * width), float(x[0] - width)
    before = float(mu[first - 1])
    if before <= EDGE:
        return float(x[first - 1]), float(x[first])
    if first == 1:
        return None
    foot = float(x[first - 2])
    top = foot + float(x[first - 1] - x[first - 2]) / before
    if top <= x[first]:
        return foot, top
    top = float(x[first])
    return top - float(x[first] - x[first - 1]) / (1.0 - before), top


def _line(samples: _Samples, transform: Callable[[Array], Array], *, left: bool) -> _Line | None:
    """The transformed flank beside the largest samples; None if fewer than two lie on it."""
    side = slice(0, samples.first) if left else slice(samples.last + 1, None)
    x, mu = samples.x[side], samples.mu[side]
    on = (mu > EDGE) & (mu < 1.0 - EDGE)
    if np.count_nonzero(on) < 2:
        return None
    x, t = x[on], transform(mu[on])
    away, up = x - x.mean(), t - t.mean()
    slope = float(away @ up / (away @ away))
    return _Line(slope, float(t.mean() - slope * x.mean())) if slope else None
