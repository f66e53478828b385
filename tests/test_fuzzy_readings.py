"""Readings of Table I: which reach 247 rules, what their rules are, and what is refused."""

from itertools import combinations, product
from math import prod

import pytest

from fuzzy.liver.assumptions import assumptions
from fuzzy.liver.knowledge import SEVERITIES
from fuzzy.liver.readings import (
    MISSING_TRIPLE,
    READINGS,
    UNSUPPORTED,
    TableReading,
    disease_sets,
    reading_named,
    rule_count,
)
from fuzzy.liver.rules import CONSEQUENTS
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.liver.table1 import AETIOLOGIES, cells, is_odd
from fuzzy.systems.options import InferenceOptions

# Most sets that the data describe: F1 to F4 of HCV and HBV, F2 to F4 of the others.
MOST_SETS = (4, 4, 3, 3, 3)


# --- Table I ---------------------------------------------------------------------------------


def test_table_has_29_ones_of_27_disease_sets():
    assert len(cells()) == 29
    assert len({frozenset(cell) for cell in cells()}) == 27
    assert sorted(len(cell) for cell in cells()) == [1] * 5 + [2] * 10 + [3] * 11 + [4] * 3


def test_odd_cell_is_the_only_one_with_a_disease_twice():
    assert [cell for cell in cells() if is_odd(cell)] == [("hcv", "nafld", "nafld")]


def test_one_triple_stands_twice_and_one_is_missing():
    triples = [cell for cell in cells() if len(set(cell)) == 3]
    assert [cell for cell in set(triples) if triples.count(cell) > 1] == [("hbv", "cld", "nafld")]
    assert set(combinations(AETIOLOGIES, 3)) - set(triples) == {MISSING_TRIPLE}


# --- counts ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", READINGS)
def test_reading_gives_247_rules(name):
    expected = 235 if name == "R1-no-duplicates" else 247
    assert len(liver_system(LiverSettings(knowledge="severity", reading=name)).rules) == expected
    assert rule_count(READINGS[name]) == expected


def test_r1_by_number_of_terms():
    sizes = [
        len(rule.antecedents) for rule in liver_system(LiverSettings(knowledge="severity")).rules
    ]
    assert [sizes.count(size) for size in (1, 2, 3, 4)] == [11, 48, 116, 72]


def reaching_247(readings, counts):
    """(disease sets, counts) that give 247 rules, each once."""
    found = set()
    for reading in readings:
        grids = [[AETIOLOGIES.index(disease) for disease in cell] for cell in disease_sets(reading)]
        for count in counts:
            if sum(prod(count[i] for i in grid) for grid in grids) == 247:
                found.add((tuple(sorted(map(tuple, grids))), count))
    return found


def every_reading(sizes):
    return [
        TableReading((2, 2, 2, 2, 2), size, diagonal, odd, duplicates)
        for size in sizes
        for diagonal in ("single", "square")
        for odd in ("missing-triple", "literal", "pair", "drop")
        for duplicates in ("keep", "drop")
    ]


ALL_SIZES = [size for k in (1, 2, 3, 4) for size in combinations((1, 2, 3, 4), k)]
WITHIN_DATA = list(product(*(range(2, most + 1) for most in MOST_SETS)))


def test_22_readings_within_the_data_reach_247_so_the_count_singles_out_none():
    assert len(reaching_247(every_reading(ALL_SIZES), WITHIN_DATA)) == 22


def test_r1_is_the_only_fit_of_its_kind_but_the_literal_one_has_two():
    def fits(odd):
        return {
            counts
            for _, counts in reaching_247([TableReading((2,) * 5, odd_cell=odd)], WITHIN_DATA)
        }

    assert fits("missing-triple") == {(2, 3, 2, 2, 2)}
    assert fits("literal") == {(2, 3, 2, 2, 2), (3, 2, 2, 2, 2)}


