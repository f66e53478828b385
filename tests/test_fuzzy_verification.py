"""The three inference engines against printed outputs, closed forms and exhaustive search."""

from dataclasses import replace
from itertools import combinations, pairwise, product
from math import erf, exp, log, pi, sqrt

import numpy as np
import pytest
import skfuzzy
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzy.systems import exact, sugeno
from fuzzy.systems.inference import infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import Quadrature, centroid, sampled
from fuzzy.systems.sets import Footprint, FuzzySet, lower_membership, membership, upper_membership
from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable, memberships
from fuzzy.systems.type_reduction import eiasc, karnik_mendel

GRID = np.linspace(0, 10, 101)
SUMS = Quadrature(GRID, np.ones(101))


def rule(terms, consequent, connective="and", weight=1.0):
    return Rule(tuple(Term(*term) for term in terms), consequent, connective, weight)


def tipper(*, connective="or", sd=1.5):
    service = Variable(
        "service", 0, 10, tuple(FuzzySet(f"s{c}", "gaussmf", (sd, c)) for c in (0.0, 5.0, 10.0))
    )
    food = Variable(
        "food",
        0,
        10,
        (
            FuzzySet("rancid", "trapmf", (-2.0, 0.0, 1.0, 3.0)),
            FuzzySet("delicious", "trapmf", (7.0, 9.0, 10.0, 12.0)),
        ),
    )
    tip = Variable(
        "tip", 0, 30, tuple(FuzzySet(f"t{a}", "trimf", (a, a + 5, a + 10)) for a in (0.0, 10, 20))
    )
    rules = (
        rule([(0, 0), (1, 0)], 0, connective),
        rule([(0, 1)], 1),
        rule([(0, 2), (1, 1)], 2, connective),
    )
    return FuzzySystem((service, food), tip, rules)


def always(*output_sets, low=0.0, high=75.0):
    """Every output set is reached in full, whatever the reading."""
    full = Variable("x", 0, 1, (FuzzySet("any", "smf", (-2.0, -1.0)),))
    rules = tuple(rule([(0, 0)], k) for k in range(len(output_sets)))
    return FuzzySystem((full,), Variable("y", low, high, output_sets), rules)


ANY = np.array([[0.5]])


def answer(system, X, kind, **options):
    return infer(system, X, kind, InferenceOptions(**options)).value


# --- Mamdani ---------------------------------------------------------------------------------

TIPPER_INPUTS = np.array([[2.0, 1.0], [4.0, 5.0], [7.0, 8.0]])
TIPPER_PRINTED = ["7.0169", "14.4585", "20.3414"]  # MATLAB documentation, 101 samples


def printed(values):
    return [f"{value:.4f}" for value in values]


def test_tipper_prints_matlabs_digits():
    assert printed(answer(tipper(), TIPPER_INPUTS, "mamdani")) == TIPPER_PRINTED


@pytest.mark.parametrize(
    ("system", "options"),
    [
        (tipper(connective="and"), {}),
        (tipper(sd=1.51), {}),
        (tipper(), {"samples": 100}),
        (tipper(), {"sampling": "exact"}),
    ],
    ids=["and-for-or", "sd-one-percent-off", "100-samples", "not-sampled"],
)
def test_tipper_shows_a_planted_error(system, options):
    assert printed(answer(system, TIPPER_INPUTS, "mamdani", **options)) != TIPPER_PRINTED


def by_hand(**operators):
    """Heights 1/4 and 3/4 on triangles (0, 1, 2) and (2, 3, 4)."""
    x = Variable(
        "x",
        0,
        1,
        (
            FuzzySet("down", "trapmf", (-1.0, -0.5, 0.0, 1.0)),
            FuzzySet("up", "trapmf", (0.0, 1.0, 2.0, 3.0)),
        ),
    )
    sets = (
        FuzzySet("low", "trimf", (0.0, 1.0, 2.0)),
        FuzzySet("high", "trimf", (2.0, 3.0, 4.0)),
    )
    rules = (rule([(0, 0)], 0), rule([(0, 1)], 1))
    return FuzzySystem((x,), Variable("y", 0, 4, sets), rules, Operators(**operators))


