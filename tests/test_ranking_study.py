"""The study of the paper's unknowns: its motions, measures, indices and sums are right."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import qmc, sobol_indices

from msm import control_point, oscillators
from msm.damping import NodalDamping
from msm.laws import Basafa, Hooke
from study.problem.response import Motion
from study.robustness import block, request, summary
from study.robustness.design import shares
from study.robustness.unknowns import UNKNOWNS, Draw, Placed, Sampled, draws
from study.run.study import run_study
from study.scene.file import read_scene
from study.similarity import batch
from study.similarity.iso18571 import rate
from study.similarity.score import scores
from study.sweep.status import SweepStatus

H0 = 5.5e-3
TIMES = np.linspace(0.0, 3.0, 301)
LOADS = {
    "step": oscillators.Load(oscillators.STEP, 2e-3, (0.0, 0.0, 0.0), 0.0),
    "ramp": oscillators.Load(oscillators.RAMP, 20e-3, (0.3, 2.1, 2.4), 0.0),
    "sinusoid": oscillators.Load(oscillators.SINUSOID, 10e-3, (0.0, 0.0, 0.0), 4.0),
}


@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
@pytest.mark.parametrize("mass", [2e-4, 0.06])
@pytest.mark.parametrize("law", [Hooke(9.0), Basafa(0.05 / H0, 10.0 / H0, 0.1)], ids=["1", "6"])
def test_many_oscillators_move_as_one_by_a_standard_solver(load, mass, law):
    k1, k2, x_c = (law.k, 0.0, 1.0) if isinstance(law, Hooke) else law
    point = oscillators.Oscillator(mass, H0, k1, k2, x_c, 0.7, 200.0, 0.0)
    found = oscillators.move(point, load, 3.0, 301)

    def force(t):
        return oscillators.force_at(load, t)[0]

    damping = NodalDamping(0.7 / mass, 200.0 / mass)
    truth = control_point.run(law, H0, mass, damping, force, TIMES)
    for ours, theirs in zip(found, (truth.displacement, truth.velocity), strict=True):
        assert ours == pytest.approx(theirs[:, 0, 0], abs=1e-6 * np.abs(theirs).max())


def test_a_point_let_go_swings_as_the_damped_oscillator_of_eq_1():
    m, k, c, x0 = 0.06, 9.0, 0.7, 1e-4
    point = oscillators.Oscillator(m, H0, k, 0.0, 1.0, c, 0.0, x0)
    still = oscillators.Load(oscillators.STEP, 0.0, (0.0, 0.0, 0.0), 0.0)
    found = oscillators.move(point, still, 3.0, 301)[0]
    decay, w = c / (2 * m), np.sqrt(k / m - (c / (2 * m)) ** 2)
    exact = x0 * np.exp(-decay * TIMES) * (np.cos(w * TIMES) + decay / w * np.sin(w * TIMES))
    assert found == pytest.approx(exact, abs=1e-6 * x0)


def test_the_steps_of_a_point_are_of_order_four_and_their_error_estimates_of_order_three():
    """Of equal steps: adaptive ones would become shorter and hide a wrong coefficient."""
    m, k1, k2, c0, c1 = 0.06, 9.0, 4e3, 0.7, 200.0
    point = oscillators.Oscillator(m, H0, k1, k2, 1.0, c0, c1, 5e-4)
    load = oscillators.Load(oscillators.SINUSOID, 20e-3, (0.0, 0.0, 0.0), 15.0)

    def rates(t, state):
        x, v = state
        spring = k1 * x + k2 * x**3 / H0**2
        return v, (20e-3 * np.sin(15.0 * t) - spring - (c0 + c1 * abs(x)) * v) / m

    exact = solve_ivp(rates, (0.0, 0.2), (5e-4, 0.0), "DOP853", rtol=1e-13, atol=1e-16)
    assert exact.y[0].min() > 0.0  # the damping has no derivative at 0
    errors, estimates = [], []
    for count in (80, 160, 320):
        h, state = 0.2 / count, (5e-4, 0.0)
        for n in range(count):
            *state, _, _ = oscillators._step(point, load, n * h, *state, h)
        errors.append(np.abs(state - exact.y[:, -1]))
        *_, in_x, in_v = oscillators._step(point, load, 0.1, 6e-4, 3e-3, h)
        estimates.append([in_x, in_v])
    orders, local = (np.log2(np.divide(e[:-1], e[1:])) for e in (errors, estimates))
    assert orders[-1] == pytest.approx([4.0, 4.0], abs=0.2)
    assert local[-1] == pytest.approx([4.0, 4.0], abs=0.3)


def motion(seed):
    """A decaying wave, rough or not, from rest."""
    rng, t = np.random.default_rng(seed), np.linspace(0.0, 3.0, 161)
    u = np.sin(rng.uniform(0.5, 3.0) * t) * np.exp(-rng.uniform(0.0, 1.0) * t)
    u += 0.02 * (seed % 2) * np.cumsum(rng.normal(size=t.size))
    return Motion(t, u, np.gradient(u, t))


@pytest.mark.parametrize("seed", range(0, 12, 2))
def test_compiled_measures_are_those_of_the_study(seed):
    one, other = motion(seed), motion(seed + 1)
    own, truth = (one.displacement, one.velocity), (other.displacement, other.velocity)
    known = scores(one, other)
    assert tuple((score.curve, score.measure) for score in known) == batch.COLUMNS
    assert batch.scores(*own, *truth) == pytest.approx([score.value for score in known], abs=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_compiled_measures_are_those_of_the_study_on_rough_curves_too(seed):
    """Noise, also in steps, of few samples: warpings with ties, loops as long as their noise."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(8, 120))
    values = rng.normal(size=(4, n))
    u, v, true_u, true_v = np.round(values) if seed % 2 else np.cumsum(values, axis=1)
    t = np.arange(n) / 10.0
    known = [score.value for score in scores(Motion(t, u, v), Motion(t, true_u, true_v))]
    assert batch.scores(u, v, true_u, true_v) == pytest.approx(known, abs=1e-12)
    parts = rate(u, true_u)
    assert batch.iso_18571_parts(u, true_u) == pytest.approx(
        [parts.corridor, parts.phase, parts.magnitude, parts.slope], abs=1e-12
    )


