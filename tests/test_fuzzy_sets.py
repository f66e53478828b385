"""Membership functions against Octave and scikit-fuzzy, footprints against what lies in them."""

from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
import skfuzzy

from fuzzy.systems.sets import (
    FORMS,
    Footprint,
    FuzzySet,
    lower_membership,
    membership,
    upper_membership,
)

OCTAVE = Path(__file__).parent / "data" / "octave" / "functions.csv"

# The trapezoids with one flank, which test_fuzzy_odd_sets.py compares with others.
MATLABS_ALONE = {"linsmf", "linzmf"}

# Memberships are at most 1; the codes compare a few roundings of the same formula.
ROUNDING = 4e-15


def octave_functions():
    """Kind, parameters, places and Octave's memberships of every function tabulated."""
    rows = [line.split(",") for line in OCTAVE.read_text().splitlines()[1:]]
    for (kind, parameters), group in groupby(rows, key=lambda row: tuple(row[:2])):
        places, mu = np.array([row[2:] for row in group], dtype=float).T
        yield kind, tuple(float(number) for number in parameters.split()), places, mu


@pytest.mark.parametrize(("kind", "parameters", "x", "mu"), list(octave_functions()))
def test_functions_are_octaves(kind, parameters, x, mu):
    ours = membership(FuzzySet("one", kind, parameters), x)
    if kind == "dsigmf":
        # Octave cuts off where the first sigmoid is the smaller; MATLAB and we change the sign.
        assert np.abs(np.where(mu > 0, ours, 0.0) - mu).max() < ROUNDING
    else:
        assert np.abs(ours - mu).max() < ROUNDING


def test_octaves_table_holds_every_kind():
    assert {kind for kind, *_ in octave_functions()} == set(FORMS) - MATLABS_ALONE


# Our parameters in scikit-fuzzy's order, which is that of .fis files for the other kinds.
SCIKIT_ORDER = {
    "gaussmf": (1, 0),
    "gauss2mf": (1, 0, 3, 2),
    "sigmf": (1, 0),
    "dsigmf": (1, 0, 3, 2),
    "psigmf": (1, 0, 3, 2),
}
SAMPLES = [
    ("gaussmf", (1.5, 4.0)),
    ("gauss2mf", (0.75, 3.0, 2.0, 6.0)),
    ("gauss2mf", (1.0, 5.0, 3.0, 5.0)),
    ("trimf", (1.0, 4.0, 9.0)),
    ("trimf", (2.0, 2.0, 6.0)),
    ("trimf", (3.0, 8.0, 8.0)),
    ("trapmf", (-2.0, 1.0, 4.0, 7.5)),
    ("trapmf", (2.0, 2.0, 5.0, 5.0)),
    ("gbellmf", (1.5, 2.5, 5.0)),
    ("sigmf", (2.0, 4.0)),
    ("sigmf", (-1.5, 6.0)),
    ("dsigmf", (5.0, 2.0, 4.0, 7.0)),
    ("dsigmf", (1.5, 4.0, 3.0, 2.0)),
    ("psigmf", (2.0, 3.0, -5.0, 8.0)),
    ("zmf", (3.0, 7.0)),
    ("smf", (1.0, 8.0)),
    ("pimf", (1.0, 4.0, 5.0, 10.0)),
    ("pimf", (2.0, 5.0, 5.0, 6.0)),
]
# Off every corner, where a rounding decides on which side of a vertical flank a place lies.
X = np.linspace(-1, 11, 241) + 0.0137


def scikit(kind, parameters):
    order = SCIKIT_ORDER.get(kind, range(len(parameters)))
    ordered = [parameters[i] for i in order]
    if kind in ("trimf", "trapmf"):
        return getattr(skfuzzy, kind)(X, ordered)
    return getattr(skfuzzy, kind)(X, *ordered)


@pytest.mark.parametrize(("kind", "parameters"), SAMPLES)
def test_functions_are_scikit_fuzzys(kind, parameters):
    expected = scikit(kind, parameters)
    if kind == "dsigmf":
        expected = np.abs(expected)  # the sign of scikit-fuzzy's depends on the order
    ours = membership(FuzzySet("one", kind, parameters), X)
    assert np.abs(ours - expected).max() < ROUNDING