@pytest.mark.parametrize("options", [{"samples": 1601}, {"sampling": "exact"}])
def test_mamdani_by_hand(options):
    # A triangle of base 2 clipped at h has area h (2 - h), one scaled by h has area h, and both
    # stay symmetric about 1 and 3. The corners are samples: sums are then exact to rounding.
    X = np.array([[0.75]])
    clipped = (7 / 16 * 1 + 15 / 16 * 3) / (22 / 16)
    scaled = 1 / 4 * 1 + 3 / 4 * 3
    assert answer(by_hand(), X, "mamdani", **options) == pytest.approx(clipped, abs=1e-12)
    product_system = by_hand(implication="prod")
    assert answer(product_system, X, "mamdani", **options) == pytest.approx(scaled, abs=1e-12)


def two_inputs(operators, *terms, connective="and", weight=1.0):
    """Sugeno with one rule under test and a second that answers 0 with strength 1/2."""
    ramp = (FuzzySet("up", "trapmf", (0.0, 1.0, 2.0, 3.0)),)
    inputs = (Variable("a", 0, 1, ramp), Variable("b", 0, 1, ramp), Variable("c", 0, 1, ramp))
    out = Variable(
        "y", 0, 1, (FuzzySet("one", "constant", (1.0,)), FuzzySet("nil", "constant", (0.0,)))
    )
    rules = (rule(terms, 0, connective, weight), rule([(2, 0)], 1))
    return FuzzySystem(inputs, out, rules, Operators(**operators))


@pytest.mark.parametrize(
    ("system", "strength"),
    [
        (two_inputs({}, (0, 0), (1, 0)), 0.2),
        (two_inputs({"conjunction": "prod"}, (0, 0), (1, 0)), 0.12),
        (two_inputs({}, (0, 0), (1, 0), connective="or"), 0.6),
        (two_inputs({"disjunction": "probor"}, (0, 0), (1, 0), connective="or"), 0.68),
        (two_inputs({}, (0, 0), (1, 0, True)), 0.2),
        (two_inputs({}, (0, 0, True), (1, 0, True)), 0.4),
        (two_inputs({}, (0, 0), (1, 0), weight=0.25), 0.05),
    ],
    ids=["min", "product", "max", "probor", "not-b", "neither", "weight"],
)
def test_strength_of_a_rule_by_hand(system, strength):
    # The degrees are 0.2, 0.6 and 0.5; the weighted average is then w / (w + 0.5).
    found = answer(system, np.array([[0.2, 0.6, 0.5]]), "sugeno")[0]
    assert found == pytest.approx(strength / (strength + 0.5), rel=1e-14)


def test_one_rule_gives_the_centroid_of_its_own_set():
    # +-10 sd fit on the universe, so symmetry about a grid point (samples 0.75 apart) is exact.
    system = always(FuzzySet("only", "gaussmf", (3.0, 30.0)))
    assert answer(system, ANY, "mamdani") == pytest.approx(30.0, abs=1e-12)


# --- the integral without samples --------------------------------------------------------------


def gaussian_piece(sd, c, a, b):
    """Area and moment of a Gaussian over [a, b], by the error function."""
    za, zb = (a - c) / (sd * sqrt(2)), (b - c) / (sd * sqrt(2))
    area = sd * sqrt(pi / 2) * (erf(zb) - erf(za))
    return area, c * area - sd**2 * (exp(-(zb**2)) - exp(-(za**2)))


def shoulders(sd, c, height):
    if height >= 1:
        return [c]
    reach = sd * sqrt(-2 * log(height))
    return [c - reach, c + reach]


def crossings(first, second):
    """Where two Gaussians are equal: as far from both centres, each in its own sd."""
    (s1, c1), (s2, c2) = first, second
    between = (c1 * s2 + c2 * s1) / (s1 + s2)
    return [between] if s1 == s2 else [between, (c1 * s2 - c2 * s1) / (s2 - s1)]


