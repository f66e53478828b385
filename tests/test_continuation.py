"""Paths of growing load: where increments are halved and doubled, and where they end."""

from typing import NamedTuple

import pytest

from study.numerics.continuation import Increments, follow, slow_iterations

BY = Increments(easy=2, smallest=1 / 8, unit="the load")


class Found(NamedTuple):
    factor: float
    residuals: tuple[float, ...]
    failure: str = ""


START = Found(0.0, ())


def taken(at, iterations):
    """The state of the path: the factor and what it cost."""
    return at.factor, iterations


def search(*, reach, end=2.0, iterations=1):
    """Equilibria no further than `reach` from the start, at factors below `end`."""
    tried = []

    def find(start, factor):
        tried.append((start.factor, factor))
        near = abs(factor - start.factor) <= reach and factor < end
        return Found(factor, (1.0,) * (iterations + 1), "" if near else "too far")

    return find, tried


def test_the_whole_way_is_tried_first():
    find, tried = search(reach=1.0)
    found = follow(START, (0.5, 1.0), find, taken, BY)
    assert tried == [(0.0, 0.5), (0.5, 1.0)]
    assert [factor for factor, _ in found.states] == [0.5, 1.0]
    assert [spent for _, spent in found.states] == [1, 1]
    assert (found.reached, found.failure) == (1.0, "")


def test_increments_are_halved_where_none_is_found_and_doubled_where_it_is_easy():
    find, tried = search(reach=0.25)
    found = follow(START, (1.0,), find, taken, BY)
    assert tried[:4] == [(0.0, 1.0), (0.0, 0.5), (0.0, 0.25), (0.25, 0.75)]
    assert [spent for _, spent in found.states] == [len(tried)]
    slow, tried_slowly = search(reach=0.25, iterations=3)
    follow(START, (1.0,), slow, taken, BY)
    assert tried_slowly[2:] == [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_path_ends_at_the_last_equilibrium_and_says_where_it_failed(sign):
    """It is told apart to the smallest increment; a factor may be negative."""

    def find(_start, factor):
        return Found(factor, (1.0, 0.0), "unstable" if abs(factor) > 0.6 else "")

    found = follow(START, (0.5 * sign, sign), find, taken, BY)
    assert [factor for factor, _ in found.states] == [0.5 * sign]
    assert found.reached == 0.5 * sign
    assert found.failure == f"unstable at {sign * 0.625:.4g} times the load"


def test_only_iterations_that_leave_more_than_a_tenth_count_to_a_limit():
    assert slow_iterations([]) == 0
    assert slow_iterations([1.0]) == 0
    assert slow_iterations([1.0, 0.05, 1e-3, 1e-7]) == 0
    assert slow_iterations([1.0, 0.5, 2.0, 0.01, 0.0099]) == 3
