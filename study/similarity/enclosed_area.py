"""Area between two polygonal curves in a plane, exact also where they cross."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def area_between(one: Floats, other: Floats) -> float:
    """Area between polygonal curves (n, 2) and (m, 2), closed by joining their starts and ends.

    It is the integral of |w| over the plane, with w the winding number of the closed path out along
    one curve and back along the other: for two graphs over the same abscissae the integral of |f -
    g|, for two loops of the same sense the area inside only one of them.
    """
    start, end = _edges(np.concatenate([one, other[::-1]]))
    if not len(start):
        return 0.0
    ordinates = np.concatenate([start[:, 1], end[:, 1], _crossing_ordinates(start, end)])
    return _between_levels(start, end, np.unique(ordinates))


def _edges(polygon: Floats) -> tuple[Floats, Floats]:
    """Start and end points of the edges of a closed polygon that are not horizontal."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    rising = start[:, 1] != end[:, 1]
    return start[rising], end[rising]


def _crossing_ordinates(start: Floats, end: Floats) -> Floats:
    """Ordinates at which two of the edges cross."""
    along = end - start
    first, second = np.triu_indices(len(start), 1)
    turn = _cross(along[first], along[second])
    crossing = turn != 0.0
    first, second, turn = first[crossing], second[crossing], turn[crossing]
    apart = start[second] - start[first]
    # A share beyond double range is none: the edges are parallel to rounding.
    with np.errstate(over="ignore"):
        share = _cross(apart, along[second]) / turn
        other = _cross(apart, along[first]) / turn
    inside = (share > 0.0) & (share < 1.0) & (other > 0.0) & (other < 1.0)
    return np.asarray(start[first[inside], 1] + share[inside] * along[first[inside], 1])


def _between_levels(start: Floats, end: Floats, levels: Floats) -> float:
    """Integral of |w| over the horizontal slabs between levels (s,).

    No edges begin, end or cross within a slab. The edges divide it into trapezoids, whose width at
    half height is their mean width.
    """
    rising = end[:, 1] > start[:, 1]
    lower = np.searchsorted(levels, np.where(rising, start[:, 1], end[:, 1]))
    upper = np.searchsorted(levels, np.where(rising, end[:, 1], start[:, 1]))
    edge = np.repeat(np.arange(len(start)), upper - lower)
    first = np.cumsum(upper - lower) - (upper - lower)
    slab = np.arange(len(edge)) - first[edge] + lower[edge]
    middle = 0.5 * (levels[slab] + levels[slab + 1])
    # A share first: the slope of an edge that is nearly level may exceed double range.
    share = (middle - start[edge, 1]) / (end[edge, 1] - start[edge, 1])
    abscissa = start[edge, 0] + share * (end[edge, 0] - start[edge, 0])
    order = np.lexsort([abscissa, slab])
    edge, slab, abscissa = edge[order], slab[order], abscissa[order]
    # As many edges rise in a slab as fall, so the sum starts anew from 0 in each.
    winding = np.abs(np.cumsum(np.where(rising[edge], 1, -1)))[:-1]
    heights = np.diff(levels)[slab[:-1]]
    return float(np.sum(winding * heights * np.diff(abscissa)))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
