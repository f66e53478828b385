"""Pairs that have no score are refused, with the curve at fault named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import similaritymeasures

from study.problem.response import Motion
from study.similarity.score import scores


def motion(samples=50, step=0.01):
    t = step * np.arange(samples)
    return Motion(t, np.sin(5.0 * t), 5.0 * np.cos(5.0 * t))


def spoiled(name, sample, value):
    values = getattr(motion(), name).copy()
    values[sample] = value
    return replace(motion(), **{name: values})


@pytest.mark.parametrize("name", ["displacement", "velocity", "time"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e31])
def test_one_sample_that_is_not_a_number_is_refused(name, value):
    with pytest.raises(ValueError, match=rf"candidate {name} is .* at sample 17.*diverged"):
        scores(spoiled(name, 17, value), motion())
    with pytest.raises(ValueError, match=f"reference {name}"):
        scores(motion(), spoiled(name, 17, value))


def test_the_library_would_have_called_it_perfect():
    """Negative control: the reason for the refusal."""
    curve = np.column_stack([motion().displacement, motion().velocity])
    broken = curve.copy()
    broken[17] = np.nan
    assert similaritymeasures.frechet_dist(broken, curve) == 0.0


def test_different_sample_counts_are_refused():
    with pytest.raises(ValueError, match="candidate has 49 samples, reference 50"):
        scores(motion(49), motion(50))


def test_arrays_of_different_length_are_refused():
    short = replace(motion(), velocity=motion().velocity[:-1])
    with pytest.raises(ValueError, match=r"candidate velocity has shape \(49,\)"):
        scores(short, motion())


def test_a_vector_instead_of_a_component_is_refused():
    vector = replace(motion(), displacement=np.zeros((50, 3)))
    with pytest.raises(ValueError, match=r"displacement has shape \(50, 3\)"):
        scores(motion(), vector)


@pytest.mark.parametrize(("samples", "refused"), [(7, True), (8, False)])
def test_eight_samples_are_the_least(samples, refused):
    if refused:
        with pytest.raises(ValueError, match="at least 8"):
            scores(motion(samples), motion(samples))
    else:
        assert len(scores(motion(samples), motion(samples))) == 7


@pytest.mark.parametrize("name", ["displacement", "velocity"])
@pytest.mark.parametrize("level", [0.0, 1e-40, 0.3, -0.3])
def test_a_flat_reference_is_refused(name, level):
    flat = replace(motion(), **{name: np.full(50, level)})
    with pytest.raises(ValueError, match=f"reference {name} is flat"):
        scores(motion(), flat)


@pytest.mark.parametrize("level", [0.3, -0.3, 1e6])
def test_a_reference_that_only_rounding_moves_is_flat(level):
    values = np.full(50, level)
    values[17:] = np.nextafter(level, np.inf)
    with pytest.raises(ValueError, match="reference displacement is flat"):
        scores(motion(), replace(motion(), displacement=values))


def test_a_flat_candidate_is_a_result():
    still = replace(motion(), displacement=np.zeros(50), velocity=np.zeros(50))
    assert all(0.0 <= s.value < 0.6 for s in scores(still, motion()))


@pytest.mark.parametrize("step", [0.0101, 0.0099])
def test_different_times_are_refused(step):
    with pytest.raises(ValueError, match="times differ"):
        scores(motion(step=step), motion())


@pytest.mark.parametrize("shift", [0.01, -0.01])
def test_times_that_start_elsewhere_are_refused(shift):
    with pytest.raises(ValueError, match="times differ"):
        scores(replace(motion(), time=motion().time + shift), motion())


def test_times_may_start_anywhere():
    later = replace(motion(), time=motion().time + 5.0)
    assert scores(later, later) == scores(motion(), motion())


def test_times_that_stand_still_are_refused():
    still = replace(motion(), time=np.full(50, 0.2))
    with pytest.raises(ValueError, match="not uniform and increasing"):
        scores(still, still)


def test_uneven_times_are_refused():
    uneven = spoiled("time", 17, 0.1701)
    with pytest.raises(ValueError, match="not uniform"):
        scores(uneven, uneven)


@pytest.mark.parametrize("step", [1e-9, 1.0, 1e3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_times_are_held_to_a_millionth_of_their_step(step, sign):
    exact = replace(motion(), time=step * np.arange(50))
    for off, refused in ((3e-6, True), (3e-7, False)):
        time = exact.time.copy()
        time[17] += sign * off * step
        moved = replace(exact, time=time)
        if refused:
            with pytest.raises(ValueError, match="not uniform"):
                scores(exact, moved)
            with pytest.raises(ValueError, match="times differ"):
                scores(moved, exact)
        else:
            assert scores(exact, moved) == scores(moved, exact) == scores(exact, exact)


def test_reversed_times_are_refused():
    reverse = replace(motion(), time=motion().time[::-1])
    with pytest.raises(ValueError, match="not uniform and increasing"):
        scores(reverse, reverse)
