"""Aggregations and defuzzifications beside the maximum and its centroid."""

from dataclasses import replace

import numpy as np
import pytest
import skfuzzy

from fuzzy.systems.audit import audit
from fuzzy.systems.compiled import compiled
from fuzzy.systems.conversion import sugeno_of
from fuzzy.systems.explain import explain
from fuzzy.systems.fis_file import FisError, fis_text, read_fis
from fuzzy.systems.inference import COMPILED_FROM_ROWS, infer
from fuzzy.systems.json_file import json_text, read_json
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import DEFUZZIFICATIONS, defuzzified, sampled
from fuzzy.systems.scikit_fuzzy import to_skfuzzy
from fuzzy.systems.sets import FuzzySet
from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable

OCTAVE = InferenceOptions(sampling="octave")


def system(implication="min", aggregation="max", defuzzification="centroid"):
    a = Variable(
        "a", 0, 10, (FuzzySet("low", "gaussmf", (3, 0)), FuzzySet("high", "gaussmf", (3, 10)))
    )
    b = Variable(
        "b", 0, 10, (FuzzySet("low", "gaussmf", (4, 1)), FuzzySet("high", "gaussmf", (4, 8)))
    )
    sets = (
        FuzzySet("down", "trimf", (-7, -4, 1)),
        FuzzySet("mid", "gaussmf", (2, 2)),
        FuzzySet("up", "trapmf", (3, 6, 8, 12)),
    )
    rules = (
        Rule((Term(0, 0), Term(1, 0)), 0),
        Rule((Term(0, 1), Term(1, 0)), 1, weight=0.8),
        Rule((Term(0, 0), Term(1, 1)), 1, "or"),
        Rule((Term(0, 1), Term(1, 1)), 2),
    )
    operators = Operators("min", "max", implication, aggregation, defuzzification)
    return FuzzySystem((a, b), Variable("y", -6, 10, sets), rules, operators, "m")


X = np.array([[1, 2], [4, 4], [5, 7], [9, 9], [8, 1]], dtype=float)

# Octave's toolkit 0.4.6 on 101 samples.
GOLDEN = {
    ("min", "probor", "centroid"): (-0.1425148256, 1.03443389, 2.003047499, 4.201464193),
    ("min", "probor", "lom"): (-3.76, 0.08, 2.48, 2.48, 3.76),
    ("min", "probor", "mom"): (-3.76, 0.08, 2, 2, 3.76),
    ("min", "probor", "som"): (-3.76, 0.08, 1.52, 1.52, 3.76),
    ("min", "max", "centroid"): (-0.1730758421, 0.8246293444, 2, 4.398010704, 2.871136487),
    ("min", "max", "lom"): (2.64, 3.92, 2.48, 2.48, 3.76),
    ("min", "max", "mom"): (0.52, 2, 2, 2, 2),
    ("min", "max", "som"): (-4.08, 0.08, 1.52, 1.52, 0.24),
    ("min", "sum", "centroid"): (-0.1728664219, 1.064051948, 2.010325855, 4.164021762),
    ("min", "sum", "lom"): (-3.76, -0.08, 2.48, 5.84, 3.76),
    ("min", "sum", "mom"): (-3.76, -0.08, 2, 5.84, 3.76),
    ("prod", "probor", "centroid"): (-0.1672451143, 1.141211129, 2.145597705, 4.331800381),
    ("prod", "max", "centroid"): (-0.1711159296, 1.021031452, 2.140628066, 4.39972557),
    ("prod", "sum", "centroid"): (-0.19470691, 1.171358621, 2.151429241, 4.287058759),
    ("prod", "sum", "mom"): (2, 2, 2, 6, 2),
}


@pytest.mark.parametrize("methods", GOLDEN)
def test_answers_are_octaves(methods):
    expected = GOLDEN[methods]
    found = infer(system(*methods), X[: len(expected)], "mamdani", OCTAVE).value
    assert found == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("sampling", ["matlab", "octave"])
