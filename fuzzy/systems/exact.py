"""Centroids of the continuous output curve by adaptive quadrature, without sampling error.

The curve is a maximum of clipped sets and smooth between its kinks. Clenshaw-Curtis quadrature is
applied to panels bounded by the corners of the sets. Panels with a large contribution to the error
of the centroid are subdivided until the sum of all contributions is below TOLERANCE times the width
of the universe. A contribution is the difference to the rule with half as many points, plus a bound
for kinks between the points.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fuzzy.systems.sets import (
    Array,
    FuzzySet,
    core,
    corners,
    has_core,
    lower_membership,
    upper_membership,
)
from fuzzy.systems.system import FuzzySystem, Membership, Variable, memberships

TOLERANCE = 1e-10
"""Largest estimated error of a centroid, relative to the width of the universe."""

PANELS = 64
CUTS = 8
MOST_PANELS = 100_000
MEMBERSHIPS_AT_ONCE = 2_000_000
NEWTON_STEPS = 100
STILL = 1e-13
# Points at the ends of a panel lie this far inside, over the largest coordinate: at a vertical
# flank the value belongs to one of the two sides, and rounding may move the flank.
HAIR = 1e-14
# Smaller areas lose their digits to underflow.
LEAST_AREA = 1e-290
RISING_FROM_0 = ("trimf", "trapmf", "pimf", "smf", "linsmf")
FALLING_TO_0 = ("trimf", "trapmf", "pimf", "zmf", "linzmf")


def _clenshaw_curtis(intervals: int) -> tuple[Array, Array]:
    """Points on [0, 1], both ends included, and weights exact for polynomials through them."""
    x = -np.cos(np.pi * np.arange(intervals + 1) / intervals)
    even = np.arange(0, intervals + 1, 2)
    integrals = np.zeros(intervals + 1)
    integrals[even] = 2.0 / (1.0 - even**2.0)
    basis = np.polynomial.chebyshev.chebvander(x, intervals)
    return 0.5 * (1.0 + x), np.asarray(0.5 * np.linalg.solve(basis.T, integrals))


NODES, WEIGHTS = _clenshaw_curtis(16)
EXCESS = WEIGHTS.copy()
"""Weights of the difference to the rule with every second point."""
EXCESS[::2] -= _clenshaw_curtis(8)[1]


class Union(NamedTuple):
    """The union of a system's output sets implied at `heights` (sets,)."""

    system: FuzzySystem
    heights: Array
    membership: Membership

    def value(self, y: Array) -> Array:
        """Membership in the union at points y of any shape."""
        return np.asarray(self._implied(self._memberships(y)).max(axis=0))

    def with_distances(self, y: Array) -> tuple[Array, Array]:
        """The curve at points y, and D distances to kinks, shape (D, *y.shape).

        They change sign where the largest set changes, where it is clipped (not for a product) and
        where the curve rises from 0, in this order.
        """
        mu = self._memberships(y)
        implied = self._implied(mu)
        winner = implied.argmax(axis=0)[None]
        value = np.take_along_axis(implied, winner, axis=0)
        if self.system.operators.implication == "prod":
            return value[0], np.concatenate([value - implied, value])
        beyond = np.take_along_axis(mu - self._heights(y), winner, axis=0)
        # However far a set rises above its height, the curve differs by its value at most.
        clipped = np.clip(beyond, -value, value)
        return value[0], np.concatenate([value - implied, clipped, value])

    def _memberships(self, y: Array) -> Array:
        mu = memberships(self.system.output, y.ravel(), self.membership)
        return mu.reshape(len(mu), *y.shape)

    def _implied(self, mu: Array) -> Array:
        imply = np.multiply if self.system.operators.implication == "prod" else np.minimum
        return np.asarray(imply(self._heights(mu[0]), mu))

    def _heights(self, y: Array) -> Array:
        return self.heights.reshape(-1, *(1,) * y.ndim)


