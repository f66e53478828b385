"""Readings that no system can answer are treated alike by all three, and never silently."""

from itertools import pairwise

import numpy as np
import pytest

from fuzzy.systems.compiled import compiled
from fuzzy.systems.inference import COMPILED_FROM_ROWS, infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.policy import LEAST_STRENGTH
from fuzzy.systems.sets import FuzzySet
from fuzzy.systems.system import FuzzySystem, Rule, Term, Variable
from fuzzy.systems.table import evaluate_table

MIDDLE = 15.0


def narrow():
    """One set about 5 on a universe to 100, so that most of it is silent."""
    x = Variable("hcv", 0, 100, (FuzzySet("mild", "gaussmf", (1.0, 5.0)),))
    y = Variable("tip", 0, 30, (FuzzySet("low", "trimf", (0.0, 5.0, 10.0)),))
    return FuzzySystem((x,), y, (Rule((Term(0, 0),), 0),))


def ramp():
    """A set that keeps firing beyond the universe, so that a reading there has an answer."""
    x = Variable(
        "hcv", 0, 10, (FuzzySet("a", "gaussmf", (4.0, 0.0)), FuzzySet("b", "gaussmf", (4.0, 10.0)))
    )
    sets = FuzzySet("low", "trimf", (0.0, 5.0, 10.0)), FuzzySet("high", "trimf", (10.0, 15.0, 30.0))
    return FuzzySystem(
        (x,), Variable("tip", 0, 30, sets), tuple(Rule((Term(0, k),), k) for k in (0, 1))
    )


def answer(system, x, kind, **options):
    return infer(
        system, np.array([[float(v)] for v in x]), kind, InferenceOptions(**options), "kPa"
    )


@pytest.mark.parametrize("kind", SYSTEMS)
class TestPolicies:
    @pytest.mark.parametrize("policy", ["clamp", "raise"])
    def test_silence_is_no_answer(self, kind, policy):
        with pytest.raises(ValueError, match=r"no rule fires for hcv = 40 \(row 2 of 2\): add a"):
            answer(narrow(), [5, 40], kind, out_of_range=policy)

    def test_matlab_answers_silence_with_the_middle_and_says_so(self, kind):
        found = answer(narrow(), [5, 60], kind, out_of_range="matlab")
        assert found.value[1] == MIDDLE
        assert found.value[0] != MIDDLE
        assert any("no more than the middle" in note for note in found.notes)
        if found.interval is not None:
            assert found.interval[1].tolist() == [0.0, 30.0]

    def test_underflow_of_all_memberships_is_silence(self, kind):
        with pytest.raises(ValueError, match="no rule fires"):
            answer(narrow(), [99.0], kind)
        assert answer(narrow(), [1e4], kind, out_of_range="matlab").value[0] == MIDDLE

    def test_clamp_takes_the_end_of_the_universe_and_says_so(self, kind):
        found, expected = answer(ramp(), [14, 3], kind), answer(ramp(), [10, 3], kind)
        assert found.value.tolist() == expected.value.tolist()
        assert found.notes == ("hcv: reading 14 kPa (row 1) is outside 0-10 kPa; clamped to it",)
        assert expected.notes == ()

    def test_raise_refuses_what_clamp_would_move(self, kind):
        with pytest.raises(
            ValueError, match=r"hcv: reading 14 kPa \(row 1 and 1 more\) is outside"
        ):
            answer(ramp(), [14, -2], kind, out_of_range="raise")

    def test_matlab_takes_the_reading_as_it_is_and_says_so(self, kind):
        found = answer(ramp(), [14], kind, out_of_range="matlab")
        assert found.value != pytest.approx(answer(ramp(), [10], kind).value, rel=1e-6)
        assert found.notes == ("hcv: reading 14 kPa is outside 0-10 kPa; taken as it is",)

    @pytest.mark.parametrize("policy", ["clamp", "raise", "matlab"])
    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    def test_no_number_is_refused_by_name(self, kind, policy, value):
        with pytest.raises(ValueError, match=r"hcv = .* \(row 2\): give a finite reading"):
            answer(narrow(), [5, value], kind, out_of_range=policy)

    def test_wrong_width_is_refused(self, kind):
        with pytest.raises(ValueError, match=r"shape \(1, 3\); give \(N, 1\)"):
            infer(narrow(), np.ones((1, 3)), kind)

    @pytest.mark.parametrize("count", [3000, COMPILED_FROM_ROWS])
    def test_many_rows_meet_the_same_policy_as_few(self, kind, count):
        rows = [5.0] * count
        assert answer(narrow(), rows, kind).value == pytest.approx(
            answer(narrow(), [5.0], kind).value[0], rel=1e-13
        )
        last = count + 1
        with pytest.raises(ValueError, match=rf"hcv = 40 \(row {last} of {last}\)"):
            answer(narrow(), [*rows, 40.0], kind)
        found = answer(narrow(), [*rows, 60.0], kind, out_of_range="matlab")
        assert found.value[-1] == MIDDLE
        assert found.notes


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("samples", 10),
        ("samples", 101.0),
        ("sampling", "simpson"),
        ("sugeno_aggregation", "mean"),
        ("reducer", "karnik"),
        ("out_of_range", "ignore"),
    ],
)
def test_an_option_that_is_none_is_refused_by_name(key, value):
    with pytest.raises(ValueError, match=f"^{key} = "):
        InferenceOptions(**{key: value})


