"""What holds for every pair of motions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from study.problem.response import Motion
from study.similarity import phase_plane
from study.similarity.score import scores

SAMPLES = st.integers(8, 40)
# Includes denormals and the far side of any unit error.
NUMBERS = st.floats(-1e9, 1e9)


@st.composite
def signals(draw, count):
    """As many curves as `count`, of one length, shape (samples,) each."""
    samples = draw(SAMPLES)
    return tuple(draw(arrays(float, samples, elements=NUMBERS)) for _ in range(count))


def moves(values):
    return np.ptp(values) > max(1e-30, 1e-12 * np.max(np.abs(values)))


def motion(displacement, velocity):
    return Motion(np.arange(len(displacement), dtype=float), displacement, velocity)


@settings(max_examples=25, deadline=None)
@given(signals(4))
def test_every_score_lies_between_zero_and_one(curves):
    assume(moves(curves[2]) and moves(curves[3]))
    for score in scores(motion(*curves[:2]), motion(*curves[2:])):
        assert 0.0 <= score.value <= 1.0, score


@settings(max_examples=25, deadline=None)
@given(signals(2))
def test_any_motion_against_itself_scores_one(curves):
    assume(moves(curves[0]) and moves(curves[1]))
    for score in scores(motion(*curves), motion(*curves)):
        assert score.value == pytest.approx(1.0, abs=1e-12), score


@settings(max_examples=25, deadline=None)
@given(signals(4), st.sampled_from([2.0**-20, 2.0**-10, 2.0**10]))
def test_the_unit_of_both_curves_does_not_matter(curves, factor):
    curves = [np.clip(c, -1.0, 1.0) for c in curves]
    curves = [np.where(np.abs(c) < 1e-12, 0.0, c) for c in curves]  # no underflow in squares
    assume(moves(curves[2]) and moves(curves[3]))
    plain = scores(motion(*curves[:2]), motion(*curves[2:]))
    rescaled = [factor * c for c in curves]
    # A power of two scales every float without rounding, so the scores are the same bits.
    assert scores(motion(*rescaled[:2]), motion(*rescaled[2:])) == plain


DISTANCES = [
    phase_plane.frechet_distance,
    phase_plane.area_distance,
    phase_plane.pcm_distance,
]


@pytest.mark.parametrize("distance", DISTANCES)
@settings(max_examples=10, deadline=None)
@given(signals(4))
def test_distances_are_symmetric_on_common_axes(distance, curves):
    # A last point beyond all others, the same in both, gives both orders the same axes.
    one, other = (
        np.column_stack([np.append(np.clip(c, -1.0, 1.0), 2.0) for c in pair])
        for pair in (curves[:2], curves[2:])
    )
    assert distance(one, other) == pytest.approx(distance(other, one), abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(signals(2))
def test_resampling_keeps_the_ends_and_adds_no_length(curves):
    curve = np.column_stack(curves) / 1e9
    resampled = phase_plane.resample(curve)
    assert resampled.shape == (phase_plane.POINT_COUNT, 2)
    assert resampled[[0, -1]] == pytest.approx(curve[[0, -1]], abs=1e-12)
    length = phase_plane.arc_length(curve)[-1]
    assert phase_plane.arc_length(resampled)[-1] <= length * (1.0 + 1e-12)