@pytest.mark.parametrize(("kind", "parameters"), SAMPLES)
def test_a_parameter_off_by_two_hundredths_shows_in_the_comparison(kind, parameters):
    expected = np.abs(scikit(kind, parameters))
    off = (parameters[0] * 0.98, *parameters[1:])
    ours = membership(FuzzySet("one", kind, off), X)
    assert np.abs(ours - expected).max() > 1e9 * ROUNDING


def test_the_samples_hold_every_kind():
    assert {kind for kind, _ in SAMPLES} == set(FORMS) - MATLABS_ALONE


# --- Footprints -------------------------------------------------------------------------------

MOVABLE = [(kind, p) for kind, p in SAMPLES if kind not in ("dsigmf", "psigmf")]


def members(kind, parameters, footprint):
    """Memberships of X in type-1 sets spread over the footprint, shape (members, X)."""
    shifts = np.linspace(-footprint.mean, footprint.mean, 41)
    factors = np.linspace(1 - footprint.spread, 1 + footprint.spread, 21 if footprint.spread else 1)
    return np.array(
        [
            membership(FuzzySet("member", kind, moved(kind, parameters, shift, factor)), X)
            for shift in shifts
            for factor in factors
        ]
    )


def moved(kind, p, shift, factor):
    """Parameters of the set moved as a whole, with its flanks wider by the factor."""
    if kind in ("gaussmf", "gauss2mf"):
        return tuple(q + shift if i % 2 else q * factor for i, q in enumerate(p))
    if kind == "gbellmf":
        return (p[0] * factor, p[1], p[2] + shift)
    if kind == "sigmf":
        return (p[0], p[1] + shift)
    # The others are corners, which move away from the nearest end of the core.
    low, high = {"zmf": (-np.inf, p[0]), "smf": (p[1], np.inf)}.get(kind, (p[1], p[-2]))
    ends = [min(max(q, low), high) for q in p]
    return tuple(end + (q - end) * factor + shift for q, end in zip(p, ends, strict=True))


@pytest.mark.parametrize(("kind", "parameters"), MOVABLE)
@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_the_bounds_touch_the_extreme_members_and_no_member_passes_them(kind, parameters, spread):
    spread = 0.0 if kind == "sigmf" else spread
    footprint = Footprint(mean=0.6, spread=spread)
    one = FuzzySet("one", kind, parameters, footprint)
    lower, upper = lower_membership(one, X), upper_membership(one, X)
    within = members(kind, parameters, footprint)
    assert (within >= lower - ROUNDING).all()
    assert (within <= upper + ROUNDING).all()
    # The extreme members are among those tried: both ends for the lower bound, and for the upper
    # one the ends or a member with its core at x; the nearest tried is 0.015 away, on flanks that
    # rise at most by 1/unit near the core.
    assert np.abs(within.min(axis=0) - lower).max() < ROUNDING
    assert within.max(axis=0) == pytest.approx(upper, abs=0.016)


def test_a_footprint_drawn_too_narrow_lets_members_pass():
    honest, narrow = Footprint(mean=0.6), Footprint(mean=0.59)
    one = FuzzySet("one", "gaussmf", (1.5, 4.0), narrow)
    within = members("gaussmf", (1.5, 4.0), honest)
    assert (within > upper_membership(one, X) + 1e-4).any()
    assert (within < lower_membership(one, X) - 1e-4).any()


# Reach of a set with a vertical flank, by its kind; the core is [10, 20].
VERTICAL = [
    ("trapmf", (10.0, 10.0, 20.0, 20.0)),
    ("trapmf", (10.0, 10.0, 20.0, 31.3)),
    ("trapmf", (-1.7, 10.0, 20.0, 20.0)),
    ("pimf", (10.0, 10.0, 20.0, 20.0)),
]


@pytest.mark.parametrize(("kind", "parameters"), VERTICAL)
@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_the_upper_membership_is_one_wherever_the_core_can_come(kind, parameters, spread):
    rng = np.random.default_rng(1)
    for mean in (2.5, 0.1, 1 / 3):
        one = FuzzySet("one", kind, parameters, Footprint(mean=mean, spread=spread))
        # A hair inside the reach, for its very end is rounded itself.
        x = rng.uniform(10 - mean + 1e-12, 20 + mean - 1e-12, 2000)
        assert (upper_membership(one, x) == 1.0).all()
        if parameters[0] == parameters[1]:
            assert upper_membership(one, np.array([10 - mean - 1e-9]))[0] == 0.0