class Panels(NamedTuple):
    """Panels (P,) in rising order over the universe, and integrals (C, P) of the curves on them.

    Moments are about the low end of the universe, their error bounds about the panel's middle.
    """

    left: Array
    right: Array
    area: Array
    moment: Array
    area_doubt: Array
    moment_doubt: Array

    def doubt(self, curve: int, c: float) -> Array:
        """Bound of the error of each panel in the moment of a curve about c."""
        distance = np.abs(0.5 * (self.left + self.right) - self.left[0] - c)
        return np.asarray(self.area_doubt[curve] * distance + self.moment_doubt[curve])


class SwitchPanel(NamedTuple):
    """Where one end of the interval passes from curve `first` to curve `second`.

    It lies on `panel`, near `near` from the low end. `area` and `moment` are those of `first`
    before the panel and `second` after it; `mass` is the least that the area can be with it.
    """

    first: int
    second: int
    panel: int
    near: float
    area: float
    moment: float
    mass: float


class Reduction(NamedTuple):
    """Ends of the type-reduced interval, and Nie and Tan's centroid."""

    interval: tuple[float, float]
    nie_tan: float


LOWER, UPPER = 0, 1


def centroid(system: FuzzySystem, heights: Array, membership: Membership) -> float:
    """Centroid of the union of the output sets implied at `heights` (sets,).

    NaN if it is empty on the universe. ValueError if TOLERANCE cannot be reached.
    """
    panels = _resolved([Union(system, heights, membership)], _parts_of_centroid)
    if panels is None:
        return np.nan
    return system.output.low + float(panels.moment.sum() / panels.area.sum())


def reduce(system: FuzzySystem, lower_heights: Array, upper_heights: Array) -> Reduction:
    """Type reduction of the band between two unions of output sets.

    NaN if the upper one is empty on the universe. If the lower one is, the interval is the support
    of the upper one, whose every point is a set within the band. ValueError if TOLERANCE cannot be
    reached.
    """
    curves = [
        Union(system, lower_heights, lower_membership),
        Union(system, upper_heights, upper_membership),
    ]
    panels = _resolved(curves, _parts_of_interval)
    if panels is None:
        return Reduction((np.nan, np.nan), np.nan)
    middle = system.output.low + float(panels.moment.sum() / panels.area.sum())
    if not _fills(panels.area[LOWER]):
        return Reduction(_support(system.output, upper_heights), middle)
    left, right = (_end(curves, panels, switch) for switch in _switches(panels))
    return Reduction((left, right), middle)


def _fills(area: Array) -> bool:
    return bool(area.sum() > LEAST_AREA)


def _resolved(curves: list[Union], parts: Callable[[Panels], Array]) -> Panels | None:
    """Panels on which the answer is within TOLERANCE; None where the last curve is empty.

    `parts` gives the contribution (P,) of each panel to the error of the answer.
    """
    output = curves[0].system.output
    least = 4 * CUTS * _hair(output)
    ends = _first_ends(output, curves[-1].heights)
    panels = _measured(curves, ends[:-1], ends[1:])
    if not _fills(panels.area[-1]):
        return None
    width = output.high - output.low
    rounding = np.spacing(max(abs(output.low), abs(output.high))) / width
    while True:
        part = parts(panels) / width
        error = float(part.sum() + rounding)
        if error <= TOLERANCE:
            return panels
        cut = (part * part.size > TOLERANCE) & (panels.right - panels.left > least)
        if not cut.any() or part.size > MOST_PANELS:
            raise ValueError(
                f"output {output.name!r}: exact sampling comes within {error:.1g} of the "
                f"universe only, not {TOLERANCE:g}; widen its narrowest set, move the universe "
                "towards 0, or sample by matlab or octave"
            )
        panels = _refined(curves, panels, cut)


def _hair(output: Variable) -> float:
    return HAIR * max(abs(output.low), abs(output.high))


def _first_ends(output: Variable, heights: Array) -> Array:
    """Ends of equal panels, and the corners of the sets in use."""
    used = (one for one, height in zip(output.sets, heights, strict=True) if height > 0)
    same = 4 * _hair(output)  # nearer ones differ by rounding only
    low, high = output.low + same, output.high - same
    inside = [x for one in used for x in corners(one) if low < x < high]
    # numpy.unique would import numpy.ma, a tenth of what a single estimate takes from the start.
    ends = np.sort(np.append(np.linspace(output.low, output.high, PANELS + 1), inside))
    return np.append(ends[:-1][np.diff(ends) > same], output.high)


