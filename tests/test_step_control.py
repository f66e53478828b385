"""Control of the time step of a run: what a step may be, when it is checked, kept and undone."""

import numpy as np
import pytest

from msm.timestep import (
    ALLOWED,
    LOOK,
    SHORTENINGS,
    SHORTEST,
    Automatic,
    Counts,
    Fixed,
    Rate,
    StepControl,
    prescribed_steps,
    whole_steps,
)

CRITICAL = 1e-3
INTERVAL = 20.5 * CRITICAL


def control(step, intervals=4):
    return StepControl(step, INTERVAL, intervals, CRITICAL)


def test_whole_steps_are_the_fewest_that_are_short_enough(rng):
    for interval, longest in rng.uniform(0.1, 9.0, (200, 2)):
        count = whole_steps(interval, longest)
        assert interval / count <= longest
        assert count == 1 or interval / (count - 1) > longest
    assert (0.1 + 0.2) / 0.1 > 3.0  # by rounding, which needs no fourth step
    assert whole_steps(0.1 + 0.2, 0.1) == 3


def test_prescribed_steps_fill_each_interval():
    assert prescribed_steps(Automatic(0.8), 0.1, 3) is None
    np.testing.assert_array_equal(prescribed_steps(Fixed(0.025), 0.1, 3), [4, 4, 4])
    np.testing.assert_array_equal(prescribed_steps(Rate(41.0), 0.1, 3), [5, 5, 5])
    for whole in (Fixed(0.1), Rate(0.01)):
        np.testing.assert_array_equal(prescribed_steps(whole, 0.1, 2), [1, 1])
    counts = np.array([2, 7, 1])
    np.testing.assert_array_equal(prescribed_steps(Counts(counts), 0.1, 3), counts)
    steps = control(Counts(np.array([2, 7, 1, 3])))
    assert [steps.choose(n) for n in range(4)] == [2, 7, 1, 3]
    np.testing.assert_array_equal(steps.substeps, [2, 7, 1, 3])


def test_an_automatic_step_is_the_longest_within_its_fraction():
    for fraction in (0.02, 0.3, 0.8, 1.2):
        count = control(Automatic(fraction)).choose(0)
        assert INTERVAL / count <= fraction * CRITICAL < INTERVAL / (count - 1)


def test_a_step_count_is_kept_until_it_would_fall_by_more_than_a_tenth():
    """It follows a falling critical step at once."""
    steps = control(Automatic(0.8))
    first = steps.choose(0)
    steps.current = CRITICAL / 0.93
    assert steps.choose(1) == first
    steps.current = CRITICAL / 0.85
    assert 0.8 * first < steps.choose(2) < 0.9 * first
    steps.current = 0.97 * CRITICAL
    assert steps.choose(3) > first


def test_the_margin_is_the_smallest_ratio_of_the_critical_to_an_accepted_step():
    steps = control(Automatic(0.8))
    dt = INTERVAL / steps.choose(0)
    assert steps.margin == pytest.approx(CRITICAL / dt)
    assert steps.accepts(dt, 1.5 * CRITICAL)
    assert steps.margin == pytest.approx(CRITICAL / dt)
    assert steps.accepts(dt, 1.1 * dt)
    assert steps.margin == pytest.approx(1.1)
    assert steps.current == 1.1 * dt
    assert not steps.accepts(dt, 0.9 * dt)  # repeated, so not among the accepted
    assert steps.margin == pytest.approx(1.1)


@pytest.mark.parametrize(("share", "accepted"), [(0.99 * ALLOWED, True), (1.01 * ALLOWED, False)])
def test_steps_above_what_is_allowed_are_repeated(share, accepted):
    """An automatic step above the critical one, and any given one, are the user's choice."""
    dt = share * CRITICAL
    assert control(Automatic(0.8)).accepts(dt, CRITICAL) == accepted
    assert control(Automatic(1.0)).accepts(3 * dt, CRITICAL)
    assert control(Fixed(INTERVAL / 20)).accepts(3 * dt, CRITICAL)
    assert not control(Automatic(0.8)).accepts(dt, np.nan)


def test_the_critical_step_is_checked_every_so_many_steps_and_at_the_end():
    steps = control(Automatic(0.8))
    steps.substeps[:] = LOOK, LOOK + 1, 2, 2
    assert [steps.is_check_due(n, LOOK - 1) for n in range(4)] == [False, True, False, True]
    assert all(steps.is_check_due(n, LOOK) for n in range(4))


def test_a_run_ends_as_diverged_once_shorter_steps_are_excluded_or_do_not_help():
    steps = control(Automatic(0.8))
    for n in range(SHORTENINGS):
        steps.halve()
        assert not steps.gives_up()
        assert steps.choose(0) == whole_steps(INTERVAL, 0.4 * 0.5**n * CRITICAL)
    steps.halve()
    assert steps.gives_up()
    assert control(Automatic(1.2)).gives_up()
    assert control(Fixed(INTERVAL / 20)).gives_up()
    for critical, given_up in ((1.01, False), (0.99, True), (np.nan, True)):
        falling = control(Automatic(0.8))
        dt = 0.5 * critical * SHORTEST * CRITICAL
        assert falling.accepts(dt, critical * SHORTEST * CRITICAL) != given_up
        assert falling.gives_up() == given_up
