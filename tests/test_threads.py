"""Parts of a product in the threads that a process is allowed."""

import os
from functools import partial
from threading import get_ident

import pytest

from study.stages import threads as own_threads
from study.stages.threads import side_by_side, threads


@pytest.fixture(autouse=True)
def _two_processors(monkeypatch):
    monkeypatch.setattr(own_threads, "available", lambda: 2)


def seen(count=2):
    """Threads that parts ran in, in their order."""
    found = [0] * count
    side_by_side(*(partial(lambda n: found.__setitem__(n, get_ident()), n) for n in range(count)))
    return found


def test_a_process_has_one_thread_unless_it_is_told():
    assert set(seen()) == {get_ident()}
    with threads(1):
        assert set(seen()) == {get_ident()}


def test_the_second_part_has_the_second_thread():
    with threads(2):
        first, second = seen()
        assert first == get_ident() != second
        assert seen() == [first, second]  # the same again
        assert set(seen(1)) == {first}
    assert set(seen()) == {first}


def test_there_are_no_more_threads_than_processors(monkeypatch):
    monkeypatch.setattr(own_threads, "available", lambda: 1)
    with threads(8):
        assert set(seen()) == {get_ident()}


@pytest.mark.parametrize("which", [0, 1])
def test_what_a_part_raises_is_raised_once_both_have_ended(which):
    ended = []

    def part(number):
        if number == which:
            raise ZeroDivisionError
        ended.append(number)

    with threads(2), pytest.raises(ZeroDivisionError):
        side_by_side(partial(part, 0), partial(part, 1))
    assert ended == [1 - which]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_fork_has_a_second_thread_of_its_own():
    with threads(2):
        seen()  # the thread of this process, which the fork has not
        child = os.fork()
        if child == 0:
            os._exit(0 if len(set(seen())) == 2 else 1)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