def test_the_design_changes_one_unknown_at_a_time():
    found = shares(3, 8)
    a, b, mixed = found[:, 0], found[:, 1], found[:, 2:]
    for i in range(len(UNKNOWNS)):
        assert (mixed[:, i, i] == b[:, i]).all()
        rest = np.arange(len(UNKNOWNS)) != i
        assert (mixed[:, i][:, rest] == a[:, rest]).all()
    assert not (a == b).any()
    with pytest.raises(ValueError, match="power of two"):
        shares(3, 12)


def test_indices_of_a_function_with_known_ones():
    """Ishigami and Homma 1990: a = 7, b = 0.1; and an unknown that has no part in it."""
    points = np.pi * (2.0 * qmc.Sobol(8, seed=1).random(2**12) - 1.0)
    x, y = points[:, :4], points[:, 4:]
    design = [x, y]
    for i in range(4):
        mixed = x.copy()
        mixed[:, i] = y[:, i]
        design.append(mixed)

    def f(z):
        return np.sin(z[:, 0]) * (1.0 + 0.1 * z[:, 2] ** 4) + 7.0 * np.sin(z[:, 1]) ** 2

    found = summary.sobol(np.stack([f(z) for z in design], axis=1))
    assert found[:, 0] == pytest.approx([0.3139, 0.4424, 0.0, 0.0], abs=0.02)
    assert found[:, 3] == pytest.approx([0.5576, 0.4424, 0.2437, 0.0], abs=0.02)
    assert (found[:3, 4] < found[:3, 3]).all()
    assert (found[:3, 5] > found[:3, 3]).all()
    assert not found[3].any()
    a, b, *mixed = (f(z)[None] for z in design)
    known = sobol_indices(func={"f_A": a, "f_B": b, "f_AB": np.stack(mixed)}, n=len(x))
    assert found[:, 0] == pytest.approx(known.first_order.ravel(), abs=1e-12)
    assert found[:, 3] == pytest.approx(known.total_order.ravel(), abs=1e-12)


