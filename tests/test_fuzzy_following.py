"""Knowledge bases that follow the reading: what they promise, and where their numbers are from."""

from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest

from fuzzy.liver import derivation, monotonicity
from fuzzy.liver.assumptions import assumptions
from fuzzy.liver.bases import KNOWLEDGE, STAGES_ONLY
from fuzzy.liver.knowledge import rows
from fuzzy.liver.monotonicity import largest_fall
from fuzzy.liver.partition import Combination, following_system, placement, reading_noise
from fuzzy.liver.readings import READINGS, disease_sets
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import estimate, evaluate, membership_curves, rule_count, surface
from fuzzy.liver.system import liver_system, records_in_use
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.audit import audit
from fuzzy.systems.compiled import compiled
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.redundancy import contradictory, dominated, repeated
from fuzzy.systems.sets import lower_membership, membership, upper_membership
from fuzzy.systems.system import firing_strengths

FOLLOWING = [name for name, base in KNOWLEDGE.items() if base.follows]
SCALE = 1e3 * np.geomspace(4.0, 40.0, 150)
FREED, PAPER_COUNT = (LiverSettings(knowledge=name) for name in ("freed", "paper-count"))
SEVERITY = LiverSettings(knowledge="severity")
CLOSEST = {"mamdani": 0.15, "sugeno": 0.10, "interval-type-2": 0.15}


def alone(system, settings, name="hcv", readings=SCALE):
    """Estimates [Pa] for readings [Pa] of one aetiology alone."""
    X = np.full((len(readings), len(AETIOLOGIES)), 4.1e3)
    X[:, AETIOLOGIES.index(name)] = readings
    present = (name,) if settings.missing.silences else AETIOLOGIES
    return evaluate(X, system, settings, present)[0]


def worst(system, settings, name="hcv"):
    return np.abs(alone(system, settings, name) / SCALE - 1.0).max()


# --- one aetiology ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", AETIOLOGIES)
@pytest.mark.parametrize("system", SYSTEMS)
def test_freed_follows_one_reading(system, name):
    assert worst(system, FREED, name) < CLOSEST[system]
    assert np.diff(alone(system, FREED, name)).min() > 0.0
    healthy = estimate({name: 4.1e3}, system, FREED).estimate
    assert 3.5e3 < healthy < 6e3


@pytest.mark.parametrize("name", AETIOLOGIES)
@pytest.mark.parametrize("system", SYSTEMS)
def test_paper_count_rises_and_errs_less_than_half_of_the_base_of_stages(system, name):
    assert np.diff(alone(system, PAPER_COUNT, name)).min() >= 0.0
    errors = [worst(system, settings, name) for settings in (FREED, PAPER_COUNT, SEVERITY)]
    assert errors[0] < errors[1] < 0.5 * errors[2]


def test_the_base_of_stages_would_not_pass_for_one_that_follows():
    assert worst("mamdani", SEVERITY) > 1.0


# --- several ---------------------------------------------------------------------------------


@pytest.mark.parametrize("system", SYSTEMS)
def test_concordant_readings_give_an_estimate_between_them(system):
    # Closer ones than what a single one is followed by tell nothing of the combination.
    for low in (4e3, 6e3, 9e3, 14e3, 20e3, 28e3):
        for pair in (("hcv", "hbv"), ("ald", "nafld"), ("cld", "hcv")):
            found = estimate(dict(zip(pair, (low, 1.4 * low), strict=True)), system, FREED)
            assert low < found.estimate < 1.4 * low


def grid(readings, present=AETIOLOGIES):
    X = np.full((len(readings) ** len(present), len(AETIOLOGIES)), 4.1)
    X[:, [AETIOLOGIES.index(name) for name in present]] = list(
        product(readings, repeat=len(present))
    )
    return X


def least_rises(settings, present, readings, system):
    """Least rise [kPa] over one step of each reading, whatever the others, by aetiology."""
    liver = liver_system(settings, present)
    value = compiled(liver, system, settings.options, pruned=False).evaluate(
        grid(readings, present)
    )
    table = value.value.reshape((len(readings),) * len(present))
    return [np.diff(table, axis=axis).min() for axis in range(len(present))]


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(
    ("present", "readings"),
    [
        (AETIOLOGIES, (4.0, 6.0, 9.0, 14.0, 20.0, 30.0)),
        (AETIOLOGIES, (3.0, 6.0, 12.0, 24.0, 48.0)),
        (("hcv", "ald", "nafld"), np.geomspace(2.0, 75.0, 24)),
        (("hbv", "cld"), np.geomspace(2.0, 75.0, 90)),
    ],
)
def test_no_raised_reading_lowers_the_estimate_of_freed_and_none_is_dead(present, readings, system):
    assert min(least_rises(FREED, present, readings, system)) > 0.0


