"""`liver-study tradeoff` and `recommend`: errors that are resolved, costs, rates,"""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from fem_reference.observation import evaluation
from fem_reference.subspace import transitions
from reports import tradeoff as reports_tradeoff
from study.commands import EXIT_BAD_INPUT, EXIT_FAILED_CHECK, app
from study.models import lattice
from study.models.model import Stepper
from study.problem.damping import RayleighDamping
from study.run import scene_problem as scene_problem_module
from study.run.scene_problem import scene_arguments
from study.scene.file import read_scene
from study.sweep.runner import Backend, Outcome
from study.sweep.store import Store
from study.sweep.task import Task
from study.system.progress import Silent
from study.tradeoff import study as study_module
from study.tradeoff import table
from study.tradeoff.candidates import Candidate, best, place_dependent
from study.tradeoff.contenders import CONTENDERS, Configuration, configurations
from study.tradeoff.demand import Demand, as_share, demand, length
from study.tradeoff.errors import Errors, errors
from study.tradeoff.large_displacements import with_large_displacements
from study.tradeoff.observation import Observed
from study.tradeoff.prediction import Prediction, added_by_single, fitted
from study.tradeoff.problem import SAMPLING, plain, sampled
from study.tradeoff.rates import RATES, Frame, frame
from study.tradeoff.recommend import FITTED
from study.tradeoff.recommendation import Recommended, recommended_scene, table_of
from study.tradeoff.reference import ReferenceSolution
from study.tradeoff.table import Cost, Entry
from study.tradeoff.timing import FEWEST, Timing, in_turns

SMALL = (
    'organ.size=["60 mm", "40 mm", "30 mm"]',
    "tool.radius=15 mm",
    "tool.force=0.05 N",
    "reference.element_size=8 mm",
)
COARSER = (*SMALL, "reference.element_size=12 mm")
OVERRIDES = [word for override in COARSER for word in ("--set", override)]
VOLUME = [
    Configuration("volume-springs", {"spacing": h, "volume_term": True})
    for h in (0.015, 0.01, 5e-3)
]
LINEAR = Configuration("finite-elements", {"element": "p1", "level": -2, "rate": 60.0})
RITZ = Configuration("superposition", {"vectors": "ritz", "count": 8, "level": -2})
TOO_LONG = Configuration("step-sizes", {"spacing": 0.01, "volume_term": True, "step_rate": 300.0})
NO_MESH = Configuration("finite-elements", {"element": "p1", "level": -9, "rate": 60.0})
CHOSEN = [*VOLUME, LINEAR, RITZ, TOO_LONG, NO_MESH]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    scene = sampled(read_scene("block", SMALL))
    store = Store(tmp_path_factory.mktemp("runs"))
    return study_module.study(scene, CHOSEN, store, Backend(), 2, Silent())


@pytest.fixture(scope="module")
def scene_problem():
    return scene_problem_module.scene_problem(
        **scene_arguments(sampled(read_scene("block", SMALL)))
    )


def rows_of(entries, folder):
    """Rows of the table as it is written, with numbers and marks in place of their text."""
    path = folder / "table.csv"
    table.write(entries, path)
    with path.open(newline="") as file:
        return [{k: value_of(k, text) for k, text in row.items()} for row in csv.DictReader(file)]


def value_of(column, text):
    marks = {"": None, "True": True, "False": False}
    if column in {"contender", "configuration", "status", "message"}:
        return text
    return marks[text] if text in marks else float(text)


@pytest.fixture(scope="module")
def rows(found, tmp_path_factory):
    return rows_of(found.entries, tmp_path_factory.mktemp("table"))


def row_of(rows, configuration):
    return rows[CHOSEN.index(configuration)]


def test_every_row_has_finite_numbers_or_a_status_that_says_why_not(rows):
    for row in rows:
        assert tuple(row) == table.COLUMNS
        numbers = [v for v in row.values() if isinstance(v, float)]
        assert all(math.isfinite(v) and v >= 0.0 for v in numbers)
        if row["status"] == "resolved":
            assert row["field_error"] > row["field_error_bar"] > 0.0
            assert row["wall_per_s"] > 0.0
        else:
            assert row["field_error"] is None