def test_at_a_vertical_flank_of_a_triangle_the_upper_membership_is_one():
    one = FuzzySet("a", "trimf", (1.3, 1.3, 20.0), Footprint(mean=2.5))
    x = np.array([3.30098])
    assert upper_membership(one, x)[0] == 1.0
    # The sum that leads there misses the core, so that adding alone would answer 0.
    assert x[0] + (1.3 - x[0]) < 1.3


@pytest.mark.parametrize(
    "corners", [(0.2, 0.2, 0.4, 0.6), (0.2, 0.4, 0.6, 0.6), (0.2, 0.2, 0.6, 0.6)]
)
def test_beyond_a_vertical_flank_a_pimf_is_zero_as_a_trapmf_is(corners):
    x = np.array([-5.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.61, 7.0])
    pi, trapezoid = (membership(FuzzySet("one", kind, corners), x) for kind in ("pimf", "trapmf"))
    beyond = (x < 0.2) | (x > 0.6)
    assert (pi[beyond] == 0.0).all()
    assert ((pi == 1.0) == (trapezoid == 1.0)).all()
    assert ((pi > 0.0) == (trapezoid > 0.0)).all()


def test_scale_and_lag_lower_the_lower_membership_alone():
    plain = FuzzySet("one", "trimf", (1.0, 4.0, 9.0))
    one = FuzzySet("one", "trimf", (1.0, 4.0, 9.0), Footprint(scale=0.8, lag=0.25))
    mu = membership(plain, X)
    assert (upper_membership(one, X) == mu).all()
    assert lower_membership(one, np.array([4.0]))[0] == pytest.approx(0.8, abs=1e-15)
    # It leaves 0 where the upper one reaches the lag.
    assert ((lower_membership(one, X) > 0) == (mu > 0.25)).all()


@pytest.mark.parametrize(("kind", "parameters"), SAMPLES)
def test_without_footprint_the_bounds_are_the_function(kind, parameters):
    one = FuzzySet("one", kind, parameters)
    assert (lower_membership(one, X) == membership(one, X)).all()
    assert (upper_membership(one, X) == membership(one, X)).all()


# --- Refusals ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "parameters", "footprint", "message"),
    [
        ("gausmf", (1.0, 2.0), {}, "kind 'gausmf' is none of MATLAB's.*; use gaussmf"),
        ("gaussmf", (1.0,), {}, r"takes 2 parameters \(sd, centre\), got 1"),
        ("gaussmf", (np.nan, 2.0), {}, "give finite numbers"),
        ("gauss2mf", (1.0, 5.0, 1.0, 4.0), {"mean": 0.1}, "no core to move"),
        ("trapmf", (1.0, 6.0, 4.0, 8.0), {"spread": 0.1}, "no core to move or widen"),
        ("trapmf", (2.0, 1.0, 4.0, 8.0), {}, "do not form a trapmf.* feet outside their tops"),
        ("linsmf", (2.0, 1.0), {}, "do not form a linsmf.* corners in rising order"),
        ("trimf", (1.0, 3.0, 2.0), {}, "do not form a trimf"),
        ("gbellmf", (0.0, 2.0, 0.0), {}, "do not form a gbellmf.* half-width other than 0"),
        ("gbellmf", (1.0, -2.0, 0.0), {"mean": 0.1}, "no core to move"),
        ("sigmf", (0.0, 1.0), {"mean": 0.1}, "no core to move"),
        ("sigmf", (1.0, 1.0), {"spread": 0.1}, "no core to widen"),
        ("dsigmf", (1.0, 1.0, 1.0, 2.0), {"mean": 0.1}, "no core to move"),
        ("constant", (1.0,), {"mean": 0.1}, "takes no footprint"),
        ("constant", (1.0, 2.0), {}, "takes 1 parameter"),
    ],
)
def test_what_is_no_set_is_refused_with_its_name(kind, parameters, footprint, message):
    with pytest.raises(ValueError, match=f"set 'odd': .*{message}"):
        FuzzySet("odd", kind, parameters, Footprint(**footprint))


@pytest.mark.parametrize(
    "widths", [{"mean": -0.1}, {"mean": np.inf}, {"spread": 1.0}, {"scale": 0.0}, {"lag": 1.0}]
)
def test_impossible_footprints_are_refused_by_name(widths):
    [name] = widths
    with pytest.raises(ValueError, match=f"footprint {name}"):
        Footprint(**widths)