def _refined(curves: list[Union], panels: Panels, cut: NDArray[np.bool_]) -> Panels:
    """Each panel to `cut` (P,) in CUTS equal ones."""
    ends = np.linspace(panels.left[cut], panels.right[cut], CUTS + 1, axis=-1)
    kept = Panels(*(part[..., ~cut] for part in panels))
    fresh = _measured(curves, ends[:, :-1].ravel(), ends[:, 1:].ravel())
    joined = _joined([kept, fresh])
    order = np.argsort(joined.left)
    return Panels(*(part[..., order] for part in joined))


def _joined(blocks: Sequence[Panels]) -> Panels:
    return Panels(*(np.concatenate(parts, axis=-1) for parts in zip(*blocks, strict=True)))


def _measured(curves: list[Union], left: Array, right: Array) -> Panels:
    """Integrals over panels, in batches that fit into memory."""
    size = max(1, MEMBERSHIPS_AT_ONCE // (NODES.size * curves[0].heights.size))
    starts = range(0, left.size, size)
    return _joined([_block(curves, left[i : i + size], right[i : i + size]) for i in starts])


def _block(curves: list[Union], left: Array, right: Array) -> Panels:
    output = curves[0].system.output
    length = (right - left)[:, None]
    y = _points(left[:, None], right[:, None], _hair(output))
    middle = 0.5 * (left + right) - output.low
    rows = []
    for curve in curves:
        value, distances = curve.with_distances(y)
        value *= length
        arm = value * (length * (NODES - 0.5))
        area, hidden = value @ WEIGHTS, _hidden(distances, y)
        area_doubt = np.abs(value @ EXCESS) + hidden
        moment_doubt = np.abs(arm @ EXCESS) + 0.5 * length[:, 0] * hidden
        rows.append((area, arm @ WEIGHTS + middle * area, area_doubt, moment_doubt))
    return Panels(left, right, *np.array(rows).transpose(1, 0, 2))


def _points(left: float | Array, right: float | Array, hair: float) -> Array:
    """The nodes between left and right, with the outer ones just inside."""
    return np.asarray(np.clip(left + (right - left) * NODES, left + hair, right - hair))


def _hidden(distances: Array, y: Array) -> Array:
    """Bound (P,) of the area error from kinks between points (P, M), at distances (D, P, M).

    The last distance is the value of the curve, which is near 0 without any kink in its tails.
    """
    gap, positive, size = np.diff(y), distances > 0, np.abs(distances[:-1])
    crossed = (positive[..., 1:] != positive[..., :-1]) * np.abs(np.diff(distances))
    before = np.concatenate([size[..., :1], size[..., :-1]], axis=-1)
    after = np.concatenate([size[..., 1:], size[..., -1:]], axis=-1)
    # Between its neighbours a smooth distance sinks by no more than it rises towards them.
    sunk = np.maximum(before + after - 3.0 * size, 0.0) * ((before >= size) & (after >= size))
    missed = sunk.sum(axis=0)
    return np.asarray(((crossed.sum(axis=0) + missed[:, 1:] + missed[:, :-1]) * gap).sum(axis=-1))


def _parts_of_centroid(panels: Panels) -> Array:
    area = panels.area.sum()
    return np.asarray(panels.doubt(0, panels.moment.sum() / area) / area)


def _parts_of_interval(panels: Panels) -> Array:
    """Largest contribution of each panel to the error of either end or Nie and Tan's centroid."""
    area = panels.area.sum()
    middle = panels.moment.sum() / area
    parts = [(panels.doubt(LOWER, middle) + panels.doubt(UPPER, middle)) / area]
    if _fills(panels.area[LOWER]):
        parts += [_part_of_end(panels, switch) for switch in _switches(panels)]
    return np.asarray(np.max(parts, axis=0))


def _part_of_end(panels: Panels, switch: SwitchPanel) -> Array:
    k = switch.panel
    part = np.zeros_like(panels.left)
    part[: k + 1] = panels.doubt(switch.first, switch.near)[: k + 1] / switch.mass
    part[k:] += panels.doubt(switch.second, switch.near)[k:] / switch.mass
    # However little there is on either side, the end is on this panel.
    part[k] = min(part[k], panels.right[k] - panels.left[k])
    return part


def _switches(panels: Panels) -> tuple[SwitchPanel, SwitchPanel]:
    return _switch(panels, UPPER, LOWER), _switch(panels, LOWER, UPPER)


def _switch(panels: Panels, first: int, second: int) -> SwitchPanel:
    """The panel in which the moment about the switch point, which is monotonic, changes sign."""
    areas = _before(panels.area[first]), _after(panels.area[second])
    moments = _before(panels.moment[first]), _after(panels.moment[second])
    ends = np.append(panels.left, panels.right[-1]) - panels.left[0]
    excess = np.add(*moments) - ends * np.add(*areas)
    k = min(max(int(np.count_nonzero(excess > 0)) - 1, 0), panels.left.size - 1)
    fall = excess[k] - excess[k + 1]
    share = min(max(excess[k] / fall, 0.0), 1.0) if fall > 0 else 0.5
    near = float(ends[k] + share * (ends[k + 1] - ends[k]))
    # Not by differences, which would lose a small area beside a large one.
    area, moment = (float(before[k] + after[k + 1]) for before, after in (areas, moments))
    return SwitchPanel(first, second, k, near, area, moment, area + float(panels.area[LOWER, k]))


def _before(integrals: Array) -> Array:
    """Sums over all panels before each end (P + 1,)."""
    return np.append(0.0, np.cumsum(integrals))


def _after(integrals: Array) -> Array:
    """Sums over all panels after each end (P + 1,)."""
    return np.append(np.cumsum(integrals[::-1])[::-1], 0.0)


def _end(curves: list[Union], panels: Panels, switch: SwitchPanel) -> float:
    """The centroid that equals its switch point, by Newton's method safeguarded by bisection.

    The derivative of the moment by the switch point is the area, so a step leads to the centroid.
    """
    origin, start, stop = panels.left[0], panels.left[switch.panel], panels.right[switch.panel]
    still = STILL * (panels.right[-1] - origin)
    low, high, c = start - origin, stop - origin, switch.near
    for _ in range(NEWTON_STEPS):
        area, moment = switch.area, switch.moment
        for curve, left, right in (
            (switch.first, start, c + origin),
            (switch.second, c + origin, stop),
        ):
            y = _points(left, right, _hair(curves[0].system.output))
            mass = (right - left) * WEIGHTS * curves[curve].value(y)
            area, moment = area + mass.sum(), moment + mass @ (y - origin)
        moved = moment / area
        if abs(moved - c) <= still:
            break
        low, high = (c, high) if moved > c else (low, c)
        c = moved if low < moved < high else 0.5 * (low + high)
    return float(origin + c)


def _support(output: Variable, heights: Array) -> tuple[float, float]:
    """Ends of the support of the upper memberships in use, on the universe."""
    spans = [_span(one) for one, height in zip(output.sets, heights, strict=True) if height > 0]
    met = [span for span in spans if span[0] < output.high and span[1] > output.low]
    low, high = min(left for left, _ in met), max(right for _, right in met)
    return float(max(low, output.low)), float(min(high, output.high))


def _span(one: FuzzySet) -> tuple[float, float]:
    """Interval where the upper membership is not 0."""
    p, shift, stretch = one.shape, one.footprint.mean, 1.0 + one.footprint.spread
    ends = core(one) if has_core(one) else (p[0], p[-1])  # which then have nothing to stretch
    left, right = -np.inf, np.inf
    if one.kind in RISING_FROM_0:
        left = ends[0] + stretch * (p[0] - ends[0]) - shift
    if one.kind in FALLING_TO_0:
        right = ends[1] + stretch * (p[-1] - ends[1]) + shift
    return left, right
