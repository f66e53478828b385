"""The measures of `study.similarity.score` compiled, for very many pairs of motions.

Each function is its namesake's equal to rounding and takes well under a millisecond, where that of
a library takes several. Motions are (samples,) on the same uniform times and finite.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from study.similarity.iso18571 import (
    CORRELATION_TIE,
    INNER_CORRIDOR,
    MAGNITUDE_LIMIT,
    OUTER_CORRIDOR,
    SHIFT_LIMIT,
    SLOPE_LIMIT,
    WARPING_WINDOW,
)
from study.similarity.phase_plane import OFFSET_COUNT, POINT_COUNT

Floats = NDArray[np.float64]

COLUMNS = (
    ("displacement", "relative-l2"),
    ("displacement", "iso-18571"),
    ("velocity", "relative-l2"),
    ("velocity", "iso-18571"),
    ("phase-plane", "frechet"),
    ("phase-plane", "area"),
    ("phase-plane", "pcm"),
)
"""Curve and measure of each score that `scores` gives, in its order."""


@njit(cache=True)
def scores(
    displacement: Floats, velocity: Floats, true_displacement: Floats, true_velocity: Floats
) -> Floats:
    """Scores (7,) of a motion against a reference that moves, in the order of COLUMNS."""
    found = np.empty(7)
    found[0] = relative_l2(displacement, true_displacement)
    found[1] = iso_18571(displacement, true_displacement)
    found[2] = relative_l2(velocity, true_velocity)
    found[3] = iso_18571(velocity, true_velocity)
    x, y = np.abs(true_displacement).max(), np.abs(true_velocity).max()
    found[4:] = plane_scores(displacement, velocity, true_displacement, true_velocity, x, y)
    return found


@njit(cache=True)
def plane_scores(
    displacement: Floats,
    velocity: Floats,
    true_displacement: Floats,
    true_velocity: Floats,
    x: float,
    y: float,
) -> Floats:
    """Scores (3,) of the phase plane, its axes divided by x [m] and y [m/s]."""
    found = np.empty(3)
    own = resampled(displacement / x, velocity / y)
    other = resampled(true_displacement / x, true_velocity / y)
    found[0] = 1.0 / (1.0 + frechet(own, other))
    found[1] = 1.0 / (1.0 + area(own, other))
    if _arc_length(own)[-1] <= _arc_length(other)[-1]:
        found[2] = 1.0 / (1.0 + partial_mapping(own, other))
    else:
        found[2] = 1.0 / (1.0 + partial_mapping(other, own))
    return found


@njit(cache=True)
def relative_l2(c: Floats, r: Floats) -> float:
    """max(0, 1 - ||c - r|| / ||r||)."""
    apart, size = 0.0, 0.0
    for i in range(len(r)):
        apart += (c[i] - r[i]) ** 2
        size += r[i] ** 2
    return max(0.0, 1.0 - math.sqrt(apart / size))


@njit(cache=True)
def iso_18571(c: Floats, r: Floats) -> float:
    """Overall rating, see `study.similarity.iso18571`."""
    corridor, phase, magnitude, slope = iso_18571_parts(c, r)
    return 0.4 * corridor + 0.2 * (phase + magnitude + slope)


@njit(cache=True)
def iso_18571_parts(c: Floats, r: Floats) -> tuple[float, float, float, float]:
    """Corridor, phase, magnitude and slope of the rating, each in [0, 1]."""
    n, shift = len(r), _best_shift(c, r)
    count, late, early = n - abs(shift), max(shift, 0), max(-shift, 0)
    cs, rs = c[late : late + count], r[early : early + count]
    apart, size = _slope_sums(cs, rs)
    phase = _part(float(abs(shift)), float(n), SHIFT_LIMIT)
    return _corridor(c, r), phase, _magnitude(cs, rs), _part(apart, size, SLOPE_LIMIT)


@njit(cache=True)
def _part(error: float, size: float, limit: float) -> float:
    if error == 0.0:
        return 1.0
    return 0.0 if error >= limit * size else 1.0 - error / (limit * size)


@njit(cache=True)
def _corridor(c: Floats, r: Floats) -> float:
    reach, total = np.abs(r).max(), 0.0
    for i in range(len(r)):
        inside = (OUTER_CORRIDOR - abs(c[i] - r[i]) / reach) / (OUTER_CORRIDOR - INNER_CORRIDOR)
        total += min(max(inside, 0.0), 1.0) ** 2
    return total / len(r)


@njit(cache=True)
def _correlation(x: Floats, y: Floats) -> float:
    mx, my, raw_x, raw_y, xx, yy, xy = x.mean(), y.mean(), 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        dx, dy = x[i] - mx, y[i] - my
        raw_x += x[i] * x[i]
        raw_y += y[i] * y[i]
        xx += dx * dx
        yy += dy * dy
        xy += dx * dy
    if xx <= 1e-24 * raw_x or yy <= 1e-24 * raw_y:
        return -math.inf
    return xy / math.sqrt(xx * yy)


@njit(cache=True)
def _best_shift(c: Floats, r: Floats) -> int:
    n, best, highest = len(r), 0, _correlation(c, r)
    for m in range(1, math.floor(SHIFT_LIMIT * n) + 1):
        late, early = _correlation(c[m:], r[: n - m]), _correlation(c[: n - m], r[m:])
        if late > highest + CORRELATION_TIE:
            best, highest = m, late
        if early > highest + CORRELATION_TIE:
            best, highest = -m, early
    return best


@njit(cache=True)
def _magnitude(c: Floats, r: Floats) -> float:
    """Part of the magnitude after warping within a band of the length, whose steps are kept."""
    n = len(r)
    w = math.ceil(WARPING_WINDOW * n) - 1
    steps = np.empty((n, 2 * w + 1), np.uint8)  # of cell (i, j) at column j - i + w
    before, row = np.full(n + 1, np.inf), np.full(n + 1, np.inf)
    before[0] = 0.0
    for i in range(n):
        low, high = max(0, i - w), min(n - 1, i + w)
        row[low] = np.inf  # what an older row left beside the band
        for j in range(low, high + 1):
            up, left, corner = before[j + 1], row[j], before[j]
            step = 0 if up <= left and up <= corner else (1 if left <= corner else 2)
            row[j + 1] = (c[i] - r[j]) ** 2 + min(up, left, corner)
            steps[i, j - i + w] = step
        if high + 2 <= n:
            row[high + 2] = np.inf
        before, row = row, before
    return _warped(c, r, steps, w)


@njit(cache=True)
def _warped(c: Floats, r: Floats, steps: NDArray[np.uint8], w: int) -> float:
    """The part along the path of these steps, traced back from the ends."""
    i = j = len(r) - 1
    apart, size = abs(c[i] - r[j]), abs(r[j])
    while i > 0 or j > 0:
        step = steps[i, j - i + w]
        i, j = i - (step != 1), j - (step != 0)
        apart += abs(c[i] - r[j])
        size += abs(r[j])
    return _part(apart, size, MAGNITUDE_LIMIT)


@njit(cache=True)
def _slope(y: Floats) -> Floats:
    n = len(y)
    total = np.zeros(n + 1)
    for i in range(n):
        if i == 0:
            slope = y[1] - y[0]
        elif i == n - 1:
            slope = y[n - 1] - y[n - 2]
        else:
            slope = 0.5 * (y[i + 1] - y[i - 1])
        total[i + 1] = total[i] + slope
    smooth = np.empty(n)
    for i in range(n):
        half = min(4, i, n - 1 - i)
        smooth[i] = (total[i + half + 1] - total[i - half]) / (2 * half + 1)
    return smooth


@njit(cache=True)
def _slope_sums(c: Floats, r: Floats) -> tuple[float, float]:
    sc, sr = _slope(c), _slope(r)
    return np.abs(sc - sr).sum(), np.abs(sr).sum()


@njit(cache=True)
def resampled(x: Floats, y: Floats) -> Floats:
    """Points (200, 2) at equal steps of arc length."""
    n = len(x)
    length = np.zeros(n)
    for i in range(1, n):
        length[i] = length[i - 1] + math.hypot(x[i] - x[i - 1], y[i] - y[i - 1])
    at = np.linspace(0.0, length[-1], POINT_COUNT)
    points = np.empty((POINT_COUNT, 2))
    points[:, 0], points[:, 1] = np.interp(at, length, x), np.interp(at, length, y)
    return points


@njit(cache=True)
def frechet(a: Floats, b: Floats) -> float:
    """Discrete Frechet distance of two curves (200, 2)."""
    n, m = len(a), len(b)
    row = np.empty(m)  # squared, as the order of gaps is that of their squares
    for i in range(n):
        corner = 0.0
        for j in range(m):
            gap = (a[i, 0] - b[j, 0]) ** 2 + (a[i, 1] - b[j, 1]) ** 2
            if i == 0:
                before = row[j - 1] if j else 0.0
            elif j == 0:
                before = row[0]
            else:
                before = min(row[j], row[j - 1], corner)
            corner = row[j]
            row[j] = max(before, gap)
    return math.sqrt(row[-1])


@njit(cache=True)
def area(a: Floats, b: Floats) -> float:
    """Area between two curves (200, 2), see `study.similarity.enclosed_area`."""
    edges = _edges(np.concatenate((a, b[::-1])))
    if len(edges) == 0:
        return 0.0
    ends = np.concatenate((edges[:, 1], edges[:, 3]))
    return _between(edges, np.unique(np.concatenate((ends, _crossings(edges)))))


@njit(cache=True)
def _edges(polygon: Floats) -> Floats:
    """Rows x, y of the lower and of the upper end and the sense, 1 up, of each edge not level.

    By their lower ends, so that the edges at some height are found without looking at all.
    """
    n, count = len(polygon), 0
    found = np.empty((n, 5))
    for i in range(n):
        p, q = polygon[i], polygon[(i + 1) % n]
        if p[1] == q[1]:
            continue
        low, high = (p, q) if p[1] < q[1] else (q, p)
        found[count, 0], found[count, 1] = low[0], low[1]
        found[count, 2], found[count, 3] = high[0], high[1]
        found[count, 4] = 1.0 if p[1] < q[1] else -1.0
        count += 1
    found = found[:count]
    return found[np.argsort(found[:, 1])]


@njit(cache=True)
def _crossings(edges: Floats) -> Floats:
    """Ordinates at which two of the edges cross."""
    count, found = 0, np.empty(64)
    for i in range(len(edges)):
        x, y, high = edges[i, 0], edges[i, 1], edges[i, 3]
        dx, dy = edges[i, 2] - x, high - y
        for j in range(i + 1, len(edges)):
            if edges[j, 1] >= high:
                break
            ex, ey = edges[j, 2] - edges[j, 0], edges[j, 3] - edges[j, 1]
            turn = dx * ey - dy * ex
            if turn == 0.0:
                continue
            ax, ay = edges[j, 0] - x, edges[j, 1] - y
            share, other = (ax * ey - ay * ex) / turn, (ax * dy - ay * dx) / turn
            if 0.0 < share < 1.0 and 0.0 < other < 1.0:
                if count == len(found):
                    found = np.concatenate((found, np.empty(count)))
                found[count] = y + share * dy
                count += 1
    return found[:count]


@njit(cache=True)
def _between(edges: Floats, levels: Floats) -> float:
    """Integral of the winding number's size over the slabs between levels."""
    here, at = np.empty(len(edges), np.int64), np.empty(len(edges))
    total, active, waiting = 0.0, 0, 0
    for k in range(len(levels) - 1):
        low, high = levels[k], levels[k + 1]
        kept = 0
        for i in range(active):
            if edges[here[i], 3] >= high:
                here[kept] = here[i]
                kept += 1
        while waiting < len(edges) and edges[waiting, 1] <= low:
            here[kept] = waiting
            kept, waiting = kept + 1, waiting + 1
        active, middle = kept, 0.5 * (low + high)
        for i in range(active):
            x0, y0 = edges[here[i], 0], edges[here[i], 1]
            x1, y1 = edges[here[i], 2], edges[here[i], 3]
            at[i] = x0 + (middle - y0) / (y1 - y0) * (x1 - x0)
        _sort(at, here, active)
        winding, width = 0.0, 0.0
        for m in range(active - 1):
            winding += edges[here[m], 4]
            width += abs(winding) * (at[m + 1] - at[m])
        total += width * (high - low)
    return total