def test_a_sugeno_system_cannot_be_evaluated_as_mamdani():
    x = Variable("x", 0, 1, (FuzzySet("any", "smf", (-2.0, -1.0)),))
    y = Variable("y", 0, 1, (FuzzySet("one", "constant", (1.0,)),))
    system = FuzzySystem((x,), y, (Rule((Term(0, 0),), 0),))
    for kind in ("mamdani", "interval-type-2"):
        with pytest.raises(ValueError, match="only be evaluated as sugeno"):
            infer(system, [[0.5]], kind)
    with pytest.raises(ValueError, match="system 'type-3': use one of mamdani"):
        infer(system, [[0.5]], "type-3")


# --- rules fire, and still there is no number --------------------------------------------------

BETWEEN_SAMPLES = FuzzySet("thin", "trimf", (0.501, 0.505, 0.509))
OFF_THE_UNIVERSE = FuzzySet("off", "trimf", (2.0, 3.0, 4.0))
WIDE = FuzzySet("wide", "gaussmf", (0.1, 0.5))


def beside(*outputs):
    """One rule for each output set, from as many sets along [0, 1] that do not overlap."""
    ends = np.linspace(0.0, 1.0, len(outputs) + 1).tolist()
    inputs = tuple(
        FuzzySet(f"a{i}", "trimf", (low, (low + high) / 2, high))
        for i, (low, high) in enumerate(pairwise(ends))
    )
    rules = tuple(Rule((Term(0, k),), k) for k in range(len(outputs)))
    return FuzzySystem((Variable("x", 0, 1, inputs),), Variable("y", 0, 1, outputs), rules)


@pytest.mark.parametrize("kind", SYSTEMS)
@pytest.mark.parametrize("policy", ["clamp", "raise", "matlab"])
@pytest.mark.parametrize("thin", [BETWEEN_SAMPLES, OFF_THE_UNIVERSE])
class TestWithoutMass:
    WHAT = "a set that fires has no mass on the 101 samples of 0-1: raise samples"

    @pytest.mark.parametrize("count", [2, COMPILED_FROM_ROWS])
    def test_no_answer_is_refused_however_many_rows(self, kind, policy, thin, count):
        x = [0.25] * (count - 1) + [0.75]
        where = rf"^y: no finite answer for x = 0.75 \(row {count} of {count}\); {self.WHAT}"
        with pytest.raises(ValueError, match=where):
            answer(beside(WIDE, thin), x, kind, out_of_range=policy)

    def test_so_is_that_of_a_single_row_compiled(self, kind, policy, thin):
        model = compiled(beside(WIDE, thin), kind, InferenceOptions(out_of_range=policy))
        with pytest.raises(ValueError, match=self.WHAT):
            model.one([0.75])
        assert model.one([0.25]).value == pytest.approx(0.5, abs=1e-12)

    @pytest.mark.parametrize("count", [1, COMPILED_FROM_ROWS])
    def test_a_set_that_does_not_fire_spoils_no_answer(self, kind, policy, thin, count):
        found = answer(beside(WIDE, thin), [0.25] * count, kind, out_of_range=policy)
        assert found.value == pytest.approx(0.5, abs=1e-12)
        assert found.notes == ()