def fitting(sizes, diagonals, most):
    readings = [r for r in every_reading([sizes]) if r.diagonal in diagonals]
    counts = product(range(2, most + 1), repeat=5)
    return {counts for _, counts in reaching_247(readings, list(counts))}


def test_readings_that_the_data_cannot_carry_need_what_is_said():
    quadruples = fitting((1, 2, 4), ["single"], 4)
    assert len(quadruples) == 12
    assert all(4 in counts[2:] for counts in quadruples)  # R6
    assert fitting((2,), ["single", "square"], 5) == set()  # R7
    assert fitting((2,), ["single"], 6) != set()
    assert fitting((1, 2), ["single", "square"], 4) == set()  # R8
    assert fitting((1, 2), ["single", "square"], 5) != set()


@pytest.mark.parametrize("name", UNSUPPORTED)
def test_unsupported_reading_is_refused_with_its_reason(name):
    with pytest.raises(ValueError, match=f"{name}: .*which no data describe.*use one of R1, "):
        reading_named(name)


# --- rules -----------------------------------------------------------------------------------


def terms_of_nafld(reading):
    rules = liver_system(LiverSettings(knowledge="severity", reading=reading)).rules
    nafld = AETIOLOGIES.index("nafld")
    return [sum(term.input == nafld for term in rule.antecedents) for rule in rules]


def test_literal_cell_asks_for_two_nafld_terms():
    assert terms_of_nafld("R1-literal").count(2) == 8
    assert terms_of_nafld("R1").count(2) == 0


def test_squared_diagonal_has_no_single_terms():
    sizes = [
        len(rule.antecedents)
        for rule in liver_system(LiverSettings(knowledge="severity", reading="R2")).rules
    ]
    assert 1 not in sizes
    assert 1 in [
        len(rule.antecedents) for rule in liver_system(LiverSettings(knowledge="severity")).rules
    ]


def test_dropping_duplicates_drops_one_copy_of_the_repeated_rules():
    once = liver_system(LiverSettings(knowledge="severity", reading="R1-no-duplicates")).rules
    twice = liver_system(LiverSettings(knowledge="severity")).rules
    assert len(set(once)) == len(once) == 235
    assert set(once) == set(twice)


@pytest.mark.parametrize("reading", ["R1", "R2", "R5-hcv4"])
def test_severest_term_governs_every_rule(reading):
    system = liver_system(LiverSettings(knowledge="severity", reading=reading))
    severity = {"F1": 0, "F2": 0, "F3": 1, "F4": 2}
    for rule in system.rules:
        stages = [system.inputs[i].sets[s].name for i, s, _ in rule.antecedents]
        assert rule.consequent == max(severity[stage] for stage in stages)
    assert tuple(one.name for one in system.output.sets) == SEVERITIES


@pytest.mark.parametrize(
    ("severities", "severest", "mean"),
    [([0], 0, 0), ([0, 2], 2, 1), ([0, 0, 1], 1, 1), ([0, 0, 0, 2], 2, 1), ([2, 2, 1], 2, 2)],
)
def test_governing_severity(severities, severest, mean):
    assert CONSEQUENTS["max"].governing(severities) == severest
    assert CONSEQUENTS["mean"].governing(severities) == mean


# --- aetiologies without a reading -----------------------------------------------------------


def test_rules_that_name_an_absent_aetiology_are_left_out():
    full = liver_system(LiverSettings(knowledge="severity"))
    part = liver_system(LiverSettings(knowledge="severity"), ("hcv", "ald"))
    present = {AETIOLOGIES.index("hcv"), AETIOLOGIES.index("ald")}
    kept = [r for r in full.rules if {term.input for term in r.antecedents} <= present]
    assert list(part.rules) == kept
    assert len(kept) == 2 + 2 + 4
    assert part.inputs == full.inputs


