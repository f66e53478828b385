"""The ranking over draws of an organ: a draw is its scene, and what is coarse is told."""

from __future__ import annotations

import csv
import re
from dataclasses import replace

import numpy as np
import pytest

from msm.dead_load import NoEquilibriumError
from reports import organ_ranking as told
from reports.ranking_study import FEWEST, movers
from study.commands.flags import WorkerFlags
from study.commands.robustness import robustness
from study.results.tables import write_table
from study.robustness import finer, organ_request, rows
from study.robustness import organ_block as organ
from study.robustness.block import Block, plain
from study.robustness.design import shares
from study.robustness.organ_unknowns import PLACE, TABLE_II, OrganDraw, draws, unknowns
from study.robustness.unknowns import Placed, Sampled, groups
from study.run.scene_problem import scene_arguments, scene_problem
from study.run.study import run_study
from study.scene import Place
from study.scene.file import read_scene
from study.scene.problem import problem_of

COARSE = 0.02
SHORT = (
    "time.duration=0.6 s",
    "time.samples=61",
    "tool.history.ramp=0.1 s",
    "lattice.spacing=20 mm",
)


@pytest.fixture(scope="module")
def scene():
    """The block, coarse and short."""
    return organ.prepared(read_scene("block", SHORT))


@pytest.fixture(scope="module")
def given(scene):
    return scene_problem(**scene_arguments(scene))


def as_the_scene(scene, **changed):
    """The draw that says what the scene says."""
    fuzzy = scene.fuzzy
    neutral = dict.fromkeys(OrganDraw._fields, 1.0) | {
        "stiffness": scene.patient.hcv,
        "aetiologies": ("hcv",),
        "knowledge": fuzzy.knowledge,
        "placed": Placed(fuzzy.reading, fuzzy.placement),
        "consequent": fuzzy.consequent,
        "absent": fuzzy.absent,
        "footprint": fuzzy.footprint,
        "footprint_factor": fuzzy.footprint_factor,
        "sampled": Sampled(fuzzy.sampling, fuzzy.samples),
        "sugeno_aggregation": fuzzy.sugeno_aggregation,
        "reducer": fuzzy.reducer,
        "reference_spacing": scene.damping.reference_spacing,
        "spacing": scene.lattice.spacing,
        "poisson_ratio": scene.tissue.poisson_ratio,
        "across": 0.0,
        "along": 0.0,
    }
    return OrganDraw(**(neutral | changed))


def scored(draw, given):
    """Scores (contenders, measures) of one draw."""
    return organ.evaluated([draw], given.scene, given.problem).scores[0]


def test_a_draw_is_scored_as_a_scene_that_says_the_same(scene, given):
    results = run_study(scene)
    found = scored(as_the_scene(scene), given)
    for k, name in enumerate(organ.CONTENDERS):
        model = name if name == organ.READING else f"msm-{name}"
        for m, (curve, measure) in enumerate(organ.COLUMNS):
            known = [
                row.score
                for row in results.scores
                if (row.model, row.curve, row.measure) == (model, curve, measure)
            ]
            assert len(known) == len(given.problem.probes)
            assert found[k, m] == pytest.approx(np.mean(known), abs=1e-9)
        field = next(
            row.value
            for row in results.field_differences
            if (row.model, row.reference, row.quantity)
            == (model, "basafa", "field-relative-l2-peak")
        )
        # Looked at once in each tetrahedron, where a run does eight times.
        assert found[k, -1] == pytest.approx(max(0.0, 1.0 - field), abs=0.02)


HUNG = (
    *SHORT,
    "gravity.acceleration=9.81 m/s^2",
    "gravity.towards=inferior",
    'weight=[{place={side="superior", at=[0.3, 0.5]}, mass="5 g", radius="15 mm"}]',
)