def centroid_by_error_functions(gaussians, heights, low, high):
    """Centroid of a maximum of clipped Gaussians from closed forms between all candidate kinks."""
    kinks = [low, high]
    for (sd, c), _ in zip(gaussians, heights, strict=True):
        for height in heights:
            kinks += shoulders(sd, c, height)
    for first, second in combinations(gaussians, 2):
        kinks += crossings(first, second)
    ends = sorted({x for x in kinks if low <= x <= high})
    area = moment = 0.0
    for a, b in pairwise(ends):
        middle = 0.5 * (a + b)
        # By logarithms, which do not underflow far from all centres.
        levels = [
            min(log(h), -(((middle - c) / sd) ** 2) / 2)
            for (sd, c), h in zip(gaussians, heights, strict=True)
        ]
        k = int(np.argmax(levels))
        if levels[k] == log(heights[k]):
            piece = heights[k] * (b - a), heights[k] * (b**2 - a**2) / 2
        else:
            piece = gaussian_piece(*gaussians[k], a, b)
        area, moment = area + piece[0], moment + piece[1]
    return moment / area


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(st.floats(0.3, 12), st.floats(0, 75), st.floats(0.001, 1)), min_size=1, max_size=4
    )
)
def test_exact_centroid_is_that_of_the_error_functions(drawn):
    gaussians, heights = [(sd, c) for sd, c, _ in drawn], [h for *_, h in drawn]
    system = always(*(FuzzySet(f"{i}", "gaussmf", g) for i, g in enumerate(gaussians)))
    found = exact.centroid(system, np.array(heights), membership)
    expected = centroid_by_error_functions(gaussians, heights, 0, 75)
    # The tolerance that the module states; the last of a converging series is far nearer.
    assert found == pytest.approx(expected, abs=75 * exact.TOLERANCE)


LIVER_LIKE = [(2.3, 6.77), (4.67, 9.69), (6.49, 17.68)]


def test_error_functions_notice_a_height_off_by_a_millionth():
    system = always(*(FuzzySet(f"{sd}", "gaussmf", (sd, c)) for sd, c in LIVER_LIKE))
    heights = np.array([0.9, 0.3, 0.12])
    found = exact.centroid(system, heights * [1, 1, 1 + 1e-6], membership)
    expected = centroid_by_error_functions(LIVER_LIKE, list(heights), 0, 75)
    assert found != pytest.approx(expected, abs=1e-7)


def test_samples_converge_to_the_exact_centroid():
    system = always(*(FuzzySet(f"{sd}", "gaussmf", (sd, c)) for sd, c in LIVER_LIKE))
    heights = np.array([0.9, 0.3, 0.12])
    exactly = exact.centroid(system, heights, membership)
    errors = []
    for samples in (101, 1001, 10001):
        quadrature = sampled(system.output, samples, "octave")
        mu = np.minimum(heights[:, None], memberships(system.output, quadrature.y, membership))
        errors.append(abs(centroid(quadrature, mu.max(axis=0)) - exactly))
    assert errors[0] > 10 * errors[1] > 100 * errors[2]
    assert errors[2] < 1e-6


@pytest.mark.parametrize("kind", SYSTEMS)
def test_exact_sampling_is_the_limit_of_many_samples(kind):
    X = np.array([[0.3, 0.4], [5.0, 2.5], [9.0, 9.5]])
    system = tipper()
    sets = tuple(replace(one, footprint=Footprint(mean=0.4)) for one in system.output.sets)
    system = replace(system, output=replace(system.output, sets=sets))
    limit = answer(system, X, kind, sampling="exact")
    # The trapezoidal rule of a kinked curve has an error of order h^2 = 2e-7 at h = 30/60000.
    assert answer(system, X, kind, sampling="octave", samples=60001) == pytest.approx(
        limit, abs=1e-6
    )
    assert answer(system, X, kind, sampling="octave") != pytest.approx(limit, abs=1e-5)


