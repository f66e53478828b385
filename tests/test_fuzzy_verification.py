"""The three inference engines against printed outputs, closed forms and other codes."""

import numpy as np
import pytest
import skfuzzy

from fuzzy import interval_type2, mamdani, sugeno
from fuzzy.sets import FuzzySet, lower_membership, membership, upper_membership
from fuzzy.system import Rule, System, Variable, grid, memberships

GRID = np.linspace(0, 10, 101)


def tipper(*, connective="or", sd=1.5):
    service = Variable(
        "service",
        0,
        10,
        tuple(FuzzySet(f"s{c}", "gaussian", (c, sd)) for c in (0.0, 5.0, 10.0)),
    )
    food = Variable(
        "food",
        0,
        10,
        (
            FuzzySet("rancid", "trapezoid", (-2.0, 0.0, 1.0, 3.0)),
            FuzzySet("delicious", "trapezoid", (7.0, 9.0, 10.0, 12.0)),
        ),
    )
    tip = Variable(
        "tip",
        0,
        30,
        tuple(FuzzySet(f"t{a}", "triangle", (a, a + 5, a + 10)) for a in (0.0, 10.0, 20.0)),
    )
    rules = (
        Rule(((0, 0), (1, 0)), 0, connective),
        Rule(((0, 1),), 1),
        Rule(((0, 2), (1, 1)), 2, connective),
    )
    return System((service, food), tip, rules)


def one_rule(output_set, low=0.0, high=75.0):
    full = Variable("x", 0, 1, (FuzzySet("any", "left-shoulder", (1.0, 1.0)),))
    return System((full,), Variable("y", low, high, (output_set,)), (Rule(((0, 0),), 0),))


# --- Mamdani ---------------------------------------------------------------------------------

TIPPER_INPUTS = np.array([[2.0, 1.0], [4.0, 5.0], [7.0, 8.0]])
TIPPER_PRINTED = ["7.0169", "14.4585", "20.3414"]  # MATLAB documentation, 101 samples


def printed(values):
    return [f"{value:.4f}" for value in values]


def test_tipper_prints_matlabs_digits():
    assert printed(mamdani.evaluate(tipper(), TIPPER_INPUTS, 101)) == TIPPER_PRINTED


@pytest.mark.parametrize(
    ("system", "samples"),
    [(tipper(connective="and"), 101), (tipper(sd=1.51), 101), (tipper(), 100)],
    ids=["and-for-or", "sd-one-percent-off", "100-samples"],
)
def test_tipper_shows_a_planted_error(system, samples):
    assert printed(mamdani.evaluate(system, TIPPER_INPUTS, samples)) != TIPPER_PRINTED


def test_mamdani_by_hand():
    # Heights 1/4 and 3/4 clip triangles (0, 1, 2) and (2, 3, 4). A triangle of base 2 clipped at h
    # has area h (2 - h); both stay symmetric, so the centroid is (7/16 * 1 + 15/16 * 3)/(22/16).
    x = Variable(
        "x",
        0,
        1,
        (
            FuzzySet("down", "trapezoid", (-1.0, -0.5, 0.0, 1.0)),
            FuzzySet("up", "trapezoid", (0.0, 1.0, 2.0, 3.0)),
        ),
    )
    y = Variable(
        "y",
        0,
        4,
        (
            FuzzySet("low", "triangle", (0.0, 1.0, 2.0)),
            FuzzySet("high", "triangle", (2.0, 3.0, 4.0)),
        ),
    )
    system = System((x,), y, (Rule(((0, 0),), 0), Rule(((0, 1),), 1)))
    # The corners (0.25, 0.75, ... ) are grid points: the sum rule is then exact to rounding.
    assert mamdani.evaluate(system, np.array([[0.75]]), 1601) == pytest.approx(52 / 22, abs=1e-12)


def test_one_rule_gives_the_centroid_of_its_own_set():
    system = one_rule(FuzzySet("only", "gaussian", (30.0, 3.0)))
    # +-10 sd fit on the universe, so symmetry about a grid point (samples 0.75 apart) is exact.
    assert mamdani.evaluate(system, np.array([[0.5]]), 101) == pytest.approx(30.0, abs=1e-12)


# --- Sugeno ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("centre", "sd", "centroid"), [(5.0, 1.6, "5.00206"), (40.0, 12.0, "39.95454")]
)
def test_sugeno_constant_is_the_centroid_cut_by_the_universe(centre, sd, centroid):
    system = one_rule(FuzzySet("only", "gaussian", (centre, sd)))
    assert f"{sugeno.constants(system, 101)[0]:.5f}" == centroid


def test_sugeno_by_hand_counts_a_repeated_rule_twice_in_the_sum_only():
    system = tipper()
    repeated = System(system.inputs, system.output, (*system.rules, system.rules[0]))
    x = np.array([[2.0, 1.0]])
    w = np.array([1.0, np.exp(-0.5 * 4), np.exp(-0.5 * (8 / 1.5) ** 2)])  # service 2, food 1
    z = np.array([5.0, 15.0, 25.0])  # symmetric triangles on grid points
    twice = w * [2, 1, 1]
    for rules, merge, weights in (
        (system, "sum", w), (system, "max", w), (repeated, "max", w), (repeated, "sum", twice)
    ):  # fmt: skip
        assert sugeno.evaluate(rules, x, 301, merge)[0] == pytest.approx(
            weights @ z / weights.sum(), rel=1e-12
        )