def test_gravity_and_weights_are_those_of_the_scene_in_every_draw(scene, given):
    hung = organ.prepared(read_scene("block", HUNG))
    posed = scene_problem(**scene_arguments(hung))
    draw = as_the_scene(hung)
    drawn = organ._posed(draw, hung, posed.problem)
    assert np.array_equal(drawn.gravity, posed.problem.gravity)
    assert drawn.weights == posed.problem.weights
    found = scored(draw, posed)
    assert np.isfinite(found).all()
    assert np.abs(found - scored(as_the_scene(scene), given)).max() > 1e-3


def test_a_draw_that_finds_no_rest_under_its_weight_counts_for_no_one(monkeypatch):
    hung = organ.prepared(read_scene("block", HUNG))

    def lost(*_):
        raise NoEquilibriumError("it falls", "hold it")

    monkeypatch.setattr("msm.stepper.rest_under_dead_load", lost)
    assert np.isnan(scored(as_the_scene(hung), scene_problem(**scene_arguments(hung)))).all()


WAY = (
    *SHORT,
    "tool.radius=15 mm",
    "control_points={}",
    'tool.path=[{time="0 s", offset=[0, 0, 0]}, {time="0.5 s", offset=["30 mm", 0, 0]}]',
)


@pytest.fixture(scope="module")
def travelling():
    """The block under a tool that travels, and one that does not."""
    wanted = organ.prepared(read_scene("block", WAY))
    beside = replace(wanted.tool, place=Place(side="superior", at=(0.2, 0.2)), path=())
    return replace(wanted, further_tools=(beside,))


def test_a_way_is_moved_as_a_scene_that_has_it_elsewhere(travelling):
    """Stations of the drawn radius, from the drawn place on; other tools stay."""
    problem = problem_of(travelling)
    draw = as_the_scene(travelling, across=0.4, radius=1.4, force=0.5)
    drawn = organ.as_drawn(travelling, draw)
    found = organ._posed(draw, drawn, problem)
    x, y, z = map(float, found.tool.centre)
    moved = replace(drawn.tool, place=Place(point=(x, y, z)))
    known = problem_of(replace(drawn, tool=moved))
    assert np.linalg.norm(found.tool.centre - problem.tool.centre) == pytest.approx(0.4 * 0.015)
    assert len(found.loads) == len(known.loads) < len(problem.loads)
    times = np.linspace(0.0, 0.6, 61)
    np.testing.assert_allclose(found.factors(times), known.factors(times), atol=1e-12)
    for one, other in zip(found.loads, known.loads, strict=True):
        np.testing.assert_allclose(one.tool.centre, other.tool.centre, atol=1e-9)
        assert (one.tool.radius, one.tool.force) == (other.tool.radius, other.tool.force)
    assert found.loads[-1].tool.radius == problem.loads[-1].tool.radius == 0.015


def test_a_way_has_its_scores_and_one_that_leaves_the_surface_none():
    wanted = organ.prepared(read_scene("block", WAY))
    posed = scene_problem(**scene_arguments(wanted))
    away = as_the_scene(wanted, across=0.5), as_the_scene(wanted, along=-3.0)
    kept, lost = (scored(one, posed) for one in away)
    assert np.isfinite(kept).all()
    assert np.isnan(lost).all()


def test_tools_that_are_moved_are_refused_with_the_reason():
    moved = ("tool.shape=sphere", "tool.displacement=2 mm")
    with pytest.raises(ValueError, match="place and force of a blunt tool"):
        _ = organ_request.OrganRequest(scene="block", overrides=moved).given


@pytest.mark.parametrize(
    ("unknown", "value"),
    [
        ("reference_spacing", 5e-3),
        ("spacing", 0.025),
        ("k1", 1.1),
        ("k2", 1.5),
        ("gamma_0", 1.2),
        ("gamma_1", 1.5),
        ("damping", 1.5),
        ("poisson_ratio", 0.3),
        ("force", 0.5),
        ("across", 0.4),
        ("along", 0.4),
        ("radius", 1.3),
        ("support", 0.3),
        ("stiffness", 15e3),
    ],
)
def test_every_unknown_moves_a_score(unknown, value, scene, given):
    before, after = (
        scored(as_the_scene(scene, **changed), given) for changed in ({}, {unknown: value})
    )
    assert np.abs(after - before).max() > 1e-5


