"""Similarity against closed forms and reproduced anchors."""

from __future__ import annotations

import numpy as np
import pytest
import similaritymeasures

from study.problem.response import Motion
from study.similarity import phase_plane
from study.similarity.score import FORMULAS, MEASURES, scores
from study.similarity.time_history import relative_l2_distance
from study.similarity.time_warping import warping_path

CASES = [(kind, measure.name) for kind, measures in MEASURES.items() for measure in measures]


def oscillator(stiffness=1.0, *, damping=1.8, horizon=10.0, samples=401):
    """Unit step response of m x'' + damping x' + stiffness x = 1 with m = 1 kg, from rest."""
    t = np.linspace(0.0, horizon, samples)
    decay = damping / 2.0
    omega = np.sqrt(stiffness - decay**2)
    envelope = np.exp(-decay * t)
    x = (1.0 - envelope * (np.cos(omega * t) + decay / omega * np.sin(omega * t))) / stiffness
    return Motion(t, x, envelope * np.sin(omega * t) / omega)


def scaled(motion, factor):
    return Motion(motion.time, factor * motion.displacement, factor * motion.velocity)


def values(candidate, reference):
    return {(s.curve, s.measure): s.value for s in scores(candidate, reference)}


def curve(x, y):
    return np.column_stack([x, y])


def circle(radius, samples=4001):
    angle = np.linspace(0.0, 2.0 * np.pi, samples)
    return radius * curve(np.cos(angle), np.sin(angle))


# --- identity, order, formulas


@pytest.mark.parametrize("damping", [0.1, 1.8])
def test_a_motion_against_itself_scores_one(damping):
    motion = oscillator(damping=damping)
    assert list(values(motion, motion).values()) == pytest.approx([1.0] * 7, abs=1e-12)


def test_scores_come_in_the_order_of_the_table_and_each_has_a_formula():
    found = scores(oscillator(1.2), oscillator())
    assert [(s.curve, s.measure) for s in found] == CASES
    assert set(FORMULAS) == {name for _, name in CASES}
    assert all(FORMULAS.values())


def test_each_kind_is_scored_on_its_own_curve():
    reference = oscillator()
    faster = Motion(reference.time, reference.displacement, 1.3 * reference.velocity)
    found = values(faster, reference)
    assert found["displacement", "relative-l2"] == pytest.approx(1.0, abs=1e-12)
    assert found["velocity", "relative-l2"] == pytest.approx(0.7, abs=1e-12)
    # Only the top of the loop is apart, by 0.3 of the reference's largest velocity.
    assert found["phase-plane", "frechet"] == pytest.approx(1 / 1.3, abs=5e-3)


# --- anchors


@pytest.mark.parametrize(
    ("stiffness", "relative_l2", "iso", "pearson"),
    [(1.2, 0.853, 0.781, 0.994), (1.1, 0.921, 0.911, 0.998)],
)
def test_anchors_of_a_stiffness_error(stiffness, relative_l2, iso, pearson):
    """Unit mass and stiffness, zeta 0.9 of the reference, horizon 10 / omega, 1001 samples.

    The anchors, computed earlier with other code and printed to three digits, hold if the damping
    coefficient 1.8 is kept while the stiffness grows (keeping zeta gives .843 and .915 instead).
    """
    candidate = oscillator(stiffness, samples=1001)
    reference = oscillator(samples=1001)
    found = values(candidate, reference)
    half_digit = 5e-4
    assert found["displacement", "relative-l2"] == pytest.approx(relative_l2, abs=half_digit)
    assert found["displacement", "iso-18571"] == pytest.approx(iso, abs=half_digit)
    correlation = np.corrcoef(candidate.displacement, reference.displacement)[0, 1]
    assert correlation == pytest.approx(pearson, abs=half_digit)  # blind: hence it never ranks


# --- closed forms


def test_relative_l2_of_a_scaled_curve_is_the_scale_error():
    reference = oscillator().displacement
    assert relative_l2_distance(1.3 * reference, reference) == pytest.approx(0.3, rel=1e-12)