# --- interval type-2 -------------------------------------------------------------------------

# Printed to 6 decimals, so half a unit of the last place is the rounding left over.
ROUNDED = 0.51e-6


@pytest.mark.parametrize(
    ("spread", "left", "right"),
    [
        (0.125, 4.874977, 5.125023),
        (0.25, 4.749523, 5.250477),
        (0.375, 4.622647, 5.377353),
        (0.5, 4.492848, 5.507152),
        (1.0, 3.906969, 6.093031),
        (1.5, 3.150534, 6.849466),
    ],
)
def test_centroid_of_an_uncertain_mean(spread, left, right):
    uncertain = FuzzySet("u", "gaussian", (5.0, 1.0), spread)
    bounds = lower_membership(uncertain, GRID), upper_membership(uncertain, GRID)
    assert interval_type2.type_reduce(GRID, *bounds) == pytest.approx([left, right], abs=ROUNDED)


def sd_bounds(x, low_sd, high_sd, mean=5.0):
    return [membership(FuzzySet("g", "gaussian", (mean, sd)), x) for sd in (low_sd, high_sd)]


@pytest.mark.parametrize(
    ("low_sd", "high_sd", "left", "right"),
    [
        (0.875, 1.125, 4.800539, 5.199461),
        (0.75, 1.25, 4.600786, 5.399214),
        (0.625, 1.375, 4.398492, 5.601508),
        (0.5, 1.5, 4.184879, 5.815121),
        (0.25, 1.75, 3.593878, 6.406122),
    ],
)
def test_centroid_of_an_uncertain_sd(low_sd, high_sd, left, right):
    bounds = sd_bounds(GRID, low_sd, high_sd)
    assert interval_type2.type_reduce(GRID, *bounds) == pytest.approx([left, right], abs=ROUNDED)


@pytest.mark.parametrize(
    ("low_sd", "high_sd", "half_width"),
    [
        (0.875, 1.125, 0.199484610212825),
        (0.75, 1.25, 0.399405516663326),
        (0.8, 1.2, 0.319300412016649),
        (0.5, 1.5, 0.818048399831111),
    ],
)
def test_uncertain_sd_on_the_whole_line_reaches_the_analytic_root(low_sd, high_sd, half_width):
    # Sums of a smooth function are spectrally accurate, but the jump at the switch point is known
    # to a step h only; the centroid is stationary there, so the error is of order h^2 = 4e-6.
    x = np.linspace(-15, 25, 20001)
    bounds = sd_bounds(x, low_sd, high_sd)
    reduced = interval_type2.type_reduce(x, *bounds)
    assert reduced == pytest.approx([5 - half_width, 5 + half_width], abs=4e-6)
    swapped = interval_type2.type_reduce(x, *sd_bounds(x, low_sd, 1.01 * high_sd))
    assert swapped != pytest.approx([5 - half_width, 5 + half_width], abs=4e-6)


@pytest.mark.parametrize("a", [0.01, 0.25, 0.81])
def test_centroid_of_a_constant_band(a):
    x = np.linspace(0, 1, 20001)
    reduced = interval_type2.type_reduce(x, np.full_like(x, a), np.ones_like(x))
    root = np.sqrt(a)
    # Rectangle sums of a constant: the two end samples weigh a full step h = 5e-5 instead of half.
    assert reduced == pytest.approx([root / (1 + root), 1 / (1 + root)], abs=5e-5)


def test_zero_footprint_is_mamdani():
    X = np.array([[0.3, 0.4], [5.0, 2.5], [9.0, 9.5]])
    value, interval = interval_type2.evaluate(tipper(), X, 101)
    expected = mamdani.evaluate(tipper(), X, 101)
    assert value == pytest.approx(expected, abs=1e-12 * 30)
    assert interval == pytest.approx(np.stack([expected, expected], axis=1), abs=1e-12 * 30)


def test_bounds_that_nothing_fills_from_below_span_the_support():
    upper = np.where((GRID > 1.95) & (GRID < 4.05), 0.5, 0.0)
    reduced = interval_type2.type_reduce(GRID, np.zeros_like(GRID), upper)
    assert reduced == pytest.approx([2.0, 4.0], abs=1e-12)


def test_nothing_to_reduce_is_refused():
    with pytest.raises(ValueError, match="nothing to reduce"):
        interval_type2.type_reduce(GRID, np.zeros_like(GRID), np.zeros_like(GRID))


# --- scikit-fuzzy as oracle ------------------------------------------------------------------


