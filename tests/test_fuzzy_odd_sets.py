"""Sets and variables at the edge of what MATLAB and Octave answer to, against their definitions."""

from dataclasses import replace

import numpy as np
import pytest
import skfuzzy
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzy.systems.audit import audit, audit_lines
from fuzzy.systems.compiled import compiled
from fuzzy.systems.explain import explain
from fuzzy.systems.explanation_arrays import drawing_arrays
from fuzzy.systems.fis_file import fis_text, read_fis, write_fis
from fuzzy.systems.inference import infer
from fuzzy.systems.json_file import json_text, read_json, write_json
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.sets import (
    FORMS,
    Footprint,
    FuzzySet,
    lower_membership,
    membership,
    upper_membership,
)
from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable

ROUNDING = 4e-15
X = np.array([-1.0, 0.0, 2.0, 4.0, 5.0, 5.5, 6.0, 7.0, 10.0])


def rising(x, foot, top):
    return (x - foot) / (top - foot)


def s_curve(x, a, b):
    """MATLAB's smf of a number: a step half-way unless a < b."""
    if a >= b:
        return float(x >= 0.5 * (a + b))
    if x <= 0.5 * (a + b):
        return 2 * max(rising(x, a, b), 0) ** 2
    return 1 - 2 * min(rising(x, a, b) - 1, 0) ** 2


def z_curve(x, a, b):
    if a >= b:
        return float(x <= 0.5 * (a + b))
    return 1 - s_curve(x, a, b)


def trapezoid(x, a, b, c, d):
    left = 1.0 if x >= b else 0.0 if x < a else rising(x, a, b)
    right = 1.0 if x <= c else 0.0 if x > d else rising(x, d, c)
    return min(left, right)


def bump(x, sd, centre):
    if sd == 0:
        return float(x == centre)
    return np.exp(-((x - centre) ** 2) / (2 * sd**2))


def logistic(x, slope, centre):
    return 1 / (1 + np.exp(-slope * (x - centre)))


def bell(x, a, b, c):
    u = abs((x - c) / a)
    if u == 0:
        return 1.0 if b > 0 else 0.5 if b == 0 else 0.0
    return 1 / (1 + u ** (2 * b))


# One number at a time, as the manuals write them, with what becomes of equal and crossed corners.
DEFINITIONS = {
    "gaussmf": bump,
    "gauss2mf": lambda x, s, c, t, d: (
        (bump(x, s, c) if x < c else 1.0) * (bump(x, t, d) if x > d else 1.0)
    ),
    "gbellmf": bell,
    "sigmf": logistic,
    "dsigmf": lambda x, a, c, b, d: abs(logistic(x, a, c) - logistic(x, b, d)),
    "psigmf": lambda x, a, c, b, d: logistic(x, a, c) * logistic(x, b, d),
    "trimf": lambda x, a, b, c: trapezoid(x, a, b, b, c),
    "trapmf": trapezoid,
    "smf": s_curve,
    "zmf": z_curve,
    "pimf": lambda x, a, b, c, d: s_curve(x, a, b) * z_curve(x, c, d),
    "linsmf": lambda x, a, b: 1.0 if x >= b else 0.0 if x < a else rising(x, a, b),
    "linzmf": lambda x, a, b: 0.0 if x >= b else 1.0 if x < a else rising(x, b, a),
}
ODD = [
    ("gaussmf", (-2, 5)),
    ("gaussmf", (0, 5)),
    ("gauss2mf", (-2, 4, -1, 6)),
    ("gauss2mf", (2, 6, 1, 4)),
    ("gauss2mf", (0, 5, 1, 6)),
    ("gauss2mf", (1, 4, 0, 5)),
    ("gauss2mf", (0, 5, 0, 5)),
    ("gbellmf", (-2, 2, 5)),
    ("gbellmf", (2, -2, 5)),
    ("gbellmf", (2, -1.5, 5)),
    ("gbellmf", (2, 0, 5)),
    ("sigmf", (0, 5)),
    ("dsigmf", (2, 4, 0, 5)),
    ("dsigmf", (0, 4, 0, 5)),
    ("psigmf", (0, 5, 2, 4)),
    ("psigmf", (0, 5, 0, 4)),
    ("trimf", (5, 5, 5)),
    ("trimf", (2, 2, 5)),
    ("trimf", (2, 5, 5)),
    ("trapmf", (5, 5, 5, 5)),
    ("trapmf", (2, 2, 5, 5)),
    ("trapmf", (1, 6, 4, 8)),
    ("trapmf", (5, 5, 2, 2)),
    ("smf", (5, 5)),
    ("smf", (6, 4)),
    ("zmf", (5, 5)),
    ("zmf", (6, 4)),
    ("pimf", (5, 5, 5, 5)),
    ("pimf", (2, 2, 5, 5)),
    ("pimf", (6, 4, 6, 8)),
    ("pimf", (0, 7, 4, 10)),
    ("linsmf", (2, 6)),
    ("linsmf", (5, 5)),
    ("linzmf", (2, 6)),
    ("linzmf", (5, 5)),
]


