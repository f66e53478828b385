"""scikit-fuzzy's control systems from ours and back."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import skfuzzy
from skfuzzy import control

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.systems import mamdani
from fuzzy.systems.conversion import type_1_of
from fuzzy.systems.inference import infer
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.recognition import recognised
from fuzzy.systems.scikit_fuzzy import from_skfuzzy, to_skfuzzy
from fuzzy.systems.sets import FuzzySet, membership
from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable

LIVER = liver_system(LiverSettings(knowledge="severity"))
EXACT = InferenceOptions(sampling="exact")
INSIDE = np.random.default_rng(20240917).uniform(2.0, 75.0, (300, 5))


def tipper():
    service = tuple(FuzzySet(f"s{c}", "gaussmf", (1.5, c)) for c in (0.0, 5.0, 10.0))
    food = (
        FuzzySet("rancid", "trapmf", (-2.0, 0.0, 1.0, 3.0)),
        FuzzySet("delicious", "trapmf", (7.0, 9.0, 10.0, 12.0)),
    )
    tip = tuple(FuzzySet(f"t{a}", "trimf", (a, a + 5.0, a + 10.0)) for a in (0.0, 10.0, 20.0))
    return FuzzySystem(
        (Variable("service", 0, 10, service), Variable("food", 0, 10, food)),
        Variable("tip", 0, 30, tip),
        (
            Rule((Term(0, 0), Term(1, 0)), 0, "or"),
            Rule((Term(0, 1),), 1, weight=0.7),
            Rule((Term(0, 2), Term(1, 1), Term(1, 0, negated=True)), 2),
        ),
    )


def simulated(system, X, points):
    """scikit-fuzzy's answers (N,)."""
    return computed(to_skfuzzy(system, points), system, X)


def computed(controller, system, X):
    """Answers (N,) of a control system with the names of our system."""
    simulation = control.ControlSystemSimulation(controller)
    for i, variable in enumerate(system.inputs):
        simulation.input[variable.name] = X[:, i].copy()
    with warnings.catch_warnings():
        # scikit-fuzzy 0.5 hands `out` to numpy.maximum by position.
        warnings.simplefilter("ignore", DeprecationWarning)
        simulation.compute()
    return simulation.output[system.output.name]


@pytest.mark.parametrize(
    "operators", [Operators(), Operators(conjunction="prod", disjunction="probor")]
)
def test_scikit_fuzzy_approaches_the_exact_answer_as_its_grid_is_refined(operators):
    system = replace(tipper(), operators=operators)
    X = np.random.default_rng(1).uniform(0, 10, (25, 2))
    exact = mamdani.evaluate(system, X, EXACT).value
    assert_second_order(*(np.abs(simulated(system, X, n) - exact).max() for n in (1001, 5001)))


def test_scikit_fuzzy_agrees_on_the_liver():
    X = INSIDE[:25]
    exact = mamdani.evaluate(LIVER, X, EXACT).value
    assert_second_order(*(np.abs(simulated(LIVER, X, n) - exact).max() for n in (1001, 5001)))


def assert_second_order(coarse, fine):
    """Errors of a grid and of one five times as fine.

    Between samples scikit-fuzzy interpolates linearly, and its error goes with the square of their
    distance: by 25, or some factor around it where the worst reading is another one. At 1001
    points a degree is off by up to (75 / 1000)^2 / 8 sd^2 = 2e-4; areas and answers by less.
    """
    assert coarse < 1e-3
    assert 12 < coarse / fine < 50


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"operators": Operators(implication="prod")}, "clips"),
        ({"output": replace(tipper().output, name="food")}, "rename"),
        (
            {
                "output": replace(
                    tipper().output,
                    sets=tuple(FuzzySet(f"c{i}", "constant", (1.0,)) for i in range(3)),
                )
            },
            "Sugeno",
        ),
    ],
)
def test_what_scikit_fuzzy_does_not_have_is_refused(change, match):
    with pytest.raises(ValueError, match=match):
        to_skfuzzy(replace(tipper(), **change))


# --- back from scikit-fuzzy --------------------------------------------------------------------


@pytest.mark.parametrize(
    "operators", [Operators(), Operators(conjunction="prod", disjunction="probor")]
)
def test_a_system_comes_back_with_its_answers(operators):
    system = replace(tipper(), operators=operators)
    X = np.random.default_rng(2).uniform(0, 10, (50, 2))
    back = from_skfuzzy(to_skfuzzy(system), system.name)
    assert [one.name for one in back.inputs] == ["service", "food"]
    assert (back.rules, back.operators) == (system.rules, operators)
    wanted = infer(system, X, "mamdani", EXACT).value
    assert infer(back, X, "mamdani", EXACT).value == pytest.approx(wanted, abs=1e-8)


def test_the_liver_comes_back_with_its_sets_and_rules():
    liver, back = type_1_of(LIVER), from_skfuzzy(to_skfuzzy(LIVER), LIVER.name)
    assert back.rules == liver.rules
    assert back.output == liver.output
    wanted = infer(liver, INSIDE, "mamdani", EXACT).value
    assert infer(back, INSIDE, "mamdani", EXACT).value == pytest.approx(wanted, abs=1e-8)


