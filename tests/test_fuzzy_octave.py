"""Answers of Octave's fuzzy-logic-toolkit, kept in data/octave, against ours."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.systems.conversion import sugeno_of, type_1_of
from fuzzy.systems.fis_file import read_fis
from fuzzy.systems.inference import infer
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.system import Operators

FOLDER = Path(__file__).parent / "data" / "octave"
OCTAVE = InferenceOptions(sampling="octave")

# Relative to the output's universe: both sides do the same sums in another order.
TOLERANCE = 1e-13


def golden(name, system):
    """Readings, and Octave's answers by column."""
    table = np.genfromtxt(FOLDER / f"{name}.csv", delimiter=",", names=True, deletechars="")
    inputs = [variable.name for variable in system.inputs]
    assert list(table.dtype.names[: len(inputs)]) == inputs
    assert table.size == 200
    return np.column_stack([table[key] for key in inputs]), table


def difference(system, X, kind, options, expected):
    """Largest difference, relative to the universe of the output."""
    answers = infer(system, X, kind, options)
    assert not answers.notes
    universe = system.output.high - system.output.low
    return np.abs(answers.value - expected).max() / universe


@pytest.mark.parametrize("name", ["liver", "mixed"])
def test_mamdani_answers_as_octave(name):
    system = read_fis(FOLDER / f"{name}.fis")
    X, octave = golden(name, system)
    assert difference(system, X, "mamdani", OCTAVE, octave["centroid"]) < TOLERANCE


@pytest.mark.parametrize("merge", ["sum", "max"])
@pytest.mark.parametrize("name", ["liver_sugeno", "mixed_sugeno"])
def test_sugeno_answers_as_octave_with_either_aggregation(name, merge):
    system = read_fis(FOLDER / f"{name}.fis")
    X, octave = golden(name, system)
    options = replace(OCTAVE, sugeno_aggregation=merge)
    assert difference(system, X, "sugeno", options, octave[merge]) < TOLERANCE


def test_a_mamdani_system_evaluated_as_sugeno_answers_as_octave_does_to_its_constants():
    liver = read_fis(FOLDER / "liver.fis")
    X, octave = golden("liver_sugeno", liver)
    # The file's constants are MATLAB's, sums of 101 samples.
    assert difference(liver, X, "sugeno", InferenceOptions(), octave["sum"]) < TOLERANCE


# Each of these is a slip that the comparison must not let pass.
SLIPS = {
    "sums instead of trapezoids": lambda s: (s, InferenceOptions(sampling="matlab")),
    "one sample more": lambda s: (s, replace(OCTAVE, samples=102)),
    "min instead of product": lambda s: (operated(s, conjunction="min"), OCTAVE),
    "max instead of probabilistic or": lambda s: (operated(s, disjunction="max"), OCTAVE),
    "clipping instead of scaling": lambda s: (operated(s, implication="min"), OCTAVE),
    "NOT forgotten": lambda s: (changed(s, antecedents=plain), OCTAVE),
    "weights forgotten": lambda s: (changed(s, weight=always(1.0)), OCTAVE),
    "OR read as AND": lambda s: (changed(s, connective=always("and")), OCTAVE),
}


def operated(system, **chosen):
    return replace(system, operators=replace(system.operators, **chosen))


def changed(system, **change):
    [(field, new)] = change.items()
    return replace(system, rules=tuple(replace(r, **{field: new(r)}) for r in system.rules))


def always(value):
    return lambda _: value


def plain(rule):
    return tuple(term._replace(negated=False) for term in rule.antecedents)


@pytest.mark.parametrize("slip", SLIPS)
def test_a_planted_slip_shows_in_the_comparison(slip):
    system = read_fis(FOLDER / "mixed.fis")
    X, octave = golden("mixed", system)
    wrong, options = SLIPS[slip](system)
    assert difference(wrong, X, "mamdani", options, octave["centroid"]) > 1e6 * TOLERANCE


def test_the_mixed_system_leaves_nothing_out():
    system = read_fis(FOLDER / "mixed.fis")
    kinds = {one.kind for v in (*system.inputs, system.output) for one in v.sets}
    assert len(kinds) == 11
    assert system.operators == Operators("prod", "probor", "prod")
    assert {rule.connective for rule in system.rules} == {"and", "or"}
    assert min(rule.weight for rule in system.rules) < 1
    assert any(term.negated for rule in system.rules for term in rule.antecedents)


@pytest.mark.parametrize("dropped", range(10))
def test_every_rule_of_the_mixed_system_counts(dropped):
    system = read_fis(FOLDER / "mixed.fis")
    X, octave = golden("mixed", system)
    rest = replace(system, rules=system.rules[:dropped] + system.rules[dropped + 1 :])
    assert difference(rest, X, "mamdani", OCTAVE, octave["centroid"]) > 1e6 * TOLERANCE


def test_the_two_aggregations_differ_where_rules_share_a_consequent():
    _, octave = golden("liver_sugeno", read_fis(FOLDER / "liver_sugeno.fis"))
    assert np.abs(octave["sum"] - octave["max"]).max() > 1.0  # kPa


REGENERATE = (
    "the committed .fis files are not the liver system of today; see tests/data/octave/README.md "
    "for the commands that make them and Octave's answers again"
)


def test_the_committed_files_are_the_liver_system_of_today():
    liver = type_1_of(liver_system(LiverSettings(knowledge="severity")))
    assert read_fis(FOLDER / "liver.fis") == liver, REGENERATE
    assert read_fis(FOLDER / "liver_sugeno.fis") == sugeno_of(liver), REGENERATE