def odd(kind, parameters):
    return FuzzySet("odd", kind, tuple(float(p) for p in parameters))


def defined(kind, parameters, places):
    return np.array([DEFINITIONS[kind](x, *parameters) for x in places])


@pytest.mark.parametrize(("kind", "parameters"), ODD)
def test_odd_sets_are_as_defined(kind, parameters):
    expected = defined(kind, parameters, X)
    assert np.abs(membership(odd(kind, parameters), X) - expected).max() < ROUNDING


def test_every_kind_has_a_definition():
    assert set(DEFINITIONS) == set(FORMS) == {kind for kind, _ in ODD}


# Printed by Octave's toolkit 0.4.6 for places -1, 0, 2, 7, 10; at the centre of a Gaussian without
# width, which is not among them, it has no number.
OCTAVE = {
    ("gaussmf", (-2, 5)): [0.01110899653824, 0.04393693362341, 0.3246524673583, 0.6065306597126],
    ("gaussmf", (0, 5)): [0, 0, 0, 0, 0],
    ("gauss2mf", (2, 6, 1, 4)): [0.00218749111812, 0.01110899653824, 0.1353352832366],
    ("gauss2mf", (0, 5, 1, 6)): [0, 0, 0, 0.6065306597126, 0.000335462627903],
    ("gbellmf", (2, -2, 5)): [0.9878048780488, 0.9750390015601, 0.8350515463918, 0.5],
    ("gbellmf", (2, 0, 5)): [0.5, 0.5, 0.5, 0.5, 0.5],
    ("sigmf", (0, 5)): [0.5, 0.5, 0.5, 0.5, 0.5],
    ("psigmf", (0, 5, 2, 3)): [0.000167675065233, 0.001236311578317, 0.0596014610111],
    ("psigmf", (0, 5, 0, 3)): [0.25, 0.25, 0.25, 0.25, 0.25],
}


@pytest.mark.parametrize(("kind", "parameters"), list(OCTAVE))
def test_odd_sets_are_octaves_where_it_has_an_answer(kind, parameters):
    expected = OCTAVE[kind, parameters]
    places = np.array([-1.0, 0.0, 2.0, 7.0, 10.0])[: len(expected)]
    assert membership(odd(kind, parameters), places) == pytest.approx(expected, abs=1e-12)


NUMBERS = st.integers(-6, 6).map(float)


@given(st.sampled_from(sorted(FORMS)), st.lists(NUMBERS, min_size=4, max_size=4))
@settings(deadline=None, max_examples=400)
def test_whatever_is_a_set_is_as_defined(kind, numbers):
    parameters = tuple(numbers[: len(FORMS[kind].parameters.split())])
    if not FORMS[kind].valid(parameters):
        with pytest.raises(ValueError, match="do not form"):
            FuzzySet("one", kind, parameters)
        return
    places = np.linspace(-8, 8, 65)
    mu = membership(FuzzySet("one", kind, parameters), places)
    assert np.abs(mu - defined(kind, parameters, places)).max() < ROUNDING