def test_the_round_trip_would_show_a_rule_read_wrongly():
    system, X = tipper(), np.random.default_rng(2).uniform(0, 10, (50, 2))
    wanted = infer(system, X, "mamdani", EXACT).value
    back = from_skfuzzy(to_skfuzzy(system))
    first, *others = back.rules
    for planted in (replace(first, connective="and"), replace(first, weight=0.5)):
        wrong = replace(back, rules=(planted, *others))
        assert np.abs(infer(wrong, X, "mamdani", EXACT).value - wanted).max() > 0.01


def variables(points=1001):
    """Their own sets, by their own functions."""
    x = np.linspace(0.0, 10.0, points)
    service, food = control.Antecedent(x, "service"), control.Antecedent(x, "food")
    tip = control.Consequent(np.linspace(0.0, 25.0, points), "tip")
    service["poor"] = skfuzzy.gaussmf(x, 0.0, 1.5)
    service["good"] = skfuzzy.gauss2mf(x, 4.0, 1.0, 6.0, 2.0)
    service["fine"] = skfuzzy.sigmf(x, 8.0, 2.0)
    food["bad"] = skfuzzy.zmf(x, 1.0, 6.0)
    food["fair"] = skfuzzy.pimf(x, 2.0, 4.5, 5.0, 8.0)
    food["plain"] = skfuzzy.gbellmf(x, 2.0, 2.5, 4.0)
    food["nice"] = skfuzzy.smf(x, 5.0, 9.0)
    tip.automf(3, names=["low", "middle", "high"])
    return service, food, tip


def controller(*rules, points=1001, **functions):
    """Rules by their own operators on terms; each is given the three variables."""
    service, food, tip = variables(points)
    made = [control.Rule(*rule(service, food, tip), **functions) for rule in rules]
    return control.ControlSystem(made)


MIXED = (
    lambda s, f, t: ((s["poor"] | f["bad"]) & ~s["fine"], t["low"]),
    lambda s, f, t: (~(s["poor"] & f["bad"]) & f["fair"], t["middle"] % 0.6),
    lambda s, f, t: (~(s["poor"] | ~s["fine"]) | ~~f["nice"], (t["high"] % 0.9, t["middle"] % 0.2)),
    lambda s, f, t: (s["good"] & f["plain"], t["middle"]),
)


PRODUCTS = (MIXED[0], MIXED[3], lambda s, f, t: (f["nice"] & s["good"], t["high"]))


@pytest.mark.parametrize(
    ("rules", "functions"), [(MIXED, {}), (PRODUCTS, {"and_func": np.multiply})]
)
def test_their_own_system_answers_here_as_there(rules, functions):
    errors = []
    for points in (1001, 5001):
        theirs = controller(*rules, points=points, **functions)
        ours = from_skfuzzy(theirs)
        assert ours.operators.conjunction == ("prod" if functions else "min")
        X = np.random.default_rng(3).uniform(0, 10, (100, 2))
        answers = computed(theirs, ours, X)
        errors.append(np.abs(infer(ours, X, "mamdani", EXACT).value - answers).max())
    assert_second_order(*errors)
    assert np.ptp(answers) > 5


def test_the_comparison_would_show_a_not_left_out():
    def planted(s, f, t):
        return (s["poor"] | f["bad"]) & s["fine"], t["low"]

    theirs, other = controller(*MIXED), controller(planted, *MIXED[1:])
    X = np.random.default_rng(3).uniform(0, 10, (100, 2))
    wrong, ours = from_skfuzzy(other), from_skfuzzy(theirs)
    assert [one.name for one in wrong.inputs] == [one.name for one in ours.inputs]
    found = infer(wrong, X, "mamdani", EXACT).value
    assert np.abs(found - computed(theirs, ours, X)).max() > 0.1


def test_several_consequents_become_rules_of_their_own():
    ours = from_skfuzzy(controller(lambda s, _, t: (s["poor"], (t["low"] % 0.9, t["high"] % 0.2))))
    assert [(rule.consequent, rule.weight) for rule in ours.rules] == [(0, 0.9), (2, 0.2)]


def chained():
    service, _, tip = variables()
    mood = control.Consequent(np.linspace(0, 1, 11), "mood")
    mood.automf(3)
    return control.ControlSystem(
        [control.Rule(service["poor"], mood["poor"]), control.Rule(mood["poor"], tip["low"])]
    )


def two_outputs():
    service, _, tip = variables()
    other = control.Consequent(np.linspace(0, 1, 11), "other")
    other.automf(3)
    return control.ControlSystem([control.Rule(service["poor"], (tip["low"], other["poor"]))])


def by(**attributes):
    service, _, tip = variables()
    for name, value in attributes.items():
        setattr(tip, name, value)
    return control.ControlSystem([control.Rule(service["poor"], tip["low"])])


def odd_set(mu):
    service, _, tip = variables()
    service["odd"] = mu
    return control.ControlSystem([control.Rule(service["odd"], tip["low"])])


