"""Load histories, peaks, response quantities and norms by their closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csc_array

from study.numerics.factors import has_inertia, symmetric_factors
from study.problem.history import LoadHistory, peak_sample
from study.problem.response import Response, ToolPath
from study.problem.trajectory import Trajectory
from study.similarity import fields


def test_a_ramp_rises_holds_and_falls_to_nothing():
    history = LoadHistory(ramp=2.0, hold=3.0, release=4.0)
    times = np.array([0.0, 0.5, 2.0, 5.0, 6.0, 9.0, 20.0])
    assert history.factor(times) == pytest.approx([0.0, 0.25, 1.0, 1.0, 0.75, 0.0, 0.0])


def test_a_sinusoid_has_its_frequency_in_cycles_per_second_and_a_step_is_whole_at_once():
    wave = LoadHistory(kind="sinusoid", frequency=5.0)
    quarters = np.arange(5) / 20.0
    assert wave.factor(quarters) == pytest.approx([0.0, 1.0, 0.0, -1.0, 0.0], abs=1e-12)
    assert (LoadHistory(kind="step").factor(np.array([0.0, 1.0])) == 1.0).all()


def test_the_peak_is_the_last_of_equal_ones_of_either_sign():
    assert peak_sample(np.array([0.0, 1.0, 1.0, 0.5])) == 2
    assert peak_sample(np.array([0.0, 1.0, -1.0, 0.5])) == 2
    assert peak_sample(np.array([0.0, 0.5, -0.75, 0.7])) == 2
    assert peak_sample(np.array([1.0, 1.0 - 1e-12, 1.0 - 1e-6])) == 1  # equal but for rounding


AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
ACROSS = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)


def response(tools=()):
    return Response(np.arange(3.0), ("near", "far"), AXIS, np.ones(1), tools)


def trajectory(**curves):
    """Of three samples at two control points, at rest unless told otherwise."""
    still, none = np.zeros((3, 2, 3)), np.zeros((0, 0, 3))
    no_fields = {"volume_field": none, "surface_field": none}
    return Trajectory(**{"displacement": still, "velocity": still} | no_fields | curves)


def test_a_motion_is_that_of_its_control_point_along_the_push():
    still = np.zeros((3, 2, 3))
    u, v = still.copy(), still.copy()
    u[:, 1] = np.outer([0.0, 0.1, 0.2], AXIS) + 5.0 * ACROSS
    v[:, 1] = np.outer([0.0, -3.0, 4.0], AXIS)
    seen = trajectory(displacement=u, velocity=v)
    far = response().motion(seen, 1)
    assert far.displacement == pytest.approx([0.0, 0.1, 0.2])
    assert far.velocity == pytest.approx([0.0, -3.0, 4.0])
    assert not response().motion(seen, 0).displacement.any()


def test_the_force_of_a_tool_is_that_on_the_body_along_its_axis_and_across_it():
    """The trajectory has the force on the tool."""
    on_tool = np.zeros((3, 2, 3))
    on_tool[:, 1] = -np.outer([0.0, 2.0, -1.0], AXIS) + np.outer([0.0, 0.5, -0.25], ACROSS)
    travel = np.outer([0.0, 0.003, 0.004], AXIS) + 0.1 * ACROSS
    other = ToolPath("other", ACROSS, np.zeros((3, 3)))
    tools = (other, ToolPath("tool", AXIS, travel))
    found = response(tools).tool_curve(trajectory(tool_force=on_tool), 1)
    assert found.force == pytest.approx([0.0, 2.0, -1.0])
    assert found.tangential == pytest.approx([0.0, 0.5, 0.25])
    assert found.travel == pytest.approx([0.0, 0.003, 0.004])


def test_norms_weigh_points_by_their_volume_and_curves_by_all_of_their_components():
    volumes = np.array([1.0, 3.0])
    field = np.array([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]])
    assert fields.norm(field, volumes) == pytest.approx(5.0)
    assert fields.norm(field[::-1], volumes) == pytest.approx(5.0 * np.sqrt(3.0))
    reference = np.array([[0.0, 5.0, 0.0], [0.0, 0.0, 0.0]])
    assert fields.relative_l2(field, 2.0 * reference, volumes) == pytest.approx(np.sqrt(1.25))
    curves = np.zeros((2, 2, 3))
    curves[:, 0, 1], curves[1, 1, 2] = (3.0, 4.0), 2.0
    of = np.zeros((2, 2, 3))
    of[0, 0] = [6.0, 0.0, 8.0]
    of[1, 1, 0] = -4.0
    assert fields.relative_l2_of_curves(curves, of) == pytest.approx([0.5, 0.5])


def test_factors_tell_the_signs_of_eigenvalues():
    rng = np.random.default_rng(4)
    turn = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    for negative in range(4):
        values = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
        values[:negative] *= -1.0
        factors = symmetric_factors(csc_array(turn @ np.diag(values) @ turn.T))
        assert [has_inertia(factors, n) for n in range(5)] == [n == negative for n in range(5)]
    assert symmetric_factors(csc_array(np.ones((2, 2)))) is None
    assert not has_inertia(None)
