"""Exact sampling against closed forms and dense sums: the stated tolerance holds, or it says so."""

from math import log, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expit

from fuzzy.systems import exact
from fuzzy.systems.inference import infer
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.sets import (
    FORMS,
    TYPE_1,
    Footprint,
    FuzzySet,
    corners,
    lower_membership,
    membership,
    upper_membership,
)
from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable, memberships, union


def system_of(*sets, low=0.0, high=1.0, implication="min"):
    """Output sets given as (kind, parameters[, footprint]), each with a rule of its own."""
    named = tuple(FuzzySet(f"set {k}", *one) for k, one in enumerate(sets))
    full = Variable("x", 0, 1, (FuzzySet("any", "smf", (-2.0, -1.0)),))
    rules = tuple(Rule((Term(0, 0),), k) for k in range(len(named)))
    return FuzzySystem(
        (full,), Variable("y", low, high, named), rules, Operators("min", "max", implication)
    )


def all_answers(system, lower, upper):
    """Type-1 centroid, both ends, and Nie and Tan's centroid."""
    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    band = exact.reduce(system, lower, upper)
    return np.array([exact.centroid(system, upper, membership), *band.interval, band.nie_tan])


# --- dense sums ------------------------------------------------------------------------------

SAMPLES = 2**20
BLOCK = 2**16