MOST_FALLEN = {1: 0.0, 2: 0.0, 3: 2e-3, 4: 4e-3, 5: 12e-3}
"""Of the estimate of freed where one of so many readings rises in steps of 3 %."""


@pytest.mark.parametrize("number", MOST_FALLEN)
@pytest.mark.parametrize("system", SYSTEMS)
def test_a_raised_reading_hardly_lowers_the_estimate_on_fine_steps_either(number, system):
    for present in combinations(AETIOLOGIES, number):
        found = largest_fall(system, FREED, present)
        assert max(found.anywhere, found.of_one_liver) <= MOST_FALLEN[number]


@pytest.mark.parametrize("system", SYSTEMS)
def test_without_its_own_cells_and_cores_the_estimate_falls_several_times_as_far(
    monkeypatch, system
):
    """What was wrong: several cells compete where no cell of Table I has all of the readings."""
    present = ("hcv", "ald", "cld", "nafld")
    base = FREED.base._replace(completed=False)
    monkeypatch.setitem(KNOWLEDGE, "freed", base)
    own, kept = dict(placement("freed").combinations), placement("freed").sets
    bare = {size: one._replace(core=0.0) for size, one in own.items()}
    planted = following_system(
        placement("freed")._replace(sets=dict(kept), combinations=bare), FREED, present
    )
    monkeypatch.setattr(monotonicity, "liver_system", lambda *_: planted)
    assert largest_fall(system, FREED, present).anywhere > 5 * MOST_FALLEN[len(present)]


def test_falls_are_those_of_the_estimates(monkeypatch):
    """A set that lowers the estimate by some per cent is found."""
    placed = placement("freed")
    sets = dict(placed.sets)
    sets["hcv"] = (*sets["hcv"][:2], sets["hcv"][2]._replace(consequent=3.0), *sets["hcv"][3:])
    planted = following_system(placed._replace(sets=sets), FREED, ("hcv",))
    monkeypatch.setattr(monotonicity, "liver_system", lambda *_: planted)
    X = np.full((400, 5), 4.1)
    X[:, 0] = np.geomspace(2.0, 75.0, 400)
    found = compiled(planted, "sugeno", FREED.options, pruned=False).evaluate(X).value
    known = (1.0 - found / np.maximum.accumulate(found)).max()
    assert known > 0.05
    assert largest_fall("sugeno", FREED, ("hcv",)).anywhere == pytest.approx(known, rel=0.02)


def test_with_four_readings_a_set_has_a_core_and_crosses_its_neighbour_where_it_did():
    few, many = (liver_system(FREED, AETIOLOGIES[:n]).inputs[0].sets[2] for n in (3, 4))
    one, above = placement("freed").sets["hcv"][2:4]
    beside = one.centre + 0.15 * (one.crossing - one.centre)
    assert membership(many, np.array(beside)) == 1.0 > membership(few, np.array(beside))
    for found in (few, many):
        assert membership(found, np.array(one.crossing)) == pytest.approx(0.5)
    far = [float(membership(found, np.array(above.centre))) for found in (few, many)]
    assert far[1] < 0.5 * far[0]


def test_a_wrong_consequent_would_lower_an_estimate():
    placed = placement("freed")
    sets = {name: tuple(found) for name, found in placed.sets.items()}
    sets["hcv"] = (*sets["hcv"][:2], sets["hcv"][2]._replace(consequent=3.0), *sets["hcv"][3:])
    planted = following_system(placed._replace(sets=sets), FREED, ("hcv",))
    X = grid(np.geomspace(4.0, 40.0, 60), ("hcv",))
    for system in SYSTEMS:
        found = compiled(planted, system, FREED.options).evaluate(X)
        assert np.diff(found.value).min() < 0.0


@pytest.mark.parametrize("knowledge", FOLLOWING)
def test_a_missing_reading_is_silent(knowledge):
    settings = LiverSettings(knowledge=knowledge)
    for system in SYSTEMS:
        X = np.full((3, 5), 4.1e3)
        X[:, 1:] = [[4.1e3], [20e3], [70e3]]
        X[:, 0] = 9e3
        assert np.ptp(evaluate(X, system, settings, ("hcv",))[0]) < 1e-9
    notes = estimate({"hcv": 9e3}, "sugeno", settings).notes
    told = "hbv, ald, cld, nafld: no reading; rules on a disease without one are left out"
    assert told in notes
    with pytest.raises(ValueError, match="no aetiology has a reading: give one"):
        estimate({}, "sugeno", settings)
    with pytest.raises(ValueError, match="aetiology 'flu': use one of hcv"):
        estimate({"flu": 9e3}, "sugeno", settings)
    as_normal = replace(settings, absent="normal")
    assert estimate({}, "sugeno", as_normal).estimate < 6e3


