"""The screening of open choices: what it covers and leaves out, and that its numbers are right."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from fuzzy.liver.sensitivity import (
    AXES,
    EXACT_ROWS,
    LARGEST_READING,
    Screening,
    Sensitivity,
    sensitivity,
    spread_readings,
)
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import NORMAL_LIVER, estimate, evaluate
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions

READINGS = {"hcv": 9.5e3, "nafld": 12e3}
TYPE_2 = "interval-type-2"
INDEPENDENT_SD = 5.3
"""Of the number of 256 independent points that fall in one eighth."""


@pytest.fixture(scope="module")
def timed() -> tuple[Screening, float]:
    start = time.process_time()
    return sensitivity(READINGS, LiverSettings(knowledge="severity")), time.process_time() - start


@pytest.fixture(scope="module")
def found(timed) -> Screening:
    return timed[0]


def pick(found: Screening, choice: str, alternative: str, system: str) -> Sensitivity:
    (row,) = (
        row
        for row in found.rows
        if (row.choice, row.alternative, row.system) == (choice, alternative, system)
    )
    return row


def test_every_alternative_is_tried_on_every_system_it_can_move(found):
    expected = Counter(
        {axis.key: (len(axis.values) - 1) * len(axis.systems) for axis in AXES} | {"system": 3}
    )
    assert Counter(row.choice for row in found.rows) == expected
    assert found.left_out == ()


def test_it_takes_less_than_six_seconds(timed):
    assert timed[1] < 6.0


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_change_at_the_readings_is_that_of_two_estimates(found, system):
    for choice, other in (
        ("reading", LiverSettings(knowledge="severity", reading="R4-pair")),
        ("consequent", LiverSettings(knowledge="severity", consequent="mean")),
        ("absent", LiverSettings(knowledge="severity", absent="silent")),
        ("samples", LiverSettings(knowledge="severity", options=InferenceOptions(samples=1001))),
    ):
        value = getattr(other, choice, other.options.samples)
        row = pick(found, choice, str(value), system)
        before, after = (
            estimate(READINGS, system, s).estimate
            for s in (LiverSettings(knowledge="severity"), other)
        )
        assert row.at_readings == pytest.approx(after - before, abs=1e-7)  # of 1e4 Pa


def test_rms_and_largest_are_taken_over_the_spread_readings(found):
    X = spread_readings(256)
    before, after = (
        evaluate(X, "sugeno", s)[0]
        for s in (
            LiverSettings(knowledge="severity"),
            LiverSettings(knowledge="severity", consequent="mean"),
        )
    )
    row = pick(found, "consequent", "mean", "sugeno")
    assert row.rows == 256
    assert row.rms == pytest.approx(np.linalg.norm(after - before) / 16.0)
    assert row.largest == np.abs(after - before).max()
    assert row.rms < row.largest


def test_exact_sampling_is_tried_on_fewer_readings_and_says_so(found):
    assert {row.rows for row in found.rows if row.alternative == "exact"} == {EXACT_ROWS}
    assert {row.rows for row in found.rows if row.alternative != "exact"} == {256}


def test_type_2_without_a_footprint_moves_as_far_as_to_mamdani(found):
    none = pick(found, "footprint_factor", "0", TYPE_2)
    to_type_2 = pick(found, "system", TYPE_2, "mamdani")
    assert none.at_readings == pytest.approx(-to_type_2.at_readings, abs=1e-7)
    assert none.rms == pytest.approx(to_type_2.rms, rel=1e-9)
    assert none.widths[1] == pytest.approx(0.0, abs=1e-7)


def test_a_choice_without_effect_changes_nothing_and_one_with_effect_does(found):
    # EIASC finds the same ends; a rule stated twice counts twice in a sum alone.
    assert pick(found, "reducer", "eiasc", TYPE_2).largest < 1e-7
    assert pick(found, "reducer", "nie-tan", TYPE_2).largest > 100.0
    assert pick(found, "reading", "R1-no-duplicates", "mamdani").largest == 0.0
    assert pick(found, "reading", "R1-no-duplicates", "sugeno").largest > 10.0


def test_a_larger_footprint_widens_the_interval(found):
    widths = [pick(found, "footprint_factor", f, TYPE_2).widths for f in ("0.5", "2")]
    assert widths[0][1] < widths[0][0] < widths[1][1]
    assert all((row.widths is None) == (row.system != TYPE_2) for row in found.rows)


def test_what_happens_to_absent_aetiologies_is_tried_on_such_patients(found):
    X = spread_readings(256, READINGS)
    assert (X[:, AETIOLOGIES.index("hbv")] == NORMAL_LIVER).all()
    silent = evaluate(
        X, "mamdani", LiverSettings(knowledge="severity", absent="silent"), tuple(READINGS)
    )[0]
    row = pick(found, "absent", "silent", "mamdani")
    assert (
        row.largest
        == np.abs(silent - evaluate(X, "mamdani", LiverSettings(knowledge="severity"))[0]).max()
    )


@pytest.mark.parametrize("readings", [{}, dict.fromkeys(AETIOLOGIES, 9e3)])
def test_alternatives_that_cannot_be_had_are_left_out_with_a_reason(readings):
    screening = sensitivity(
        readings, LiverSettings(knowledge="severity", placement="cut-off"), rows=8
    )
    kept = {row.alternative for row in screening.rows}
    assert "R5-hbv4" not in kept
    reason = next(text for text in screening.left_out if "R5-hbv4" in text)
    assert "no cut-off is known for F1" in reason
    assert any("absent silent" in text and "aetiologies" in text for text in screening.left_out)


def test_a_base_of_exact_sampling_is_screened_by_a_stand_in_as_good():
    base = LiverSettings(knowledge="severity", options=InferenceOptions(sampling="exact"))
    found = sensitivity(READINGS, base, rows=32)
    assert "samples" not in {row.choice for row in found.rows}
    assert {row.rows for row in found.rows if row.choice == "sampling"} == {EXACT_ROWS}
    for system in SYSTEMS:
        row = pick(found, "consequent", "mean", system)
        other = replace(base, consequent="mean")
        before, after = (estimate(READINGS, system, s).estimate for s in (base, other))
        assert row.rows == 32
        assert row.at_readings == pytest.approx(after - before, abs=0.4)  # the stand-in, twice
        coarse = estimate(READINGS, system, LiverSettings(knowledge="severity")).estimate
        assert abs(coarse - before) > 4.0  # as 101 points would not be


@pytest.mark.parametrize(
    ("readings", "message"), [({"hcv": 9.5}, "give Pa"), ({"hvc": 9.5e3}, "aetiology 'hvc'")]
)
def test_faulty_readings_are_refused_and_not_taken_for_faulty_alternatives(readings, message):
    with pytest.raises(ValueError, match=message):
        sensitivity(readings, LiverSettings(knowledge="severity"), rows=8)


def test_spread_readings_are_log_uniform_and_even():
    X = spread_readings(256)
    assert 2e3 <= X.min() < 2.1e3
    assert 0.95 * LARGEST_READING < X.max() <= LARGEST_READING
    unit = np.log(X / 2e3) / np.log(LARGEST_READING / 2e3)
    eighths = [np.bincount((8 * column).astype(int), minlength=8) for column in unit.T]
    assert np.abs(np.array(eighths) - 32).max() <= INDEPENDENT_SD
    quarters = (4 * unit).astype(int)
    pairs = Counter(map(tuple, quarters[:, [0, 4]]))
    # Independent numbers would have an SD of 3.9 about 16, and one of 16 cells beyond +- 7.
    assert len(pairs) == 16
    assert max(abs(count - 16) for count in pairs.values()) <= 6
    np.testing.assert_array_equal(X[:100], spread_readings(100))


def test_random_numbers_would_not_be_found_even(rng):
    eighths = np.bincount((8 * rng.uniform(size=256)).astype(int), minlength=8)
    assert np.abs(eighths - 32).max() > INDEPENDENT_SD


def test_more_readings_give_nearly_the_same_rms():
    base, other = (
        LiverSettings(knowledge="severity"),
        LiverSettings(knowledge="severity", consequent="mean"),
    )
    rms = []
    for X in (spread_readings(256), spread_readings(500)[256:]):
        change = evaluate(X, "sugeno", other)[0] - evaluate(X, "sugeno", base)[0]
        rms.append(np.sqrt(np.mean(change**2)))
    # An SD of 0.75 kPa over 250 readings leaves about 2 % if they were independent.
    assert rms[1] == pytest.approx(rms[0], rel=0.03)
