"""The measures of `study.similarity.score` compiled, for very many pairs of motions.

Each function is its namesake's equal to rounding and takes well under a millisecond, where those on
whole arrays take several. Motions are (samples,) on the same uniform times and finite.

The measures are written twice so that a score does not rest on one hand's work: there they read as
their definitions do, on whole arrays, here they are loops. Loops over plain numbers,
for what numba puts in the place of numpy's sorting, interpolation and array arithmetic takes longer
to compile than all that is here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

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
Ints = NDArray[np.int64]

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


GAPS = (701, 301, 132, 57, 23, 10, 4, 1)
"""Gaps of Shell's sort, after Ciura (2001)."""


def _compiled(*, inner: bool = True) -> Callable[[Any], Any]:
    """Compile a function and keep it on disk; one that is `inner` has no way in from Python."""
    return njit(cache=True, error_model="numpy", no_cpython_wrapper=inner, no_cfunc_wrapper=True)


def scores(
    displacement: Floats, velocity: Floats, true_displacement: Floats, true_velocity: Floats
) -> Floats:
    """Scores (7,) of a motion against a reference that moves, in the order of COLUMNS.

    Put together in Python: each level of compiled functions compiles those below once more.
    """
    pairs = (displacement, true_displacement), (velocity, true_velocity)
    found = [measure(*pair) for pair in pairs for measure in (relative_l2, iso_18571)]
    x, y = (float(np.abs(true).max()) for _, true in pairs)
    plane = plane_scores(displacement, velocity, true_displacement, true_velocity, x, y)
    return np.concatenate((found, plane))


def compile_measures() -> None:
    """Compile all measures where they are not kept on disk, some ten seconds' work."""
    ramp = np.linspace(0.0, 1.0, 8)
    scores(ramp, ramp, 0.9 * ramp, 1.1 * ramp)


@_compiled(inner=False)
def plane_scores(
    displacement: Floats,
    velocity: Floats,
    true_displacement: Floats,
    true_velocity: Floats,
    x: float,
    y: float,
) -> Floats:
    """Scores (3,) of the phase plane, its axes divided by x [m] and y [m/s]."""
    own, other = np.empty((POINT_COUNT, 2)), np.empty((POINT_COUNT, 2))
    resample(displacement, velocity, x, y, own)
    resample(true_displacement, true_velocity, x, y, other)
    length, true_length = _arc_length(own), _arc_length(other)
    found = np.empty(3)
    found[0] = 1.0 / (1.0 + frechet(own, other))
    found[1] = 1.0 / (1.0 + area(own, other))
    if length[-1] > true_length[-1]:
        own, length, other, true_length = other, true_length, own, length
    found[2] = 1.0 / (1.0 + partial_mapping(own, length, other, true_length))
    return found


@_compiled(inner=False)
def relative_l2(c: Floats, r: Floats) -> float:
    """max(0, 1 - ||c - r|| / ||r||)."""
    apart, size = 0.0, 0.0
    for i in range(len(r)):
        apart += (c[i] - r[i]) ** 2
        size += r[i] ** 2
    return max(0.0, 1.0 - math.sqrt(apart / size))


@_compiled()
def _reach(r: Floats) -> float:
    """Largest size."""
    reach = 0.0
    for x in r:
        reach = max(reach, abs(x))
    return reach


def iso_18571(c: Floats, r: Floats) -> float:
    """Overall rating, see `study.similarity.iso18571`."""
    corridor, phase, magnitude, slope = iso_18571_parts(c, r)
    return 0.4 * corridor + 0.2 * (phase + magnitude + slope)


@_compiled(inner=False)
def iso_18571_parts(c: Floats, r: Floats) -> tuple[float, float, float, float]:
    """Corridor, phase, magnitude and slope of the rating, each in [0, 1]."""
    n, shift = len(r), _best_shift(c, r)
    count, late, early = n - abs(shift), max(shift, 0), max(-shift, 0)
    cs, rs = c[late : late + count], r[early : early + count]
    apart, size = _slope_sums(cs, rs)
    phase = _part(float(abs(shift)), float(n), SHIFT_LIMIT)
    return _corridor(c, r), phase, _magnitude(cs, rs), _part(apart, size, SLOPE_LIMIT)


@_compiled()
def _part(error: float, size: float, limit: float) -> float:
    if error == 0.0:
        return 1.0
    return 0.0 if error >= limit * size else 1.0 - error / (limit * size)


@_compiled()
def _corridor(c: Floats, r: Floats) -> float:
    reach, total = _reach(r), 0.0
    for i in range(len(r)):
        inside = (OUTER_CORRIDOR - abs(c[i] - r[i]) / reach) / (OUTER_CORRIDOR - INNER_CORRIDOR)
        total += min(max(inside, 0.0), 1.0) ** 2
    return total / len(r)


@_compiled()
def _correlation(x: Floats, y: Floats) -> float:
    mx, my, raw_x, raw_y, xx, yy, xy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        mx += x[i]
        my += y[i]
    mx, my = mx / len(x), my / len(x)
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


@_compiled()
def _best_shift(c: Floats, r: Floats) -> int:
    n, best, highest = len(r), 0, _correlation(c, r)
    for m in range(1, math.floor(SHIFT_LIMIT * n) + 1):
        late, early = _correlation(c[m:], r[: n - m]), _correlation(c[: n - m], r[m:])
        if late > highest + CORRELATION_TIE:
            best, highest = m, late
        if early > highest + CORRELATION_TIE:
            best, highest = -m, early
    return best