def test_negative_widths_are_scikit_fuzzys():
    for sd, a, b in ((1.5, 2.0, 1.5), (0.3, 4.0, 3.0)):
        gaussian = membership(odd("gaussmf", (-sd, 5)), X)
        assert np.abs(gaussian - skfuzzy.gaussmf(X, 5, -sd)).max() < ROUNDING
        generalised = membership(odd("gbellmf", (-a, b, 5)), X)
        assert np.abs(generalised - skfuzzy.gbellmf(X, -a, b, 5)).max() < ROUNDING
    for foot, top in ((2.0, 6.0), (-1.0, 3.5)):
        ramp = membership(odd("linsmf", (foot, top)), X)
        assert np.abs(ramp - skfuzzy.trapmf(X, [foot, top, 99, 99])).max() < ROUNDING
        ramp = membership(odd("linzmf", (foot, top)), X)
        assert np.abs(ramp - skfuzzy.trapmf(X, [-99, -99, foot, top])).max() < ROUNDING


# --- Systems of odd sets ----------------------------------------------------------------------


def average(one, *others, low=0.0, high=10.0, output=(0.0, 0.0)):
    """Sugeno: the set says 1, a wide Gaussian 0; so the answer gives the membership away."""
    wide = FuzzySet("wide", "gaussmf", (4.0, 3.0))
    says = [FuzzySet("one", "constant", (1.0,)), FuzzySet("none", "constant", (0.0,))]
    x = Variable("x", low, high, (one, wide))
    rules = (Rule((Term(0, 0),), 0), Rule((Term(0, 1),), 1))
    return FuzzySystem((x, *others), Variable("y", *output, tuple(says)), rules)


@pytest.mark.parametrize(("kind", "parameters"), ODD)
def test_odd_inputs_are_answered_compiled_and_not(kind, parameters):
    places = X[(X >= 0) & (X <= 10)]
    system = average(odd(kind, parameters))
    mu, other = defined(kind, parameters, places), defined("gaussmf", (4, 3), places)
    expected = mu / (mu + other)
    assert infer(system, places[:, None], "sugeno").value == pytest.approx(expected, abs=1e-12)
    fast = compiled(system, "sugeno", InferenceOptions())
    assert fast.evaluate(places[:, None]).value == pytest.approx(expected, abs=1e-12)
    assert [fast.one([x]).value for x in places] == pytest.approx(expected, abs=1e-12)


CROSSED = [
    ("gauss2mf", (2, 6, 1, 4)),
    ("gbellmf", (2, -2, 5)),
    ("psigmf", (0, 5, 2, 4)),
    ("dsigmf", (2, 4, 0, 5)),
    ("trapmf", (1, 6, 4, 8)),
    ("smf", (6, 4)),
    ("pimf", (0, 7, 4, 10)),
    ("linzmf", (2, 6)),
    ("linsmf", (5, 5)),
]


@pytest.mark.parametrize(("kind", "parameters"), CROSSED)
@pytest.mark.parametrize("implication", ["min", "prod"])
def test_odd_outputs_have_the_centroid_of_their_curve(kind, parameters, implication):
    x = Variable("x", 0, 1, (FuzzySet("half", "trimf", (0, 1, 2)),))
    y = Variable("y", 0, 10, (odd(kind, parameters),))
    system = FuzzySystem((x,), y, (Rule((Term(0, 0),), 0),), Operators("min", "max", implication))
    found = infer(system, np.array([[0.4]]), "mamdani", InferenceOptions(sampling="exact")).value
    places = np.linspace(0, 10, 200_001)
    mu = membership(y.sets[0], places)
    curve = np.minimum(mu, 0.4) if implication == "min" else 0.4 * mu
    assert found == pytest.approx(np.trapezoid(curve * places) / np.trapezoid(curve), abs=1e-4)