def both_ands():
    service, food, tip = variables()
    pair = service["poor"], food["bad"]
    return control.ControlSystem(
        [
            control.Rule(pair[0] & pair[1], tip["low"]),
            control.Rule(~pair[0] & pair[1], tip["high"], and_func=np.multiply),
        ]
    )


def fluctuating():
    return 0.5 + 0.4 * np.sin(np.linspace(0, 20, 1001))


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (two_outputs, "'tip', 'other': give a control system with one output"),
        (chained, "one output"),
        (lambda: by(defuzzify_method="mom"), "'tip': defuzzification by 'mom'"),
        (lambda: by(accumulation_method=np.add), "'tip': accumulates"),
        (lambda: odd_set(fluctuating()), "service: set 'odd': its samples are of no triangle"),
        (lambda: odd_set(np.full(1001, np.nan)), "service: set 'odd': has samples that are not"),
        (lambda: odd_set(np.zeros(1001)), "service: set 'odd'"),
        (both_ands, "conjunction by min and prod: use one"),
        (
            lambda: controller(MIXED[0], and_func=np.hypot),
            "rule .*: AND by .*hypot.* use min or product",
        ),
        (
            lambda: controller(
                lambda s, f, t: (~(s["poor"] & f["bad"]) & f["fair"], t["low"]),
                and_func=np.multiply,
            ),
            "rule .*: mixes AND with OR by probabilistic sum",
        ),
        (
            lambda: controller(lambda s, _, t: (s["poor"], t["low"] % 1.5)),
            "rule .*: rule weight 1.5",
        ),
    ],
)
def test_what_a_system_of_ours_cannot_hold_is_refused(make, match):
    with pytest.raises(ValueError, match=match):
        from_skfuzzy(make())


def test_a_chain_of_rules_is_refused_by_name():
    service, _, tip = variables()
    tip["again"] = np.linspace(0, 1, 1001)
    chain = control.ControlSystem(
        [control.Rule(service["poor"], tip["low"]), control.Rule(tip["low"], tip["again"])]
    )
    with pytest.raises(ValueError, match="'tip' is an output of other rules"):
        from_skfuzzy(chain)


def test_a_falling_universe_is_refused():
    service = control.Antecedent(np.linspace(10, 0, 11), "service")
    service["on"] = np.ones(11)
    *_, tip = variables()
    with pytest.raises(ValueError, match="service: its universe does not rise"):
        from_skfuzzy(control.ControlSystem([control.Rule(service["on"], tip["low"])]))


SETS = (
    ("trimf", (0.0, 0.0, 5.0)),
    ("trimf", (0.0, 5.0, 10.0)),
    ("trimf", (1.03, 4.444, 9.99)),
    ("trimf", (5.0, 10.0, 10.0)),
    ("trimf", (-2.0, -1.0, 5.0)),
    ("trapmf", (1.0, 2.5, 2.75, 8.0)),
    ("gaussmf", (1.3, 4.444)),
    ("gaussmf", (3.0, -2.0)),
    ("gauss2mf", (1.3, 4.0, 2.0, 6.1)),
    ("gbellmf", (2.0, 2.5, 4.444)),
    ("gbellmf", (1.5, 4.0, 0.0)),
    ("gbellmf", (3.0, 1.0, 11.0)),
    ("sigmf", (2.0, 3.0)),
    ("sigmf", (-1.5, 8.0)),
    ("zmf", (1.0, 7.3)),
    ("smf", (1.0, 7.3)),
    ("pimf", (1.0, 3.0, 4.2, 9.0)),
)


@pytest.mark.parametrize(("kind", "parameters"), SETS)
@pytest.mark.parametrize("points", [101, 1001])
def test_a_set_is_recognised_in_its_samples(kind, parameters, points):
    one = FuzzySet("one", kind, parameters)
    x = np.linspace(0.0, 10.0, points)
    found = recognised("one", x, membership(one, x))
    assert found.kind == kind
    assert membership(found, x) == pytest.approx(membership(one, x), abs=1e-8)
    fine = np.linspace(0.0, 10.0, 7777)
    assert membership(found, fine) == pytest.approx(membership(one, fine), abs=1e-7)


def test_shoulders_and_steps_are_trapezoids():
    x = np.linspace(0.0, 10.0, 11)
    for mu in (np.ones(11), np.clip(4.0 - x, 0.0, 1.0), np.clip(x - 6.5, 0.0, 1.0), x >= 4):
        found = recognised("one", x, np.asarray(mu, dtype=float))
        assert found.kind == "trapmf"
        assert membership(found, x) == pytest.approx(np.asarray(mu, dtype=float), abs=1e-12)


def test_a_set_that_is_off_by_little_is_not_taken_for_another():
    x = np.linspace(0.0, 10.0, 101)
    mu = skfuzzy.trimf(x, [0.0, 5.0, 10.0])
    mu[30] += 1e-6
    with pytest.raises(ValueError, match="its samples are of no triangle"):
        recognised("one", x, mu)
