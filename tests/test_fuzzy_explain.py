"""An explanation adds up to the answer that it explains."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import liver_row, patient_system
from fuzzy.systems.explain import Explanation, explain, shown_rules
from fuzzy.systems.explanation_arrays import drawing_arrays
from fuzzy.systems.explanation_text import explanation_lines
from fuzzy.systems.inference import infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import sampled
from fuzzy.systems.sets import Footprint, FuzzySet
from fuzzy.systems.system import FuzzySystem, Rule, Term, Variable

# Both sides are sums of some hundred products of numbers of order 10.
ROUNDING = 1e-12
OPTIONS = (
    InferenceOptions(),
    InferenceOptions(sampling="octave", samples=57),
    InferenceOptions(sampling="exact"),
    InferenceOptions(sugeno_aggregation="max", reducer="nie-tan"),
)


def trapezoid(name: str, *corners: float) -> FuzzySet:
    return FuzzySet(name, "trapmf", corners, Footprint(mean=0.3))


def gaussian(name: str, sd: float, centre: float) -> FuzzySet:
    return FuzzySet(name, "gaussmf", (sd, centre), Footprint(mean=0.5))


HOT = Variable("heat", 0.0, 10.0, (gaussian("cold", 2.0, 1.0), gaussian("hot", 2.0, 9.0)))
WET = Variable("rain", 0.0, 10.0, (trapezoid("dry", 0, 0, 2, 6), trapezoid("wet", 4, 8, 10, 10)))
OUT = Variable("flow", 0.0, 30.0, (gaussian("low", 3.0, 5.0), gaussian("high", 4.0, 22.0)))
RULES = (
    Rule((Term(0, 0), Term(1, 0)), 0),
    Rule((Term(0, 1), Term(1, 1)), 1, "or"),
    Rule((Term(0, 1, negated=True),), 0, weight=0.6),
    Rule((Term(1, 1),), 1),
)
SMALL = FuzzySystem((HOT, WET), OUT, RULES, name="small")
POINTS = np.array([[3.0, 5.0], [8.0, 1.0], [5.0, 9.0], [0.0, 0.0]])


def liver(**readings: float) -> tuple[FuzzySystem, np.ndarray]:
    pascal = {name: 1e3 * value for name, value in readings.items()}
    return patient_system(pascal, LiverSettings(knowledge="severity")), liver_row(pascal)[0]


@pytest.fixture(scope="module")
def cases() -> list[tuple[Explanation, InferenceOptions]]:
    system, row = liver(hcv=9.5, nafld=12.0)
    pairs = [(SMALL, x) for x in POINTS] + [(system, row)]
    return [
        (explain(one, x, kind, options), options)
        for one, x in pairs
        for kind in SYSTEMS
        for options in OPTIONS
    ]


def test_the_answer_and_interval_are_those_of_inference(cases):
    for found, options in cases:
        inferred = infer(found.system, found.readings[None], found.kind, options)
        assert found.answer == pytest.approx(float(inferred.value[0]), rel=ROUNDING)
        assert (found.interval is None) == (inferred.interval is None)
        if found.interval is not None:
            np.testing.assert_allclose(found.interval, inferred.interval[0], rtol=ROUNDING)


def test_the_centroid_of_the_curve_is_mamdanis_answer(cases):
    for found, options in cases:
        if found.kind == "mamdani" and options.sampling != "exact":
            y, weights = sampled(found.system.output, options.samples, options.sampling)
            mass = weights * found.curve.upper
            assert mass @ y / mass.sum() == pytest.approx(found.answer, rel=ROUNDING)
            np.testing.assert_array_equal(found.curve.lower, found.curve.upper)


def switched(found: Explanation, options: InferenceOptions, shift: int = 0) -> list[float]:
    """Centroids of the sets that switch where the explanation says, or `shift` samples later."""
    _, weights = sampled(found.system.output, options.samples, options.sampling)
    y, lower, upper = found.curve
    ends = []
    for switch, (first, second) in zip(
        found.switches, ((upper, lower), (lower, upper)), strict=True
    ):
        mass = weights * np.where(np.arange(y.size) < switch.samples + shift, first, second)
        ends.append(mass @ y / mass.sum())
    return ends


def test_sets_that_switch_where_it_is_said_have_the_ends_as_centroids(cases):
    checked = 0
    for found, options in cases:
        if found.kind != "interval-type-2" or options.sampling == "exact":
            continue
        np.testing.assert_allclose(switched(found, options), found.interval, rtol=1e-11)
        for switch, end in zip(found.switches, found.interval, strict=True):
            assert switch.before <= end <= switch.after
        checked += 1
    assert checked == 15


def test_a_switch_two_samples_off_has_another_centroid():
    found = explain(SMALL, POINTS[0], "interval-type-2")
    wrong = switched(found, InferenceOptions(), shift=2)
    assert wrong[0] > found.interval[0] + 1e-6
    assert wrong[1] < found.interval[1] - 1e-6


def test_without_samples_the_bounds_switch_at_the_ends_themselves():
    found = explain(SMALL, POINTS[0], "interval-type-2", InferenceOptions(sampling="exact"))
    assert [s.before for s in found.switches] == list(found.interval)
    assert [s.samples for s in found.switches] == [None, None]


def test_constants_and_shares_add_up_to_sugenos_answer(cases):
    for found, _ in cases:
        if found.kind != "sugeno":
            continue
        by_sets = sum(one.constant * one.share for one in found.outputs)
        constants = [one.constant for one in found.outputs]
        by_rules = sum(firing.share * constants[firing.rule.consequent] for firing in found.rules)
        assert by_sets == pytest.approx(found.answer, rel=ROUNDING)
        assert by_rules == pytest.approx(found.answer, rel=ROUNDING)


def without(system: FuzzySystem, numbers: set[int]) -> FuzzySystem:
    kept = [rule for n, rule in enumerate(system.rules, start=1) if n not in numbers]
    return replace(system, rules=tuple(kept))


@pytest.mark.parametrize("kind", ["mamdani", "interval-type-2"])
def test_only_rules_that_set_a_height_matter(kind):
    system, row = liver(hcv=9.5)
    found = explain(system, row, kind)
    idle = {f.number for f in found.rules if not (f.sets_lower or f.sets_upper)}
    assert len(idle) > 150
    assert explain(without(system, idle), row, kind).answer == found.answer
    severe = found.outputs[-1]
    less = explain(without(system, {*severe.upper_rules}), row, kind)
    assert less.outputs[-1].upper < severe.upper


def test_equally_strong_rules_set_a_height_together_the_shortest_first():
    system, row = liver(hcv=9.5)
    mild = explain(system, row, "mamdani").outputs[0]
    lengths = [len(system.rules[n - 1].antecedents) for n in mild.upper_rules]
    assert len(lengths) > 4
    assert lengths == sorted(lengths)
    assert lengths[0] == 1


def test_a_repeated_rule_shares_the_weight_under_max_and_adds_to_it_under_sum():
    twice = replace(SMALL, rules=(*RULES, RULES[3]))
    x = POINTS[2]
    merged = InferenceOptions(sugeno_aggregation="max")
    assert explain(twice, x, "sugeno", merged).answer == pytest.approx(
        explain(SMALL, x, "sugeno", merged).answer, rel=ROUNDING
    )
    added = explain(twice, x, "sugeno")
    assert added.answer > explain(SMALL, x, "sugeno").answer + 0.1
    assert all(one.upper_rules == () for one in added.outputs)


def test_a_negated_term_has_one_less_the_membership():
    found = explain(SMALL, POINTS[0], "mamdani")
    hot = next(d for d in found.degrees if (d.input, d.set) == ("heat", "hot"))
    not_hot = next(firing for firing in found.rules if firing.number == 3)
    assert not_hot.upper == pytest.approx(0.6 * (1.0 - hot.upper), rel=ROUNDING)


def test_lower_values_never_exceed_upper_ones():
    found = explain(SMALL, POINTS[0], "interval-type-2")
    for part in (*found.degrees, *found.rules, *found.outputs):
        assert 0.0 <= part.lower <= part.upper <= 1.0
    assert np.any(found.curve.lower < found.curve.upper)


def test_a_sugeno_system_of_its_own_answers_with_its_functions():
    sets = (FuzzySet("plane", "linear", (1.0, -2.0, 3.0)), FuzzySet("seven", "linear", (0, 0, 7.0)))
    system = replace(SMALL, output=Variable("flow", 0.0, 30.0, sets))
    found = explain(system, POINTS[0], "sugeno")
    assert [one.constant for one in found.outputs] == [3.0 - 10.0 + 3.0, 7.0]
    assert found.answer == infer(system, POINTS[:1], "sugeno").value[0]
    assert drawing_arrays(found)["view.sugeno.outputs.lower"].size == 0


def test_a_reading_outside_is_explained_where_inference_puts_it():
    x = np.array([12.0, 5.0])
    clamped = explain(SMALL, x, "mamdani", unit="K")
    assert clamped.readings[0] == 10.0
    assert "12 K is outside 0-10 K; clamped" in clamped.notes[0]
    as_it_is = explain(SMALL, x, "mamdani", InferenceOptions(out_of_range="matlab"))
    assert as_it_is.readings[0] == 12.0
    for found in (clamped, as_it_is):
        mass = found.curve.upper
        assert mass @ found.curve.y / mass.sum() == pytest.approx(found.answer, rel=ROUNDING)
    with pytest.raises(ValueError, match="heat: reading 12 is outside"):
        explain(SMALL, x, "mamdani", InferenceOptions(out_of_range="raise"))


@pytest.mark.parametrize("kind", SYSTEMS)
def test_silence_is_explained_as_no_rule_at_all(kind):
    silent = replace(SMALL, rules=(Rule((Term(1, 1),), 1),))
    found = explain(silent, np.array([5.0, 0.0]), kind, InferenceOptions(out_of_range="matlab"))
    assert found.answer == 15.0
    assert found.rules == ()
    assert found.switches is None
    assert any("no rule fires" in line for line in explanation_lines(found))
    with pytest.raises(ValueError, match="no rule fires"):
        explain(silent, np.array([5.0, 0.0]), kind)


def test_shown_rules_cover_every_output_set_and_are_strongest_first():
    system, row = liver(hcv=9.5)
    for kind in SYSTEMS:
        shown = shown_rules(explain(system, row, kind), 6)
        assert len(shown) == 6
        assert {firing.rule.consequent for firing in shown} == {0, 1, 2}
        assert [f.upper for f in shown] == sorted((f.upper for f in shown), reverse=True)
        assert len({term for firing in shown for term in firing.rule.antecedents}) == 6


def test_lines_give_answer_interval_degrees_and_aligned_rules():
    lines = explanation_lines(explain(SMALL, POINTS[0], "interval-type-2"), unit="l/s", rules=4)
    text = "\n".join(lines)
    assert lines[0].startswith("interval-type-2: ")
    assert lines[0].count("l/s") == 3
    assert "if heat is not hot then low (weight 0.6)" in text
    assert "rules: 4 of 4 fire; shown: 4" in text
    rules = [line for line in lines if " then " in line]
    assert len({line.index("if ") for line in rules}) == 1


def test_lines_give_a_sugeno_systems_shares():
    text = "\n".join(explanation_lines(explain(SMALL, POINTS[0], "sugeno")))
    assert text.count("constant") == 2 + 1  # two sets, and how they were made
    assert text.count(" %") == 4 + 2


def test_drawing_arrays_are_plain_and_survive_storing():
    for kind in SYSTEMS:
        arrays = drawing_arrays(explain(SMALL, POINTS[0], kind), unit="l/s")
        file = io.BytesIO()
        np.savez(file, allow_pickle=False, **arrays)
        file.seek(0)
        stored = np.load(file)
        assert str(stored[f"view.{kind}.unit"]) == "l/s"
        for name, array in arrays.items():
            assert name.startswith(f"view.{kind}.")
            np.testing.assert_array_equal(stored[name], array)


def test_drawn_sets_pass_through_the_drawn_degrees():
    arrays = drawing_arrays(explain(SMALL, POINTS[0], "interval-type-2"))
    view = {name.removeprefix("view.interval-type-2."): a for name, a in arrays.items()}
    assert view["terms.negated"].any()
    for t, i in enumerate(view["terms.input"]):
        for bound in ("lower", "upper"):
            drawn = np.interp(view["readings"][i], view["x"][i], view[f"terms.{bound}"][t])
            # Linear between points 1/30 apart, slopes turning by at most 1/4 a unit per unit.
            assert drawn == pytest.approx(view[f"terms.degree_{bound}"][t], abs=1e-4)


def test_a_reading_that_no_rule_asks_for_is_not_listed_as_one():
    unused = replace(SMALL, rules=(Rule((Term(0, 0),), 0), Rule((Term(0, 1),), 1)))
    x = np.full(len(SMALL.inputs), 9.0)
    lines = explanation_lines(explain(unused, x, "sugeno"))
    rain = next(line for line in lines if line.split()[:1] == ["rain"])
    assert rain.split() == ["rain", "in", "no", "rule"]
    whole = explanation_lines(explain(SMALL, x, "sugeno"))
    assert any(line.split()[:2] == ["rain", "9.00"] for line in whole)


def test_a_small_degree_is_not_printed_as_none():
    x = np.array([2.0, *np.full(len(SMALL.inputs) - 1, 9.0)])
    (heat,) = (line for line in explanation_lines(explain(SMALL, x, "sugeno")) if "heat  " in line)
    cold, hot = heat.split("cold ")[1].split("hot ")
    assert float(hot) == pytest.approx(np.exp(-0.5 * 3.5**2), abs=1e-3)
    far = explanation_lines(explain(SMALL, np.array([0.0, *x[1:]]), "sugeno"))
    (heat,) = (line for line in far if "heat  " in line)
    assert heat.split("hot ")[1] == "4e-05"
    assert float(cold) > 0.8
