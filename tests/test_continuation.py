"""Paths of growing load: where increments are halved and doubled, and where they end."""

from typing import NamedTuple

import pytest

from study.problem.continuation import Increments, follow

BY = Increments(easy=2, smallest=1 / 8, unit="the load")


class Found(NamedTuple):
    factor: float
    residuals: tuple[float, ...]
    failure: str = ""


START = Found(0.0, ())


def search(*, reach, end=2.0, iterations=1):
    """A rest wherever the start is no further off than `reach`, and the factor below `end`."""
    tried = []

    def rest(start, factor):
        tried.append((start.factor, factor))
        near = abs(factor - start.factor) <= reach and factor < end
        return Found(factor, (1.0,) * (iterations + 1), "" if near else "too far")

    return rest, tried


def test_the_whole_way_is_tried_first():
    rest, tried = search(reach=1.0)
    found = follow(START, (0.5, 1.0), rest, BY)
    assert tried == [(0.0, 0.5), (0.5, 1.0)]
    assert [one.factor for one in found.rests] == [0.5, 1.0]
    assert found.iterations == (1, 1)
    assert (found.reached, found.failure) == (1.0, "")


def test_increments_are_halved_where_none_is_found_and_doubled_where_it_is_easy():
    rest, tried = search(reach=0.25)
    found = follow(START, (1.0,), rest, BY)
    assert tried[:4] == [(0.0, 1.0), (0.0, 0.5), (0.0, 0.25), (0.25, 0.75)]
    assert found.iterations == (len(tried),)
    slow, tried_slowly = search(reach=0.25, iterations=3)
    follow(START, (1.0,), slow, BY)
    assert tried_slowly[2:] == [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_path_ends_at_the_last_rest_and_says_where_it_failed(sign):
    """It is told apart to the smallest increment; a factor may be negative."""

    def rest(_start, factor):
        return Found(factor, (1.0, 0.0), "the body gives way" if abs(factor) > 0.6 else "")

    found = follow(START, (0.5 * sign, sign), rest, BY)
    assert [one.factor for one in found.rests] == [0.5 * sign]
    assert found.reached == 0.5 * sign
    assert found.failure == f"the body gives way at {sign * 0.625:.4g} times the load"
