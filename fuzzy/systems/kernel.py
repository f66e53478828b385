"""The compiled inner loops of the modules `mamdani`, `sugeno` and `interval_type2`.

Rows are processed in blocks that fit into the cache, with the inner loops over the rows of a block,
which the compiler vectorises. Formulas and their order of operations are those of the numpy
modules, which define the results; sums are not reassociated (no fastmath). Arrays are passed whole
with an index, since a slice costs more than the loop over it.
"""

import math
from decimal import Decimal
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Single = tuple[float, float, float, float, int]
"""Answer, ends of its interval, strength, and what `count_outside` found."""

BLOCK = 256
"""Rows per block: few enough for the caches, enough to amortise the start of a loop."""

GAUSSIAN, TRAPEZOID, SPLINE, BELL, SIGMOID_DIFFERENCE, SIGMOID_PRODUCT = range(6)
"""Kinds of set; `fuzzy.systems.compiled` writes all others as one of them."""

TAYLOR = tuple(1.0 / math.factorial(n) for n in range(14))
LOG2_E = 1.0 / math.log(2.0)
LN_2_HIGH = math.floor(math.log(2.0) * 2.0**32) / 2.0**32  # its whole multiples are exact
LN_2_LOW = float(Decimal(2).ln() - Decimal(LN_2_HIGH))
SHIFT = 1.5 * 2.0**52

SUMMED, SCALES, CLAMPS, NIE_TAN, HEAD = range(4, 9)
"""Places of the switches in the integers of `pack`, after D, S, R and M; then the arrays."""

MINIMUM, PRODUCT, MAXIMUM, PROBOR = range(4)
"""What joins the terms of a rule."""


class Sets(NamedTuple):
    """The input sets in the form of the kernels, one row each.

    `kind` (S,), `column` (S,) of its input in X, `negated` (S,) if a rule negates it,
    `shape` (S, 6): four parameters and both ends of the core, `footprint` (S, 4): mean, spread,
    scale, lag.
    """

    kind: Integers
    column: Integers
    negated: Integers
    shape: Floats
    footprint: Floats


class Rules(NamedTuple):
    """Rule r joins by its operator two or more degrees, `members[first[r]:first[r + 1]]`.

    Degree 2 s belongs to set s, degree 2 s + 1 to NOT s. `again` (R,) marks a rule that shares all
    members but the last with the rule before it, `consequent` (R,) is an output set. `summed` adds
    the rules of an output set instead of taking the strongest.
    """

    first: Integers
    members: Integers
    operator: Integers
    again: Integers
    weight: Floats
    consequent: Integers
    summed: bool


class Grid(NamedTuple):
    """Samples `y` (M,) of the output, their `weights` (M,), the bounds of its sets there (K, M).

    `scales`: the implication is the product.
    """

    y: Floats
    weights: Floats
    lower: Floats
    upper: Floats
    scales: bool


@numba.njit(cache=True, error_model="numpy", nogil=True)
def mamdani(X: Floats, sets: Sets, rules: Rules, grid: Grid) -> tuple[Floats, Floats]:
    """Centroid (N,), NaN where nothing fires, and the greatest strength (N,)."""
    value, strength = np.empty(len(X)), np.zeros(len(X))
    block = min(BLOCK, len(X))
    x, degrees = np.empty((X.shape[1], block)), np.empty((2 * sets.kind.size + 2, block))
    heights, union = np.empty((len(grid.upper), block)), np.empty((grid.y.size, block))
    for start in range(0, len(X), BLOCK):
        n = min(block, len(X) - start)
        transpose(X, start, n, x)
        fill_upper(x, n, sets, degrees)
        fire(rules, degrees, n, heights, strength, start)
        unite(heights, grid.upper, grid.scales, n, union)
        centroid(grid, union, n, value, start)
    return value, strength


@numba.njit(cache=True, error_model="numpy", nogil=True)
def sugeno(X: Floats, sets: Sets, rules: Rules, coefficients: Floats) -> tuple[Floats, Floats]:
    """Weighted average (N,) of the consequents (K, D + 1), and the greatest strength (N,)."""
    value, strength = np.empty(len(X)), np.zeros(len(X))
    block = min(BLOCK, len(X))
    x, degrees = np.empty((X.shape[1], block)), np.empty((2 * sets.kind.size + 2, block))
    heights = np.empty((len(coefficients), block))
    for start in range(0, len(X), BLOCK):
        n = min(block, len(X) - start)
        transpose(X, start, n, x)
        fill_upper(x, n, sets, degrees)
        fire(rules, degrees, n, heights, strength, start)
        average(x, heights, coefficients, n, value, start)
    return value, strength


