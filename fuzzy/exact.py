"""Centroids of the continuous output curve, without the error of samples.

The curve is a maximum of clipped sets: smooth between its kinks. They are bracketed on a grid, to
which the places are added where a set comes closest to the largest one and may just exceed it, and
found by bisection. Gauss-Legendre quadrature runs from kink to kink; its panels are halved until
the answer moves by less than TOLERANCE of the universe.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fuzzy.quadrature import Quadrature
from fuzzy.sets import Array, corners, lower_membership, upper_membership
from fuzzy.system import Membership, System, memberships

TOLERANCE = 1e-10
"""Change on halving all panels, over the width of the universe, at which an answer is taken."""

PANELS = 64
DOUBLINGS = 6
PASSES = 3
"""Kinks are found one at a time in a panel; each pass halves again those with several."""
BISECTIONS = 55
SCANNED = 257
SECTIONS = 40
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
SWITCHES = 100
STILL = 1e-13
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


class Union(NamedTuple):
    """The union of a system's output sets implied at `heights` (sets,)."""

    system: System
    heights: Array
    membership: Membership

    def implied(self, y: Array) -> Array:
        """Each implied set at points (M,), shape (sets, M)."""
        mu = memberships(self.system.output, y, self.membership)
        heights = self.heights[:, None]
        product = self.system.operators.implication == "prod"
        return heights * mu if product else np.minimum(heights, mu)

    def value(self, y: Array) -> Array:
        """The curve at points (M,)."""
        return np.asarray(self.implied(y).max(axis=0))

    def piece(self, y: Array) -> NDArray[np.intp]:
        """A number for the smooth piece of the curve that each point (M,) lies on."""
        mu = memberships(self.system.output, y, self.membership)
        winner = self.implied(y).argmax(axis=0)
        clipped = mu[winner, np.arange(y.size)] > self.heights[winner]
        return np.asarray(2 * winner + clipped)

    def lead(self, k: NDArray[np.intp], y: Array) -> Array:
        """By how much another set exceeds set k[i] at y[i]; negative where none does."""
        implied, columns = self.implied(y), np.arange(y.size)
        own = implied[k, columns]
        implied[k, columns] = -np.inf
        return np.asarray(implied.max(axis=0) - own)


class Reduction(NamedTuple):
    """Ends of the type-reduced interval, and Nie and Tan's centroid."""

    interval: tuple[float, float]
    nie_tan: float


def centroid(system: System, heights: Array, membership: Membership) -> float:
    """Centroid of the union of the output sets implied at `heights` (sets,); NaN if all are 0."""
    if not heights.max() > 0:
        return np.nan
    curve = Union(system, heights, membership)
    kinks = _kinks([curve])

    def answer(panels: int) -> Array:
        y, weights = _on_panels(_panel_ends(system, kinks, panels))
        mass = weights * curve.value(y)
        return np.array([mass @ y / mass.sum()])

    return float(_converged(system, answer)[0])


def reduce(system: System, lower_heights: Array, upper_heights: Array) -> Reduction:
    """Type reduction of the band between two unions of output sets; NaN if nothing fires."""
    if not upper_heights.max() > 0:
        return Reduction((np.nan, np.nan), np.nan)
    lower = Union(system, lower_heights, lower_membership)
    upper = Union(system, upper_heights, upper_membership)
    kinks = _kinks([lower, upper])

    def answer(panels: int) -> Array:
        ends = _panel_ends(system, kinks, panels)
        y, weights = _on_panels(ends)
        both = weights * (lower.value(y) + upper.value(y))
        middle = both @ y / both.sum()
        return np.array(
            [_end(ends, upper, lower, middle), _end(ends, lower, upper, middle), middle]
        )

    left, right, middle = _converged(system, answer)
    return Reduction((float(left), float(right)), float(middle))