def test_more_readings_of_one_liver_narrow_the_interval():
    def width(*names):
        low, high = estimate(dict.fromkeys(names, 9e3), "interval-type-2", FREED).interval
        return high - low

    assert width("hcv") > 1.2 * width("hcv", "hbv") > 1.2 * width("hcv", "hbv", "ald")


def test_the_whole_base_answers_for_five_readings_as_the_patient_s_does():
    row = np.array([[9.0, 8.0, 11.0, 10.0, 9.5]])
    for settings in (FREED, PAPER_COUNT):
        whole = compiled(liver_system(settings), "sugeno", settings.options, pruned=False)
        readings = dict(zip(AETIOLOGIES, 1e3 * row[0], strict=True))
        found = estimate(readings, "sugeno", settings).estimate
        assert whole.evaluate(row).value[0] == pytest.approx(found / 1e3)


def test_surfaces_span_the_scale():
    for system in SYSTEMS:
        _, _, z = surface(system, "hcv", "hbv", points=9, settings=FREED)
        assert z.min() < 3e3
        assert z.max() > 55e3


# --- sets and rules --------------------------------------------------------------------------


@pytest.mark.parametrize("knowledge", FOLLOWING)
def test_neighbouring_sets_cross_at_one_half(knowledge):
    system = liver_system(LiverSettings(knowledge=knowledge))
    placed = placement(knowledge)
    for variable in system.inputs:
        crossings = [one.crossing for one in placed.sets[variable.name][:-1]]
        for k, x in enumerate(crossings):
            degrees = [membership(one, np.array(x)) for one in variable.sets[k : k + 2]]
            assert degrees == pytest.approx([0.5, 0.5])
        scale = np.linspace(variable.low, variable.high, 500)
        assert np.max([membership(one, scale) for one in variable.sets], axis=0).min() > 0.499


def test_freed_divides_the_scale_evenly_where_readings_can_tell_sets_apart():
    sets = placement("freed").sets
    assert len({tuple(found) for found in sets.values()}) == 1
    gaps = np.diff(np.log([one.centre for one in sets["hcv"]]))
    assert gaps == pytest.approx(gaps.mean(), rel=1e-3)
    least = derivation.LEAST_DISTANCE * reading_noise()
    assert least < gaps.mean() < least * len(gaps) / (len(gaps) - 1)


def test_rules_are_the_cells_of_table_i():
    assert rule_count(PAPER_COUNT) == 247
    counts = tuple(len(placement("paper-count").sets[name]) for name in AETIOLOGIES)
    assert counts == READINGS["R1"].counts
    # Table I lacks two cells of four diseases and that of all five.
    cells = {*disease_sets(READINGS["R1-no-duplicates"])}
    assert {*map(len, cells)} == {1, 2, 3, 4}
    assert sum(7 ** len(cell) for cell in cells) == 11158
    assert rule_count(FREED) == 11158 + 2 * 7**4 + 7**5 == 8**5 - 1


def test_rules_conclude_more_the_higher_their_sets():
    for settings in (FREED, PAPER_COUNT):
        system = liver_system(settings, ("hcv", "hbv"))
        centres = [one.parameters[1] for one in system.output.sets]
        pairs = [rule for rule in system.rules if len(rule.antecedents) == 2]
        shape = [len(system.inputs[i].sets) for i in (0, 1)]
        table = np.reshape([centres[rule.consequent] for rule in pairs], shape)
        assert (np.diff(table, axis=0) > 0).all()
        assert (np.diff(table, axis=1) > 0).all()


def test_audit_of_idle_and_contradictory_rules_before_and_after():
    before, after = liver_system(SEVERITY), liver_system(PAPER_COUNT)
    assert len(dominated(before)) == 236
    # What is left is the triple that Table I marks twice.
    assert len(dominated(after)) == len(repeated(after)) == 12
    assert contradictory(after) == ()
    found = audit(liver_system(FREED, ("hcv", "hbv", "ald")), samples=512)
    assert (found.dominated, found.contradictions, found.duplicates) == ((), (), ())
    assert found.unreachable == found.gaps == ()
    assert found.coverage.uncovered == 0.0


def test_a_rule_on_fewer_diseases_gives_way_where_there_are_more():
    system = liver_system(FREED, ("hcv", "hbv"))
    strengths = firing_strengths(system, np.array([[4.5, 20.0, 4.1, 4.1, 4.1]]), membership)[:, 0]
    single = max(s for s, r in zip(strengths, system.rules, strict=True) if len(r.antecedents) == 1)
    assert single == pytest.approx(1e-3, rel=0.1)
    assert strengths.max() > 0.5


