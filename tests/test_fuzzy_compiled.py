"""The compiled kernels against the numpy definitions, and scikit-fuzzy against both."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.systems import interval_type2, kernel
from fuzzy.systems.compiled import KERNEL_FORMS, compiled
from fuzzy.systems.inference import infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.policy import LEAST_STRENGTH
from fuzzy.systems.redundancy import dominated
from fuzzy.systems.sets import FORMS, TYPE_1, Footprint, FuzzySet
from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable

LIVER = liver_system(LiverSettings(knowledge="severity"))
EXACT = InferenceOptions(sampling="exact")
INSIDE = np.random.default_rng(20240917).uniform(2.0, 75.0, (300, 5))


def defined(system, X, kind, options):
    """Output of the numpy module that defines the answer."""
    return SYSTEMS[kind].evaluate(system, X, options)


def assert_same(got, wanted, allowed):
    """NaN in the same rows, and nowhere further apart than `allowed`, a number or one per row."""
    np.testing.assert_allclose(got.strength, wanted.strength, rtol=1e-12, atol=1e-15)
    ends = [(got.value, wanted.value)]
    if wanted.interval is not None:
        ends += list(zip(got.interval.T, wanted.interval.T, strict=True))
    for one, other in ends:
        answered = ~np.isnan(other)
        assert (np.isnan(one) == ~answered).all()
        apart = np.where(answered, np.abs(one - other), 0.0)
        assert (apart <= allowed).all()


def rounding(system, X, kind, strength):
    """What an error of 4e-16 in degrees may move an answer by, as a fraction of the universe.

    NOT, probor, a lag and a difference of sigmoids leave such an error however small the strength.
    A weight of that strength is wrong by their quotient. An end of the type-2 interval lies where
    the square root of lower over upper area takes it, so that it may move by the root of the error.
    """
    error = 4e-16
    if kind == "interval-type-2":
        lower = interval_type2.bounds_of_firing(system, X)[0].max(axis=0)
        return np.minimum(error / np.maximum(lower, 1e-300), np.sqrt(error / strength))
    return error / strength


# Random systems


def parameters_of(kind, rng):
    """Valid parameters on a universe of about [0, 10]."""
    corners = np.sort(rng.uniform(-2, 12, 4))
    width, centre = rng.uniform(0.3, 4), rng.uniform(-1, 11)
    slopes = rng.choice([-1, 1], 2) * rng.uniform(0.3, 6, 2)
    return {
        "gaussmf": (width, centre),
        "gauss2mf": (width, corners[1], rng.uniform(0.3, 4), corners[2]),
        "trimf": tuple(corners[:3]),
        "trapmf": tuple(corners),
        "pimf": tuple(corners),
        "gbellmf": (width, rng.uniform(0.5, 5), centre),
        "sigmf": (slopes[0], centre),
        "dsigmf": (slopes[0], corners[0], slopes[1], corners[3]),
        "psigmf": (slopes[0], corners[0], slopes[1], corners[3]),
        "zmf": (corners[1], corners[2]),
        "smf": (corners[1], corners[2]),
        "linzmf": (corners[1], corners[2]),
        "linsmf": (corners[1], corners[2]),
    }[kind]


def footprint_of(kind, rng, lag):
    moved = kind not in ("dsigmf", "psigmf")
    return Footprint(
        mean=rng.choice([0, rng.uniform(0, 2)]) if moved else 0.0,
        spread=rng.choice([0, rng.uniform(0, 0.9)]) if moved and kind != "sigmf" else 0.0,
        scale=rng.choice([1, rng.uniform(0.3, 1)]),
        lag=rng.choice([0, rng.uniform(0, 0.5)]) if lag else 0.0,
    )


def random_variable(name, kinds, rng, lag):
    sets = (
        FuzzySet(
            f"s{i}",
            str(kind),
            tuple(float(p) for p in parameters_of(kind, rng)),
            footprint_of(kind, rng, lag),
        )
        for i, kind in enumerate(kinds)
    )
    return Variable(name, 0.0, 10.0, tuple(sets))


def random_rule(inputs, outputs, rng, negation):
    chosen = rng.choice(len(inputs), rng.integers(1, len(inputs) + 2))  # one may come twice
    terms = tuple(
        Term(int(i), int(rng.integers(len(inputs[i].sets))), bool(rng.random() < negation))
        for i in chosen
    )
    weight = float(rng.choice([1.0, rng.uniform()]))
    return Rule(terms, int(rng.integers(outputs)), str(rng.choice(["and", "or"])), weight)


def random_system(seed, exactly=False):
    """Three inputs with sets of all kinds, rules with NOT, OR and weights, random operators.

    `exactly` leaves out whatever rounds by more than a fraction of its result.
    """
    rng = np.random.default_rng(seed)
    pool = [kind for kind in FORMS if not exactly or kind != "dsigmf"]
    kinds = rng.permutation([*pool, *rng.choice(pool, 13 - len(pool))])
    inputs = tuple(
        random_variable(f"x{i}", kinds[3 * i : 3 * i + 3], rng, not exactly) for i in range(3)
    )
    output = random_variable("y", kinds[9:], rng, not exactly)
    operators = Operators(
        str(rng.choice(["min", "prod"])),
        "max" if exactly else str(rng.choice(["max", "probor"])),
        str(rng.choice(["min", "prod"])),
    )
    negation = 0.0 if exactly else 0.3
    rules = [random_rule(inputs, len(output.sets), rng, negation) for _ in range(12)]
    return FuzzySystem(inputs, output, tuple(rules), operators)


OPTIONS = [
    ("mamdani", InferenceOptions()),
    ("mamdani", InferenceOptions(sampling="octave", samples=57)),
    ("sugeno", InferenceOptions()),
    ("sugeno", InferenceOptions(sugeno_aggregation="max")),
    ("interval-type-2", InferenceOptions()),
    ("interval-type-2", InferenceOptions(sampling="octave", samples=57)),
    ("interval-type-2", InferenceOptions(reducer="nie-tan")),
]


def readings(seed):
    """Also far outside, and more rows than one block holds."""
    return np.random.default_rng(seed).uniform(-8, 18, (kernel.BLOCK + 37, 3))


# A hundred terms summed in another order move a centroid by some 1e-14 of its universe.
SUMS = 1e-13


@pytest.mark.parametrize("seed", range(30))
def test_kernels_give_what_the_numpy_modules_define(seed):
    system, X = random_system(seed, exactly=True), readings(seed)
    for kind, options in OPTIONS:
        wanted = defined(system, X, kind, options)
        assert_same(compiled(system, kind, options).evaluate(X), wanted, SUMS * 10.0)


@pytest.mark.parametrize("seed", range(30))
def test_so_they_do_with_not_probor_lags_and_differences_to_their_rounding(seed):
    system, X = random_system(seed), readings(seed)
    for kind, options in OPTIONS:
        wanted = defined(system, X, kind, options)
        allowed = 10.0 * (SUMS + rounding(system, X, kind, np.maximum(wanted.strength, 1e-300)))
        assert_same(compiled(system, kind, options).evaluate(X), wanted, allowed)


def test_an_error_in_the_ninth_digit_would_be_seen():
    system, X = LIVER, INSIDE
    first = system.output.sets[0]
    moved = replace(first, parameters=(first.parameters[0], first.parameters[1] * (1 + 1e-9)))
    wrong = replace(system, output=replace(system.output, sets=(moved, *system.output.sets[1:])))
    for kind in SYSTEMS:
        got = compiled(wrong, kind, InferenceOptions()).evaluate(X)
        with pytest.raises(AssertionError):
            assert_same(got, defined(system, X, kind, InferenceOptions()), SUMS * 75.0)


def test_every_kind_has_a_form_in_the_kernel():
    assert set(KERNEL_FORMS) == set(FORMS)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_the_liver_is_the_same_compiled(kind):
    for options in (
        InferenceOptions(),
        InferenceOptions(sugeno_aggregation="max", reducer="nie-tan", samples=1001),
    ):
        wanted = defined(LIVER, INSIDE, kind, options)
        assert_same(compiled(LIVER, kind, options).evaluate(INSIDE), wanted, SUMS * 75.0)


@pytest.mark.parametrize("consequent", ["constant", "linear"])
@pytest.mark.parametrize("merge", ["sum", "max"])
def test_functions_as_consequents(consequent, merge):
    system = random_system(3)
    numbers = np.random.default_rng(1).uniform(-5, 5, (4, 1 if consequent == "constant" else 4))
    functions = tuple(
        FuzzySet(f"f{i}", consequent, tuple(row)) for i, row in enumerate(numbers.tolist())
    )
    system = replace(system, output=replace(system.output, sets=functions))
    X, options = readings(3), InferenceOptions(sugeno_aggregation=merge)
    wanted = defined(system, X, "sugeno", options)
    allowed = 100.0 * (SUMS + rounding(system, X, "sugeno", wanted.strength))
    assert_same(compiled(system, "sugeno", options).evaluate(X), wanted, allowed)


# Vertical flanks


def stepped(kind):
    """A set for each way to have a vertical flank, all with an uncertain mean."""
    corners = ((3.1, 3.1, 5.2, 6.7), (3.1, 4.4, 6.7, 6.7), (3.1, 3.1, 6.7, 6.7))
    sets = tuple(FuzzySet(f"s{i}", kind, p, Footprint(mean=0.7)) for i, p in enumerate(corners))
    out = tuple(FuzzySet(f"o{k}", "gaussmf", (0.5, 2.0 + 3 * k)) for k in range(len(sets)))
    rules = tuple(Rule((Term(0, k),), k) for k in range(len(sets)))
    return FuzzySystem((Variable("x", 0, 10, sets),), Variable("y", 0, 10, out), rules)


@pytest.mark.parametrize("kind", SYSTEMS)
@pytest.mark.parametrize("form", ["trapmf", "pimf"])
def test_vertical_flanks_are_the_same_compiled(kind, form):
    system, X = stepped(form), np.random.default_rng(1).uniform(0, 10, (5000, 1))
    wanted, got = (
        defined(system, X, kind, InferenceOptions()),
        compiled(system, kind, InferenceOptions()).evaluate(X),
    )
    assert_same(got, wanted, SUMS * 10.0)
    # Beyond the feet nothing fires, and within reach of the cores something fires fully.
    reach = 0.7 if kind == "interval-type-2" else 0.0
    beyond = (X[:, 0] < 3.1 - reach) | (X[:, 0] > 6.7 + reach)
    assert 0.2 < beyond.mean() < 0.8
    assert (got.strength[beyond] == 0.0).all()
    assert (got.strength[~beyond] == 1.0).all()


# Small strengths and areas


def falling(footprint=TYPE_1):
    """One rule per output set; strengths fall to nothing as x grows."""
    inputs = Variable("x", 0, 1, (FuzzySet("near", "gaussmf", (1.0, 0.0), footprint),))
    sets = tuple(
        FuzzySet(f"c{c}", "gaussmf", (1.5, c), Footprint(spread=0.3)) for c in (2.0, 5.0, 9.0)
    )
    rules = tuple(Rule((Term(0, 0),), k, weight=weight) for k, weight in enumerate((1.0, 0.5, 0.1)))
    return FuzzySystem((inputs,), Variable("y", 0.0, 10.0, sets), rules)


@pytest.mark.parametrize("kind", SYSTEMS)
@pytest.mark.parametrize("footprint", [TYPE_1, Footprint(spread=0.97), Footprint(lag=0.2)])
def test_down_to_the_least_strength_a_float_can_be(kind, footprint):
    # exp(-745) is the least of all; the lower bound is long 0 by then.
    X = np.linspace(0.0, 80.0, 4001)[:, None]
    system = falling(footprint)
    wanted = defined(system, X, kind, InferenceOptions())
    got = compiled(system, kind, InferenceOptions()).evaluate(X)
    silent = wanted.strength == 0
    assert silent[-1]
    assert not silent[0]
    normal = wanted.strength > 1e-290  # below, products lose digits in both
    for one, other in zip(got, wanted, strict=True):
        if other is not None:
            np.testing.assert_allclose(one[normal], other[normal], rtol=1e-12, atol=1e-12)
            assert (np.isnan(one) == np.isnan(other)).all()


def test_exponentials_to_two_units_in_the_last_place():
    x = np.concatenate([-np.geomspace(1e-20, 760.0, 5000), -np.linspace(0, 760, 5000), [0.0]])
    table = np.zeros((3, x.size))
    table[0] = x
    kernel.exponentiate(table, 0, x.size)
    exact = np.array([math.exp(one) for one in x])
    assert (np.abs(table[0] - exact) <= 2 * np.spacing(exact)).all()
    assert table[0, -1] == 1.0
    assert (table[0] <= 1.0).all()


# Rules that are left out


@pytest.mark.parametrize("kind", ["mamdani", "interval-type-2"])
def test_dominated_rules_change_no_bit_of_the_liver(kind):
    # By min, a longer AND is not greater by a single bit.
    pruned = compiled(LIVER, kind, InferenceOptions())
    whole = compiled(LIVER, kind, InferenceOptions(), pruned=False)
    kept = len(LIVER.rules) - len(dominated(LIVER))
    assert pruned.arguments[1].weight.size == kept < whole.arguments[1].weight.size == 247
    for one, other in zip(pruned.evaluate(INSIDE), whole.evaluate(INSIDE), strict=True):
        np.testing.assert_array_equal(one, other)


def test_no_rule_is_left_out_of_a_sum():
    options = InferenceOptions(sugeno_aggregation="sum")
    assert compiled(LIVER, "sugeno", options).arguments[1].weight.size == 247


@pytest.mark.parametrize("seed", range(12))
def test_dominated_rules_change_no_answer_of_any_system(seed):
    system, X = random_system(seed, exactly=True), readings(seed)
    # Longer and weaker copies of the rules, which are dominated under every operator.
    extra = tuple(
        replace(rule, antecedents=(*rule.antecedents, Term(0, 0)), weight=0.9 * rule.weight)
        for rule in system.rules
        if rule.connective == "and"
    )
    system = replace(system, rules=extra + system.rules)
    assert len(dominated(system)) >= len(extra)
    for kind in ("mamdani", "interval-type-2"):
        pruned = compiled(system, kind, InferenceOptions()).evaluate(X)
        whole = compiled(system, kind, InferenceOptions(), pruned=False).evaluate(X)
        # A product of the same terms in another order differs by an ulp.
        assert_same(pruned, whole, 1e-14)


def test_a_rule_wrongly_left_out_would_be_seen():
    idle = {pair.rule for pair in dominated(LIVER)}
    needed = next(number for number in range(247) if number not in idle)
    lost = replace(LIVER, rules=LIVER.rules[:needed] + LIVER.rules[needed + 1 :])
    got = compiled(lost, "mamdani", InferenceOptions()).evaluate(INSIDE)
    with pytest.raises(AssertionError):
        assert_same(got, defined(LIVER, INSIDE, "mamdani", InferenceOptions()), 1e-6)


# Rows and blocks


def test_ends_that_differ_by_rounding_alone_are_in_order():
    """Without a footprint both ends are the centroid, and the answer is not outside them."""
    system = liver_system(LiverSettings(knowledge="severity", footprint_factor=0.0))
    for found in (
        defined(system, INSIDE, "interval-type-2", InferenceOptions()),
        compiled(system, "interval-type-2", InferenceOptions()).evaluate(INSIDE),
    ):
        low, high = found.interval.T
        assert (low <= found.value).all()
        assert (found.value <= high).all()
        np.testing.assert_allclose(low, high, rtol=1e-12)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_an_answer_does_not_depend_on_the_rows_beside_it(kind):
    model = compiled(LIVER, kind, InferenceOptions())
    X = np.random.default_rng(1).uniform(2, 75, (2 * kernel.BLOCK + 1, 5))
    together = model.evaluate(X)
    for rows in (slice(0, 1), slice(7, 7 + kernel.BLOCK), slice(kernel.BLOCK - 3, None)):
        apart = model.evaluate(X[rows])
        np.testing.assert_array_equal(apart.value, together.value[rows])
        np.testing.assert_array_equal(apart.strength, together.strength[rows])
    for x, value in zip(X[:50], together.value, strict=False):
        assert model.one(tuple(x)).value == value


@pytest.mark.parametrize(("kind", "options"), OPTIONS)
@pytest.mark.parametrize("seed", range(2))
def test_one_gives_every_bit_of_evaluate(kind, options, seed):
    # One row has sums of its own, which stop early at the ends of the type-2 interval.
    system, X = random_system(seed), readings(seed)
    model = compiled(system, kind, replace(options, out_of_range="matlab"))
    output = model.evaluate(X)
    fired = np.flatnonzero(output.strength >= LEAST_STRENGTH)
    assert fired.size > 50
    answers = np.array([model.one(x)[:3] for x in X[fired]])
    ends = output.value[:, None] if output.interval is None else output.interval
    np.testing.assert_array_equal(answers[:, 0], output.value[fired])
    np.testing.assert_array_equal(answers[:, 1:], np.broadcast_to(ends, (len(X), 2))[fired])


@pytest.mark.parametrize("kind", SYSTEMS)
def test_what_is_packed_for_one_row_comes_back(kind):
    system = random_system(4)
    model = compiled(system, kind, InferenceOptions())
    sets, rules, output = model.arguments[:3]
    integers, floats = kernel.pack(model.universes, True, *model.arguments)
    universes, *parts, rest = kernel.unpacked(integers, floats)
    np.testing.assert_array_equal(universes, model.universes)
    wanted, got = [*sets, *rules], [*parts[0], *parts[1]]
    if kind == "sugeno":
        wanted.append(output.ravel())
        got.append(rest)
    else:
        wanted += output
        got += kernel.grid_of(integers, rest)
    for one, other in zip(got, wanted, strict=True):
        np.testing.assert_array_equal(one, other)


def test_columns_may_lie_in_any_order_in_memory():
    model = compiled(LIVER, "mamdani", InferenceOptions())
    wanted = model.evaluate(INSIDE).value
    np.testing.assert_array_equal(model.evaluate(np.asfortranarray(INSIDE)).value, wanted)
    np.testing.assert_array_equal(model.evaluate(INSIDE[::2]).value, wanted[::2])


@pytest.mark.parametrize("kind", SYSTEMS)
def test_no_rows_have_no_answers(kind):
    output = compiled(LIVER, kind, InferenceOptions()).evaluate(np.empty((0, 5)))
    assert output.value.shape == (0,)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_many_rows_are_inferred_as_few_are(kind):
    # Beyond 512 rows `infer` takes the kernel.
    X = np.random.default_rng(1).uniform(2, 75, (600, 5))
    many = infer(LIVER, X, kind)
    few = [infer(LIVER, part, kind) for part in np.split(X, 3)]
    apart = many.value - np.concatenate([one.value for one in few])
    assert np.abs(apart).max() < SUMS * 75.0


# What is refused, and what is said


def test_exact_sampling_is_not_compiled():
    with pytest.raises(ValueError, match="exact"):
        compiled(LIVER, "mamdani", InferenceOptions(sampling="exact"))


def test_a_kind_the_system_cannot_be_is_refused():
    with pytest.raises(ValueError, match="mamdany"):
        compiled(LIVER, "mamdany", InferenceOptions())


@pytest.mark.parametrize("bad", [np.full((3, 4), 10.0), np.array([[10.0, np.nan, 9, 9, 9]])])
def test_readings_that_make_no_sense_are_refused(bad):
    with pytest.raises(ValueError, match=r"shape \(3, 4\)|hbv = nan"):
        compiled(LIVER, "mamdani", InferenceOptions()).evaluate(bad)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_one_answers_as_infer_does(kind):
    for options in (InferenceOptions(), InferenceOptions(reducer="nie-tan", sampling="octave")):
        model = compiled(LIVER, kind, options)
        inferred = infer(LIVER, INSIDE[:40], kind, options)
        ends = inferred.interval
        if ends is None:
            ends = np.stack([inferred.value, inferred.value], axis=-1)
        for x, value, (lower, upper) in zip(INSIDE, inferred.value, ends, strict=False):
            answer = model.one(list(x))
            np.testing.assert_allclose(answer[:3], (value, lower, upper), rtol=0, atol=1e-11)
            assert not answer.clamped
            assert not answer.silent
            assert all(type(number) is float for number in answer[:3])


def test_one_clamps_and_says_so():
    model = compiled(LIVER, "mamdani", InferenceOptions())
    outside, edge = (90.0, 10.0, 10.0, 10.0, 10.0), (75.0, 10.0, 10.0, 10.0, 10.0)
    assert model.one(outside) == model.one(edge)._replace(clamped=True)
    assert outside[0] == 90.0


def test_one_refuses_or_takes_readings_outside_as_requested():
    outside = np.array([90.0, 10.0, 10.0, 10.0, 10.0])
    with pytest.raises(ValueError, match="hcv: reading 90"):
        compiled(LIVER, "mamdani", InferenceOptions(out_of_range="raise")).one(outside)
    answer = compiled(LIVER, "mamdani", InferenceOptions(out_of_range="matlab")).one(outside)
    assert not answer.clamped
    assert not answer.silent


@pytest.mark.parametrize("bad", [(1.0, 2.0), (10.0, math.nan, 9, 9, 9), (math.inf, 9, 9, 9, 9)])
def test_one_refuses_what_is_no_reading(bad):
    for policy in ("clamp", "raise", "matlab"):
        with pytest.raises(ValueError, match="give"):
            compiled(LIVER, "mamdani", InferenceOptions(out_of_range=policy)).one(bad)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_one_says_that_no_rule_fires(kind):
    system = falling()
    wide = replace(system, inputs=(replace(system.inputs[0], high=100.0),))
    with pytest.raises(ValueError, match="no rule fires"):
        compiled(wide, kind, InferenceOptions()).one((60.0,))
    answer = compiled(wide, kind, InferenceOptions(out_of_range="matlab")).one((60.0,))
    assert answer.silent
    assert answer.value == 5.0
    assert compiled(wide, kind, InferenceOptions()).one((0.5,)).silent is False
