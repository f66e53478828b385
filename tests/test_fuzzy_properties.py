"""Properties that hold for every system, tried on random ones."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.systems.inference import infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import centroid, sampled
from fuzzy.systems.sets import (
    FORMS,
    Footprint,
    FuzzySet,
    lower_membership,
    membership,
    upper_membership,
)
from fuzzy.systems.system import (
    FuzzySystem,
    Operators,
    Rule,
    Term,
    Variable,
    firing_strengths,
    memberships,
    union,
)

READING = st.floats(2, 75)
ROW = st.lists(READING, min_size=5, max_size=5).map(lambda row: np.array([row]))
quick = settings(max_examples=50, deadline=None, derandomize=True)
LIVER = liver_system(LiverSettings(knowledge="severity"))
TYPE_1 = liver_system(LiverSettings(knowledge="severity", footprint_factor=0.0))


def interval(system, row):
    return infer(system, row, "interval-type-2").interval[0]


@quick
@given(ROW, st.integers(0, 20), st.integers(1, 20))
def test_interval_grows_with_the_footprint(row, tenths, more):
    narrow, wide = (
        interval(liver_system(LiverSettings(knowledge="severity", footprint_factor=n / 20)), row)
        for n in (tenths, tenths + more)
    )
    assert wide[0] <= narrow[0] + 1e-10
    assert wide[1] >= narrow[1] - 1e-10


@quick
@given(ROW)
def test_zero_footprint_is_mamdani_on_the_liver(row):
    found = infer(TYPE_1, row, "interval-type-2")
    expected = infer(TYPE_1, row, "mamdani").value[0]
    assert [found.value[0], *found.interval[0]] == pytest.approx([expected] * 3, rel=1e-12)


def every_answer(system, row):
    one_by_one = [infer(system, row, kind).value[0] for kind in SYSTEMS]
    merged = infer(system, row, "sugeno", InferenceOptions(sugeno_aggregation="max")).value[0]
    return [*one_by_one, merged, *interval(system, row)]


@quick
@given(ROW, st.permutations(range(247)))
def test_rule_order_changes_nothing(row, order):
    shuffled = replace(LIVER, rules=tuple(LIVER.rules[i] for i in order))
    # Only the order of the sum over rules differs, 247 roundings at most.
    assert every_answer(LIVER, row) == pytest.approx(every_answer(shuffled, row), rel=1e-13)


@quick
@given(ROW)
def test_repeated_rules_change_the_sugeno_sum_only(row):
    dropped = liver_system(LiverSettings(knowledge="severity", reading="R1-no-duplicates"))
    kept, once = every_answer(LIVER, row), every_answer(dropped, row)
    at_sum = list(SYSTEMS).index("sugeno")
    assert kept[:at_sum] == once[:at_sum]
    assert kept[at_sum + 1 :] == once[at_sum + 1 :]


def test_a_repeated_rule_does_change_the_sugeno_sum():
    row = np.array([[9.5, 4.1, 4.1, 4.1, 4.1]])
    dropped = liver_system(LiverSettings(knowledge="severity", reading="R1-no-duplicates"))
    kept, once = (infer(system, row, "sugeno").value[0] for system in (LIVER, dropped))
    assert abs(kept - once) > 1e-3


@quick
@given(ROW)
def test_merging_heights_equals_clipping_rule_by_rule(row):
    strengths = firing_strengths(LIVER, row, membership)[:, 0]
    quadrature = sampled(LIVER.output, 101, "matlab")
    sets = memberships(LIVER.output, quadrature.y, membership)
    clipped = [
        np.minimum(w, sets[r.consequent]) for w, r in zip(strengths, LIVER.rules, strict=True)
    ]
    expected = centroid(quadrature, np.max(clipped, axis=0))
    assert infer(LIVER, row, "mamdani").value[0] == pytest.approx(expected, rel=1e-13)


@st.composite
def fuzzy_sets(draw):
    """A set with a core, and a footprint of every kind that it can have."""
    kind = draw(st.sampled_from([k for k, form in FORMS.items() if form.core and k != "sigmf"]))
    width = st.floats(0.3, 3)
    steps = [draw(width) for _ in range(4)]
    corners = tuple(float(x) for x in np.cumsum(steps) - 4)
    parameters = {
        "gaussmf": (steps[0], corners[0]),
        "gauss2mf": (steps[0], corners[0], steps[1], corners[1]),
        "trimf": corners[:3],
        "gbellmf": (steps[0], steps[1], corners[0]),
        "zmf": corners[:2],
        "smf": corners[:2],
        "linzmf": corners[:2],
        "linsmf": corners[:2],
    }.get(kind, corners)
    footprint = Footprint(draw(st.floats(0, 2)), draw(st.floats(0, 0.8)))
    return FuzzySet("s", kind, parameters, footprint)


def reshaped(one, shift, factor, x):
    """The principal form moved by `shift`, its flanks `factor` times as wide about its core."""
    low, high = FORMS[one.kind].core(one.parameters)
    x = x - shift
    core = np.clip(x, low, high)
    return membership(replace(one, footprint=Footprint()), core + (x - core) / factor)


@quick
@given(fuzzy_sets())
def test_bounds_are_the_extremes_over_the_footprint(one):
    x = np.linspace(-10, 10, 41)
    mean, spread = one.footprint.mean, one.footprint.spread
    shifts, factors = np.linspace(-mean, mean, 61), np.linspace(1 - spread, 1 + spread, 7)
    family = np.array([reshaped(one, s, f, x) for s in shifts for f in factors])
    upper, lower = upper_membership(one, x), lower_membership(one, x)
    assert np.all(upper >= family.max(axis=0) - 1e-12)
    assert lower == pytest.approx(family.min(axis=0), abs=1e-12)
    # Between two positions, 1/15 apart at most, the steepest flank here rises by 1/0.3 of that, a
    # narrowed one up to five times as much, but the largest value has the widest flanks.
    assert upper == pytest.approx(family.max(axis=0), abs=0.25)


def test_a_lower_scale_and_lag_shrink_the_lower_bound_only():
    x = np.linspace(0, 10, 101)
    one = FuzzySet("s", "trimf", (0.0, 5.0, 10.0), Footprint(scale=0.8, lag=0.2))
    mu = membership(one, x)
    assert np.array_equal(upper_membership(one, x), mu)
    lower = lower_membership(one, x)
    assert lower[50] == pytest.approx(0.8)
    assert np.all((lower > 0) == (mu > 0.2 + 1e-12))
    # A lag turns the triangle into one whose feet are where the upper bound has reached it.
    assert lower == pytest.approx(0.8 * np.maximum(0, 1 - np.abs(x - 5) / 4), abs=1e-12)


def test_union_of_one_clipped_set_is_the_clipped_set():
    mu = np.array([[0.0, 0.5, 1.0]])
    heights = np.array([[0.4, 0.0]])
    assert np.array_equal(union(heights, mu, Operators()), [[0.0, 0.4, 0.4], [0.0, 0.0, 0.0]])
    scaled = union(heights, mu, Operators(implication="prod"))
    assert np.array_equal(scaled, [[0.0, 0.2, 0.4], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize("kind", SYSTEMS)
def test_a_mirrored_system_gives_the_middle(kind):
    y = FuzzySet("low", "gaussmf", (5.0, 20.0)), FuzzySet("high", "gaussmf", (5.0, 55.0))
    x = Variable("x", 0, 1, (FuzzySet("any", "smf", (-2.0, -1.0)),))
    rules = tuple(Rule((Term(0, 0),), k) for k in (0, 1))
    mirrored = FuzzySystem((x,), Variable("y", 0, 75, y), rules)
    # The sets are cut 4 sd from the ends of the universe, alike on both sides.
    assert infer(mirrored, [[0.5]], kind).value[0] == pytest.approx(37.5, abs=1e-12)