def test_a_spike_moved_about_is_a_box():
    for kind, parameters in (("trimf", (5, 5, 5)), ("gaussmf", (0, 5)), ("pimf", (5, 5, 5, 5))):
        one = replace(odd(kind, parameters), footprint=Footprint(mean=1.0))
        assert upper_membership(one, X).tolist() == [0, 0, 0, 1, 1, 1, 1, 0, 0]
        assert not lower_membership(one, X).any()


# --- Variables --------------------------------------------------------------------------------

LOW, HIGH = FuzzySet("low", "gaussmf", (3, 0)), FuzzySet("high", "gaussmf", (3, 10))
FIVE = FuzzySet("b", "constant", (5,))


def crossfade(*others, plane=(1, 2), low=0.0, high=10.0, output=(0.0, 0.0)):
    """Sugeno: a plane near x = 0, five near x = 10."""
    x, y = Variable("x", low, high, (LOW, HIGH)), FuzzySet("a", "linear", plane)
    rules = (Rule((Term(0, 0),), 0), Rule((Term(0, 1),), 1))
    return FuzzySystem((x, *others), Variable("y", *output, (y, FIVE)), rules, Operators("prod"))


def test_a_sugeno_output_needs_no_width():
    found = infer(crossfade(), np.array([[0], [2.5], [5], [10]]), "sugeno").value
    assert found == pytest.approx([2.0116, 4.5293, 6.0, 5.0270], abs=5e-5)  # Octave's
    fast = compiled(crossfade(output=(3.0, 3.0)), "sugeno", InferenceOptions())
    assert fast.one([2.5]).value == pytest.approx(4.5293, abs=5e-5)


def test_an_input_without_sets_serves_linear_consequents():
    system = crossfade(Variable("u", -1, 1, ()), plane=(1, 2, 2))
    X = np.array([[0, 0.5], [2.5, -0.5]])
    found = infer(system, X, "sugeno").value
    assert found == pytest.approx([3.0077, 3.5878], abs=5e-5)  # Octave's
    fast = compiled(system, "sugeno", InferenceOptions())
    assert fast.evaluate(X).value == pytest.approx(found, abs=1e-14)


@pytest.mark.parametrize("policy", ["clamp", "raise", "matlab"])
def test_an_input_range_without_width_bounds_no_reading(policy):
    bounded, open_ = crossfade(), crossfade(low=0, high=0)
    X = np.array([[0.0], [2.5], [9.0]])
    options = InferenceOptions(out_of_range=policy)
    found = infer(open_, X, "sugeno", options)
    assert found.value.tolist() == infer(bounded, X, "sugeno", options).value.tolist()
    assert found.notes == ()
    assert compiled(open_, "sugeno", options).one([9.0]).value == pytest.approx(found.value[2])


def odd_systems():
    mamdani = Variable("y", 0, 10, (odd("trapmf", (1, 6, 4, 8)), FuzzySet("s", "linsmf", (5, 5))))
    bare = Variable("u", 0, 0, ())
    yield "bare input", crossfade(bare, plane=(1, 2, 2))
    yield "no width", crossfade(low=4, high=4, output=(1, 1))
    yield "mamdani", replace(crossfade(bare, plane=(1, 2, 2)), output=mamdani)
    for kind, parameters in ODD:
        yield f"{kind} {parameters}", average(odd(kind, parameters))


@pytest.mark.parametrize("system", [pytest.param(s, id=name) for name, s in odd_systems()])
def test_odd_systems_come_back_and_are_audited_explained_and_drawn(tmp_path, system):
    write_fis(system, tmp_path / "odd.fis")
    write_json(system, tmp_path / "odd.json")
    assert read_fis(tmp_path / "odd.fis") == system == read_json(tmp_path / "odd.json")
    assert fis_text(read_json(tmp_path / "odd.json")) == fis_text(system)
    assert json_text(read_fis(tmp_path / "odd.fis")) == json_text(system)
    assert audit_lines(audit(system), system)
    kind = "sugeno" if system.is_sugeno else "mamdani"
    explained = explain(system, np.full(len(system.inputs), 3.0), kind)
    assert np.isfinite(explained.answer)
    assert drawing_arrays(explained)