def test_exact_interval_spans_the_universe_where_nothing_fills_it_from_below():
    x = Variable("x", 0, 1, (FuzzySet("a", "trimf", (0.2, 0.5, 0.8), Footprint(mean=0.1)),))
    y = Variable("y", 0, 100, (FuzzySet("o", "gaussmf", (3.0, 90.0)),))
    found = infer(
        FuzzySystem((x,), y, (rule([(0, 0)], 0),)),
        [[0.28]],  # within the footprint of the foot: the lower strength is 0
        "interval-type-2",
        InferenceOptions(sampling="exact"),
    )
    assert found.interval[0] == pytest.approx([0.0, 100.0], abs=1e-9)


@pytest.mark.parametrize(
    "one",
    [
        FuzzySet("skewed", "trimf", (0.436, 0.526, 0.543), Footprint(mean=0.0357)),
        FuzzySet("lagging", "gaussmf", (0.05, 0.4), Footprint(spread=0.3, scale=0.9, lag=0.4)),
        FuzzySet("both", "trapmf", (0.1, 0.2, 0.25, 0.9), Footprint(mean=0.03, spread=0.2)),
    ],
)
def test_exact_interval_is_that_of_two_million_samples(one):
    y = np.linspace(0, 1, 2_000_001)
    weights = np.ones_like(y)
    weights[[0, -1]] = 0.5
    sampled_ends = karnik_mendel(
        Quadrature(y, weights), lower_membership(one, y), upper_membership(one, y)
    )
    system = always(one, low=0, high=1)
    found = infer(system, ANY, "interval-type-2", InferenceOptions(sampling="exact")).interval[0]
    # The samples' own error: a step of 5e-7 squared, times bends of up to 60.
    assert found == pytest.approx(sampled_ends, abs=1e-10)


# --- Sugeno ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("centre", "sd", "expected"), [(5.0, 1.6, "5.00206"), (40.0, 12.0, "39.95454")]
)
def test_sugeno_constant_is_the_centroid_cut_by_the_universe(centre, sd, expected):
    system = always(FuzzySet("only", "gaussmf", (sd, centre)))
    assert f"{sugeno.constants(system, 'matlab', 101)[0]:.5f}" == expected


def test_sugeno_by_hand_counts_a_repeated_rule_twice_in_the_sum_only():
    system = tipper()
    repeated = replace(system, rules=(*system.rules, system.rules[0]))
    X = np.array([[2.0, 1.0]])
    w = np.array([1.0, np.exp(-0.5 * 4), np.exp(-0.5 * (8 / 1.5) ** 2)])  # service 2, food 1
    z = np.array([5.0, 15.0, 25.0])  # symmetric triangles on grid points
    twice = w * [2, 1, 1]
    for rules, merge, weights in (
        (system, "sum", w), (system, "max", w), (repeated, "max", w), (repeated, "sum", twice)
    ):  # fmt: skip
        found = answer(rules, X, "sugeno", samples=301, sugeno_aggregation=merge)[0]
        assert found == pytest.approx(weights @ z / weights.sum(), rel=1e-12)


def test_linear_consequents_follow_the_readings():
    system = tipper()
    plane = FuzzySet("plane", "linear", (2.0, -3.0, 0.5))
    flat = FuzzySet("flat", "constant", (4.0,))
    linear = replace(
        system,
        output=replace(system.output, sets=(plane, flat)),
        rules=(rule([(0, 0)], 0), rule([(0, 1)], 1)),
    )
    w = np.exp([-0.5 * (2 / 1.5) ** 2, -0.5 * (3 / 1.5) ** 2])
    expected = w @ [2 * 2.0 - 3 * 1.0 + 0.5, 4.0] / w.sum()
    assert answer(linear, [[2.0, 1.0]], "sugeno")[0] == pytest.approx(expected, rel=1e-14)


# --- interval type-2 -------------------------------------------------------------------------

# Printed to 6 decimals, so half a unit of the last place is the rounding left over.
ROUNDED = 0.51e-6