@pytest.mark.parametrize("gap", [0.05, 0.4])
def test_parallel_lines_are_one_gap_apart(gap):
    x = np.linspace(0.0, 1.0, 101)
    reference = curve(x, np.full_like(x, 1.0))
    candidate = curve(x, np.full_like(x, 1.0 + gap))
    # Both are resampled at the same abscissae: only rounding is left. Length 1, so area = gap.
    assert phase_plane.frechet_distance(candidate, reference) == pytest.approx(gap, rel=1e-12)
    assert phase_plane.pcm_distance(candidate, reference) == pytest.approx(gap, rel=1e-12)
    assert phase_plane.area_distance(candidate, reference) == pytest.approx(gap, rel=1e-9)


def test_concentric_circles():
    candidate, reference = circle(1.1), circle(1.0)
    # Points of equal rank lie on one ray. 199 chords cut (2 pi / 199)^2 / 6 = 1.7e-4 off the area;
    # the 4000 chords resampled lie up to (pi / 4000)^2 / 2 = 3e-7 inside, of 0.1 a part of 7e-7.
    assert phase_plane.frechet_distance(candidate, reference) == pytest.approx(0.1, rel=1e-6)
    area = np.pi * (1.1**2 - 1.0)
    assert phase_plane.area_distance(candidate, reference) == pytest.approx(area, rel=2e-4)


def test_partial_curve_mapping_slides_the_shorter_line_into_place():
    # The middle half of a unit line: its ends are held over a quarter line on each side, so the
    # gap runs from 0 to 1/4 over half of the length, and averages 1/16.
    whole, middle = np.linspace(0.0, 1.0, 101), np.linspace(0.25, 0.75, 51)
    reference = curve(whole, np.ones_like(whole))
    candidate = curve(middle, np.ones_like(middle))
    # Trapezoids of 1/199 across the two kinks, and an offset grid of 1/200: errors of their square.
    assert phase_plane.pcm_distance(candidate, reference) == pytest.approx(1 / 16, abs=1e-4)


def test_the_axes_are_normalised_by_the_reference():
    reference = curve(*np.array([[0.0, 0.01, 0.02], [0.0, -5.0, 1.0]]))
    _, normal = phase_plane.comparable(reference, reference)
    assert np.max(np.abs(normal), axis=0) == pytest.approx([1.0, 1.0], rel=1e-2)
    assert np.diff(phase_plane.arc_length(normal)).std() < 1e-2 * phase_plane.arc_length(normal)[1]


def exhaustive_cost(x, y, half_width, i=0, j=0):
    """Least warping cost from cell (i, j) on, by trying every path."""
    if i >= len(x) or j >= len(y) or abs(i - j) > half_width:
        return np.inf
    rest = min(
        (exhaustive_cost(x, y, half_width, i + a, j + b) for a, b in ((1, 0), (0, 1), (1, 1))),
    )
    at_end = i == len(x) - 1 and j == len(y) - 1
    return (x[i] - y[j]) ** 2 + (0.0 if at_end else rest)


@pytest.mark.parametrize("half_width", [0, 1, 2, 5])
def test_the_warping_path_is_the_cheapest_of_all(half_width):
    x, y = np.random.default_rng(half_width).normal(size=(2, 6))
    i, j = warping_path(x, y, half_width)
    assert (i[0], j[0], i[-1], j[-1]) == (0, 0, 5, 5)
    assert np.max(np.abs(i - j)) <= half_width
    steps = set(zip(np.diff(i).tolist(), np.diff(j).tolist(), strict=True))
    assert steps <= {(1, 0), (0, 1), (1, 1)}
    cost = np.sum((x[i] - y[j]) ** 2)
    assert cost == pytest.approx(exhaustive_cost(x, y, half_width), rel=1e-12)