def test_what_diverged_or_failed_is_told_and_has_neither_score_nor_cost(rows):
    for configuration, status, word in (
        (TOO_LONG, "diverged", "at "),
        (NO_MESH, "failed", "level -9"),
    ):
        row = row_of(rows, configuration)
        assert row["status"] == status
        assert word in row["message"]
        assert [row[c] for c in ("tool_error", "worst_error", "wall_per_s")] == [None] * 3
        assert row["pareto"] is row["pareto_any_load"] is False


def test_refining_the_spacing_lowers_the_error_and_raises_the_cost(rows):
    found = [row_of(rows, one) for one in VOLUME]
    assert found[0]["field_error"] > 1.2 * found[1]["field_error"]
    assert found[0]["worst_error"] > 1.2 * found[1]["worst_error"]
    steps = [row["step_s"] for row in found]
    assert steps == sorted(steps, reverse=True)


def test_a_superposition_follows_one_load_and_stays_off_the_front_of_those_that_follow_any(rows):
    assert row_of(rows, RITZ)["any_load"] is False
    assert row_of(rows, RITZ)["pareto_any_load"] is False
    assert any(row["pareto_any_load"] for row in rows)


def test_the_table_is_read_back_with_all_columns(found, tmp_path):
    scene = sampled(read_scene("block", SMALL))
    with study_module.place(tmp_path / "out") as folder:
        study_module.write(found, scene, 2, folder)
    with (tmp_path / "out" / study_module.TABLE).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == table.COLUMNS
    assert [row["status"] for row in rows] == [one.errors.status for one in found.entries]