def test_unknowns_of_a_group_change_together():
    of = unknowns(COARSE)
    assert tuple(one.name for one in of) == OrganDraw._fields
    together = groups(of)
    found = shares(0, 4, of)
    assert found.shape == (4, len(together) + 2, len(of))
    for name in (PLACE, TABLE_II):
        i = list(together).index(name)
        moved = np.isin(np.arange(len(of)), together[name])
        assert moved.sum() > 1
        assert (found[:, i + 2, moved] == found[:, 1, moved]).all()
        assert (found[:, i + 2, ~moved] == found[:, 0, ~moved]).all()
    for draw in draws(found[:, 0], of):
        assert 0.8 * COARSE <= draw.spacing <= 1.2 * COARSE


def test_a_larger_design_has_the_rows_of_a_smaller_one():
    of = unknowns(COARSE)
    assert (shares(5, 16, of)[:4] == shares(5, 4, of)).all()
    for row in (0, 1, 6, 15):
        assert organ.DesignRow(5, row, 3, COARSE).draws() == draws(shares(5, 16, of)[row, :3], of)


def test_a_motion_that_diverges_has_no_score(scene, given):
    wild = as_the_scene(scene, force=1e4)
    assert np.isnan(scored(wild, given)).all()
    assert plain(Block(np.ones((1, 3)), np.array([[[np.nan, 0.5]]])))["scores"] == [[None, 0.5]]


def test_what_finer_lattices_change_is_counted():
    columns = (("displacement", "relative-l2"), ("field", "relative-l2"))
    coarse = np.tile([[0.5, 0.1], [0.4, 0.3], [0.2, 0.2]], (10, 1, 1))
    fine = coarse.copy()
    fine[:3, 1, 0] = 0.7  # another is nearest by the first measure
    fine[5, :, 0] = 0.3  # a tie
    fine[9] = np.nan
    one, other = finer.changes(coarse, fine, columns)
    assert (one.draws, one.changed) == (8, 3 / 8)
    assert (other.draws, other.changed) == (9, 0.0)
    assert one.lead == pytest.approx(0.1)
    assert list(finer.changes(np.full_like(coarse, np.nan), fine, columns)) == []


def test_a_study_of_an_organ_is_kept_and_told(tmp_path, capsys):
    out = tmp_path / "found"

    def ask():
        robustness("block", set_=list(SHORT), size=2, again=1, spacing="30 mm", out=out)
        return capsys.readouterr()

    first = ask()
    tables = {name: (out / name).read_bytes() for name in organ_request.FILES}
    again = ask()
    assert "3 from before" in again.err
    assert again.out == first.out
    assert tables == {name: (out / name).read_bytes() for name in organ_request.FILES}
    assert "too few samples to estimate its Sobol' indices" in first.out
    with (out / organ_request.RANGES).open(newline="") as file:
        assert [row["unknown"] for row in csv.DictReader(file)] == list(OrganDraw._fields)


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        ({"scene": "paper"}, 'organ.shape: "point" has no organ; leave SCENE out'),
        ({"scene": "block", "set_": ["fuzzy.rule_base=a.fis"]}, "fuzzy.rule_base"),
        ({"scene": "block", "size": 3}, "no power of two"),
        ({"scene": "block", "spacing": "20"}, "--spacing: the unit is missing"),
        ({"scene": "block", "again": -1}, "again: -1 is negative"),
        ({"scene": "block", "where": WorkerFlags(workers=-1)}, "workers: -1 is negative"),
        ({"scene": "no-such-scene"}, "no-such-scene"),
        ({"spacing": "20 mm"}, "--spacing: is of an organ; name a scene"),
        ({"set_": ["tool.force=1 N"]}, "--set: is of an organ"),
        ({"again": 3}, "--again: is of an organ"),
        ({"size": 0}, "no power of two"),
    ],
)
def test_what_cannot_be_drawn_is_refused(asked, reason, tmp_path):
    with pytest.raises(ValueError, match=re.escape(reason)):
        robustness(**asked, out=tmp_path / "none", dry_run=True)