def test_equally_cheap_warping_steps_are_taken_in_the_stated_order():
    i, j = warping_path(np.zeros(3), np.zeros(3), 2)
    assert (i.tolist(), j.tolist()) == ([0, 0, 0, 1, 2], [0, 1, 2, 2, 2])


# --- order and stability


@pytest.mark.parametrize("damping", [0.4, 1.8])
@pytest.mark.parametrize("errors", [(1.0, 1.05, 1.1, 1.2, 1.3, 1.5, 2.0), (1.0, 0.95, 0.9, 0.85)])
def test_scores_fall_as_the_stiffness_error_grows(damping, errors):
    reference = oscillator(damping=damping)
    rows = [values(oscillator(e, damping=damping), reference) for e in errors]
    for case in CASES:
        fall = -np.diff([row[case] for row in rows])
        assert np.all(fall > 0.0), case


# With N samples:
# - the L2 sums weigh the last sample whole instead of half, 1 / (2 N) of each sum, so 1 / (4 N) of
#   its root, times a distance of 0.18;
# - a shift of whole samples moves ISO's phase part by 1 / (0.2 N) per sample, 1 / N after its
#   weight of 0.2; magnitude and slope each lose up to as much through misalignment;
# - phase-plane curves are resampled: what is left is the corner cut by steps of L / N on a curve of
#   about unit radius, (L / N)^2 / 8 for each of two curves of length L < 5.
RESAMPLING_TOLERANCE = {
    "relative-l2": lambda n: 0.05 / n,
    "iso-18571": lambda n: 3.0 / n,
    "frechet": lambda n: 6.25 / n**2,
    "area": lambda n: 6.25 / n**2,
    "pcm": lambda n: 6.25 / n**2,
}


@pytest.mark.parametrize("damping", [0.4, 1.8])
@pytest.mark.parametrize("samples", [201, 401])
def test_scores_hardly_depend_on_the_sampling(damping, samples):
    pairs = [
        values(oscillator(1.2, damping=damping, samples=n), oscillator(damping=damping, samples=n))
        for n in (samples, 1001)
    ]
    for kind, measure in CASES:
        change = abs(pairs[0][kind, measure] - pairs[1][kind, measure])
        assert change < RESAMPLING_TOLERANCE[measure](samples), (kind, measure)


def test_the_library_pcm_depends_on_the_sampling():
    """Why it is not used: twice the points, twice the distance."""
    coarse, fine = (similaritymeasures.pcm(circle(1.1, n), circle(1.0, n)) for n in (101, 201))
    assert fine / coarse == pytest.approx(2.0, rel=0.01)


# --- planted errors


@pytest.mark.parametrize("factor", [-1.0, 1e3, 1e-3, 0.0], ids=["sign", "mm", "km", "no motion"])
def test_a_gross_error_scores_far_below_one(factor):
    reference = oscillator()
    found = values(scaled(reference, factor), reference)
    # A motionless candidate is the best of them: half a reach of mean gap gives PCM and area about
    # 1/2, a lost slope leaves ISO 0.44. Compare 0.95 for +20 % stiffness.
    assert max(found.values()) < 0.6
    assert found["displacement", "relative-l2"] < 0.01
    if factor:
        correlation = np.corrcoef(factor * reference.displacement, reference.displacement)[0, 1]
        assert abs(correlation) == pytest.approx(1.0, abs=1e-12)  # what a blind measure would say


def test_a_late_candidate_loses_the_phase_part_but_no_phase_plane_score():
    t = np.linspace(0.0, 10.0, 501)

    def pulse(delay):
        return Motion(
            t, np.exp(-((t - delay) ** 2)), -2 * (t - delay) * np.exp(-((t - delay) ** 2))
        )

    found = values(pulse(6.0), pulse(5.0))
    assert found["displacement", "iso-18571"] < 0.8
    assert found["displacement", "relative-l2"] < 0.5
    # The same loop is drawn later: only its first and last 1e-7 differ, and the sampling of it.
    assert found["phase-plane", "frechet"] == pytest.approx(1.0, abs=1e-3)