def test_a_row_has_the_cost_of_its_steps_in_the_units_of_its_columns(tmp_path):
    """Turns of 0.1, 0.2 and 0.3 ms a step, of which one of 1 ms is made."""
    timing = Timing(np.repeat([[1e-4], [2e-4], [3e-4]], 40, axis=1), np.array([1e-4, 2e-4, 9e-4]))
    one = Configuration("springs", {"spacing": 0.01})
    entry = Entry(one, Errors("resolved", field=0.05), 0.01, Cost(12, 0.5, 1e-3, timing))
    table.write([entry], tmp_path / "tradeoff.csv")
    with (tmp_path / "tradeoff.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    numbers = {"unknowns": 12, "step_s": 1e-3, "setup_s": 0.5, "step_us": 200, "bare_step_us": 200}
    numbers |= {"wall_per_s_q1": 0.15, "wall_per_s": 0.2, "wall_per_s_q3": 0.25}
    numbers |= {"substeps_25hz": 40, "substeps_60hz": 17, "substeps_1khz": 1}
    numbers |= {"frame_ms_1khz": 0.2, "slow_frame_ms_1khz": 0.3, "field_error_bar": 0.01}
    assert {name: float(row[name]) for name in numbers} == pytest.approx(numbers)
    assert reports_tradeoff.rates(row) == RATES


def test_every_contender_enters_with_settings_of_its_own():
    scene = read_scene("block", SMALL)
    entered = configurations(scene)
    assert {one.contender for one in entered} == set(CONTENDERS)
    assert len({(one.contender, one.label) for one in entered}) == len(entered)
    quarter = read_scene("block", (*SMALL, "tissue.poisson_ratio=0.25"))
    assert configurations(quarter, ["volume-springs"]) == []


def planted(error, wall, *, any_load=True):
    """An entry of an error, or one that is not resolved, and a wall per simulated second."""
    found = Errors("not resolved") if error is None else Errors("resolved", field=error)
    cost = Cost(3, 0.0, 1e-3, Timing(np.full((1, 4), wall * 1e-3), None))
    return Entry(VOLUME[0] if any_load else RITZ, found, 0.01, cost)


def test_the_front_holds_what_nothing_beats(tmp_path):
    best, cheap, beaten = planted(0.1, 2.0), planted(0.3, 1.0), planted(0.2, 3.0)
    twin, hardly_better = planted(0.1, 2.0), planted(0.0995, 2.5)
    unresolved = planted(None, 0.1)
    precomputed = planted(0.05, 0.5, any_load=False)
    entries = [best, cheap, beaten, twin, hardly_better, unresolved, precomputed]
    rows = rows_of(entries, tmp_path)
    assert [row["pareto"] for row in rows] == [False] * 6 + [True]
    assert [row["pareto_any_load"] for row in rows] == [
        True,
        True,
        False,
        True,
        False,
        False,
        False,
    ]


class Clock:
    """Time that passes only when a step is taken."""

    now = 0.0

    def __call__(self):
        return self.now

    def ready(self, seconds):
        def take(count=1):
            self.now += seconds * count

        return Stepper(take, lambda: np.zeros((1, 3)), 1e-3, 3, take)


def test_a_slower_kernel_costs_in_proportion_and_loses_its_place_on_the_front(tmp_path):
    def rows(second):
        clock = Clock()
        timings = in_turns([clock.ready(1e-4), clock.ready(second)], 3, clock)
        kept = [Errors("resolved", field=0.2), Errors("resolved", field=0.1)]
        costs = [Cost(3, 0.0, 1e-3, timing) for timing in timings]
        pairs = zip(kept, costs, strict=True)
        return rows_of([Entry(VOLUME[0], e, 0.01, c) for e, c in pairs], tmp_path)

    equal, slower = rows(1e-4), rows(3e-4)
    assert equal[1]["wall_per_s"] == pytest.approx(0.1)
    assert slower[1]["wall_per_s"] == pytest.approx(3 * equal[1]["wall_per_s"])
    assert slower[1]["bare_step_us"] == pytest.approx(300.0)
    assert [row["pareto"] for row in equal] == [False, True]
    assert [row["pareto"] for row in slower] == [True, True]


def test_a_setup_is_that_of_a_lattice_of_its_own(scene_problem, monkeypatch):
    """One on the same lattice would take what another had assembled, and seem to cost nothing."""
    built, genuine = [], lattice.msm.assemble

    def counting(*things):
        built.append(1)
        return genuine(*things)

    monkeypatch.setattr(lattice.msm, "assemble", counting)
    same = [VOLUME[0], Configuration("step-sizes", {**VOLUME[0].settings, "step_fraction": 0.4})]
    study_module.costs(scene_problem, same, [1e-3, 1e-3], 1, Silent())
    assert len(built) == 2 * len(same)  # of each contender one to warm up


def test_a_turn_takes_as_many_steps_whatever_disturbs_it():
    clock = Clock()
    (timing,) = in_turns([clock.ready(1.0)], 4, clock)
    assert timing.walls.shape == (4, FEWEST)


@pytest.mark.parametrize(
    ("rate", "step", "substeps"),
    [(60.0, 1 / 60, 1), (60.0, 0.0166, 2), (60.0, 1e-3, 17), (1000.0, 1e-3, 1), (1000.0, 0.5, 1)],
)
def test_a_frame_has_the_fewest_whole_steps_that_are_short_enough(rate, step, substeps):
    found = frame(rate, step, np.full(100, 1e-5))
    assert found.substeps == substeps
    assert found.wall == pytest.approx(substeps * 1e-5)
    assert found.slow == pytest.approx(found.wall)


def test_slow_frames_decide_whether_a_rate_is_kept():
    walls = np.full(1000, 1e-4)
    assert frame(1000.0, 1e-3, walls).in_time
    walls[::10] = 5e-3  # one in ten, so the 95th percentile is of these
    found = frame(1000.0, 1e-3, walls)
    assert found.wall == pytest.approx(1e-4)
    assert found.slow == pytest.approx(5e-3)
    assert not found.in_time


def test_a_frame_of_more_steps_than_were_timed_has_no_slow_one():
    found = frame(25.0, 1e-3, np.full(20, 1e-4))
    assert (found.substeps, found.slow) == (40, None)
    assert found.wall == pytest.approx(4e-3)
    assert found.in_time
    assert not frame(25.0, 1e-3, np.full(20, 1.1e-3)).in_time
    assert frame(25.0, 1e-3, np.full(40, 1e-4)).slow == pytest.approx(4e-3)


def observed(**values):
    """What a run observed, of a whole motion unless told otherwise."""
    whole = {"ended_at_s": None, "inverted_cells": 0, "margin": None, "step_s": 1e-3}
    return vars(Observed(**whole | values))


@pytest.mark.parametrize(("away", "status"), [(0.019, "not resolved"), (0.021, "resolved")])
def test_an_error_below_that_of_the_reference_is_not_resolved(away, status, scene_problem):
    seen = scene_problem.problem.observation
    field = np.ones((len(seen.volume_points), 3))
    curves = np.ones((len(seen.times), len(seen.probes), 3))
    known = ReferenceSolution(field, curves, 0.02, np.full(len(seen.probes), 0.02))
    value = observed(field=plain((1 + away) * field), curves=plain((1 + away) * curves))
    task = Task("study.tradeoff.observation:observe", {})
    found = errors(Outcome(task, "done", value, "", 0.0), known, scene_problem)
    assert found.status == status
    expected = pytest.approx(away) if status == "resolved" else None
    assert (found.field, found.tool, found.worst) == (expected,) * 3


@pytest.mark.parametrize(
    ("margin", "inverted", "status"), [(2.0, 2, "inverted"), (0.9, 0, "unstable")]
)
def test_cells_turned_inside_out_and_steps_beyond_the_limit_leave_no_error(
    margin, inverted, status
):
    value = observed(field=[1.0], curves=[1.0], margin=margin, inverted_cells=inverted)
    task = Task("study.tradeoff.observation:observe", {})
    found = errors(Outcome(task, "done", value, "", 0.0), None, None)
    assert (found.status, found.field) == (status, None)


def test_control_points_have_one_order_here_and_in_a_run(scene_problem):
    given = scene_arguments(sampled(read_scene("block", SMALL)))
    there = scene_problem_module.scene_problem(**json.loads(json.dumps(given, sort_keys=True)))
    assert list(read_scene("block").control_points) == ["tool", "corner"]
    assert there.problem.probes == scene_problem.problem.probes == ("corner", "tool")
    assert scene_problem.problem.probes[scene_problem.problem.tool_probe] == "tool"


def stepped(scene_problem, configuration, seconds):
    """Displacement of the nodes after a time, as the timing steps to it."""
    ready = configuration.model(scene_problem.scene).prepare(scene_problem.problem).stepper()
    for _ in range(round(seconds / ready.step)):
        ready.take_step()
    return ready.displacement()


def ran(scene_problem, configuration, seconds):
    """Displacement of the control points after a time, as the errors have it."""
    found = configuration.model(scene_problem.scene).prepare(scene_problem.problem).simulate()
    return found.trajectory.displacement[round(seconds / SAMPLING)]


def test_what_is_timed_is_the_lattice_whose_error_is_measured(scene_problem):
    settings = {"spacing": 0.01, "volume_term": True, "step_rate": 2000.0}
    one = Configuration("step-sizes", settings)
    net = one.model(scene_problem.scene).prepare(scene_problem.problem).assembly.lattice
    at_probes = net.interpolation(scene_problem.problem.observation.probes)[0]
    expected = ran(scene_problem, one, 0.2)
    found = at_probes @ stepped(scene_problem, one, 0.2)
    scale = np.abs(expected).max()
    # The same steps, but their times are summed otherwise.
    assert np.abs(found - expected).max() < 1e-9 * scale
    late = at_probes @ stepped(scene_problem, one, 0.2 + 0.0005)
    assert np.abs(late - expected).max() > 1e-4 * scale


@pytest.mark.parametrize("one", [LINEAR, RITZ], ids=lambda one: one.contender)
def test_what_is_timed_are_the_elements_whose_error_is_measured(one, scene_problem):
    prepared = one.model(scene_problem.scene).prepare(scene_problem.problem)
    body = prepared.body() if one is LINEAR else prepared.body
    at_probes = evaluation(body, scene_problem.problem.observation.probes)
    expected = ran(scene_problem, one, 0.2)
    scale = np.abs(expected).max()
    assert np.abs(at_probes @ stepped(scene_problem, one, 0.2) - expected).max() < 1e-9 * scale
    late = at_probes @ stepped(scene_problem, one, 0.2 + 1 / 60)
    assert np.abs(late - expected).max() > 1e-3 * scale


def test_a_mode_of_the_superposition_moves_as_its_closed_form():
    w, dt = 30.0, 0.01
    state = np.array([0.0, 0.0, 2.0, 0.0])  # a constant load of 2
    for _ in range(7):
        state = transitions(np.array([w**2]), RayleighDamping(0.0), dt)[0] @ state
    assert state[0] == pytest.approx(2.0 / w**2 * (1 - math.cos(7 * w * dt)), rel=1e-12)


def test_a_mesh_that_changed_since_the_runs_were_planned_is_refused(tmp_path):
    mesh = tmp_path / "organ.stl"
    mesh.write_text("solid a")
    scene = read_scene("block")
    scene = replace(scene, organ=replace(scene.organ, mesh=str(mesh)))
    given = scene_arguments(scene)
    mesh.write_text("solid b")
    with pytest.raises(ValueError, match="has changed"):
        scene_problem_module.scene_problem(**given)


def test_a_fit_gives_back_the_order_and_its_spread_is_that_of_the_errors():
    h = np.array(FITTED) * 0.01
    exact = fitted(h, 5.0 * h**1.5, 0.004)
    assert exact.order == pytest.approx(1.5)
    assert exact.prediction(0.006).error == pytest.approx(5.0 * 0.006**1.5)
    assert exact.prediction(0.006).bar == pytest.approx(0.004)
    shaken = 1.0 + 0.05 * (-1.0) ** np.arange(len(h))
    rough = fitted(h, 5.0 * h**1.5 * shaken, 0.004)
    assert rough.prediction(0.01).contains(1.05 * 5e-3)
    assert rough.prediction(0.01).bar > 0.004 + 0.1 * 5e-3
    assert not exact.prediction(0.01).contains(2 * 5e-3)
    with pytest.raises(ValueError, match=r"only 2.*lattice\.spacing"):
        fitted(h[:2], h[:2], 0.004)


@pytest.mark.parametrize("count", [3, 4, 6])
def test_a_fit_holds_the_curve_of_scattered_errors_however_few_they_are(count):
    """At least in 95 % of fits, within the spacings; of 1000, less two standard deviations."""
    rng = np.random.default_rng(count)
    h = 0.01 * np.array(FITTED[:count])
    middle = float(np.sqrt(h[0] * h[-1]))
    fits = (fitted(h, h * np.exp(0.05 * rng.normal(size=count)), 0.0) for _ in range(1000))
    assert np.mean([fit.prediction(middle).contains(middle) for fit in fits]) > 0.936


def candidate(error, wall, *, in_time=True, single=False, spacing=0.01):
    cost = Cost(3, 0.0, 1e-3, Timing(np.full((1, 4), wall * 1e-3), None))
    prediction = Prediction(error, 0.01)
    kind = "single-precision" if single else "springs"
    settings = {"spacing": spacing} | ({"precision": "single"} if single else {})
    return Candidate(Configuration(kind, settings), prediction, cost, Frame(1, wall, wall, in_time))


COARSE, MIDDLE, FINE = (
    candidate(0.20, 0.1),
    candidate(0.08, 0.4),
    candidate(0.03, 2.0, in_time=False),
)


@pytest.mark.parametrize(
    ("wanted", "taken", "met"),
    [
        (Demand(60.0, None), MIDDLE, True),
        (Demand(60.0, 0.3), COARSE, True),
        (Demand(60.0, 0.1), MIDDLE, True),
        (Demand(60.0, 0.085), MIDDLE, False),
        (Demand(60.0, 0.04), MIDDLE, False),
    ],
)
def test_the_cheapest_that_meets_a_demand_is_taken_or_the_nearest(wanted, taken, met):
    found = best([COARSE, MIDDLE, FINE], wanted)
    assert found is taken
    assert found.meets(wanted) is met


def test_where_nothing_keeps_up_the_fastest_is_nearest():
    faster = candidate(0.2, 1.0, in_time=False)
    assert best([FINE, faster], Demand(1e3, None)) is faster


def test_single_precision_is_taken_where_only_it_keeps_up_or_it_is_cheaper():
    fine = candidate(0.03, 1.0, single=True)
    assert best([MIDDLE, FINE, fine], Demand(60.0, None)) is fine
    same = candidate(0.08, 0.2, single=True)
    assert best([MIDDLE, same], Demand(60.0, None)) is MIDDLE
    assert best([MIDDLE, same], Demand(60.0, 0.1)) is same


def test_a_recommended_scene_says_its_precision():
    one = candidate(0.08, 0.2, single=True, spacing=0.02)
    found = Recommended(one, True, Errors("resolved", field=0.08), None, 0.2)
    text = recommended_scene(read_scene("block", SMALL), found)
    assert 'precision = "single"' in text
    assert "in single precision" in text


def test_what_single_precision_adds_is_the_change_of_the_field():
    """Of runs in double and in single; where one is missing single precision is not offered."""
    given = scene_problem_module.scene_problem(
        **scene_arguments(sampled(read_scene("block", SMALL)))
    )
    count = len(given.problem.volume_rule.weights)
    task = Task("study.tradeoff.observation:observe", {})
    double, single = (
        Outcome(task, "done", vars(Observed(None, 0, None, 1e-3, [x] * (3 * count), [])), "", 0.0)
        for x in (1.0, 1.1)
    )
    assert added_by_single([double, single], given) == pytest.approx({"single": 0.1})
    assert added_by_single([double], given) == {}


@pytest.fixture
def command(monkeypatch, tmp_path, capsys):
    """Exit code, and what was printed, of a command; `main` turns ValueErrors into code 2."""

    def run(*words):
        monkeypatch.chdir(tmp_path)
        try:
            app(words)
        except ValueError as problem:
            return EXIT_BAD_INPUT, str(problem)
        except SystemExit as left:
            return left.code or 0, capsys.readouterr().out
        return 0, capsys.readouterr().out

    return run


def test_a_recommended_scene_is_ready_to_run_and_is_as_predicted(command, tmp_path):
    code, said = command("recommend", "block", *OVERRIDES, "--error", "30 %")
    assert code == 0, said
    assert "as expected" in said
    assert "modulus of the tissue" in said
    scene = read_scene(str(tmp_path / "block-30percent.toml"))
    assert scene.lattice.volume_term
    assert scene.time == read_scene("block", SMALL).time
    assert scene.lattice.spacing > 0.005

    code, said = command("recommend", "block", *OVERRIDES, "--error", "0.1 %")
    assert code == EXIT_FAILED_CHECK
    assert "cannot: no lattice tried meets an error of 0.1 %; the nearest is" in said
    assert not (tmp_path / "block-0.1percent.toml").exists()


@pytest.mark.slow
def test_where_the_place_is_known_more_is_chosen_from(command, tmp_path):
    """On this block no lattice down to half the scene's spacing is predicted to be as exact."""
    words = ("recommend", "block", *OVERRIDES, "--error", "10 %")
    code, said = command(*words)
    assert code == EXIT_FAILED_CHECK, said
    code, said = command(*words, "--known-place")
    assert code == 0, said
    assert "valid for this place or path of the load only" in said
    assert "MB of memory during the steps" in said
    scene = read_scene(str(tmp_path / "block-10percent.toml"))
    assert scene.models[-1] in {"superposition", "corrected", "region"}


def recommended(settings, contender="corrected"):
    """The text of the block's scene with a configuration that was chosen."""
    cost = Cost(3, 0.0, 1e-3, Timing(np.full((1, 4), 1e-5), None), 12_000_000)
    chosen = Candidate(Configuration(contender, settings), Prediction(0.02, 0.01), cost, None)
    found = Recommended(chosen, True, Errors("resolved", 0.02), None, 0.01, (chosen,))
    return recommended_scene(read_scene("block", SMALL), found)


def test_a_recommended_corrected_lattice_has_its_spacing_in_the_scene():
    text = recommended({"spacing": 0.015})
    assert 'spacing = "0.015 m"' in text.split("[corrected]")[1]
    assert '"corrected",\n]' in text
    assert "#     0.01 s    2.0 +- 1.0 %    12 MB  corrected lattice of 15 mm" in text


def test_a_table_of_candidates_says_whose_frames_are_late():
    """The more accurate one is faster than real time, and yet its slow frames are not in time."""
    frames = Frame(6, 0.002, 0.004, True), Frame(6, 0.004, 0.03, False)
    cheap, accurate = (
        Candidate(
            Configuration("volume-springs", {"spacing": spacing}),
            Prediction(spacing, 0.001),
            Cost(3, 0.0, 1e-3, Timing(np.full((1, 4), 1e-6 / spacing), None)),
            own,
        )
        for spacing, own in zip((0.02, 0.01), frames, strict=True)
    )
    head, first, second = table_of([cheap, accurate], taken=cheap)
    assert "95 % of its frames" in head
    assert "4 ms, in time" in first
    assert "<- selected" in first
    assert "30 ms, late" in second


@pytest.mark.parametrize("contender", ["region", "corrected-graded"])
def test_a_recommended_graded_lattice_has_its_size_in_the_scene(contender, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(recommended({"spacing": 0.005, "radius": 0.02}, contender))
    found = read_scene(str(path))
    assert (found.region.spacing, found.region.radius) == (0.005, 0.02)
    assert found.models[-1] == contender.removesuffix("-graded")
    assert (found.corrected.coarse == "graded") is (contender == "corrected-graded")
    assert "graded lattice of 5 mm within 20 mm of the tool" in path.read_text()


def test_a_recommended_superposition_has_its_vectors_in_the_scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(recommended({"vectors": "ritz", "count": 12, "level": 0}, "superposition"))
    assert read_scene(str(path)).superposition.count == 12


def test_only_what_none_is_cheaper_and_better_than_stands_in_the_table():
    lines = list(table_of([MIDDLE, COARSE, candidate(0.21, 0.5)]))
    assert len(lines) == 3
    assert lines[1].startswith("     0.1 s   20.0")
    same = candidate(0.08, 0.2, single=True)
    marked = list(table_of([MIDDLE, same], "field", MIDDLE))
    assert [line.endswith("<- selected") for line in marked[1:]] == [False, True]
    assert list(table_of([])) == []


def test_what_follows_one_place_is_a_configuration_of_a_contender():
    scene = read_scene("block", SMALL)
    chosen = list(place_dependent(scene))
    assert not any(one.any_load for one in chosen)
    assert {one.contender for one in chosen} == {
        *("superposition", "corrected", "corrected-graded", "region"),
    }
    for one in chosen:
        one.model(scene)


def test_large_displacements_are_what_a_correction_adds():
    given = scene_problem_module.scene_problem(
        **scene_arguments(sampled(read_scene("block", SMALL)))
    )
    count = len(given.problem.volume_rule.weights)
    samples, probes = len(given.problem.observation.times), len(given.problem.probes)
    task = Task("study.tradeoff.observation:observe", {})

    def run(x):
        values = [x] * (3 * count), [x] * (3 * samples * probes)
        return Outcome(task, "done", vars(Observed(None, 0, None, 1e-3, *values)), "", 0.0)

    known = ReferenceSolution(
        np.ones((count, 3)), np.ones((samples, probes, 3)), 0.01, np.full(probes, 0.02)
    )
    found = with_large_displacements(known, run(2.0), run(2.2), run(2.25), given)
    np.testing.assert_allclose(found.field, 1.25)
    np.testing.assert_allclose(found.curves, 1.25)
    assert found.field_error == pytest.approx(0.01 + 0.05 / 1.25)
    np.testing.assert_allclose(found.curve_errors, 0.02 + 0.05 / 1.25)
    lost = replace(run(2.0), value=vars(Observed(0.1, 0, None, 1e-3, None, None)))
    assert with_large_displacements(known, lost, run(2.2), run(2.25), given) is None


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("tradeoff", "block", "--contender", "rods"), "choose from springs"),
        (("tradeoff", "block", "--contender", "msm"), "choose from springs"),
        (("tradeoff", "paper"), "organ.shape"),
        (("tradeoff", "block", "--workers", "-1"), "workers: -1 is negative"),
        (("recommend", "block"), "give --rate"),
        (("recommend", "block", "--rate", "60 kg"), "--rate 60 kg"),
        (("recommend", "block", "--error", "many %"), "--error many %"),
        (("recommend", "block", "--error", "0 %"), "--error 0 %"),
        (("recommend", "block", "--error", "500 mm"), "the organ moves by"),
        (("recommend", "block", "--error", "5 %", "--out", "no/where.toml"), "there is no folder"),
    ],
)
def test_bad_input_ends_with_exit_code_2_and_the_remedy(command, words, told, tmp_path):
    code, said = command(*words)
    assert code == EXIT_BAD_INPUT
    assert told in said
    assert list(tmp_path.iterdir()) == []


def test_a_dry_run_says_what_would_be_run_and_writes_nothing(command, tmp_path):
    code, said = command("tradeoff", "block", "--dry-run", "--contender", "basafa")
    assert code == 0
    assert said.startswith("4 runs, 0 stored, 4 left")
    assert list(tmp_path.iterdir()) == []


def test_demands_are_read_with_their_units():
    assert demand("1 kHz", "5%") == Demand(1000.0, 0.05)
    assert demand(None, "0.05") == Demand(None, 0.05)


@pytest.mark.parametrize("rate", ["60", "60 fps", "60 Hz", "0.06 kHz"])
def test_frames_per_second_and_a_bare_number_are_a_rate(rate):
    assert demand(rate, None) == Demand(60.0, None)


def test_a_length_is_an_error_and_a_share_of_what_the_organ_moves_by():
    assert length("0.5 mm") == pytest.approx(5e-4)
    assert [length(one) for one in ("5 %", "0.05", None)] == [None] * 3
    assert as_share(5e-4, 2e-3) == "25 %"
    with pytest.raises(ValueError, match=r"--error 3 mm: the organ moves by 2 mm at most"):
        as_share(3e-3, 2e-3)