def test_a_combination_stays_within_what_the_output_can_show():
    assert Combination(0.0, 1.0).consequent([4.0, 9.0]) == pytest.approx(6.0)
    assert Combination(5.0, 1.0).consequent([60.0]) == 72.5
    assert Combination(-5.0, 1.0).consequent([4.0]) == 2.0


# --- footprints and settings -----------------------------------------------------------------


@pytest.mark.parametrize("footprint", ["uncertain-mean", "uncertain-spread", "scaled"])
def test_footprints_are_those_of_the_settings(footprint):
    settings = LiverSettings(knowledge="freed", footprint=footprint, footprint_factor=3.0)
    one = liver_system(settings, ("hcv",)).inputs[0].sets[2]
    x = np.linspace(2.0, 40.0, 300)
    assert (lower_membership(one, x) <= upper_membership(one, x)).all()
    assert (lower_membership(one, x) < upper_membership(one, x) - 0.1).any()
    without = replace(settings, footprint_factor=0.0)
    both = [alone(kind, without) for kind in ("mamdani", "interval-type-2")]
    np.testing.assert_allclose(*both, rtol=1e-9)


@pytest.mark.parametrize("knowledge", FOLLOWING)
@pytest.mark.parametrize(
    ("key", "value"), [("reading", "R4-drop"), ("consequent", "mean"), ("placement", "cut-off")]
)
def test_what_shapes_stages_alone_is_refused(knowledge, key, value):
    assert key in STAGES_ONLY
    with pytest.raises(ValueError, match=f"{key} = '{value}': shapes the knowledge base severity"):
        LiverSettings(knowledge=knowledge, **{key: value})


@pytest.mark.parametrize("knowledge", FOLLOWING)
def test_what_is_assumed_is_said(knowledge):
    text = " ".join(assumptions(LiverSettings(knowledge=knowledge)))
    assert f"Knowledge base {knowledge}: " in text
    assert f"{rule_count(LiverSettings(knowledge=knowledge))} rules" in text
    assert "takes every rule that names it out of the rule base" in text
    assert "without a bias, is an assumption" in text
    assert "far too stiff" not in text
    switched = assumptions(LiverSettings(knowledge=knowledge, footprint_factor=0.0))
    assert any("footprint is switched off" in one for one in switched)


@pytest.mark.parametrize("knowledge", FOLLOWING)
def test_every_input_set_has_a_record_and_a_curve(knowledge):
    settings = LiverSettings(knowledge=knowledge)
    found = records_in_use(settings)
    curves = membership_curves(settings, 51)
    for name in AETIOLOGIES:
        stages = [record.stage for record in found if record.aetiology == name]
        assert tuple(stages) == curves[name].sets
    assert {record.sourced for record in found} == {"no"}


def test_sampling_hardly_matters():
    fine = LiverSettings(knowledge="freed", options=InferenceOptions(samples=2001))
    for system in SYSTEMS:
        np.testing.assert_allclose(alone(system, FREED), alone(system, fine), rtol=0.02)


# --- derivation ------------------------------------------------------------------------------


def close(made, kept):
    """Whether two placements agree to the digits kept, and to what the fit leaves undecided."""
    for name in AETIOLOGIES:
        for one, other in zip(made.sets[name], kept.sets[name], strict=True):
            np.testing.assert_allclose(one[1:], other[1:], rtol=2e-3)


def test_the_sets_of_freed_are_those_of_their_script():
    close(derivation.freed_sets(), placement("freed"))


@pytest.mark.parametrize("knowledge", FOLLOWING)
def test_combinations_are_those_of_their_script(knowledge):
    made = derivation.with_combinations(placement(knowledge), knowledge, sizes=(2,))
    np.testing.assert_allclose(
        made.combinations[2], placement(knowledge).combinations[2], atol=2e-3
    )


@pytest.mark.parametrize("name", ["hcv", "hbv"])
def test_the_search_for_paper_count_finds_nothing_better_close_by(name):
    judged = derivation.aetiology_training_data(name)
    kept = placement("paper-count").sets[name]
    best = derivation.loss(name, kept, judged)
    for k in range(len(kept)):
        for field, factor in product(("centre", "consequent"), (0.8, 1.25)):
            moved = kept[k]._replace(**{field: factor * getattr(kept[k], field)})
            if moved.centre >= moved.crossing or (k and moved.centre <= kept[k - 1].crossing):
                continue
            other = (*kept[:k], moved, *kept[k + 1 :])
            assert derivation.loss(name, other, judged) > 0.95 * best


def test_the_script_writes_what_is_read(tmp_path):
    derivation.write({name: placement(name) for name in ("paper-count", "freed")}, tmp_path)
    for file in ("partition.csv", "combination.csv"):
        written = (tmp_path / file).read_text().splitlines()
        assert len(written) == len(rows(file)) + 1
        assert written[1].split(",") == list(rows(file)[0].values())