def test_memberships_equal_scikit_fuzzy():
    far = 1e6  # a plateau that ends outside the grid
    pairs = [
        (("gaussian", (4.0, 1.3)), skfuzzy.gaussmf(GRID, 4.0, 1.3)),
        (("left-shoulder", (4.0, 1.3)), skfuzzy.gauss2mf(GRID, -far, 1.0, 4.0, 1.3)),
        (("right-shoulder", (4.0, 1.3)), skfuzzy.gauss2mf(GRID, 4.0, 1.3, far, 1.0)),
        (("triangle", (1.0, 4.0, 6.0)), skfuzzy.trimf(GRID, [1.0, 4.0, 6.0])),
        (("trapezoid", (1.0, 3.0, 4.0, 8.0)), skfuzzy.trapmf(GRID, [1.0, 3.0, 4.0, 8.0])),
    ]
    for (kind, parameters), expected in pairs:
        ours = membership(FuzzySet(kind, kind, parameters), GRID)
        assert ours == pytest.approx(expected, abs=1e-14)


def test_uncertain_mean_is_scikit_fuzzys_plateau_and_smaller_gaussian():
    uncertain = FuzzySet("u", "gaussian", (4.0, 1.3), 0.5)
    upper = skfuzzy.gauss2mf(GRID, 3.5, 1.3, 4.5, 1.3)
    lower = np.minimum(skfuzzy.gaussmf(GRID, 3.5, 1.3), skfuzzy.gaussmf(GRID, 4.5, 1.3))
    assert upper_membership(uncertain, GRID) == pytest.approx(upper, abs=1e-14)
    assert lower_membership(uncertain, GRID) == pytest.approx(lower, abs=1e-14)


def test_centroid_equals_scikit_fuzzy_on_a_fine_grid():
    tip = tipper().output
    y = grid(tip, 3001)
    mu = memberships(tip, y, membership).max(axis=0)
    skewed = mu * y / tip.high
    # scikit-fuzzy integrates the piecewise-linear curve exactly. It vanishes at both ends, so the
    # two differ by the bends within a step only, of order h^2 = 1e-4.
    assert mamdani.centroid(y, skewed) == pytest.approx(skfuzzy.centroid(y, skewed), abs=1e-4)
    assert mamdani.centroid(y, mu) != pytest.approx(skfuzzy.centroid(y, skewed), abs=1e-4)


# --- refusals --------------------------------------------------------------------------------


@pytest.mark.parametrize("evaluate", [
    lambda s, X: mamdani.evaluate(s, X, 101),
    lambda s, X: sugeno.evaluate(s, X, 101, "sum"),
    lambda s, X: interval_type2.evaluate(s, X, 101),
], ids=["mamdani", "sugeno", "interval-type-2"])  # fmt: skip
class TestRefusals:
    def silent(self):
        x = Variable("hcv", 0, 100, (FuzzySet("mild", "gaussian", (5.0, 1.0)),))
        return System((x,), tipper().output, (Rule(((0, 0),), 0),))

    def test_silence_is_no_answer(self, evaluate):
        with pytest.raises(ValueError, match=r"no rule fires for hcv = 40 \(row 1\)"):
            evaluate(self.silent(), np.array([[5.0], [40.0]]))

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    def test_no_number_is_refused_by_name(self, evaluate, value):
        with pytest.raises(ValueError, match=r"hcv = .*finite reading"):
            evaluate(self.silent(), np.array([[value]]))

    def test_wrong_width_is_refused(self, evaluate):
        with pytest.raises(ValueError, match=r"shape \(1, 3\)"):
            evaluate(self.silent(), np.ones((1, 3)))


@pytest.mark.parametrize(
    ("kind", "parameters", "spread", "message"),
    [
        ("bell", (1.0, 2.0), 0.0, "kind 'bell'"),
        ("gaussian", (1.0,), 0.0, "takes 2 parameters, got 1"),
        ("gaussian", (1.0, 0.0), 0.0, "positive sd"),
        ("gaussian", (np.nan, 1.0), 0.0, "do not form"),
        ("triangle", (1.0, 0.0, 2.0), 0.0, "rise and fall"),
        ("gaussian", (1.0, 1.0), -0.1, "spread -0.1"),
    ],
)
def test_a_set_that_is_none_is_refused(kind, parameters, spread, message):
    with pytest.raises(ValueError, match=message):
        FuzzySet("odd", kind, parameters, spread)


@pytest.mark.parametrize("rule", [Rule(((2, 0),), 0), Rule(((0, 3),), 0), Rule(((0, 0),), 3),
                                  Rule((), 0), Rule(((-1, 0),), 0)])  # fmt: skip
def test_a_rule_out_of_the_system_is_refused(rule):
    system = tipper()
    with pytest.raises(ValueError, match=r"rule 2: .*does not have"):
        System(system.inputs, system.output, (system.rules[0], rule))


def test_a_system_without_rules_and_an_empty_variable_are_refused():
    system = tipper()
    with pytest.raises(ValueError, match="no rules"):
        System(system.inputs, system.output, ())
    with pytest.raises(ValueError, match="no set"):
        Variable("x", 0, 1, ())
    with pytest.raises(ValueError, match="must be below"):
        Variable("x", 1, 1, system.output.sets)
