"""Properties that hold for every system, tried on random ones."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzy import interval_type2, mamdani, sugeno
from fuzzy.interval_type2 import type_reduce
from fuzzy.liver import liver_system
from fuzzy.sets import FuzzySet, lower_membership, membership, upper_membership
from fuzzy.system import Rule, System, Variable, firing_strengths, grid, memberships, union

R1 = {"odd_cell": "missing-triple", "duplicates": "keep", "consequent": "max"}
READING = st.floats(2, 75)
ROW = st.lists(READING, min_size=5, max_size=5).map(lambda row: np.array([row]))
# Memberships on a coarse scale: exact zeros, and no numbers so small that products underflow.
LEVEL = st.integers(0, 1000).map(lambda n: n / 1000)
quick = settings(max_examples=50, deadline=None, derandomize=True)


@st.composite
def bands(draw, low=2, high=9):
    size = draw(st.integers(low, high))
    levels = st.lists(LEVEL, min_size=size, max_size=size).map(np.array)
    a, b = draw(levels), draw(levels)
    upper = np.maximum(a, b)
    upper[draw(st.integers(0, size - 1))] = 1.0
    return np.linspace(0, 75, size), np.minimum(a, b), upper


def vertex_centroids(y, lower, upper):
    """Centroids of all 2^M sets that take one of the two bounds at each sample."""
    corners = np.array(list(product(*zip(lower, upper, strict=True))))
    filled = corners[corners.sum(axis=1) > 0]
    return filled @ y / filled.sum(axis=1)


@quick
@given(bands())
def test_karnik_mendel_finds_the_extremes_of_all_embedded_sets(band):
    # No switch point is assumed: the centroid is extreme at a corner of the box of bounds.
    centroids = vertex_centroids(*band)
    assert type_reduce(*band) == pytest.approx([centroids.min(), centroids.max()], abs=1e-10)


def test_bounds_in_the_wrong_order_miss_the_extremes():
    y, lower, upper = np.arange(4.0), np.full(4, 0.2), np.ones(4)
    centroids = vertex_centroids(y, lower, upper)
    wrong = type_reduce(y, upper, lower)
    assert wrong != pytest.approx([centroids.min(), centroids.max()], abs=1e-3)


@quick
@given(bands(low=3, high=60))
def test_interval_contains_nie_tan(band):
    y, lower, upper = band
    left, right = type_reduce(*band)
    nie_tan = (y * (lower + upper)).sum() / (lower + upper).sum()
    assert left - 1e-10 <= nie_tan <= right + 1e-10


@quick
@given(ROW, st.floats(0, 0.2), st.floats(0.001, 0.2))
def test_interval_grows_with_the_footprint(row, footprint, more):
    narrow, wide = (
        interval_type2.evaluate(liver_system(footprint=f, **R1), row, 101)[1][0]
        for f in (footprint, footprint + more)
    )
    assert wide[0] <= narrow[0] + 1e-10
    assert wide[1] >= narrow[1] - 1e-10


@quick
@given(ROW)
def test_zero_footprint_is_mamdani_on_the_liver(row):
    system = liver_system(footprint=0.0, **R1)
    value, interval = interval_type2.evaluate(system, row, 101)
    expected = mamdani.evaluate(system, row, 101)[0]
    assert [value[0], *interval[0]] == pytest.approx([expected] * 3, rel=1e-12)


@quick
@given(ROW, st.permutations(range(247)))
def test_rule_order_changes_nothing(row, order):
    system = liver_system(footprint=0.08, **R1)
    shuffled = System(system.inputs, system.output, tuple(system.rules[i] for i in order))
    a, b = (
        [
            mamdani.evaluate(s, row, 101)[0],
            sugeno.evaluate(s, row, 101, "max")[0],
            sugeno.evaluate(s, row, 101, "sum")[0],
            *interval_type2.evaluate(s, row, 101)[1][0],
        ]
        for s in (system, shuffled)
    )
    # Only the order of the sum over rules differs, 247 roundings at most.
    assert a == pytest.approx(b, rel=1e-13)


@quick
@given(ROW)
def test_repeated_rules_change_the_sugeno_sum_only(row):
    kept, dropped = (
        liver_system(footprint=0.08, **R1 | {"duplicates": d}) for d in ("keep", "drop")
    )
    assert mamdani.evaluate(kept, row, 101) == mamdani.evaluate(dropped, row, 101)
    assert sugeno.evaluate(kept, row, 101, "max") == sugeno.evaluate(dropped, row, 101, "max")
    assert np.array_equal(
        interval_type2.evaluate(kept, row, 101)[1], interval_type2.evaluate(dropped, row, 101)[1]
    )


def test_a_repeated_rule_does_change_the_sugeno_sum():
    row = np.array([[9.5, 4.1, 4.1, 4.1, 4.1]])
    kept, dropped = (
        sugeno.evaluate(liver_system(footprint=0.0, **R1 | {"duplicates": d}), row, 101, "sum")[0]
        for d in ("keep", "drop")
    )
    assert abs(kept - dropped) > 1e-3


@quick
@given(ROW)
def test_merging_heights_equals_clipping_rule_by_rule(row):
    system = liver_system(footprint=0.0, **R1)
    strengths = firing_strengths(system, row, membership)[:, 0]
    y = grid(system.output, 101)
    sets = memberships(system.output, y, membership)
    clipped = [
        np.minimum(w, sets[r.consequent]) for w, r in zip(strengths, system.rules, strict=True)
    ]
    expected = mamdani.centroid(y, np.max(clipped, axis=0))
    assert mamdani.evaluate(system, row, 101)[0] == pytest.approx(expected, rel=1e-13)


@st.composite
def fuzzy_sets(draw):
    kind, count = draw(
        st.sampled_from(
            [
                ("gaussian", 0),
                ("left-shoulder", 0),
                ("right-shoulder", 0),
                ("triangle", 3),
                ("trapezoid", 4),
            ]
        )
    )
    if count == 0:
        parameters = (draw(st.floats(-5, 5)), draw(st.floats(0.1, 5)))
    else:
        steps = draw(st.lists(st.floats(0.1, 3), min_size=count, max_size=count))
        parameters = tuple(np.cumsum(steps) - 4)
    return FuzzySet("s", kind, parameters, draw(st.floats(0, 3)))


@quick
@given(fuzzy_sets())
def test_bounds_are_the_extremes_over_all_positions(fuzzy_set):
    x = np.linspace(-10, 10, 41)
    shifts = np.linspace(-fuzzy_set.spread, fuzzy_set.spread, 301)
    moved = membership(fuzzy_set, x - shifts[:, None])
    upper, lower = upper_membership(fuzzy_set, x), lower_membership(fuzzy_set, x)
    assert np.all(upper >= moved.max(axis=0) - 1e-12)
    assert lower == pytest.approx(moved.min(axis=0), abs=1e-12)
    # Between two of the 301 positions, 0.02 apart, the steepest set here (1 over 0.1) rises by 0.1.
    assert upper == pytest.approx(moved.max(axis=0), abs=0.1)


def test_union_of_one_clipped_set_is_the_clipped_set():
    mu = np.array([[0.0, 0.5, 1.0]])
    assert np.array_equal(union(np.array([[0.4, 0.0]]), mu), [[0.0, 0.4, 0.4], [0.0, 0.0, 0.0]])


def test_a_mirrored_system_gives_the_middle():
    y = FuzzySet("low", "gaussian", (20.0, 5.0)), FuzzySet("high", "gaussian", (55.0, 5.0))
    x = Variable("x", 0, 1, (FuzzySet("any", "left-shoulder", (1.0, 1.0)),))
    mirrored = System((x,), Variable("y", 0, 75, y), (Rule(((0, 0),), 0), Rule(((0, 0),), 1)))
    row = np.array([[0.5]])
    assert mamdani.evaluate(mirrored, row, 101)[0] == pytest.approx(37.5, abs=1e-12)
    assert interval_type2.evaluate(mirrored, row, 101)[0][0] == pytest.approx(37.5, abs=1e-12)
    # The constants 20 and 55 are cut 4 sd from the ends of the universe, alike on both sides.
    assert sugeno.evaluate(mirrored, row, 101, "sum")[0] == pytest.approx(37.5, abs=1e-12)
