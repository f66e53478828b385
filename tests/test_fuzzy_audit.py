"""The audit finds what is planted in a rule base, and nothing in one that has no fault."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.systems.audit import audit, audit_lines
from fuzzy.systems.coverage import Gap, spread_readings
from fuzzy.systems.inference import infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.redundancy import Pair, dominated
from fuzzy.systems.rule_text import rule_text
from fuzzy.systems.sets import Footprint, FuzzySet, lower_membership, upper_membership
from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable, firing_strengths

LOW, HIGH = 0, 1
COLD, WARM = Term(0, LOW), Term(0, HIGH)
DRY, WET = Term(1, LOW), Term(1, HIGH)


def variable(name):
    """Two ramps that cross at a half, so that some set always fires."""
    ramps = ((-11.0, -10.0, 0.0, 10.0), (0.0, 10.0, 20.0, 21.0))
    sets = zip(("low", "high"), ramps, strict=True)
    return Variable(name, 0.0, 10.0, tuple(FuzzySet(n, "trapmf", p) for n, p in sets))


def system(*rules, operators=None):
    names = ("heat", "rain")
    inputs = tuple(variable(name) for name in names)
    return FuzzySystem(inputs, variable("growth"), rules, operators or Operators())


SOUND = system(Rule((COLD,), LOW), Rule((WARM, DRY), LOW), Rule((WARM, WET), HIGH))


def test_a_sound_system_has_no_finding():
    found = audit(SOUND)
    assert not found.duplicates
    assert not found.contradictions
    assert not found.dominated
    assert not found.unreachable
    assert not found.weightless
    assert not found.unused_sets
    assert not found.gaps
    assert found.coverage.uncovered == 0
    assert len(audit_lines(found, SOUND)) == 2


def planted(*rules):
    """The sound system with rules of index 3 and on appended."""
    return replace(SOUND, rules=(*SOUND.rules, *rules))


def test_a_repeated_rule_is_found_in_any_order_of_terms():
    found = audit(planted(Rule((DRY, WARM), LOW)))
    assert found.duplicates == (Pair(3, 1),)
    assert found.contradictions == ()
    assert found.dominated == (Pair(3, 1),)


def test_a_contradiction_is_found():
    found = audit(planted(Rule((DRY, WARM), HIGH)))
    assert found.contradictions == (Pair(3, 1),)
    assert found.duplicates == ()


@pytest.mark.parametrize(
    ("rule", "other"),
    [
        (Rule((COLD, WET), LOW), 0),  # a part of its antecedent is enough
        (Rule((COLD, WET), LOW, weight=0.5), 0),
        (Rule((COLD, COLD), LOW), 0),  # min does not see the repetition
        (Rule((COLD,), LOW, "or"), 0),
        (Rule((COLD, WET), HIGH), None),  # another consequent
        (Rule((COLD, WET), LOW, "or"), None),  # OR is stronger
        (Rule((Term(0, LOW, negated=True), WET), LOW), None),  # not the same term
    ],
)
def test_a_dominated_rule_is_found(rule, other):
    assert [pair.other for pair in dominated(planted(rule)) if pair.rule == 3] == (
        [] if other is None else [other]
    )


def test_a_heavier_rule_is_not_dominated_but_dominates():
    light = system(Rule((COLD,), LOW, weight=0.5), Rule((COLD,), LOW), Rule((COLD, DRY), LOW))
    assert dominated(light) == (Pair(0, 1), Pair(2, 1))
    assert dominated(system(Rule((COLD,), LOW, weight=0.5), Rule((COLD, DRY), LOW))) == ()


def test_and_gives_way_to_or_and_or_to_a_longer_or():
    either = Rule((COLD, DRY), LOW, "or")
    assert dominated(system(either, Rule((COLD, WET), LOW))) == (Pair(1, 0),)
    assert dominated(system(Rule((COLD,), LOW), either)) == (Pair(0, 1),)
    longer = Rule((COLD, DRY, WET), LOW, "or")
    assert dominated(system(either, longer)) == (Pair(0, 1),)


def test_product_sees_a_repeated_term():
    by_product = Operators(conjunction="prod")
    squared = (Rule((COLD, COLD), LOW), Rule((COLD, DRY), LOW))
    assert dominated(system(*squared, operators=by_product)) == ()
    assert dominated(system(*squared)) == (Pair(1, 0),)


def random_system(rng):
    def rule():
        terms = tuple(
            Term(int(rng.integers(2)), int(rng.integers(2)), bool(rng.random() < 0.3))
            for _ in range(rng.integers(1, 4))
        )
        weight = float(rng.choice([0.5, 1.0]))
        return Rule(terms, int(rng.integers(2)), str(rng.choice(["and", "or"])), weight)

    operators = Operators(
        conjunction=str(rng.choice(["min", "prod"])), disjunction=str(rng.choice(["max", "probor"]))
    )
    made = system(*(rule() for _ in range(12)), operators=operators)
    fuzzy = tuple(
        replace(v, sets=tuple(replace(s, footprint=Footprint(mean=1.0)) for s in v.sets))
        for v in made.inputs
    )
    return replace(made, inputs=fuzzy)


def test_a_dominated_rule_is_never_stronger_in_random_systems():
    rng = np.random.default_rng(7)
    found = 0
    for _ in range(60):
        made = random_system(rng)
        X = rng.uniform(0, 10, (50, 2))
        lower = firing_strengths(made, X, lower_membership, upper_membership)
        upper = firing_strengths(made, X, upper_membership, lower_membership)
        for pair in dominated(made):
            found += 1
            # Products of the same factors in another order differ by rounding.
            assert np.all(lower[pair.rule] <= lower[pair.other] + 1e-15)
            assert np.all(upper[pair.rule] <= upper[pair.other] + 1e-15)
    assert found > 100


def outdone(rules, strengths):
    """Rules that another one of the same consequent outdoes everywhere; of equals, the later."""
    everyone = range(len(rules))
    weaker = np.array([[np.all(strengths[i] <= strengths[j]) for j in everyone] for i in everyone])
    return {
        i
        for i in everyone
        for j in everyone
        if i != j
        and rules[i].consequent == rules[j].consequent
        and weaker[i, j]
        and (j < i or not weaker[j, i])
    }


def test_no_dominated_rule_is_missed_under_min_and_max():
    # Every term has a degree of its own here, so that nothing but the terms can decide.
    rng = np.random.default_rng(8)
    degree = {
        Term(i, s, negated): rng.choice([0.0, 0.25, 0.5, 0.75, 1.0], 5000)
        for i, s, negated in product(range(2), range(2), (False, True))
    }
    for _ in range(40):
        made = replace(random_system(rng), operators=Operators())
        join = {"and": np.minimum.reduce, "or": np.maximum.reduce}
        strengths = [
            rule.weight * join[rule.connective]([degree[term] for term in rule.antecedents])
            for rule in made.rules
        ]
        assert {pair.rule for pair in dominated(made)} == outdone(made.rules, strengths)


# --- the liver -------------------------------------------------------------------------------


def test_eleven_of_the_livers_247_rules_decide_mamdani_and_type_2():
    liver = liver_system(LiverSettings(knowledge="severity"))
    dead = {pair.rule for pair in dominated(liver)}
    alive = tuple(rule for i, rule in enumerate(liver.rules) if i not in dead)
    assert len(dead) == 236
    assert all(len(rule.antecedents) == 1 for rule in alive)
    X = spread_readings(liver, 64)
    few, by_max = replace(liver, rules=alive), InferenceOptions(sugeno_aggregation="max")
    for kind in SYSTEMS:
        # Not one bit: the same heights reach the output.
        assert np.array_equal(
            infer(few, X, kind, by_max).value, infer(liver, X, kind, by_max).value
        )


def test_sugenos_sum_needs_the_dominated_rules():
    liver = liver_system(LiverSettings(knowledge="severity"))
    dead = {pair.rule for pair in dominated(liver)}
    few = replace(liver, rules=tuple(r for i, r in enumerate(liver.rules) if i not in dead))
    X = spread_readings(liver, 64)
    change = infer(few, X, "sugeno").value - infer(liver, X, "sugeno").value
    assert np.abs(change).max() > 1.0  # kPa


def test_each_of_the_eleven_rules_matters():
    liver = liver_system(LiverSettings(knowledge="severity"))
    dead = {pair.rule for pair in dominated(liver)}
    alive = tuple(rule for i, rule in enumerate(liver.rules) if i not in dead)
    scale = np.arange(2.0, 76.0)
    # One aetiology at a time crosses the scale beside four mild or four severe ones.
    X = np.concatenate(
        [
            np.where(np.arange(5) == i, scale[:, None], others)
            for i in range(5)
            for others in (4.1, 40.0)
        ]
    )
    whole = infer(liver, X, "mamdani").value
    for rule in alive:
        few = replace(liver, rules=tuple(other for other in alive if other is not rule))
        assert np.abs(infer(few, X, "mamdani").value - whole).max() > 1.0  # kPa


def test_the_liver_has_twelve_duplicates_and_no_gap():
    found = audit(liver_system(LiverSettings(knowledge="severity")))
    assert len(found.duplicates) == 12
    assert not found.contradictions
    assert not found.gaps
    assert not found.unused_sets
    assert found.coverage.uncovered == 0


# --- rules and readings that never meet ------------------------------------------------------


def three(name):
    """Sets on the left and on the right that do not meet, and one that lies outside."""
    shapes = ((-1.0, 0.0, 1.0, 2.0), (3.0, 4.0, 5.0, 6.0), (12.0, 13.0, 14.0, 15.0))
    sets = zip(("left", "right", "outside"), shapes, strict=True)
    return Variable(name, 0.0, 10.0, tuple(FuzzySet(n, "trapmf", p) for n, p in sets))


def apart(*rules):
    return FuzzySystem((three("heat"), three("rain")), variable("growth"), rules)


@pytest.mark.parametrize(
    ("rule", "fires"),
    [
        (Rule((Term(0, 0), Term(0, 1)), LOW), False),  # no reading is left and right
        (Rule((Term(0, 0), Term(0, 1)), LOW, "or"), True),
        (Rule((Term(0, 0), Term(1, 1)), LOW), True),  # two inputs vary freely
        (Rule((Term(0, 2),), LOW), False),  # beyond the universe
        (Rule((Term(0, 2, negated=True),), LOW), True),
        (Rule((Term(0, 0), Term(0, 1, negated=True)), LOW), True),
        (Rule((Term(0, 0), Term(1, 2)), LOW), False),
        (Rule((Term(0, 0), Term(1, 2)), LOW, "or"), True),
    ],
)
def test_a_rule_that_no_reading_fires_is_found(rule, fires):
    assert audit(apart(Rule((Term(0, 0),), LOW), rule), samples=8).unreachable == (
        () if fires else (1,)
    )


def test_a_footprint_can_bring_a_set_within_reach():
    rule = Rule((Term(0, 2),), LOW)
    far = apart(rule).inputs[0].sets
    near = tuple(replace(one, footprint=Footprint(mean=3.0)) for one in far)
    moved = replace(apart(rule), inputs=(replace(three("heat"), sets=near), three("rain")))
    assert audit(apart(rule), samples=8).unreachable == (0,)
    assert audit(moved, samples=8).unreachable == ()


def test_a_narrow_set_between_the_grid_points_is_reachable():
    needle = FuzzySet("needle", "trimf", (5.0031, 5.0032, 5.0033))
    narrow = FuzzySystem(
        (Variable("x", 0.0, 10.0, (needle,)),), variable("y"), (Rule((Term(0, 0),), LOW),)
    )
    assert audit(narrow, samples=8).unreachable == ()


def test_weightless_rules_and_unused_sets_are_found():
    found = audit(apart(Rule((Term(0, 0),), LOW), Rule((Term(1, 1),), LOW, weight=0.0)), samples=8)
    assert found.weightless == (1,)
    assert found.unreachable == ()
    assert found.dominated == ()
    assert found.unused_sets == (
        ("heat", "right"),
        ("heat", "outside"),
        ("rain", "left"),
        ("rain", "outside"),
        ("growth", "high"),
    )


def test_gaps_of_one_input_are_where_its_sets_end():
    found = audit(apart(Rule((Term(0, 0),), LOW)), samples=8, threshold=0.25)
    heat = [gap for gap in found.gaps if gap.input == "heat"]
    # The ramps pass 0.25 at 1.75, 3.25 and 5.75; the grid's spacing is 0.01.
    expected = [(1.75, 3.25), (5.75, 10.0)]
    assert [gap[1:] for gap in heat] == [pytest.approx(ends, abs=0.011) for ends in expected]
    assert all(isinstance(gap, Gap) for gap in heat)


def test_share_of_uncovered_readings_is_that_of_their_area():
    # Covered: both inputs left of 1.75 (the ramp passes 0.25 there), of a 10 by 10 square.
    corner = apart(Rule((Term(0, 0), Term(1, 0)), LOW))
    found = audit(corner, threshold=0.25).coverage
    # Evenly spread points err by about log(n)^2 / n, 0.02 for 4096.
    assert found.uncovered == pytest.approx(1 - 0.175**2, abs=0.02)
    assert found.least_strength == 0
    x = found.least_covered
    assert max(x) > 2


def test_spread_readings_fill_the_universe_more_evenly_than_random_ones():
    liver = liver_system(LiverSettings(knowledge="severity"))
    low, high = 2.0, 75.0

    def unevenness(X):
        octant = ((X - low) / (high - low) > 0.5) @ (2 ** np.arange(5))
        return np.abs(np.bincount(octant, minlength=32) - len(X) / 32).max()

    X = spread_readings(liver, 4096)
    random = np.random.default_rng(1).uniform(low, high, X.shape)
    assert unevenness(X) < unevenness(random)
    assert X.min() >= low
    assert X.max() <= high


@pytest.mark.parametrize(
    ("options", "message"),
    [({"samples": 0}, "samples = 0"), ({"threshold": 1.0}, "threshold = 1.0")],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        audit(SOUND, **options)


# --- in words --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rule", "text"),
    [
        (Rule((COLD,), LOW), "if heat is low then low"),
        (
            Rule((COLD, Term(1, HIGH, negated=True)), HIGH, weight=0.5),
            "if heat is low and rain is not high then high (weight 0.5)",
        ),
        (Rule((COLD, WET), HIGH, "or"), "if heat is low or rain is high then high"),
    ],
)
def test_a_rule_in_words(rule, text):
    assert rule_text(rule, SOUND) == text


def test_the_audit_of_the_liver_in_words():
    liver = liver_system(LiverSettings(knowledge="severity"))
    lines = audit_lines(audit(liver), liver, examples=1)
    assert lines[0].startswith("liver-R1: 247 rules on sets: 2 of hcv, 3 of hbv")
    text = "\n".join(lines)
    assert "12 of 247 rules repeat an earlier rule" in text
    assert "and 11 more" in text
    assert "236 of 247 rules change no answer where rules are merged by max" in text
    assert "The other 11 alone give the same answers" in text
    assert "gives way to rule 1, if hcv is F2 then mild" in text
    assert "each of 4096 readings spread over the universe fires a rule above 0.05" in text


def test_every_finding_has_its_words():
    bad = apart(
        Rule((Term(0, 0),), LOW),
        Rule((Term(0, 0),), HIGH),
        Rule((Term(0, 2),), LOW),
        Rule((Term(0, 1),), LOW, weight=0.0),
    )
    text = "\n".join(audit_lines(audit(bad), bad))
    for words in (
        "1 of 4 rules contradict an earlier rule",
        "rule 2, as rule 1: if heat is left then high",
        "1 of 4 rules can be fired by no reading",
        "1 of 4 rules have weight 0",
        "rain: no rule uses the set left",
        "heat: no set exceeds 0.05 from 1.96 to 3.04",
        "% of 4096 readings spread over the universe fire no rule above 0.05",
    ):
        assert words in text