def index(unknown, total, low, high):
    lead = "mamdani - interval-type-2"
    found = rows.Index(
        "displacement", "relative-l2", lead, unknown, 0.0, 0.0, 0.0, total, low, high
    )
    return {name: str(value) for name, value in found._asdict().items()}


def test_indices_that_mean_nothing_are_not_printed():
    lines = [index("mass", 0.5, 0.4, 0.6), index("span", 0.9, 0.1, 2.0)]
    output = "mamdani - interval-type-2", "The lead"
    few = movers(lines, 2 * FEWEST - 2, *output)
    assert "too few samples to estimate its Sobol' indices" in few
    assert "0.5" not in few
    enough = movers(lines, 2 * FEWEST, *output)
    assert "mass 0.50 (0.40–0.60); the intervals of 1 more are wider than" in enough
    assert "0.90" not in enough
    assert "too few samples" in movers(lines[1:], 2 * FEWEST, *output)


def test_sentences_name_the_numbers_of_the_tables(tmp_path):
    column = ("displacement", "relative-l2")
    nearest = [
        rows.Nearest(*column, name, part, part - 0.05, part + 0.06, 0.07, 250)
        for name, part in zip(organ.CONTENDERS, (0.11, 0.52, 0.23, 0.07), strict=True)
    ]
    pair = ("mamdani", "interval-type-2")
    apart = [rows.Difference(*column, *pair, -0.06, -0.02, 0.0, 0.01, 0.05, -0.0018, 0.71, 0.4)]
    changed = [rows.Finer(*column, 2.0, 31, 0.129, 0.051, 0.289, 0.03, 0.02)]
    indices = [
        rows.Index(*column, " - ".join(pair), "support", 0.1, 0.0, 0.2, 0.3, 0.2, 0.4),
    ]
    for name, kind, found in (
        (told.NEAREST, rows.Nearest, nearest),
        (told.DIFFERENCES, rows.Difference, apart),
        (told.INDICES, rows.Index, indices),
        (told.FINER, rows.Finer, changed),
    ):
        write_table(tmp_path / f"{name}.csv", kind, found)
    winners, near, moved, coarse = told.sentences(tmp_path)
    assert "In 250 independent samples" in winners
    assert "Sugeno in 52.0 %" in winners
    assert "the reading in 7.0 % (no difference in 7.0 %" in winners
    assert "0.0018, in 71.0 %" in near
    assert "by no more than 0.0600" in near
    assert "support 0.30 (0.20–0.40)" in moved
    assert "2 times as fine, another is nearest in 12.9 % of 31 repeated samples" in coarse
    assert told.organ_ranking(tmp_path)["nearest"] == [
        [
            "displacement, relative L2",
            "11.0 % (6.0–17.0)",
            "52.0 % (47.0–58.0)",
            "23.0 % (18.0–29.0)",
            "7.0 % (2.0–13.0)",
            "7.0 %",
            "12.9 % (5.1–28.9)",
        ]
    ]
    (tmp_path / f"{told.FINER}.csv").unlink()
    assert "not known: no sample was repeated" in list(told.sentences(tmp_path))[-1]


def test_scenes_keep_their_own_damping_and_models(scene):
    assert scene.models == ("basafa", "msm", "reading")
    rayleigh = replace(scene, damping=replace(scene.damping, kind="rayleigh", mass=2.0))
    assert organ.as_drawn(rayleigh, as_the_scene(scene, damping=2.0)).damping.mass == 4.0