def _converged(system: System, answer: Callable[[int], Array]) -> Array:
    width = system.output.high - system.output.low
    coarse = answer(PANELS)
    for doubling in range(1, DOUBLINGS + 1):
        fine = answer(PANELS * 2**doubling)
        if np.abs(fine - coarse).max() <= TOLERANCE * width:
            return fine
        coarse = fine
    return coarse


def _panel_ends(system: System, kinks: Array, panels: int) -> Array:
    return _rising(np.linspace(system.output.low, system.output.high, panels + 1), kinks)


def _kinks(curves: list[Union]) -> Array:
    """Rising places between which all curves are smooth."""
    output = curves[0].system.output
    grid = np.linspace(output.low, output.high, SCANNED)
    fixed = [x for one in output.sets for x in corners(one) if output.low < x < output.high]
    # Close calls are kept too: one may lie on the very place where two other sets change over.
    found = [np.array(fixed), *(_close_calls(curve, grid) for curve in curves)]
    ends = _rising(grid, *found)
    for _ in range(PASSES):
        found += [_changes(curve, ends) for curve in curves]
        ends = _rising(ends, *found)
    return np.concatenate(found)


def _close_calls(curve: Union, y: Array) -> Array:
    """Places where a set comes closest to the largest one, or exceeds it most."""
    implied = curve.implied(y)
    gap = implied.max(axis=0) - implied
    fall, rise = gap[:, :-2] - gap[:, 1:-1], gap[:, 2:] - gap[:, 1:-1]
    # Within its bracket a smooth gap sinks by no more than it rises to the sides.
    near = (fall > 0) & (rise >= 0) & (gap[:, 1:-1] > 0) & (gap[:, 1:-1] <= fall + rise)
    k, m = np.nonzero(near)
    left, right = y[m], y[m + 2]
    for _ in range(SECTIONS if k.size else 0):
        first, second = right - GOLDEN * (right - left), left + GOLDEN * (right - left)
        nearer = curve.lead(k, first) < curve.lead(k, second)
        left, right = np.where(nearer, left, first), np.where(nearer, second, right)
    return np.asarray(0.5 * (left + right))


def _rising(*places: Array) -> Array:
    """All places in order, each once."""
    # numpy.unique would import numpy.ma, a tenth of what a single estimate takes from the start.
    ordered = np.sort(np.concatenate(places))
    return np.asarray(ordered[np.append(True, np.diff(ordered) > 0)])


def _on_panels(ends: Array) -> Quadrature:
    """Gauss-Legendre points and weights on every panel."""
    half, middle = 0.5 * np.diff(ends), 0.5 * (ends[1:] + ends[:-1])
    y = middle[:, None] + half[:, None] * NODES
    return Quadrature(y.ravel(), (half[:, None] * WEIGHTS).ravel())


def _changes(curve: Union, ends: Array) -> Array:
    """Places between neighbouring `ends` where the curve passes to another smooth piece."""
    left: Array = ends[:-1]
    right: Array = ends[1:]
    # A hair inside, for a label at a corner itself may belong to either side.
    hair = 1e-9 * (right - left)
    left, right = left + hair, right - hair
    changes = curve.piece(left) != curve.piece(right)
    left, right = left[changes], right[changes]
    if not left.size:
        return left
    start = curve.piece(left)
    for _ in range(BISECTIONS):
        middle = 0.5 * (left + right)
        same = curve.piece(middle) == start
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return 0.5 * (left + right)


def _end(ends: Array, first: Union, second: Union, start: float) -> float:
    """One end of the interval: the fixed point of passing from `first` to `second` at the centroid.

    Every pass moves towards the end and never beyond it, and the distance shrinks quadratically.
    """
    switch = start
    for _ in range(SWITCHES):
        y, weights = _on_panels(np.insert(ends, np.searchsorted(ends, switch), switch))
        mass = weights * np.where(y < switch, first.value(y), second.value(y))
        if not mass.sum() > 0:
            break
        moved = float(mass @ y / mass.sum())
        if abs(moved - switch) <= STILL * (ends[-1] - ends[0]):
            return moved
        switch = moved
    return switch