@numba.njit(cache=True, error_model="numpy", nogil=True)
def interval_type2(
    X: Floats, sets: Sets, rules: Rules, grid: Grid, nie_tan: bool, least_area: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Answer, both ends of the centroids and the greatest strength, each (N,).

    The answer is Nie and Tan's centroid or the middle of the ends. Areas up to `least_area` have
    no centroid: NaN.
    """
    value, left, right = np.empty(len(X)), np.empty(len(X)), np.empty(len(X))
    strength = np.zeros(len(X))
    block = min(BLOCK, len(X))
    x, heights = np.empty((X.shape[1], block)), np.empty((len(grid.upper), block))
    low = np.empty((2 * sets.kind.size + 2, block))
    high = np.empty((2 * sets.kind.size + 2, block))
    lower, upper = np.empty((grid.y.size, block)), np.empty((grid.y.size, block))
    for start in range(0, len(X), BLOCK):
        n = min(block, len(X) - start)
        transpose(X, start, n, x)
        fill_bounds(x, n, sets, low, high)
        fire(rules, low, n, heights, strength, start)
        unite(heights, grid.lower, grid.scales, n, lower)
        fire(rules, high, n, heights, strength, start)
        unite(heights, grid.upper, grid.scales, n, upper)
        end_of_centroids(grid, lower, upper, n, 1, least_area, left, start)
        end_of_centroids(grid, lower, upper, n, -1, least_area, right, start)
        if nie_tan:
            add(lower, n, upper)
            centroid(grid, upper, n, value, start)
    if not nie_tan:
        value[:] = 0.5 * (left + right)
    for k in range(len(X)):  # without a footprint the ends differ by rounding alone
        if left[k] > right[k]:
            left[k], right[k] = right[k], left[k]
    return value, left, right, strength


@numba.njit(cache=True, error_model="numpy", nogil=True)
def one_mamdani(x: Floats, integers: Integers, floats: Floats) -> Single:
    """`mamdani` of one row and the arrays of `pack`; `count_outside` may move the row."""
    universes, sets, rules, rest = unpacked(integers, floats)
    outside = count_outside(x, universes, integers[CLAMPS] != 0)
    value, strength = mamdani(x.reshape(1, -1), sets, rules, grid_of(integers, rest))
    return value[0], value[0], value[0], strength[0], outside


@numba.njit(cache=True, error_model="numpy", nogil=True)
def one_sugeno(x: Floats, integers: Integers, floats: Floats) -> Single:
    """`sugeno` of one row and the arrays of `pack`; `count_outside` may move the row."""
    universes, sets, rules, rest = unpacked(integers, floats)
    outside = count_outside(x, universes, integers[CLAMPS] != 0)
    value, strength = sugeno(x.reshape(1, -1), sets, rules, rest.reshape(-1, x.size + 1))
    return value[0], value[0], value[0], strength[0], outside


@numba.njit(cache=True, error_model="numpy", nogil=True)
def one_interval_type2(x: Floats, integers: Integers, floats: Floats) -> Single:
    """`interval_type2` of one row and the arrays of `pack`; `count_outside` may move the row."""
    universes, sets, rules, rest = unpacked(integers, floats)
    outside = count_outside(x, universes, integers[CLAMPS] != 0)
    grid, nie_tan = grid_of(integers, rest), integers[NIE_TAN] != 0
    value, left, right, strength = interval_type2(
        x.reshape(1, -1), sets, rules, grid, nie_tan, floats[0]
    )
    return value[0], left[0], right[0], strength[0], outside


def pack(
    universes: Floats,
    clamps: bool,
    sets: Sets,
    rules: Rules,
    output: Grid | Floats,
    nie_tan: bool = False,
    least_area: float = 0.0,
) -> tuple[Integers, Floats]:
    """A whole system in two arrays, since numba takes longer to unbox an array than to slice one.

    `output` is a grid or the coefficients (K, D + 1); the last two are for type-2 only.
    """
    numbers: list[Floats]
    if isinstance(output, Grid):
        samples, scales, numbers = output.y.size, output.scales, [*output[:4]]
    else:
        samples, scales, numbers = 0, False, [output]
    sizes = [len(universes), sets.kind.size, rules.weight.size, samples]
    head = np.array([*sizes, rules.summed, scales, clamps, nie_tan])
    per_rule = [rules.operator, rules.again, rules.consequent]
    integers = [head, *sets[:3], *per_rule, rules.first, rules.members]
    floats = [np.array([least_area]), universes, sets.shape, sets.footprint, rules.weight, *numbers]
    return (
        np.concatenate([np.ravel(one) for one in integers], dtype=np.int64),
        np.concatenate([np.ravel(one) for one in floats], dtype=np.float64),
    )


@numba.njit(cache=True, error_model="numpy", nogil=True)
def unpacked(integers: Integers, floats: Floats) -> tuple[Floats, Sets, Rules, Floats]:
    """Universes (D, 2), sets, rules and the output's numbers, as views of the packed arrays."""
    d, s, r = integers[0], integers[1], integers[2]
    i, j = HEAD + 3 * s, HEAD + 3 * (s + r)
    per_set, per_rule = integers[HEAD:i].reshape(3, s), integers[i:j].reshape(3, r)
    first, members = integers[j : j + r + 1], integers[j + r + 1 :]
    a = 1 + 2 * d
    b, c, e = a + 6 * s, a + 10 * s, a + 10 * s + r
    shape, footprint = floats[a:b].reshape(s, 6), floats[b:c].reshape(s, 4)
    summed = integers[SUMMED] != 0
    sets = Sets(per_set[0], per_set[1], per_set[2], shape, footprint)
    rules = Rules(first, members, per_rule[0], per_rule[1], floats[c:e], per_rule[2], summed)
    return floats[1:a].reshape(d, 2), sets, rules, floats[e:]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def grid_of(integers: Integers, rest: Floats) -> Grid:
    """The grid of the output that `pack` packed."""
    rows = rest.reshape(-1, integers[3])
    upper = 1 + len(rows) // 2  # after y, weights and half of the others
    return Grid(rows[0], rows[1], rows[2:upper], rows[upper:], integers[SCALES] != 0)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def count_outside(x: Floats, universes: Floats, clamps: bool) -> int:
    """Number of readings (D,) outside their universes (D, 2); -1 if one is not finite.

    `clamps` moves them to the nearest end.
    """
    outside = 0
    for i in range(x.size):
        low, high = universes[i, 0], universes[i, 1]
        if not math.isfinite(x[i]):
            return -1
        if x[i] < low or high < x[i]:
            outside += 1
            if clamps:
                x[i] = min(max(x[i], low), high)
    return outside


@numba.njit(cache=True, error_model="numpy", nogil=True)
def transpose(X: Floats, start: int, n: int, x: Floats) -> None:
    """Copy n rows of X into the columns of x (D, BLOCK)."""
    for i in range(X.shape[1]):
        for b in range(n):
            x[i, b] = X[start + b, i]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def fill_upper(x: Floats, n: int, sets: Sets, degrees: Floats) -> None:
    """Degrees of the sets and their negations, largest over the footprint.

    That is the membership at the point within the footprint nearest to the core.
    """
    kind, column, negated, shape, footprint = sets
    for s in range(kind.size):
        i, row, low, high = column[s], 2 * s, shape[s, 4], shape[s, 5]
        shift, factor = footprint[s, 0], 1.0 + footprint[s, 1]
        for b in range(n):
            nearest = min(max(x[i, b], low), high)
            distance = nearest - x[i, b]
            step = min(max(distance, -shift), shift)
            moved = nearest if step == distance else x[i, b] + step
            degrees[row, b] = stretched(moved, low, high, factor)
        fill_form(kind[s], shape, s, n, degrees, row)
        finish_form(kind[s], n, degrees, row)
        if negated[s]:
            for b in range(n):
                degrees[row + 1, b] = 1.0 - degrees[row, b]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def fill_bounds(x: Floats, n: int, sets: Sets, low: Floats, high: Floats) -> None:
    """Both bounds of the degrees: the upper one of NOT A is one less the lower one of A."""
    fill_upper(x, n, sets, high)
    kind, column, negated, shape, footprint = sets
    for s in range(kind.size):
        fill_least(x, n, column[s], kind[s], shape, footprint, s, low)
        if negated[s]:
            for b in range(n):
                low[2 * s + 1, b] = 1.0 - high[2 * s, b]
                high[2 * s + 1, b] = 1.0 - low[2 * s, b]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def fill_least(
    x: Floats,
    n: int,
    i: int,
    kind: int,
    shape: Floats,
    footprint: Floats,
    s: int,
    low: Floats,
) -> None:
    """Degrees of set s, smallest over the footprint, at one end of its range.

    The row of NOT s, which is written later, holds the other end.
    """
    row, other, start, end = 2 * s, 2 * s + 1, shape[s, 4], shape[s, 5]
    shift, factor = footprint[s, 0], 1.0 - footprint[s, 1]
    for b in range(n):
        low[row, b] = stretched(x[i, b] - shift, start, end, factor)
        low[other, b] = stretched(x[i, b] + shift, start, end, factor)
    fill_form(kind, shape, s, n, low, row)
    fill_form(kind, shape, s, n, low, other)
    for b in range(n):
        low[row, b] = min(low[row, b], low[other, b])
    finish_form(kind, n, low, row)
    scale, lag = footprint[s, 2], footprint[s, 3]
    for b in range(n):
        low[row, b] = scale * max(low[row, b] - lag, 0.0) / (1.0 - lag)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def stretched(x: float, low: float, high: float, factor: float) -> float:
    """Where the principal form is what one with flanks `factor` times as wide is at x."""
    if factor == 1.0:
        return x
    nearest = min(max(x, low), high)
    return nearest + (x - nearest) / factor


@numba.njit(cache=True, error_model="numpy", nogil=True)
def fill_form(kind: int, shape: Floats, s: int, n: int, x: Floats, row: int) -> None:
    """Replace positions by memberships in set s, or by their logarithms if it is Gaussian.

    Logarithms compare like memberships, and only one exponential is evaluated.
    """
    p, q, r, t = shape[s, 0], shape[s, 1], shape[s, 2], shape[s, 3]
    if kind == GAUSSIAN:
        for b in range(n):
            left, right = (min(x[row, b], q) - q) / p, (max(x[row, b], t) - t) / r
            x[row, b] = -0.5 * (left * left + right * right)
    else:
        for b in range(n):
            x[row, b] = degree(kind, p, q, r, t, x[row, b])


@numba.njit(cache=True, error_model="numpy", nogil=True)
def finish_form(kind: int, n: int, x: Floats, row: int) -> None:
    """Turn the result of `fill_form` into memberships."""
    if kind == GAUSSIAN:
        exponentiate(x, row, n)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def exponentiate(x: Floats, row: int, n: int) -> None:
    """Replace n numbers up to 0 in a row of x by their exponentials, to 2 units in the last place.

    math.exp() takes one number at a time; this is vector code. exp(x) = 2^k exp(r) with k whole and
    |r| <= ln(2) / 2, where Taylor's series to r^13 / 13! leaves 4e-18. 2^k is written into the bits
    of a float, in two factors, so that underflow is gradual. The last two rows of x are scratch.
    """
    first, second = len(x) - 2, len(x) - 1
    bits = x.view(np.int64)
    for b in range(n):
        # Adding SHIFT rounds to a whole number and leaves it in the lowest bits.
        shifted = max(x[row, b], -1000.0) * LOG2_E + SHIFT
        k = shifted - SHIFT
        r = max(x[row, b], -1000.0) - k * LN_2_HIGH - k * LN_2_LOW
        x[row, b] = taylor(r)
        x[first, b] = max(k, -1000.0) + SHIFT
        x[second, b] = min(k + 1000.0, 0.0) + SHIFT
    for b in range(n):
        bits[first, b] = (bits[first, b] + 1023) << 52
        bits[second, b] = (bits[second, b] + 1023) << 52
    for b in range(n):
        x[row, b] = x[row, b] * x[first, b] * x[second, b]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def taylor(r: float) -> float:
    """exp(r) for |r| <= ln(2) / 2."""
    square = r * r
    even, odd = TAYLOR[12], TAYLOR[13]  # apart, so that neither waits for the other
    for n in range(10, -1, -2):
        even = TAYLOR[n] + even * square
        odd = TAYLOR[n + 1] + odd * square
    return even + odd * r


@numba.njit(cache=True, error_model="numpy", nogil=True)
def degree(kind: int, p: float, q: float, r: float, t: float, x: float) -> float:
    """Membership of x in a set of any kind but the Gaussian."""
    rise: float
    fall: float
    if kind == TRAPEZOID:
        rise, fall = ramp(x, p, q), ramp(x, t, r)
        return min(rise, fall) if p <= x <= t else 0.0
    if kind == SPLINE:
        rise, fall = spline(x, p, q), spline(x, t, r)
        return rise * fall if p <= x <= t else 0.0
    if kind == BELL:
        return 1.0 / (1.0 + math.pow(abs((x - r) / p), 2.0 * q))
    rise, fall = sigmoid(x, p, q), sigmoid(x, r, t)
    return abs(rise - fall) if kind == SIGMOID_DIFFERENCE else rise * fall


@numba.njit(cache=True, error_model="numpy", nogil=True)
def ramp(x: float, foot: float, top: float) -> float:
    """0 before foot and 1 after top, either way round; a step that is 1 at foot = top."""
    return 1.0 if foot == top else min(max((x - foot) / (top - foot), 0.0), 1.0)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def spline(x: float, foot: float, top: float) -> float:
    """Two parabolas from 0 at foot to 1 at top, either way round."""
    t: float = ramp(x, foot, top)
    return 2.0 * t**2 if t < 0.5 else 1.0 - 2.0 * (1.0 - t) ** 2


@numba.njit(cache=True, error_model="numpy", nogil=True)
def sigmoid(x: float, slope: float, centre: float) -> float:
    """1 / (1 + exp(-slope (x - centre)))."""
    u = slope * (x - centre)
    decay = math.exp(-abs(u))
    return (1.0 if u >= 0.0 else decay) / (1.0 + decay)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def fire(
    rules: Rules, degrees: Floats, n: int, heights: Floats, strength: Floats, start: int
) -> None:
    """Strength of every output set (K, BLOCK) and of the strongest rule, from the degrees."""
    first, members, operators, again, weights, consequents, summed = rules
    part, whole = len(degrees) - 2, len(degrees) - 1  # rows for all members but the last, and all
    strongest = np.zeros(n)
    heights[:] = 0.0
    for r in range(weights.size):
        begin, last, k, weight = first[r], first[r + 1] - 1, consequents[r], weights[r]
        left, right = members[begin], members[last]
        if last - begin > 1:
            for q in range(last if again[r] else begin + 1, last):
                join(operators[r], degrees, left, members[q], part, n)
                left = part
            left = part
        if operators[r] != MINIMUM:
            join(operators[r], degrees, left, right, whole, n)
            left, right = whole, whole
        if summed:
            for b in range(n):
                heights[k, b] += weight * min(degrees[left, b], degrees[right, b])
            for b in range(n):
                fired = weight * min(degrees[left, b], degrees[right, b])
                strongest[b] = max(strongest[b], fired)
        else:
            for b in range(n):
                fired = weight * min(degrees[left, b], degrees[right, b])
                heights[k, b] = max(heights[k, b], fired)
    if not summed:
        keep_greatest(heights, n, strongest)
    strength[start : start + n] = strongest


@numba.njit(cache=True, error_model="numpy", nogil=True)
def keep_greatest(heights: Floats, n: int, strongest: Floats) -> None:
    """Raise `strongest` (n,) to the greatest of the heights (K, BLOCK)."""
    for k in range(len(heights)):
        for b in range(n):
            strongest[b] = max(strongest[b], heights[k, b])


@numba.njit(cache=True, error_model="numpy", nogil=True)
def join(operator: int, degrees: Floats, left: int, right: int, row: int, n: int) -> None:
    """AND or OR of two rows of degrees in a third one."""
    if operator == MINIMUM:
        for b in range(n):
            degrees[row, b] = min(degrees[left, b], degrees[right, b])
    elif operator == PRODUCT:
        for b in range(n):
            degrees[row, b] = degrees[left, b] * degrees[right, b]
    elif operator == MAXIMUM:
        for b in range(n):
            degrees[row, b] = max(degrees[left, b], degrees[right, b])
    else:
        for b in range(n):
            one, other = degrees[left, b], degrees[right, b]
            degrees[row, b] = one + other * (1.0 - one)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def unite(heights: Floats, output: Floats, scales: bool, n: int, union: Floats) -> None:
    """Union (M, BLOCK) of the output sets (K, M) implied at the heights (K, BLOCK)."""
    for j in range(len(union)):
        for k in range(len(heights)):
            mu = output[k, j]
            if scales and k == 0:
                for b in range(n):
                    union[j, b] = heights[k, b] * mu
            elif scales:
                for b in range(n):
                    union[j, b] = max(union[j, b], heights[k, b] * mu)
            elif k == 0:
                for b in range(n):
                    union[j, b] = min(heights[k, b], mu)
            else:
                for b in range(n):
                    union[j, b] = max(union[j, b], min(heights[k, b], mu))


@numba.njit(cache=True, error_model="numpy", nogil=True)
def add(one: Floats, n: int, other: Floats) -> None:
    """Add one union (M, BLOCK) to the other."""
    for j in range(len(one)):
        for b in range(n):
            other[j, b] += one[j, b]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def centroid(grid: Grid, union: Floats, n: int, value: Floats, start: int) -> None:
    """Centre of gravity of the union (M, BLOCK); NaN where it is 0."""
    area, moment = moments(grid.y, grid.weights, union, n)
    for b in range(n):
        value[start + b] = moment[b] / area[b] if area[b] > 0.0 else np.nan


@numba.njit(cache=True, error_model="numpy", nogil=True)
def moments(y: Floats, weights: Floats, union: Floats, n: int) -> tuple[Floats, Floats]:
    """Area and moment (n,) of the union (M, BLOCK)."""
    area, moment = np.zeros(n), np.zeros(n)
    if n == 1:
        area[0], moment[0] = moments_of_row(y, weights, union)
        return area, moment
    for j in range(y.size):
        weight, lever = weights[j], weights[j] * y[j]
        for b in range(n):
            area[b] += weight * union[j, b]
            moment[b] += lever * union[j, b]
    return area, moment


@numba.njit(cache=True, error_model="numpy", nogil=True)
def moments_of_row(y: Floats, weights: Floats, union: Floats) -> tuple[float, float]:
    """`moments` of one row, with the sums in registers."""
    area, moment = 0.0, 0.0
    for j in range(y.size):
        area += weights[j] * union[j, 0]
        moment += weights[j] * y[j] * union[j, 0]
    return area, moment


@numba.njit(cache=True, error_model="numpy", nogil=True)
def end_of_centroids(
    grid: Grid,
    lower: Floats,
    upper: Floats,
    n: int,
    side: int,
    least_area: float,
    value: Floats,
    start: int,
) -> None:
    """Least (side 1) or greatest (side -1) centroid between the bounds (M, BLOCK).

    From that end on, a sample goes over to the upper bound while the centroid lies beyond it. After
    the first that does not go none does, for the centroid then rests. Multiplying the test out
    saves the division.
    """
    if n == 1:
        value[start] = end_of_row(grid, lower, upper, side, least_area)
        return
    y, weights = grid.y, grid.weights
    area, moment = moments(y, weights, lower, n)
    for step in range(y.size):
        j = step if side > 0 else y.size - 1 - step
        y_j, weight = y[j], weights[j]
        for b in range(n):
            goes = side * (moment[b] - y_j * area[b]) >= 0.0 or area[b] <= least_area
            gain = weight * (upper[j, b] - lower[j, b]) if goes else 0.0
            area[b] += gain
            moment[b] += y_j * gain
    for b in range(n):
        value[start + b] = moment[b] / area[b] if area[b] > least_area else np.nan


@numba.njit(cache=True, error_model="numpy", nogil=True)
def end_of_row(grid: Grid, lower: Floats, upper: Floats, side: int, least_area: float) -> float:
    """`end_of_centroids` of one row, which can stop where the centroid rests."""
    y, weights = grid.y, grid.weights
    area, moment = moments_of_row(y, weights, lower)
    for step in range(y.size):
        j = step if side > 0 else y.size - 1 - step
        goes = side * (moment - y[j] * area) >= 0.0 or area <= least_area
        if not goes:
            break
        gain = weights[j] * (upper[j, 0] - lower[j, 0])
        area += gain
        moment += y[j] * gain
    return moment / area if area > least_area else np.nan


@numba.njit(cache=True, error_model="numpy", nogil=True)
def average(
    x: Floats, heights: Floats, coefficients: Floats, n: int, value: Floats, start: int
) -> None:
    """Average of the consequents (K, D + 1) weighted by the heights (K, BLOCK).

    Without height a consequent has no say, even if it is no number.
    """
    total, moment, answer = np.zeros(n), np.zeros(n), np.empty(n)
    for k in range(len(heights)):
        for b in range(n):
            answer[b] = coefficients[k, -1]
        for i in range(len(x)):
            coefficient = coefficients[k, i]
            for b in range(n):
                answer[b] += coefficient * x[i, b]
        for b in range(n):
            total[b] += heights[k, b]
            moment[b] += heights[k, b] * answer[b] if heights[k, b] > 0.0 else 0.0
    for b in range(n):
        value[start + b] = moment[b] / total[b] if total[b] > 0.0 else np.nan
