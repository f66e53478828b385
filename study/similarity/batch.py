"""The measures of `study.similarity.score` compiled, for very many pairs of motions.

Each function is its namesake's equal to rounding and takes well under a millisecond, where those on
whole arrays take several. Motions are (samples,) on the same uniform times and finite.

The measures are written twice so that a score does not rest on one hand's work: there they read as
their definitions do, on whole arrays, here they are mostly loops. Compilation is kept short: loops
are over plain numbers, for what numba puts in the place of numpy's sorting, interpolation and array
arithmetic takes longer to compile than all that is here; arrays are made in Python; and it calls
each measure, since each level of compiled functions compiles those below once more.
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
ROOM = 512
"""Crossings for which there is room at first: more than most pairs of curves have."""


def _compiled(*, inner: bool = False) -> Callable[[Any], Any]:
    """Compile a function that makes no array, and keep it on disk.

    One that is `inner` has no way in from Python.
    """
    options = {"no_cpython_wrapper": inner, "no_cfunc_wrapper": True, "_nrt": False}
    return njit(cache=True, error_model="numpy", **options)


def scores(
    displacement: Floats, velocity: Floats, true_displacement: Floats, true_velocity: Floats
) -> Floats:
    """Scores (7,) of a motion against a reference that moves, in the order of COLUMNS."""
    pairs = (displacement, true_displacement), (velocity, true_velocity)
    found = [measure(*pair) for pair in pairs for measure in (relative_l2, iso_18571)]
    x, y = (float(np.abs(true).max()) for _, true in pairs)
    plane = plane_scores(displacement, velocity, true_displacement, true_velocity, x, y)
    return np.concatenate((found, plane))


def compile_measures() -> None:
    """Compile all measures where they are not kept on disk, some seconds' work."""
    ramp = np.linspace(0.0, 1.0, 8)
    scores(ramp, ramp, 0.9 * ramp, 1.1 * ramp)


def plane_scores(
    displacement: Floats,
    velocity: Floats,
    true_displacement: Floats,
    true_velocity: Floats,
    x: float,
    y: float,
) -> Floats:
    """Scores (3,) of the phase plane, its axes divided by x [m] and y [m/s]."""
    own, other = np.empty((2, POINT_COUNT, 2))
    lengths, room = np.empty((2, POINT_COUNT)), np.empty(len(displacement))
    resample(displacement, velocity, x, y, room, own)
    resample(true_displacement, true_velocity, x, y, room, other)
    for points, length in zip((own, other), lengths, strict=True):
        arc_length(points, length)
    distances = frechet(own, other, np.empty(len(other))), area(own, other)
    curves = sorted(zip((own, other), lengths, strict=True), key=lambda curve: curve[1][-1])
    mapping = partial_mapping(*curves[0], *curves[1])
    return 1.0 / (1.0 + np.array((*distances, mapping)))


@_compiled()
def relative_l2(c: Floats, r: Floats) -> float:
    """max(0, 1 - ||c - r|| / ||r||)."""
    apart, size = 0.0, 0.0
    for i in range(len(r)):
        apart += (c[i] - r[i]) ** 2
        size += r[i] ** 2
    return max(0.0, 1.0 - math.sqrt(apart / size))


def iso_18571(c: Floats, r: Floats) -> float:
    """Overall rating, see `study.similarity.iso18571`."""
    corridor, phase, magnitude, slope = iso_18571_parts(c, r)
    return 0.4 * corridor + 0.2 * (phase + magnitude + slope)


def iso_18571_parts(c: Floats, r: Floats) -> tuple[float, float, float, float]:
    """Corridor, phase, magnitude and slope of the rating, each in [0, 1]."""
    n, shift = len(r), best_shift(c, r)
    count, late, early = n - abs(shift), max(shift, 0), max(-shift, 0)
    cs, rs = c[late : late + count], r[early : early + count]
    width = math.ceil(WARPING_WINDOW * count) - 1
    steps = np.empty((count, 2 * width + 1), np.uint8)
    gap, size = magnitude(cs, rs, width, steps, *np.empty((2, count + 1)))
    slope_gap, slope_size = slope(cs, rs, np.empty((2, count + 1)), np.empty((2, count)))
    phase = _part(float(abs(shift)), float(n), SHIFT_LIMIT)
    return (
        corridor(c, r),
        phase,
        _part(gap, size, MAGNITUDE_LIMIT),
        _part(slope_gap, slope_size, SLOPE_LIMIT),
    )


def _part(error: float, size: float, limit: float) -> float:
    if error == 0.0:
        return 1.0
    return 0.0 if error >= limit * size else 1.0 - error / (limit * size)


@_compiled()
def corridor(c: Floats, r: Floats) -> float:
    """Rating of the distance of the motions at each time, relative to the largest displacement."""
    reach, total = 0.0, 0.0
    for x in r:
        reach = max(reach, abs(x))
    for i in range(len(r)):
        inside = (OUTER_CORRIDOR - abs(c[i] - r[i]) / reach) / (OUTER_CORRIDOR - INNER_CORRIDOR)
        total += min(max(inside, 0.0), 1.0) ** 2
    return total / len(r)


