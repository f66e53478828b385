"""The elastography data: every derived number recomputed, every source named, every set traced."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from fuzzy.liver.knowledge import (
    OUTPUT,
    SEVERITIES,
    elastography,
    input_records,
    output_records,
    parameters,
    rows,
)
from fuzzy.liver.readings import READINGS
from fuzzy.liver.settings import LARGEST_FACTOR, LiverSettings
from fuzzy.liver.system import liver_system, records_in_use
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.sets import TYPE_1, Footprint, lower_membership, upper_membership

# Derived values are stored with four decimals.
STORED = 0.51e-4

POOLED = {"F1-F2": ("F1", "F2"), "F3": ("F3",), "F4": ("F4",)}
SEVERITY = {"F1": "mild", "F2": "mild", "F1-F2": "mild", "F3": "moderate", "F4": "severe"}

# Cut-offs [kPa] as their sources give them, but for NAFLD F3.
CUT_OFFS = {
    "hcv": ("liv12551", {"F2": 7.1, "F3": 9.5, "F4": 12.5}),
    "cld": ("corpechot2006", {"F2": 7.3, "F3": 9.8, "F4": 17.3}),
    "nafld": ("papatheodoridi", {"F2": 8.0, "F4": 12.0}),
    "ald": ("cochrane-cd010542", {"F2": 7.5, "F3": 9.5}),
}
FIRST_OPERATOR, SECOND_OPERATOR = 11.5, 9.8  # medians [kPa], liv12551


def sporea(stages):
    """Columns n, mean, sd of the given stages, HBV and HCV."""
    chosen = [row for row in rows("sporea2010.csv") if row["stage"] in stages]
    return np.array([[float(r["n"]), float(r["mean_kpa"]), float(r["sd_kpa"])] for r in chosen]).T


def sporea_row(record):
    return next(
        row
        for row in rows("sporea2010.csv")
        if (row["aetiology"], row["stage"]) == (record.aetiology, record.stage)
    )


def chon(stage):
    row = next(row for row in rows("chon2012.csv") if row["stage"] == stage)
    return {key: float(value) for key, value in row.items() if key != "stage"}


def sample_with(n, mean, sd):
    """n numbers with exactly this mean and standard deviation."""
    raw = np.linspace(-1, 1, int(n))
    return mean + sd * raw / raw.std(ddof=1)


def pooled(record):
    # Pooling is checked by putting samples of those moments together, not by a formula for it.
    return np.concatenate([sample_with(*group) for group in sporea(POOLED[record.stage]).T])


def expected_range(n):
    """Expected range of n standard normal values."""
    return quad(lambda x: 1 - norm.cdf(x) ** n - norm.sf(x) ** n, -12, 12)[0]


# --- what each number should be --------------------------------------------------------------


def expected_centre(record):
    if record.aetiology == OUTPUT:
        return pooled(record).mean()
    if record.placement == "stage-mean":
        return float(sporea_row(record)["mean_kpa"])
    if record.aetiology == "hbv":
        return chon(record.stage)["cut_off_kpa"]
    if (record.aetiology, record.stage) == ("ald", "F4"):
        return 22.6  # bardou2013
    limits = CUT_OFFS[record.aetiology][1]
    if (record.aetiology, record.stage) == ("nafld", "F3"):
        return 0.5 * (limits["F2"] + limits["F4"])
    return limits[record.stage]


def expected_sd(record):
    match record.sd_kind:
        case "published":
            return float(sporea_row(record)["sd_kpa"])
        case "pooled":
            return pooled(record).std(ddof=1)
    _, mean, sd = sporea([record.stage])
    return record.centre * (sd / mean).mean()


def expected_between_study(record):
    found = chon({"F1": "F2", "F1-F2": "F2"}.get(record.stage, record.stage))
    width = found["high_kpa"] - found["low_kpa"]
    return width / expected_range(found["studies"]) / found["cut_off_kpa"]


def expected_between_operator(_):
    return (FIRST_OPERATOR - SECOND_OPERATOR) / (FIRST_OPERATOR + SECOND_OPERATOR)


EXPECTED = {
    "centre": expected_centre,
    "within_stage_sd": expected_sd,
    "between_study": expected_between_study,
    "between_operator": expected_between_operator,
}


def wrong_numbers(records):
    """(aetiology, stage, placement, field) of every number that its derivation does not give."""
    return [
        (record.aetiology, record.stage, record.placement, field)
        for record in records
        for field, expected in EXPECTED.items()
        if getattr(record, field) != pytest.approx(expected(record), abs=STORED)
    ]


def test_every_number_follows_from_its_source():
    assert wrong_numbers(elastography()) == []


@pytest.mark.parametrize("field", EXPECTED)
def test_an_altered_number_is_noticed_in_every_record(field):
    for record in elastography():
        altered = replace(record, **{field: getattr(record, field) + 2 * STORED})
        named = (record.aetiology, record.stage, record.placement, field)
        assert named in wrong_numbers([altered])


def test_pooling_notices_the_spread_between_groups():
    n, mean, sd = sporea(POOLED["F1-F2"])
    within = np.sqrt(((n - 1) * sd**2).sum() / (n - 1).sum())
    mild = output_records()[0]
    assert mild.within_stage_sd != pytest.approx(within, abs=STORED)
    assert mild.centre != pytest.approx(mean.mean(), abs=STORED)


def test_expected_range_is_known_for_two_values_and_for_18():
    assert expected_range(2) == pytest.approx(2 / np.sqrt(np.pi), abs=1e-9)  # exact
    assert expected_range(18) == pytest.approx(3.640, abs=5e-4)  # tables of control charts


def test_fewer_studies_behind_a_range_would_mean_a_larger_spread():
    ranges = [expected_range(n) for n in range(2, 19)]
    assert all(few < more for few, more in pairwise(ranges))


def test_other_cut_offs_of_f4_differ_by_as_much_as_the_spread_says():
    # Half the difference of two sources over their middle: ALD, then HCV (pmc3542745).
    for one, other in ((22.6, 12.5), (12.5, 9.3)):
        half = (one - other) / (one + other)
        assert 0.5 < half / expected_between_study(output_records()[2]) < 2


# --- where each number comes from ------------------------------------------------------------


def test_counts_of_patients_are_those_of_sporea():
    for record in elastography():
        if record.placement == "stage-mean" and record.aetiology != OUTPUT:
            assert record.n == int(sporea_row(record)["n"])
    assert [r.n for r in output_records()] == [sporea(s)[0].sum() for s in POOLED.values()]


def test_cut_offs_name_the_source_that_has_them():
    for record in elastography():
        source, stages = CUT_OFFS.get(record.aetiology, ("chon2012", {"F2", "F3", "F4"}))
        if record.placement == "cut-off" and record.stage in stages:
            assert record.centre_source == source


def test_spread_is_published_for_one_disease_and_transferred_to_the_others():
    for record in elastography():
        own = (record.aetiology, record.placement) == ("hbv", "cut-off")
        assert record.between_study_kind == ("published" if own else "transferred")
        own = record.aetiology == "hcv"
        assert record.between_operator_kind == ("published" if own else "transferred")


def grade(record):
    if record.sd_kind in ("published", "pooled"):
        return "yes"
    return {"papatheodoridi": "weak", "this-study": "no"}.get(record.centre_source, "partly")


def test_grade_of_sourcing_follows_its_definition():
    assert [r.sourced for r in elastography()] == [grade(r) for r in elastography()]


def test_every_value_names_a_known_source_and_every_source_is_used():
    known = {row["id"] for row in rows("sources.csv")}
    table = rows("elastography.csv")
    named = {row[key] for row in table for key in row if key.endswith("_source")}
    for file in ("parameters.csv", "stages.csv", "groups.csv", "exam_noise.csv"):
        named |= {row["source"] for row in rows(file)}
    notes = " ".join(row["note"] for row in table)
    assert named <= known
    assert {source for source in known - named if source not in notes} == set()


def test_severity_follows_the_stage():
    assert all(r.severity == SEVERITY[r.stage] for r in elastography())
    assert [r.severity for r in output_records()] == list(SEVERITIES)


# --- the records in use ----------------------------------------------------------------------


def test_sets_stand_for_stages_by_their_number():
    for count, stages in ((2, "F2 F4"), (3, "F2 F3 F4"), (4, "F1 F2 F3 F4")):
        assert " ".join(r.stage for r in input_records("hcv", count, "stage-mean")) == stages


def test_placement_moves_hcv_and_hbv_only():
    for name in AETIOLOGIES:
        means, cut_offs = (
            [r.centre for r in input_records(name, 3, placement)]
            for placement in ("stage-mean", "cut-off")
        )
        assert (means != cut_offs) == (name in ("hcv", "hbv"))


@pytest.mark.parametrize(
    ("name", "count", "placement", "message"),
    [
        ("hbv", 4, "cut-off", "no cut-off is known for F1"),
        ("ald", 4, "stage-mean", "no stage-mean is known for F1"),
        ("hcv", 5, "stage-mean", "hcv with 5 sets: the data have F1, F2, F3, F4"),
    ],
)
def test_sets_beyond_the_data_are_refused(name, count, placement, message):
    with pytest.raises(ValueError, match=message):
        input_records(name, count, placement)


@pytest.mark.parametrize("reading", READINGS)
def test_sets_of_a_variable_rise_from_mild_to_severe(reading):
    system = liver_system(LiverSettings(knowledge="severity", reading=reading))
    for variable in system.inputs:
        # A right shoulder's second parameter is its centre, a left one's is the last.
        first, *others = variable.sets
        centres = [first.parameters[3], *(one.parameters[1] for one in others)]
        assert centres == sorted(set(centres))


@pytest.mark.parametrize("placement", ["stage-mean", "cut-off"])
def test_records_in_use_are_those_behind_the_sets(placement):
    settings = LiverSettings(knowledge="severity", placement=placement)
    system = liver_system(settings)
    variables = (*system.inputs, system.output)
    placed = [(v.name, one) for v in variables for one in v.sets]
    for (name, one), record in zip(placed, records_in_use(settings), strict=True):
        assert record.aetiology == name
        assert one.name == (record.severity if name == OUTPUT else record.stage)
        assert {record.centre, record.within_stage_sd} <= set(one.parameters)


def test_values_without_a_full_source_are_listed():
    records = records_in_use(LiverSettings(knowledge="severity", reading="R4-drop"))
    found = [(r.aetiology, r.stage, r.sourced) for r in records if r.sourced != "yes"]
    assert ("nafld", "F3", "no") in found
    assert ("nafld", "F2", "weak") in found
    assert ("ald", "F4", "partly") in found
    assert not [name for name, *_ in found if name in ("hcv", "hbv", OUTPUT)]
    assert len(found) == 8


# --- footprints ------------------------------------------------------------------------------

F2 = records_in_use(LiverSettings(knowledge="severity"))[0]
SHARE = float(np.hypot(F2.between_study, F2.between_operator))


@pytest.mark.parametrize("factor", [0.5, 1.0])
@pytest.mark.parametrize(
    ("kind", "made"),
    [
        ("uncertain-mean", lambda r: Footprint(mean=r * F2.centre)),
        ("uncertain-spread", lambda r: Footprint(spread=r)),
        ("scaled", lambda r: Footprint(scale=1 - r)),
    ],
)
def test_footprint_is_the_published_spread_times_the_factor(kind, made, factor):
    settings = LiverSettings(knowledge="severity", footprint=kind, footprint_factor=factor)
    assert liver_system(settings).inputs[0].sets[0].footprint == made(factor * SHARE)


@pytest.mark.parametrize("kind", ["uncertain-mean", "uncertain-spread", "scaled"])
def test_without_footprint_every_set_is_type_1(kind):
    system = liver_system(LiverSettings(knowledge="severity", footprint=kind, footprint_factor=0.0))
    assert all(one.footprint == TYPE_1 for v in (*system.inputs, system.output) for one in v.sets)


def bounds_at_the_ends(system):
    """Lower and upper membership of each outer set at its end of the universe."""
    for variable in system.inputs:
        for one, end in ((variable.sets[0], variable.low), (variable.sets[-1], variable.high)):
            x = np.array([end])
            yield from (lower_membership(one, x)[0], upper_membership(one, x)[0])


@pytest.mark.parametrize("kind", ["uncertain-mean", "uncertain-spread"])
def test_outer_sets_stay_full_at_the_ends_of_the_universe(kind):
    system = liver_system(
        LiverSettings(knowledge="severity", footprint=kind, footprint_factor=LARGEST_FACTOR)
    )
    assert set(bounds_at_the_ends(system)) == {1.0}


def test_a_flat_side_that_ends_at_zero_would_not_stay_full():
    variable = liver_system(
        LiverSettings(knowledge="severity", footprint_factor=LARGEST_FACTOR)
    ).inputs[0]
    sd, _, *right = variable.sets[0].parameters
    short = replace(variable.sets[0], parameters=(sd, 0.0, *right))
    assert lower_membership(short, np.array([variable.low]))[0] < 0.9


def test_universes_are_those_of_the_parameters():
    system, p = liver_system(LiverSettings(knowledge="severity")), parameters()
    assert {(v.low, v.high) for v in system.inputs} == {(p["input_low"], p["input_high"])}
    assert (system.output.low, system.output.high) == (p["output_low"], p["output_high"])