def as_in_the_paper_scene():
    """The draw that says what the built-in paper scene says."""
    mass = control_point.mass_that_meets(2.0, 0.9, 0.05 / H0)
    fuzzy = read_scene("paper").fuzzy
    return Draw(
        H0,
        mass,
        2e-3 / 0.05,
        "step",
        3.0,
        0.0,
        0.4,
        9.5e3,
        1.0,
        ("hcv",),
        fuzzy.knowledge,
        Placed(fuzzy.reading, fuzzy.placement),
        fuzzy.consequent,
        fuzzy.absent,
        fuzzy.footprint,
        fuzzy.footprint_factor,
        Sampled(fuzzy.sampling, fuzzy.samples),
        fuzzy.sugeno_aggregation,
        fuzzy.reducer,
    )


def test_a_draw_is_scored_as_a_scene_that_says_the_same():
    scene = read_scene("paper")
    scene = replace(scene, time=replace(scene.time, samples=block.SAMPLES))
    results = run_study(scene)
    found = block.evaluated([as_in_the_paper_scene()])
    for s, system in enumerate(block.SYSTEMS):
        assert found.estimates[0, s] == results.record.fuzzy.systems[system].estimate_pa
        known = [row.score for row in results.scores if row.model == f"msm-{system}"]
        assert found.scores[0, s] == pytest.approx(known, abs=1e-6)
    # Negative control: a benchmark at another reference spacing is another one.
    other = block.evaluated([as_in_the_paper_scene()._replace(rest_length=5.0e-3)])
    assert np.abs(other.scores - found.scores).max() > 0.01


def sample(size=64):
    """Scores that nothing is known of, over a design."""
    rng = np.random.default_rng(0)
    points = len(UNKNOWNS) + 2
    scored = rng.uniform(0.0, 0.8, (size, points, 3, len(batch.COLUMNS)))
    return summary.Draws(np.full((size, points, 3), 1e4), scored)


def test_shares_count_who_is_nearest_and_leave_ties_to_nobody():
    found = sample()
    found.scores[..., 0] = [0.2, 0.5, 0.1]  # Sugeno wins by the first measure
    found.scores[:16, :2, 1, 0] = 0.2  # and ties in a quarter of the draws
    rows = [row for row in summary.nearest(found) if row[:2] == batch.COLUMNS[0]]
    assert [(row.system, row.share) for row in rows] == [
        ("mamdani", 0.0),
        ("sugeno", 0.75),
        ("interval-type-2", 0.0),
    ]
    assert all(row.tied == 0.25 and row.draws == 128 for row in rows)
    assert rows[1].low < 0.75 < rows[1].high


def test_a_draw_that_gives_table_iii_is_found():
    found = sample()
    before = list(summary.table_three(found))[4]
    assert before.within_rounding == 0
    assert before.within_005 == 0
    found.scores[5, 7, :, 4] = [summary.TABLE_III[system] for system in block.SYSTEMS]
    row = list(summary.table_three(found))[4]
    assert (row.within_rounding, row.within_005, row.in_order_of_those) == (1, 1, 1)
    assert row.draw == 5 * (len(UNKNOWNS) + 2) + 7
    assert row.nearest < summary.ROUNDING


def test_what_did_not_finish_counts_nowhere():
    found = sample()
    found.scores[0, 0] = np.nan
    assert next(summary.nearest(found)).draws == 127
    assert list(summary.indices(found))


def test_draws_lie_in_the_ranges_that_are_printed():
    found = draws(shares(1, 64)[:, 0])
    for unknown in UNKNOWNS:
        values = [getattr(draw, unknown.name) for draw in found]
        if hasattr(unknown, "values"):
            assert set(values) <= set(unknown.values)
        else:
            assert unknown.low <= min(values) < max(values) <= unknown.high


def test_finished_blocks_are_not_drawn_again(tmp_path):
    asked = request.RobustnessRequest(size=2, out=tmp_path / "found")
    told: list[SweepStatus] = []
    first = request.study(asked, told.append)
    tables = {name: (asked.folder / name).read_bytes() for name in request.FILES}
    assert request.study(asked, told.append) == first
    assert told[-1].stored == len(asked.tasks())
    assert tables == {name: (asked.folder / name).read_bytes() for name in request.FILES}
    with (asked.folder / request.RANGES).open(newline="") as file:
        assert [row["unknown"] for row in csv.DictReader(file)] == list(Draw._fields)
