"""Time-step errors of motions whose velocity jumps, as where a rigid tool reaches a point."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from study.models.errors import mean_velocity_error, step_checks, time_step_errors
from study.models.model import SILENT
from study.problem.rigid import SPHERE, RigidTool
from study.problem.trajectory import Trajectory
from study.results.records import CurveErrors, ModelRecord
from study.run.preparation import prepare_scene
from study.run.warnings import warnings
from study.scene.file import read_scene

TIMES = np.linspace(0.0, 1.0, 101)
JUMP = 0.3
"""Time [s] of a jump of the velocity, on a sample."""
STEPS = 2e-3 / 2.0 ** np.arange(5)


@pytest.fixture(scope="module")
def touched(small_posed):
    def still(times):
        return np.zeros((len(times), 3))

    tool = RigidTool("tool", SPHERE, 0.01, np.zeros(3), np.array([0.0, 0.0, -1.0]), still)
    return replace(small_posed, rigid_tools=(tool,))


def stopped(late: float, lag: float = 0.0) -> Trajectory:
    """A point that moves at 1 m/s along x until it stops `late` [s], and also swings.

    `lag` [s] delays the swing, as a whole step does by an integrator of first order.
    """
    end = JUMP + late
    swing, speed = 0.1 * np.sin(5.0 * (TIMES - lag)), 0.5 * np.cos(5.0 * (TIMES - lag))
    u, v = np.zeros((101, 1, 3)), np.zeros((101, 1, 3))
    u[:, 0, 0], v[:, 0, 0] = np.minimum(TIMES, end), (end - TIMES > 1e-12).astype(float)
    u[:, 0, 1], v[:, 0, 1] = swing, speed
    nothing = np.zeros((0, 1, 3))
    return Trajectory(u, v, nothing, nothing)


def errors_by_step(touched, motions):
    """Relative errors of the velocity at samples, and of its mean between them, by step."""
    pairs = list(pairwise(motions))
    at = [time_step_errors(1, ("tool",), *pair)["tool"].velocity for pair in pairs]
    return np.array(at), np.array([mean_velocity_error(1, touched, *pair) for pair in pairs])


def test_only_the_mean_velocity_converges_where_contact_makes_it_jump(touched):
    """The time of the stop is found to within a step, on one or the other side of the sample."""
    late = STEPS * 0.4 * (-1.0) ** np.arange(5)
    at, mean = errors_by_step(touched, [stopped(one) for one in late])
    assert at.min() > 0.1
    assert at.max() < 1.1 * at.min()
    assert mean[1:] == pytest.approx(0.5 * mean[:-1], rel=0.1)
    assert mean[-1] < 0.01


def test_the_mean_velocity_shows_a_lag_of_the_motion(touched):
    """Negative control: it leaves out times of jumps, and nothing else."""
    _, mean = errors_by_step(touched, [stopped(0.0, lag) for lag in 100.0 * STEPS])
    (_, of_velocity) = step_checks(
        "m", {"tool": CurveErrors(displacement=0.0, velocity=0.0)}, mean[0]
    )
    assert not of_velocity.passed
    assert mean[1:] == pytest.approx(0.5 * mean[:-1], rel=0.1)


def test_without_rigid_tools_the_velocity_itself_is_checked(small_posed):
    assert mean_velocity_error(1, small_posed, stopped(1e-3), stopped(-1e-3)) is None
    (_, of_velocity) = step_checks("m", {"tool": CurveErrors(displacement=0.0, velocity=0.06)})
    assert not of_velocity.passed


@pytest.mark.parametrize(("error", "told"), [(0.08, True), (0.04, False)])
def test_a_velocity_that_contact_leaves_unresolved_is_told(error, told):
    scene = read_scene("press")
    errors = {"tool": CurveErrors(displacement=0.0, velocity=error)}
    record = ModelRecord(
        name="m", label="M", simulated_s=1.0, status="finished", time_step_errors=errors
    )
    texts = warnings(scene, [record], [])
    assert any("velocity of m at the samples" in text for text in texts) == told


@pytest.mark.slow
def test_the_steps_of_the_built_in_press_pass_their_checks():
    prepared = prepare_scene(read_scene("press", ['models=["reading"]']))
    found = prepared.models["reading"].run(SILENT)
    assert all(check.passed for check in found.checks)