@_compiled()
def _magnitude(c: Floats, r: Floats) -> float:
    """Part of the magnitude after warping within a band of the length, whose steps are kept."""
    n = len(r)
    w = math.ceil(WARPING_WINDOW * n) - 1
    steps = np.empty((n, 2 * w + 1), np.uint8)  # of cell (i, j) at column j - i + w
    before, row = np.empty(n + 1), np.empty(n + 1)
    for j in range(n + 1):
        before[j] = row[j] = np.inf
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


@_compiled()
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


@_compiled()
def _slope(y: Floats) -> Floats:
    n = len(y)
    total = np.empty(n + 1)
    total[0] = 0.0
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


@_compiled()
def _slope_sums(c: Floats, r: Floats) -> tuple[float, float]:
    sc, sr = _slope(c), _slope(r)
    apart, size = 0.0, 0.0
    for i in range(len(r)):
        apart += abs(sc[i] - sr[i])
        size += abs(sr[i])
    return apart, size


@_compiled()
def resample(x: Floats, y: Floats, by_x: float, by_y: float, points: Floats) -> None:
    """Set points (200, 2) at equal steps of arc length on axes divided by these."""
    n = len(x)
    length = np.empty(n)
    length[0] = 0.0
    for i in range(1, n):
        dx, dy = x[i] / by_x - x[i - 1] / by_x, y[i] / by_y - y[i - 1] / by_y
        length[i] = length[i - 1] + math.hypot(dx, dy)
    step, k = length[-1] / (len(points) - 1), 0
    for p in range(len(points)):
        at = step * p
        while k < n - 2 and length[k + 1] <= at:
            k += 1
        width = length[k + 1] - length[k]
        share = (at - length[k]) / width if at < length[-1] and width > 0.0 else 1.0
        points[p, 0] = (x[k] + share * (x[k + 1] - x[k])) / by_x
        points[p, 1] = (y[k] + share * (y[k + 1] - y[k])) / by_y
    points[-1, 0], points[-1, 1] = x[-1] / by_x, y[-1] / by_y


@_compiled()
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


@_compiled()
def area(a: Floats, b: Floats) -> float:
    """Area between two curves (200, 2), see `study.similarity.enclosed_area`."""
    edges = _edges(a, b)
    crossings = _crossings(edges)
    n, m = len(edges), len(crossings)
    levels, rank = np.empty(2 * n + m), np.empty(2 * n + m, np.int64)
    for i in range(n):
        levels[i], levels[n + i] = edges[i, 1], edges[i, 3]
    for i in range(m):
        levels[2 * n + i] = crossings[i]
    _sort(levels, rank, len(levels))
    return _between(edges, levels)


@_compiled()
def _edges(a: Floats, b: Floats) -> Floats:
    """Rows x, y of the lower and of the upper end and the sense, 1 up, of each edge not level.

    Of the way along one curve and back along the other. By their lower ends, so that the edges at
    some height are found without looking at all.
    """
    n, count = len(a) + len(b), 0
    found, low, rank = np.empty((n, 5)), np.empty(n), np.empty(n, np.int64)
    for i in range(n):
        j = (i + 1) % n
        p = a[i] if i < len(a) else b[n - 1 - i]
        q = a[j] if j < len(a) else b[n - 1 - j]
        if p[1] == q[1]:
            continue
        up = p[1] < q[1]
        found[count, 0], found[count, 1] = (p[0], p[1]) if up else (q[0], q[1])
        found[count, 2], found[count, 3] = (q[0], q[1]) if up else (p[0], p[1])
        found[count, 4] = 1.0 if up else -1.0
        low[count], rank[count] = found[count, 1], count
        count += 1
    _sort(low, rank, count)
    edges = np.empty((count, 5))
    for i in range(count):
        for k in range(5):
            edges[i, k] = found[rank[i], k]
    return edges


@_compiled()
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
                    found = _enlarged(found)
                found[count] = y + share * dy
                count += 1
    return found[:count]


@_compiled()
def _enlarged(a: Floats) -> Floats:
    """The numbers with room for as many more."""
    made = np.empty(2 * len(a))
    for i in range(len(a)):
        made[i] = a[i]
    return made


@_compiled()
def _between(edges: Floats, levels: Floats) -> float:
    """Integral of the winding number's size over the slabs between levels."""
    here, at = np.empty(len(edges), np.int64), np.empty(len(edges))
    total, active, waiting = 0.0, 0, 0
    for k in range(len(levels) - 1):
        low, high = levels[k], levels[k + 1]
        if low == high:
            continue
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


@_compiled()
def _sort(keys: Floats, with_them: Ints, count: int) -> None:
    """Sort the first of some keys, and what goes with them, after Shell."""
    for gap in GAPS:
        for i in range(gap, count):
            x, other, j = keys[i], with_them[i], i
            while j >= gap and keys[j - gap] > x:
                keys[j], with_them[j] = keys[j - gap], with_them[j - gap]
                j -= gap
            keys[j], with_them[j] = x, other


@_compiled()
def partial_mapping(shorter: Floats, own: Floats, longer: Floats, other: Floats) -> float:
    """Mean gap after sliding the shorter curve along the longer one, both (200, 2).

    `own`, `other` (200,): their lengths up to each point.
    """
    least, step = np.inf, (other[-1] - own[-1]) / (OFFSET_COUNT - 1)
    for n in range(OFFSET_COUNT):
        least = min(least, _gaps(shorter, own, longer, other, n * step))
    return least / other[-1]


@_compiled()
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


@_compiled()
def _arc_length(points: Floats) -> Floats:
    length = np.empty(len(points))
    length[0] = 0.0
    for i in range(1, len(points)):
        step = math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1])
        length[i] = length[i - 1] + step
    return length