@_compiled(inner=True)
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
def best_shift(c: Floats, r: Floats) -> int:
    """Number of samples by which c is late that makes the two most alike."""
    n, best, highest = len(r), 0, _correlation(c, r)
    for m in range(1, math.floor(SHIFT_LIMIT * n) + 1):
        late, early = _correlation(c[m:], r[: n - m]), _correlation(c[: n - m], r[m:])
        if late > highest + CORRELATION_TIE:
            best, highest = m, late
        if early > highest + CORRELATION_TIE:
            best, highest = -m, early
    return best


@_compiled()
def magnitude(
    c: Floats, r: Floats, w: int, steps: NDArray[np.uint8], before: Floats, row: Floats
) -> tuple[float, float]:
    """Sums of the gaps and of the sizes after warping within w samples.

    The steps (n, 2 w + 1) of the warping are kept; `before`, `row` (n + 1,): to work in.
    """
    n = len(r)  # the step of cell (i, j) is at column j - i + w
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


@_compiled(inner=True)
def _warped(c: Floats, r: Floats, steps: NDArray[np.uint8], w: int) -> tuple[float, float]:
    """The sums along the path of these steps, traced back from the ends."""
    i = j = len(r) - 1
    apart, size = abs(c[i] - r[j]), abs(r[j])
    while i > 0 or j > 0:
        step = steps[i, j - i + w]
        i, j = i - (step != 1), j - (step != 0)
        apart += abs(c[i] - r[j])
        size += abs(r[j])
    return apart, size


@_compiled(inner=True)
def _slope(y: Floats, total: Floats, smooth: Floats) -> None:
    n = len(y)
    total[0] = 0.0
    for i in range(n):
        if i == 0:
            slope = y[1] - y[0]
        elif i == n - 1:
            slope = y[n - 1] - y[n - 2]
        else:
            slope = 0.5 * (y[i + 1] - y[i - 1])
        total[i + 1] = total[i] + slope
    for i in range(n):
        half = min(4, i, n - 1 - i)
        smooth[i] = (total[i + half + 1] - total[i - half]) / (2 * half + 1)


@_compiled()
def slope(c: Floats, r: Floats, total: Floats, smooth: Floats) -> tuple[float, float]:
    """Sums of the gaps and of the sizes of the smoothed slopes.

    `total` (2, n + 1), `smooth` (2, n): to work in.
    """
    _slope(c, total[0], smooth[0])
    _slope(r, total[1], smooth[1])
    apart, size = 0.0, 0.0
    for i in range(len(r)):
        apart += abs(smooth[0, i] - smooth[1, i])
        size += abs(smooth[1, i])
    return apart, size


@_compiled()
def resample(
    x: Floats, y: Floats, by_x: float, by_y: float, length: Floats, points: Floats
) -> None:
    """Set points (200, 2) at equal steps of arc length on axes divided by these.

    `length` (n,): to work in.
    """
    n = len(x)
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
def frechet(a: Floats, b: Floats, row: Floats) -> float:
    """Discrete Frechet distance of two curves (200, 2); `row` (200,): to work in."""
    n, m = len(a), len(b)  # gaps are squared, which keeps their order
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


def area(a: Floats, b: Floats) -> float:
    """Area between two curves (200, 2), see `study.similarity.enclosed_area`."""
    edges = _edges(a, b)
    found = np.empty(ROOM)
    count = crossings(edges, found)
    if count > len(found):
        found = np.empty(count)
        crossings(edges, found)
    levels = np.sort(np.concatenate((edges[:, 1], edges[:, 3], found[:count])))
    return float(between(edges, levels, np.empty(len(edges), np.int64), np.empty(len(edges))))


def _edges(a: Floats, b: Floats) -> Floats:
    """Rows x, y of the lower and of the upper end and the sense, 1 up, of each edge not level.

    Of the way along one curve and back along the other. By their lower ends, so that the edges at
    some height are found without looking at all.
    """
    start = np.concatenate((a, b[::-1]))
    end = np.roll(start, -1, axis=0)
    sense = np.sign(end[:, 1:] - start[:, 1:])
    low, high = np.where(sense > 0.0, start, end), np.where(sense > 0.0, end, start)
    edges = np.concatenate((low, high, sense), axis=1)[sense[:, 0] != 0.0]
    return edges[np.argsort(edges[:, 1])]


@_compiled()
def crossings(edges: Floats, found: Floats) -> int:
    """Number of crossings of two of the edges; their ordinates, as many as there is room for."""
    count = 0
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
                if count < len(found):
                    found[count] = y + share * dy
                count += 1
    return count


@_compiled()
def between(edges: Floats, levels: Floats, here: Ints, at: Floats) -> float:
    """Integral of the winding number's size over the slabs between levels.

    `here`, `at` (edges,): to work in.
    """
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


@_compiled(inner=True)
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


@_compiled(inner=True)
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
def arc_length(points: Floats, length: Floats) -> None:
    """Set the lengths (200,) of a curve (200, 2) up to each point."""
    length[0] = 0.0
    for i in range(1, len(points)):
        step = math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1])
        length[i] = length[i - 1] + step