@njit(cache=True)
def _sort(at: Floats, here: NDArray[np.int64], count: int) -> None:
    """By insertion: few edges are at one height, and their order hardly changes between slabs."""
    for i in range(1, count):
        x, edge, j = at[i], here[i], i
        while j and at[j - 1] > x:
            at[j], here[j] = at[j - 1], here[j - 1]
            j -= 1
        at[j], here[j] = x, edge


@njit(cache=True)
def partial_mapping(shorter: Floats, longer: Floats) -> float:
    """Mean gap after sliding the shorter curve along the longer one, both (200, 2)."""
    own, other = _arc_length(shorter), _arc_length(longer)
    least = np.inf
    for offset in np.linspace(0.0, other[-1] - own[-1], OFFSET_COUNT):
        least = min(least, _gaps(shorter, own, longer, other, offset))
    return least / other[-1]


@njit(cache=True)
def _gaps(shorter: Floats, own: Floats, longer: Floats, other: Floats, offset: float) -> float:
    """Integral of the gap over the longer curve, the shorter's ends held."""
    last, total, before, k = len(own) - 1, 0.0, 0.0, 0
    for i in range(len(other)):
        at = min(max(other[i] - offset, 0.0), own[last])
        while k < last - 1 and own[k + 1] < at:
            k += 1
        width = own[k + 1] - own[k]
        share = (at - own[k]) / width if width > 0.0 else 0.0
        x = shorter[k, 0] + share * (shorter[k + 1, 0] - shorter[k, 0])
        y = shorter[k, 1] + share * (shorter[k + 1, 1] - shorter[k, 1])
        gap = math.sqrt((x - longer[i, 0]) ** 2 + (y - longer[i, 1]) ** 2)
        if i:
            total += 0.5 * (gap + before) * (other[i] - other[i - 1])
        before = gap
    return total


@njit(cache=True)
def _arc_length(points: Floats) -> Floats:
    length = np.zeros(len(points))
    for i in range(1, len(points)):
        step = math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1])
        length[i] = length[i - 1] + step
    return length