@pytest.mark.parametrize("method", DEFUZZIFICATIONS)
def test_a_curve_that_is_zero_has_no_value(method, sampling):
    quadrature = sampled(system().output, 5, sampling)
    found = defuzzified(quadrature, np.array([np.zeros(5), np.ones(5)]), method, sampling)
    assert np.isnan(found[0])
    assert np.isfinite(found[1])


@pytest.mark.parametrize(("sampling", "place"), [("matlab", 0), ("octave", 2)])
def test_the_bisector_weighs_the_ends_as_the_sampling_does(sampling, place):
    """Areas up to each sample: 1.0, 1.2, 1.6, 2.0; with half an end 0.5, 0.7, 1.1, 1.5."""
    quadrature = sampled(system().output, 5, sampling)
    found = defuzzified(quadrature, np.array([[1.0, 0.2, 0.4, 0.4, 0.0]]), "bisector", sampling)
    assert found[0] == quadrature.y[place]


def test_smallest_and_largest_go_by_size_in_matlab_by_place_in_octave():
    flat = Variable("y", -1, 1, (FuzzySet("flat", "trapmf", (-0.7, -0.61, 0.53, 0.6)),))
    x = Variable("x", 0, 1, (FuzzySet("all", "trapmf", (-2, -1, 1, 2)),))
    for method, matlab, octave in (("som", 0.0, -0.6), ("lom", -0.6, 0.52), ("mom", -0.04, -0.04)):
        one = FuzzySystem((x,), flat, (Rule((Term(0, 0),), 0),), Operators(defuzzification=method))
        for sampling, expected in (("matlab", matlab), ("octave", octave)):
            options = InferenceOptions(sampling=sampling)
            value = infer(one, np.array([[0.5]]), "mamdani", options).value
            assert value == pytest.approx([expected], abs=1e-12)


def of_two_sets(defuzzification, one, other):
    """The answer to two sets on 0 to 10 that fire in full."""
    x = Variable("x", 0, 1, (FuzzySet("all", "trapmf", (-1, 0, 1, 2)),))
    rules = tuple(Rule((Term(0, 0),), k) for k in range(2))
    operators = Operators("min", "max", "prod", "max", defuzzification)
    y = Variable("y", 0, 10, (FuzzySet("one", *one), FuzzySet("other", *other)))
    return infer(FuzzySystem((x,), y, rules, operators, "m"), np.array([[0.5]]), "mamdani").value[0]


@pytest.mark.parametrize("centre", np.arange(0.53, 4.5, 0.1).round(2))
def test_two_equal_peaks_are_equal_in_spite_of_rounding(centre):
    """Or one of them would be chosen by the last digit, and the answer lie half the range off."""
    peaks = ("gaussmf", (0.7, centre)), ("gaussmf", (0.7, 10 - centre))
    assert of_two_sets("mom", *peaks) == pytest.approx(5.0, abs=1e-9)
    nearest = 0.1 * np.round(10 * centre)
    assert of_two_sets("som", *peaks) == pytest.approx(nearest)
    assert of_two_sets("lom", *peaks) == pytest.approx(10 - nearest)
    apart = [("trimf", (c - 0.4, c, c + 0.4)) for c in (centre, 10 - centre)]
    assert of_two_sets("bisector", *apart) < 5.0


@pytest.mark.parametrize("aggregation", ["max", "sum", "probor"])
def test_the_bisector_halves_the_area_and_others_are_scikit_fuzzys(aggregation):
    for row in X:
        for method in ("bisector", "mom", "som", "lom"):
            one = system("prod", aggregation, method)
            curve = explain(one, row, "mamdani", InferenceOptions(samples=4001)).curve
            options = InferenceOptions(sampling="octave", samples=4001)
            found = infer(one, row[None], "mamdani", options).value[0]
            assert found == pytest.approx(skfuzzy.defuzz(curve.y, curve.upper, method), abs=8e-3)


@pytest.mark.parametrize("methods", [("min", "sum", "centroid"), ("min", "max", "mom")])
def test_files_hold_the_methods(tmp_path, methods):
    one = system(*methods)
    (tmp_path / "m.fis").write_text(fis_text(one))
    (tmp_path / "m.json").write_text(json_text(one))
    assert read_fis(tmp_path / "m.fis") == one == read_json(tmp_path / "m.json")
    (tmp_path / "m.fis").write_text(fis_text(one).replace("'sum'", "'algebraic_sum'"))
    assert read_fis(tmp_path / "m.fis").operators.aggregation in ("max", "probor")


