"""The data files: derived values recomputed, sources named, Table I counted."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from fuzzy.knowledge import elastography, parameters, rows
from fuzzy.liver import OUTPUT, liver_system
from fuzzy.rules import AETIOLOGIES, MISSING_TRIPLE, cells, disease_sets, governing

# Derived values are stored with four decimals.
STORED = 0.51e-4
POOLED = {"mild": ("F1", "F2"), "moderate": ("F3",), "severe": ("F4",)}
RATIO_STAGE = {"mild": "F2", "severe": "F4"}


def sporea(stages):
    """Columns n, mean, sd of the given stages, HBV and HCV."""
    chosen = [row for row in rows("sporea2010.csv") if row["stage"] in stages]
    return np.array([[float(r["n"]), float(r["mean_kpa"]), float(r["sd_kpa"])] for r in chosen]).T


def sample_with(n, mean, sd):
    """n numbers with exactly this mean and standard deviation."""
    raw = np.linspace(-1, 1, int(n))
    return mean + sd * raw / raw.std(ddof=1)


def record(variable, name):
    return next(r for r in elastography() if (r.variable, r.name) == (variable, name))


@pytest.mark.parametrize("name", POOLED)
def test_output_sets_are_the_pooled_stages(name):
    # Pooling is checked by putting samples of those moments together, not by a formula for it.
    together = np.concatenate([sample_with(*group) for group in sporea(POOLED[name]).T])
    stored = record(OUTPUT, name)
    assert stored.centre == pytest.approx(together.mean(), abs=STORED)
    assert stored.sd == pytest.approx(together.std(ddof=1), abs=STORED)


def test_pooling_notices_the_spread_between_groups():
    n, mean, sd = sporea(POOLED["mild"])
    within = np.sqrt(((n - 1) * sd**2).sum() / (n - 1).sum())
    assert record(OUTPUT, "mild").sd != pytest.approx(within, abs=STORED)
    assert record(OUTPUT, "mild").centre != pytest.approx(mean.mean(), abs=STORED)


def derived_sd(stored):
    _, mean, sd = sporea([RATIO_STAGE[stored.name]])
    return stored.centre * (sd / mean).mean()


def test_widths_without_a_publication_follow_the_ratio_of_sporea():
    derived = [r for r in elastography() if r.sd_kind == "derived" and r.variable != OUTPUT]
    assert [r.variable for r in derived] == ["ald", "ald", "cld", "cld", "nafld", "nafld"]
    assert [r.sd for r in derived] == pytest.approx([derived_sd(r) for r in derived], abs=STORED)


def test_a_derived_width_follows_its_centre():
    stored = record("ald", "mild")
    moved = derived_sd(replace(stored, centre=stored.centre + 0.1))
    assert stored.sd != pytest.approx(moved, abs=STORED)


def test_published_sets_are_rows_of_sporea():
    published = {
        (r["aetiology"], float(r["mean_kpa"]), float(r["sd_kpa"])) for r in rows("sporea2010.csv")
    }
    viral = [r for r in elastography() if r.sd_kind == "published"]
    assert [r.variable for r in viral] == ["hcv"] * 2 + ["hbv"] * 3
    assert {(r.variable, r.centre, r.sd) for r in viral} <= published


def test_footprint_is_half_the_gap_between_two_operators():
    first, second = 11.5, 9.8  # medians [kPa], liv12551
    relative = (first - second) / (first + second)
    assert parameters()["footprint"] == pytest.approx(relative, abs=0.005)  # given to a percent


def test_every_value_names_a_known_source():
    known = {row["id"] for row in rows("sources.csv")}
    used = {row["source"] for file in ("elastography.csv", "parameters.csv") for row in rows(file)}
    assert used <= known
    assert known - used == set()


def test_kinds_are_of_the_stated_few():
    assert {r.centre_kind for r in elastography()} == {"mean", "cut-off", "derived"}
    assert {r.sd_kind for r in elastography()} == {"published", "derived"}


def test_sets_of_a_variable_are_ordered_from_mild_to_severe():
    for variable in (*AETIOLOGIES, OUTPUT):
        centres = [r.centre for r in elastography() if r.variable == variable]
        assert centres == sorted(centres)


# --- Table I ---------------------------------------------------------------------------------

TABLE = rows("table1.csv")


def test_table_has_29_ones_of_27_disease_sets():
    found = cells(TABLE)
    assert len(found) == 29
    assert len({frozenset(cell) for cell in found}) == 27
    assert sorted(len(cell) for cell in found) == [1] * 5 + [2] * 10 + [3] * 11 + [4] * 3


def test_odd_cell_is_the_only_one_with_a_disease_twice():
    assert [c for c in cells(TABLE) if len(set(c)) < len(c)] == [("nafld", "hcv", "nafld")]


def test_missing_triple_is_the_only_one_missing():
    triples = {frozenset(t) for t in combinations(AETIOLOGIES, 3)}
    assert triples - {frozenset(c) for c in cells(TABLE)} == {frozenset(MISSING_TRIPLE)}
    assert MISSING_TRIPLE in disease_sets(TABLE, "missing-triple")
    assert MISSING_TRIPLE not in disease_sets(TABLE, "literal")


R1 = {"odd_cell": "missing-triple", "duplicates": "keep", "consequent": "max"}


@pytest.mark.parametrize(
    ("reading", "count"),
    [({}, 247), ({"odd_cell": "literal"}, 247), ({"duplicates": "drop"}, 235)],
    ids=["R1", "literal", "no-duplicates"],
)
def test_rule_count(reading, count):
    assert len(liver_system(footprint=0.0, **R1 | reading).rules) == count


def test_r1_by_cell_size():
    rules = liver_system(footprint=0.0, **R1).rules
    sizes = [len(rule.antecedents) for rule in rules]
    assert [sizes.count(size) for size in (1, 2, 3, 4)] == [11, 48, 116, 72]


def test_set_counts_are_those_of_r1():
    assert [len(v.sets) for v in liver_system(footprint=0.0, **R1).inputs] == [2, 3, 2, 2, 2]


def test_literal_cell_asks_for_two_nafld_terms():
    rules = liver_system(footprint=0.0, **R1 | {"odd_cell": "literal"}).rules
    nafld = AETIOLOGIES.index("nafld")
    twice = [r for r in rules if sum(i == nafld for i, _ in r.antecedents) == 2]
    assert len(twice) == 8


@pytest.mark.parametrize(
    ("severities", "stiffest", "mean"),
    [([0], 0, 0), ([0, 2], 2, 1), ([0, 0, 1], 1, 1), ([0, 0, 0, 2], 2, 1), ([2, 2, 1], 2, 2)],
)
def test_governing_severity(severities, stiffest, mean):
    assert governing(severities, "max") == stiffest
    assert governing(severities, "mean") == mean