@pytest.mark.parametrize("reduce", [karnik_mendel, eiasc])
@pytest.mark.parametrize(
    ("footprint", "left", "right"),
    [
        (Footprint(mean=0.125), 4.874977, 5.125023),
        (Footprint(mean=0.25), 4.749523, 5.250477),
        (Footprint(mean=0.375), 4.622647, 5.377353),
        (Footprint(mean=0.5), 4.492848, 5.507152),
        (Footprint(mean=1.0), 3.906969, 6.093031),
        (Footprint(mean=1.5), 3.150534, 6.849466),
        (Footprint(spread=0.125), 4.800539, 5.199461),
        (Footprint(spread=0.25), 4.600786, 5.399214),
        (Footprint(spread=0.375), 4.398492, 5.601508),
        (Footprint(spread=0.5), 4.184879, 5.815121),
        (Footprint(spread=0.75), 3.593878, 6.406122),
    ],
)
def test_centroid_of_an_uncertain_gaussian(footprint, left, right, reduce):
    uncertain = FuzzySet("u", "gaussmf", (1.0, 5.0), footprint)
    bounds = lower_membership(uncertain, GRID), upper_membership(uncertain, GRID)
    assert reduce(SUMS, *bounds) == pytest.approx([left, right], abs=ROUNDED)


@pytest.mark.parametrize(
    ("spread", "half_width"),
    [
        (0.125, 0.199484610212825),
        (0.25, 0.399405516663326),
        (0.2, 0.319300412016649),
        (0.5, 0.818048399831111),
    ],
)
def test_uncertain_sd_on_the_whole_line_reaches_the_analytic_root(spread, half_width):
    system = always(
        FuzzySet("u", "gaussmf", (1.0, 5.0), Footprint(spread=spread)), low=-25, high=35
    )
    found = infer(system, ANY, "interval-type-2", InferenceOptions(sampling="exact")).interval[0]
    assert found == pytest.approx([5 - half_width, 5 + half_width], abs=1e-11)


@pytest.mark.parametrize("a", [0.01, 0.25, 0.81])
def test_centroid_of_a_constant_band(a):
    band = FuzzySet("band", "trapmf", (-1.0, -1.0, 2.0, 2.0), Footprint(scale=a))
    system = always(band, low=0, high=1)
    found = infer(system, ANY, "interval-type-2", InferenceOptions(sampling="exact")).interval[0]
    root = sqrt(a)
    assert found == pytest.approx([root / (1 + root), 1 / (1 + root)], abs=1e-11)


def test_zero_footprint_is_mamdani():
    X = np.array([[0.3, 0.4], [5.0, 2.5], [9.0, 9.5]])
    found = infer(tipper(), X, "interval-type-2")
    expected = answer(tipper(), X, "mamdani")
    assert found.value == pytest.approx(expected, abs=1e-12 * 30)
    assert found.interval == pytest.approx(np.stack([expected, expected], axis=1), abs=1e-12 * 30)


def test_nie_tan_is_the_centroid_of_the_mean_of_both_bounds():
    skewed = FuzzySet("u", "trimf", (10.0, 20.0, 60.0), Footprint(mean=4.0, scale=0.7))
    system = always(skewed)
    y = np.linspace(0, 75, 101)
    both = lower_membership(skewed, y) + upper_membership(skewed, y)
    found = infer(system, ANY, "interval-type-2", InferenceOptions(reducer="nie-tan"))
    assert found.value[0] == pytest.approx((y @ both) / both.sum(), rel=1e-13)
    assert found.value[0] != pytest.approx(found.interval[0].mean(), rel=1e-4)


def test_bounds_that_nothing_fills_from_below_span_the_support():
    upper = np.where((GRID > 1.95) & (GRID < 4.05), 0.5, 0.0)
    for reduce in (karnik_mendel, eiasc):
        found = reduce(SUMS, np.zeros_like(GRID), upper)
        assert found == pytest.approx([2.0, 4.0], abs=1e-12)


def test_nothing_to_reduce_is_no_number():
    for reduce in (karnik_mendel, eiasc):
        assert np.isnan(reduce(SUMS, np.zeros_like(GRID), np.zeros_like(GRID))).all()