@pytest.mark.parametrize("kind", SYSTEMS)
def test_the_remedies_for_a_set_between_samples_are_remedies(kind):
    for options in ({"samples": 1001}, {"sampling": "exact"}):
        found = answer(beside(BETWEEN_SAMPLES), [0.5], kind, **options)
        assert found.value[0] == pytest.approx(0.505, abs=1e-9)


def planes(*coefficients):
    sets = (FuzzySet(f"p{k}", "linear", (factor, 1.0)) for k, factor in enumerate(coefficients))
    x = FuzzySet("rising", "sigmf", (10.0, 0.5)), FuzzySet("falling", "sigmf", (-10.0, 0.5))
    rules = tuple(Rule((Term(0, k),), k) for k in range(len(coefficients)))
    return FuzzySystem((Variable("x", 0, 1, x),), Variable("y", 0, 1, tuple(sets)), rules)


@pytest.mark.parametrize("count", [1, COMPILED_FROM_ROWS])
def test_an_answer_that_overflows_is_refused(count):
    options = InferenceOptions(out_of_range="matlab")
    for coefficients in ((10.0,), (10.0, 1.0), (-10.0,)):
        with pytest.raises(ValueError, match=r"no finite answer for x = 1e\+308 .* overflow"):
            infer(planes(*coefficients), np.full((count, 1), 1e308), "sugeno", options)
        with pytest.raises(ValueError, match="overflow"):
            compiled(planes(*coefficients), "sugeno", options).one([1e308])
    # Neither the sigmoid's argument nor a consequent without weight spoils what has an answer.
    found = infer(planes(0.5, 1e10), np.full((count, 1), 1e308), "sugeno", options)
    assert found.value == pytest.approx(0.5e308)
    assert compiled(planes(0.5, 1e10), "sugeno", options).one([1e308]).value == found.value[0]


# --- readings for which next to nothing fires --------------------------------------------------

# exp(-x^2 / 2 sd^2) = 1e-13: less than LEAST_STRENGTH, and more than nothing.
WEAK = 5.0 + np.sqrt(2.0 * np.log(1e13))


@pytest.mark.parametrize("kind", SYSTEMS)
@pytest.mark.parametrize("fillers", [0, COMPILED_FROM_ROWS])
def test_an_answer_by_rules_that_hardly_fire_is_said_to_be_that(kind, fillers):
    x = [WEAK, *[5.0] * fillers, 60.0, WEAK, 70.0]
    # On 151 samples the triangle's feet are samples, so that sums over it are symmetric.
    found = answer(narrow(), x, kind, out_of_range="matlab", samples=151)
    n = len(x)
    nothing, little = found.notes
    assert nothing == (
        f"no rule fires for hcv = 60 (row {n - 2} of {n} and 1 more): the answer is no more than "
        "the middle of the universe, as in MATLAB"
    )
    assert little == (
        f"no rule fires by {LEAST_STRENGTH:g} or more for hcv = {WEAK:g} (row 1 of {n} and 1 more):"
        " the answer is computed from what is left, as in MATLAB"
    )
    assert found.value[[-3, -1]].tolist() == [MIDDLE, MIDDLE]
    # Clipped at next to nothing, the triangle on [0, 10] is a box, whose centroid is still 5.
    assert found.value[[0, -2]] == pytest.approx(5.0, abs=1e-9)
    model = compiled(narrow(), kind, InferenceOptions(out_of_range="matlab", samples=151))
    for row in (0, -1):
        single = model.one([x[row]])
        assert single.silent
        assert single.value == pytest.approx(found.value[row], abs=1e-12)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_the_refusal_of_silence_counts_the_silent_rows(kind):
    with pytest.raises(ValueError, match=r"hcv = 40 \(row 2 of 4 and 1 more\): add a rule"):
        answer(narrow(), [5, 40, 5, 50], kind)