@pytest.mark.parametrize(
    ("reading", "present", "message"),
    [
        ("R1", (), "no aetiology has a reading: give one"),
        ("R4-pair", ("hcv",), "reading R4-pair has no rule on hcv alone"),
        ("R1", ("hvc",), "aetiology 'hvc': use one of hcv, hbv"),
    ],
)
def test_nothing_left_or_unknown_is_refused(reading, present, message):
    with pytest.raises(ValueError, match=message):
        liver_system(LiverSettings(knowledge="severity", reading=reading), present)


# --- settings --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("reading", "R9", "reading = 'R9': use one of R1, "),
        ("consequent", "least", "consequent = 'least': use one of max, mean"),
        ("placement", "cutoff", "placement = 'cutoff': use one of stage-mean, cut-off"),
        ("footprint", "none", "footprint = 'none': use one of uncertain-mean, "),
        ("footprint_factor", -0.1, "footprint_factor = -0.1: give a number from 0 to 3"),
        ("footprint_factor", float("nan"), "footprint_factor = nan"),
        ("absent", "zero", "absent = 'zero': use one of auto, normal, silent"),
    ],
)
def test_settings_name_key_value_and_remedy(key, value, message):
    with pytest.raises(ValueError, match=message):
        LiverSettings(knowledge="severity", **{key: value})


@pytest.mark.parametrize("name", ["R5-hbv4", "R5-hcv4", "R5-pair"])
def test_four_sets_need_stage_means(name):
    with pytest.raises(ValueError, match=rf"reading = '{name}': h.v with 4 sets: no cut-off"):
        LiverSettings(knowledge="severity", reading=name, placement="cut-off")


# --- what is said of them --------------------------------------------------------------------


def said(**settings):
    return " ".join(assumptions(LiverSettings(knowledge="severity", **settings)))


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"reading": "R2"}, "every pair of its sets makes a rule"),
        ({"reading": "R2"}, "is read as the pair HCV, NAFLD"),
        ({"reading": "R1-no-duplicates"}, "gives 235 rules where the paper counts 247"),
        ({"reading": "R4-pair"}, "its 18 rules weigh double"),
        ({"reading": "R4-pair"}, "only 67 of the 247 rules can change an answer"),
        ({"reading": "R4-pair"}, "No source was found for the centre of NAFLD F3"),
        ({"consequent": "mean"}, "mean severity of the antecedents, rounded up"),
        ({"placement": "cut-off"}, "Centres of HCV F2, HCV F4, HBV F2"),
        ({"footprint_factor": 0.0}, "interval type-2 equals Mamdani"),
        ({"footprint_factor": 2.0}, "43 % (F1, F2), 19 % (F3), 50 % (F4), 2 times the published"),
        ({"footprint": "uncertain-spread"}, "the width of every set's flanks"),
        ({"footprint": "scaled"}, "every lower membership"),
        ({"absent": "silent"}, "takes every rule that names it out"),
        ({"options": InferenceOptions(out_of_range="raise")}, "readings beyond are refused"),
        ({"options": InferenceOptions(samples=501)}, "centroid by sums over 501 points"),
        ({"options": InferenceOptions(reducer="nie-tan")}, "Nie-Tan centroid"),
    ],
)
def test_assumptions_follow_the_settings(settings, sentence):
    assert sentence in said(**settings)
    assert sentence not in said()


def test_assumptions_of_the_default_settings():
    assert "but so do 10 other readings here" in said()
    assert "only 11 of the 247 rules can change an answer" in said()
    assert "21 % (F1, F2), 9 % (F3), 25 % (F4), the published spread" in said()
    assert "0.20, 0.05, 0.24 of the centre at F2, F3, F4" in said()


@pytest.mark.parametrize("reading", READINGS)
def test_every_assumption_is_a_sentence(reading):
    for sentence in assumptions(LiverSettings(knowledge="severity", reading=reading)):
        assert sentence[0].isupper()
        assert sentence.endswith(".")
        assert "  " not in sentence