# Memberships on a coarse scale: exact zeros, and no numbers so small that products underflow.
LEVEL = st.integers(0, 1000).map(lambda n: n / 1000)


@st.composite
def bands(draw, low=2, high=9):
    size = draw(st.integers(low, high))
    levels = st.lists(LEVEL, min_size=size, max_size=size).map(np.array)
    a, b = draw(levels), draw(levels)
    upper = np.maximum(a, b)
    upper[draw(st.integers(0, size - 1))] = 1.0
    weights = np.ones(size)
    weights[[0, -1]] = draw(st.sampled_from([0.5, 1.0]))
    return Quadrature(np.linspace(0, 75, size), weights), np.minimum(a, b), upper


def vertex_centroids(quadrature, lower, upper):
    """Centroids of all 2^M sets that take one of the two bounds at each sample."""
    corners = np.array(list(product(*zip(lower, upper, strict=True)))) * quadrature.weights
    filled = corners[corners.sum(axis=1) > 0]
    return filled @ quadrature.y / filled.sum(axis=1)


@settings(max_examples=3000, deadline=None, derandomize=True)
@given(bands(high=7))
def test_reducers_find_the_extremes_of_all_embedded_sets(band):
    # No switch point is assumed: the centroid is extreme at a corner of the box of bounds.
    centroids = vertex_centroids(*band)
    extremes = [centroids.min(), centroids.max()]
    assert karnik_mendel(*band) == pytest.approx(extremes, abs=1e-10)
    assert eiasc(*band) == pytest.approx(extremes, abs=1e-10)


def test_bounds_in_the_wrong_order_miss_the_extremes():
    quadrature = Quadrature(np.arange(4.0), np.ones(4))
    lower, upper = np.full(4, 0.2), np.ones(4)
    centroids = vertex_centroids(quadrature, lower, upper)
    wrong = karnik_mendel(quadrature, upper, lower)
    assert wrong != pytest.approx([centroids.min(), centroids.max()], abs=1e-3)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(bands(low=3, high=60))
def test_interval_contains_nie_tan(band):
    quadrature, lower, upper = band
    left, right = karnik_mendel(*band)
    assert left - 1e-10 <= centroid(quadrature, lower + upper) <= right + 1e-10


def test_a_negated_term_uses_the_opposite_bound():
    uncertain = FuzzySet("u", "trimf", (0.0, 5.0, 10.0), Footprint(mean=1.0))
    x = Variable("x", 0, 10, (uncertain,))
    sets = (FuzzySet("a", "trimf", (0.0, 20.0, 40.0)), FuzzySet("b", "trimf", (35.0, 55.0, 75.0)))
    system = FuzzySystem(
        (x,), Variable("y", 0, 75, sets), (rule([(0, 0, True)], 0), rule([(0, 0)], 1))
    )
    from fuzzy.systems.interval_type2 import bounds_of_firing

    lower, upper = bounds_of_firing(system, np.array([[2.0]]))
    assert [lower[1, 0], upper[1, 0]] == pytest.approx([0.2, 0.6])
    assert [lower[0, 0], upper[0, 0]] == pytest.approx([0.4, 0.8])


# --- scikit-fuzzy as oracle ------------------------------------------------------------------


def test_centroid_equals_scikit_fuzzy_on_a_fine_grid():
    tip = tipper().output
    quadrature = sampled(tip, 3001, "matlab")
    y = quadrature.y
    skewed = memberships(tip, y, membership).max(axis=0) * y / tip.high
    # scikit-fuzzy integrates the piecewise-linear curve exactly. It vanishes at both ends, so the
    # two differ by the bends within a step only, of order h^2 = 1e-4.
    assert centroid(quadrature, skewed) == pytest.approx(skfuzzy.centroid(y, skewed), abs=1e-4)
    flat = memberships(tip, y, membership).max(axis=0)
    assert centroid(quadrature, flat) != pytest.approx(skfuzzy.centroid(y, skewed), abs=1e-4)