def dense_sums(system, lower, upper, every):
    """The four answers by the trapezoidal rule on every so many of SAMPLES steps."""
    output = system.output
    y = np.linspace(output.low, output.high, SAMPLES // every + 1)
    starts = range(0, y.size, BLOCK)

    def curve(heights, mu_of):
        parts = (memberships(output, y[i : i + BLOCK], mu_of) for i in starts)
        columns = np.asarray(heights)[:, None]
        return np.concatenate([union(columns, mu, system.operators)[0] for mu in parts])

    weights = np.ones(y.size)
    weights[[0, -1]] = 0.5
    principal = weights * curve(upper, membership)
    low, high = curve(lower, lower_membership), curve(upper, upper_membership)
    both = weights * (low + high)
    ends = switch_point(y, high, low), switch_point(y, low, high)
    return np.array([principal @ y / principal.sum(), *ends, both @ y / both.sum()])


def switch_point(y, first, second):
    """Where the moment about c of `first` before c and `second` after it is 0, between points."""
    before, after = (running(y, f) for f in (first, second))
    area = before[0] + after[0][-1] - after[0]
    moment = before[1] + after[1][-1] - after[1]
    excess = moment - y * area
    k = np.flatnonzero(excess > 0)[-1]
    return y[k] + (y[k + 1] - y[k]) * excess[k] / (excess[k] - excess[k + 1])


def running(y, f):
    """Running area and moment of the polyline through f."""
    h, before, after = y[1] - y[0], f[:-1], f[1:]
    area = h * (before + after) / 2
    moment = y[:-1] * area + h**2 * (before + 2 * after) / 6
    return [np.concatenate([[0.0], np.cumsum(part)]) for part in (area, moment)]


def drawn_set(rng):
    """A kind and its parameters on [0, 1], with flanks of a fiftieth at least, and a footprint."""
    kind = str(rng.choice(list(FORMS)))
    centre, width = rng.uniform(0.1, 0.9), rng.uniform(0.02, 0.3, 3)
    slopes = rng.choice([-1, 1], 2) * rng.uniform(2, 60, 2)
    rising = tuple(float(x) for x in rng.uniform(-0.1, 0.7) + np.cumsum([0, *width]))
    parameters = {
        "gaussmf": (width[0], centre),
        "gauss2mf": (width[0], centre, width[1], centre + width[2]),
        "trimf": rising[:3],
        "gbellmf": (width[0], rng.uniform(0.6, 4), centre),
        "sigmf": (slopes[0], centre),
        "dsigmf": (slopes[0], centre, slopes[1], rng.uniform(0, 1)),
        "psigmf": (abs(slopes[0]), centre, -abs(slopes[1]), centre + width[0]),
        "zmf": rising[:2],
        "smf": rising[:2],
        "linzmf": rising[:2],
        "linsmf": rising[:2],
    }.get(kind, rising)
    moved = rng.uniform(0, 0.1) if kind not in ("dsigmf", "psigmf") else 0.0
    widened = rng.uniform(0, 0.5) if kind not in ("dsigmf", "psigmf", "sigmf") else 0.0
    keep = rng.random(4) < 0.5
    footprint = Footprint(
        mean=moved * keep[0],
        spread=widened * keep[1],
        scale=rng.uniform(0.3, 1) if keep[2] else 1.0,
        lag=rng.uniform(0, 0.6) * keep[3],
    )
    return kind, tuple(float(p) for p in parameters), footprint


def drawn_case(seed):
    rng = np.random.default_rng(seed)
    system = system_of(
        *(drawn_set(rng) for _ in range(rng.integers(1, 4))),
        implication=str(rng.choice(["min", "prod"])),
    )
    upper = rng.uniform(0.1, 1, len(system.output.sets))
    return system, upper * rng.uniform(0.3, 1, upper.size), upper


@pytest.mark.parametrize("seed", range(24))
def test_drawn_bands_of_all_kinds_agree_with_dense_sums(seed):
    system, lower, upper = drawn_case(seed)
    found = all_answers(system, lower, upper)
    dense, coarser = (dense_sums(system, lower, upper, every) for every in (1, 2))
    # The sums' own error falls fourfold with half the step, so it is a third of the change.
    own = np.abs(dense - coarser).max()
    assert found == pytest.approx(dense, rel=0, abs=exact.TOLERANCE + own)
    assert own < exact.TOLERANCE


def test_dense_sums_notice_a_height_off_by_a_billionth():
    system, lower, upper = drawn_case(3)
    found = all_answers(system, lower * (1 + 1e-8), upper)
    assert found != pytest.approx(
        dense_sums(system, lower, upper, 1), rel=0, abs=2 * exact.TOLERANCE
    )


def test_kinks_of_a_skewed_set_with_an_uncertain_mean():
    # Left and right of the place where the set moved left and the set moved right are equal, which
    # is not the middle of the core, the lower bound has different slopes.
    system = system_of(("trimf", (0.436, 0.526, 0.543), Footprint(mean=0.0357)))
    found = exact.reduce(system, np.ones(1), np.ones(1)).interval
    dense, coarser = (dense_sums(system, [1.0], [1.0], every) for every in (1, 2))
    own = np.abs(dense - coarser).max()
    assert own < exact.TOLERANCE
    assert found == pytest.approx(dense[1:3], rel=0, abs=exact.TOLERANCE + own)


def test_kinks_at_the_lag_of_a_narrow_set():
    # On a universe of some widths of the set, for the dense sums to resolve it.
    system = system_of(("gaussmf", (0.00743, 0.49889), Footprint(lag=0.8969)), low=0.45, high=0.55)
    wide = system_of(("gaussmf", (0.00743, 0.49889), Footprint(lag=0.8969)))
    dense, coarser = (dense_sums(system, [1.0], [1.0], every) for every in (1, 2))
    own = np.abs(dense - coarser).max()
    assert own < exact.TOLERANCE
    for one in (system, wide):
        found = exact.reduce(one, np.ones(1), np.ones(1)).interval
        width = one.output.high - one.output.low
        assert found == pytest.approx(dense[1:3], rel=0, abs=width * exact.TOLERANCE + own)


# --- closed forms ----------------------------------------------------------------------------

FLAT = ("trapmf", (-1.0, -1.0, 2.0, 2.0))


@pytest.mark.parametrize("a", [1.0, 0.25, 1e-4, 1e-12, 1e-40, 1e-200])
def test_a_band_almost_empty_below(a):
    found = exact.reduce(system_of(FLAT), np.array([a]), np.ones(1)).interval
    root = sqrt(a)
    assert found == pytest.approx([root / (1 + root), 1 / (1 + root)], rel=0, abs=exact.TOLERANCE)


@pytest.mark.parametrize(
    ("one", "support"),
    [
        (("gaussmf", (3.0, 90.0)), (0, 100)),
        (("sigmf", (-2.0, 30.0)), (0, 100)),
        (("trimf", (20.0, 30.0, 60.0), Footprint(mean=5.0)), (15, 65)),
        (("trapmf", (20.0, 30.0, 40.0, 60.0), Footprint(mean=5.0, spread=0.5)), (10, 75)),
        (("pimf", (-20.0, 30.0, 40.0, 60.0)), (0, 60)),
        (("zmf", (20.0, 30.0), Footprint(mean=5.0)), (0, 35)),
        (("smf", (20.0, 30.0), Footprint(spread=0.5)), (15, 100)),
    ],
)
def test_a_band_empty_below_spans_the_support(one, support):
    found = exact.reduce(system_of(one, high=100.0), np.zeros(1), np.ones(1))
    assert found.interval == pytest.approx(support, rel=0, abs=1e-12)
    assert support[0] < found.nie_tan < support[1]


def test_a_set_that_does_not_fire_adds_nothing_to_the_support():
    system = system_of(("trimf", (0.2, 0.3, 0.4)), ("gaussmf", (0.1, 0.5)), ("trimf", (2, 3, 4)))
    found = exact.reduce(system, np.zeros(3), np.array([0.5, 0.0, 1.0])).interval
    assert found == pytest.approx([0.2, 0.4], rel=0, abs=1e-12)


def test_a_reading_that_the_lower_input_set_misses_answers_as_samples_do():
    uncertain = FuzzySet("a", "trimf", (0.2, 0.5, 0.8), Footprint(mean=0.1))
    output = Variable("y", 0, 100, (FuzzySet("o", "gaussmf", (3.0, 90.0)),))
    system = FuzzySystem((Variable("x", 0, 1, (uncertain,)),), output, (Rule((Term(0, 0),), 0),))
    for sampling in ("matlab", "octave", "exact"):
        found = infer(system, np.array([[0.28]]), "interval-type-2", InferenceOptions(sampling))
        assert found.interval[0] == pytest.approx([0, 100], rel=0, abs=1e-12)


@pytest.mark.parametrize("sd", [1e-2, 1e-5, 1e-9, 1e-12])
@pytest.mark.parametrize("height", [1.0, 0.3])
def test_a_narrow_gaussian_answers_with_its_centre(sd, height):
    system = system_of(("gaussmf", (sd, 0.70012)))
    found = all_answers(system, [0.5 * height], [height])
    assert found[[0, 3]] == pytest.approx(0.70012, rel=0, abs=exact.TOLERANCE)


@pytest.mark.parametrize("slope", [1e2, -1e2, 1e4, 1e5, 1e6])
def test_a_steep_sigmoid(slope):
    # The moment lacks pi^2 / 6 slope^2 of that of a step; what the universe cuts off is exp(-30).
    c = 0.70012
    area, moment = (1 - c, (1 - c**2) / 2 - pi**2 / (6 * slope**2))
    if slope < 0:
        area, moment = c, c**2 / 2 + pi**2 / (6 * slope**2)
    found = exact.centroid(system_of(("sigmf", (slope, c))), np.ones(1), membership)
    assert found == pytest.approx(moment / area, rel=0, abs=exact.TOLERANCE)


@pytest.mark.parametrize("kind", ["dsigmf", "psigmf"])
@pytest.mark.parametrize("slope", [3e4, 3e5])
def test_a_steep_bump_between_two_sigmoids(kind, slope):
    second = slope if kind == "dsigmf" else -slope
    system = system_of((kind, (slope, 0.50035, second, 0.50065)))
    found = all_answers(system, [1.0], [1.0])
    assert found == pytest.approx(0.5005, rel=0, abs=exact.TOLERANCE)


@pytest.mark.parametrize("slope", [0.05, 0.1, 0.3, 500.0])
def test_cusps_and_edges_of_bells(slope):
    half_width, c, n = 0.2, 0.4567, 20

    def integral(power, sign, reach):
        """Of (sign t)^power times the bell at c + sign t, in u = t^(1/n), which has no cusp."""

        def integrand(u):
            exponent = 2 * slope * log(u**n / half_width)
            return (sign * u**n) ** power * n * u ** (n - 1) * expit(-exponent)

        edge, end = half_width ** (1 / n), reach ** (1 / n)
        near = [edge * (1 + k / slope) for k in (-1, 0, 1)] if slope > 1 else [edge]
        return quad(integrand, 0, end, points=near, epsabs=1e-14, limit=400)[0]

    area, moment = (integral(k, -1, c) + integral(k, 1, 1 - c) for k in (0, 1))
    found = exact.centroid(system_of(("gbellmf", (half_width, slope, c))), np.ones(1), membership)
    assert found == pytest.approx(c + moment / area, rel=0, abs=exact.TOLERANCE)


@pytest.mark.parametrize("shift", [0.0, 1e-3, 0.0357, 0.1])
def test_vertical_flanks(shift):
    # Both ends lie where lower and upper are 1, so the switched curves are the moved rectangles.
    a, b = 0.3123, 0.7456
    system = system_of(("trapmf", (a, a, b, b), Footprint(mean=shift)))
    expected = [(a + b) / 2, (a + b) / 2 - shift, (a + b) / 2 + shift, (a + b) / 2]
    assert all_answers(system, [1.0], [1.0]) == pytest.approx(expected, rel=0, abs=exact.TOLERANCE)


def test_sets_that_coincide():
    twins = (("gaussmf", (0.1, 0.4)), ("gauss2mf", (0.1, 0.4, 0.1, 0.4)), ("gaussmf", (0.1, 0.4)))
    found = all_answers(system_of(*twins), [0.5] * 3, [0.7] * 3)
    alone = all_answers(system_of(twins[0]), [0.5], [0.7])
    assert found == pytest.approx(alone, rel=0, abs=exact.TOLERANCE)


def hardly_exceeding(m):
    """Heights of two Gaussians, implied by product: the second is larger within 0.0007 of m."""
    wide, narrow, reach = (0.1, 0.2), 0.05, 0.0007
    curvature = 1 / narrow**2 - 1 / wide[0] ** 2
    centre = m - (m - wide[1]) * (narrow / wide[0]) ** 2  # equal slopes of both logarithms at m
    gap = ((m - centre) / narrow) ** 2 - ((m - wide[1]) / wide[0]) ** 2
    height = np.exp(0.5 * (gap + curvature * reach**2))
    system = system_of(("gaussmf", wide), ("gaussmf", (narrow, centre)), implication="prod")
    return system, np.array([1.0, height])


def test_a_set_that_hardly_exceeds_another_between_two_points(monkeypatch):
    # The middle of its 0.0014 lies between two points of the first panels.
    system, heights = hardly_exceeding(0.3195)
    dense, coarser = (dense_sums(system, heights, heights, every)[0] for every in (1, 2))
    own = abs(dense - coarser)
    assert own < exact.TOLERANCE
    expected = pytest.approx(dense, rel=0, abs=exact.TOLERANCE + own)
    assert exact.centroid(system, heights, membership) == expected
    monkeypatch.setattr(exact, "_hidden", lambda _, y: np.zeros(len(y)))
    assert exact.centroid(system, heights, membership) != expected


# --- where the tolerance cannot be held --------------------------------------------------------


def test_a_universe_too_far_from_0_is_refused_by_name():
    system = system_of(("gaussmf", (0.1, 1e7 + 0.4)), low=1e7, high=1e7 + 1)
    with pytest.raises(ValueError, match=r"output 'y': exact sampling comes within .* not 1e-10"):
        exact.centroid(system, np.ones(1), membership)


def test_a_universe_at_some_distance_from_0_is_answered():
    near = system_of(("gaussmf", (0.1, 0.4), Footprint(mean=0.1)))
    far = system_of(("gaussmf", (0.1, 1000.4), Footprint(mean=0.1)), low=1000, high=1001)
    expected = all_answers(near, [0.5], [0.7])
    assert all_answers(far, [0.5], [0.7]) - 1000 == pytest.approx(
        expected, rel=0, abs=exact.TOLERANCE
    )


def test_refinement_without_end_is_refused(monkeypatch):
    monkeypatch.setattr(exact, "MOST_PANELS", 70)
    with pytest.raises(ValueError, match="widen its narrowest set"):
        exact.centroid(system_of(("gaussmf", (1e-6, 0.7001))), np.full(1, 0.5), membership)


@pytest.mark.parametrize(
    "one",
    [("trimf", (2.0, 3.0, 4.0)), ("gaussmf", (0.01, 9.0)), ("trapmf", (-2.0, -2.0, -1.0, -1.0))],
)
def test_a_set_off_the_universe_is_no_number(one):
    assert np.isnan(all_answers(system_of(one), [0.5], [1.0])).all()


def test_nothing_fired_is_no_number():
    assert np.isnan(all_answers(system_of(("trimf", (0.2, 0.3, 0.4))), [0.0], [0.0])).all()


# --- corners -----------------------------------------------------------------------------------


def test_corner_of_the_lower_bound_of_a_skewed_triangle():
    (a, b, d), s = (0.436, 0.526, 0.543), 0.0357
    # Equal heights on the rising flank moved right and the falling flank moved left.
    at = ((a + s) * (d - b) + (d - s) * (b - a)) / (d - a)
    places = corners(FuzzySet("skewed", "trimf", (a, b, d), Footprint(mean=s)))
    assert np.abs(np.array(places) - at).min() < 1e-15
    assert abs(at - b) > 1e-3


@pytest.mark.parametrize(
    "parameters",
    [
        ("psigmf", (10.0, 0.3, -25.0, 0.6)),
        ("psigmf", (-40.0, 0.5, 8.0, 0.4)),
        ("dsigmf", (12.0, 0.3, 12.0, 0.6)),
        ("dsigmf", (12.0, 0.3, 30.0, 0.6)),
        ("dsigmf", (-30.0, 0.6, -12.0, 0.3)),
    ],
)
def test_peak_of_two_sigmoids_is_a_corner(parameters):
    one = FuzzySet("bump", *parameters)
    x = np.linspace(0, 1, 10001)
    peak = x[membership(one, x).argmax()]
    assert np.abs(np.array(corners(one)) - peak).min() <= x[1]


def test_zero_of_a_difference_of_two_sigmoids_is_a_corner():
    one = FuzzySet("difference", "dsigmf", (12.0, 0.3, 30.0, 0.6))
    values = membership(one, np.array(corners(one)))
    assert values.min() < 1e-15 < values.max()


def test_a_smooth_set_without_footprint_has_its_centre_for_a_corner():
    assert corners(FuzzySet("g", "gaussmf", (0.1, 0.4), TYPE_1)) == (0.4,)