def test_defaults_are_not_written_into_json():
    assert "aggregation" not in json_text(system())
    assert "defuzzification" not in json_text(system())


@pytest.mark.parametrize("methods", [("min", "sum", "centroid"), ("min", "max", "lom")])
def test_what_knows_the_centroid_of_the_maximum_alone_says_so(methods):
    one = system(*methods)
    exact = InferenceOptions(sampling="exact")
    with pytest.raises(ValueError, match=r"'exact': finds centroids of the maximum only.* matlab"):
        infer(one, X, "mamdani", exact)
    with pytest.raises(ValueError, match="interval-type-2: finds centroids of the maximum only"):
        infer(one, X, "interval-type-2")
    with pytest.raises(ValueError, match="are not compiled: evaluate it with infer"):
        compiled(one, "mamdani", InferenceOptions())
    with pytest.raises(ValueError, match="only max and centroid are handed on"):
        to_skfuzzy(one)


def test_many_rows_are_answered_without_the_compiled_loops():
    one = system("min", "sum", "mom")
    many = np.tile(X, (COMPILED_FROM_ROWS // len(X), 1))[:COMPILED_FROM_ROWS]
    few = infer(one, X, "mamdani").value
    assert (infer(one, many, "mamdani").value[: len(X)] == few).all()


def test_no_rule_is_dominated_where_every_rule_adds():
    once = system("min", "sum")
    twice = replace(once, rules=(*once.rules, once.rules[0]))
    assert audit(replace(twice, operators=Operators())).dominated
    assert not audit(twice).dominated
    found = [infer(one, X[:1], "mamdani").value[0] for one in (once, twice)]
    assert abs(found[0] - found[1]) > 0.01


def test_no_rule_sets_a_height_where_curves_are_added():
    for aggregation, sets in (("max", True), ("sum", False), ("probor", False)):
        shown = explain(system("min", aggregation), X[0], "mamdani")
        assert any(firing.sets_upper for firing in shown.rules) == sets
        assert any(one.upper_rules for one in shown.outputs) == sets
        area = np.trapezoid(shown.curve.upper, shown.curve.y)
        centre = np.trapezoid(shown.curve.upper * shown.curve.y, shown.curve.y) / area
        assert shown.answer == pytest.approx(centre, abs=0.02)


def test_sets_become_constants_by_the_defuzzification():
    one = system("min", "sum", "lom")
    constants = [s.parameters[0] for s in sugeno_of(one).output.sets]
    assert constants == pytest.approx([-3.92, 2.0, 7.92], abs=1e-12)
    expected = infer(one, X, "sugeno").value
    assert infer(sugeno_of(one), X, "sugeno").value == pytest.approx(expected, abs=1e-12)
    assert compiled(one, "sugeno", InferenceOptions()).evaluate(X).value == pytest.approx(expected)


def test_the_weighted_sum_is_not_divided(tmp_path):
    average = sugeno_of(system())
    added = replace(average, operators=replace(average.operators, defuzzification="wtsum"))
    (tmp_path / "s.fis").write_text(fis_text(added))
    assert "DefuzzMethod='wtsum'" in fis_text(added)
    assert read_fis(tmp_path / "s.fis") == added
    shown = explain(added, X[0], "sugeno")
    by_hand = sum(one.upper * one.constant for one in shown.outputs)
    assert shown.answer == pytest.approx(by_hand, abs=1e-12)
    assert "weighted sum" in shown.method
    with pytest.raises(ValueError, match="wtsum is for constants"):
        system(defuzzification="wtsum")
    with pytest.raises(ValueError, match="a Sugeno system has no curve for aggregation max and"):
        replace(average, operators=Operators(defuzzification="mom"))
    (tmp_path / "s.fis").write_text(fis_text(added).replace("wtsum", "mom"))
    with pytest.raises(FisError, match=r"s\.fis:12: .*'mom'.* in a sugeno system use one of wtav"):
        read_fis(tmp_path / "s.fis")