@pytest.mark.parametrize("name", ["x (row 9)", "x (row 9 of 9)", "(row 1", "row", ""])
def test_a_table_takes_no_name_for_the_number_of_a_row(tmp_path, name):
    system = narrow()
    system = FuzzySystem(
        (Variable(name, 0, 100, system.inputs[0].sets),), system.output, system.rules
    )
    table, out = tmp_path / "in.csv", tmp_path / "out.csv"
    table.write_text(f"{name},other\n5,1\n700,2\n")
    outside, silent = evaluate_table(
        system, table, out, "mamdani", InferenceOptions(out_of_range="matlab")
    )
    assert outside.startswith(f"{name}: reading 700 (")
    assert silent.startswith(f"no rule fires for {name} = 700 (")
    if name != "(row 1":  # which is found in the number of the row, too
        assert "= 700 (line 3)" in silent
        assert "700 (line 3) is outside" in outside


def test_every_answer_states_how_it_was_computed():
    stated = {
        answer(ramp(), [3], kind, **options).method
        for kind, options in (
            ("mamdani", {}),
            ("mamdani", {"samples": 201}),
            ("mamdani", {"sampling": "octave"}),
            ("mamdani", {"sampling": "exact"}),
            ("sugeno", {}),
            ("sugeno", {"sugeno_aggregation": "max"}),
            ("interval-type-2", {}),
            ("interval-type-2", {"reducer": "eiasc"}),
            ("interval-type-2", {"reducer": "nie-tan"}),
        )
    }
    assert len(stated) == 9
    joins = "AND min, OR max, implication min, aggregation max"
    assert f"Mamdani: {joins}, centroid by sums over 101 points" in stated


def test_exact_sampling_does_not_claim_an_iteration_it_does_not_run():
    exact = {
        answer(ramp(), [3], "interval-type-2", sampling="exact", reducer=reducer).method
        for reducer in ("eiasc", "karnik-mendel")
    }
    assert len(exact) == 1
    assert not any("EIASC" in method for method in exact)
    assert "EIASC" in answer(ramp(), [3], "interval-type-2", reducer="eiasc").method


# --- systems that are none ---------------------------------------------------------------------


@pytest.mark.parametrize(
    "rule",
    [
        Rule((Term(1, 0),), 0),
        Rule((Term(0, 3),), 0),
        Rule((Term(0, 0),), 3),
        Rule((), 0),
        Rule((Term(-1, 0),), 0),
    ],
)
def test_a_rule_out_of_the_system_is_refused(rule):
    system = narrow()
    with pytest.raises(ValueError, match=r"rule 2: .*does not have"):
        FuzzySystem(system.inputs, system.output, (system.rules[0], rule))


def test_incomplete_systems_are_refused():
    system = narrow()
    with pytest.raises(ValueError, match="no rules"):
        FuzzySystem(system.inputs, system.output, ())
    with pytest.raises(ValueError, match="output 'y': has no set"):
        FuzzySystem(system.inputs, Variable("y", 0, 1, ()), system.rules)
    with pytest.raises(ValueError, match="must be below"):
        Variable("x", 2, 1, system.output.sets)
    with pytest.raises(ValueError, match=r"1 to 1 has no width.* centroid .* widen it"):
        FuzzySystem(system.inputs, Variable("y", 1, 1, system.output.sets), system.rules)
    with pytest.raises(ValueError, match="share a name"):
        Variable("x", 0, 1, system.output.sets * 2)
    with pytest.raises(ValueError, match="name of its own"):
        FuzzySystem(system.inputs * 2, system.output, system.rules)


def test_constants_belong_to_outputs_only_and_all_of_them():
    one = FuzzySet("one", "constant", (1.0,))
    system = narrow()
    with pytest.raises(ValueError, match=r"input 'x': set 'one' is constant"):
        FuzzySystem((Variable("x", 0, 1, (one,)),), system.output, system.rules)
    mixed = Variable("y", 0, 1, (one, *system.output.sets))
    with pytest.raises(ValueError, match="mixes membership functions with constants"):
        FuzzySystem(system.inputs, mixed, system.rules)
    plane = Variable("y", 0, 1, (FuzzySet("p", "linear", (1.0, 2.0, 3.0)),))
    with pytest.raises(ValueError, match="linear takes 2 parameters"):
        FuzzySystem(system.inputs, plane, system.rules)
