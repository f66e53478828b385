"""How a process ends: its streams, its signals, its exit code."""

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from study.system import signals
from study.system.folders import claimed

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = f"{shlex.quote(sys.executable)} -m study"
PAPER = "run paper --no-report --set fuzzy.sensitivity_readings=0 --out out"
TRIP = """
import os, signal, sys

class Trip:
    def find_spec(self, name, *_):
        if name == {word!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), {number})

sys.meta_path.insert(0, Trip())
sys.argv[1:] = {words!r}
from study.__main__ import main
main()
"""


def shell(line, cwd):
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )


def tripped(word, number, *words, cwd, **options):
    """A process that gets a signal as it begins to import a module."""
    code = TRIP.format(word=word, number=int(number), words=list(words))
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        **options,
    )


STREAMS = {
    ">&-": 0,
    "2>&-": 0,
    "<&- >&- 2>&-": 0,
    "2>/dev/full": 0,
    "| head -0": 0,
    "2>&1 | head -0": 0,
    ">/dev/full": 3,
    ">/dev/full 2>&1": 3,
}
"""Redirection -> exit code of a command that does its work."""


@pytest.mark.parametrize("streams", STREAMS)
def test_streams_that_are_closed_broken_or_full(streams, tmp_path):
    done = shell(f"{PROGRAM} estimate --hcv 9 {streams}", tmp_path)
    assert done.returncode == STREAMS[streams], done.stderr
    for word in ("Traceback", "Exception ignored", "BrokenPipe"):
        assert word not in done.stderr


@pytest.mark.parametrize(
    "streams", ["<&- >&- 2>&-", pytest.param(">/dev/full 2>&1", marks=pytest.mark.slow)]
)
def test_streams_cost_no_results(streams, tmp_path):
    """The run that nobody listens to is the run that is listened to."""
    done = shell(f"{PROGRAM} {PAPER} {streams}", tmp_path)
    assert done.returncode == STREAMS[streams]
    assert {"results.json", "curves.csv"} <= {path.name for path in (tmp_path / "out").iterdir()}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    for path in (tmp_path / "out").iterdir():  # nor was a file taken for a stream
        assert b"warning:" not in path.read_bytes()


def test_a_refusal_that_nobody_hears_has_its_code(tmp_path):
    assert shell(f"{PROGRAM} run livr 2>&-", tmp_path).returncode == 2
    assert shell(f"{PROGRAM} run livr >&- 2>/dev/full", tmp_path).returncode == 2


def test_a_terminal_without_greek_letters_is_answered(tmp_path):
    done = shell(f"PYTHONIOENCODING=ascii {PROGRAM} estimate --hcv 9 --explain", tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("word", ["cyclopts", "study.run.study"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_amid_the_imports_is_a_message(word, number, tmp_path):
    done = tripped(word, number, *shlex.split(PAPER), cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"liver-study: {signals.message_for(number)}")
    assert not list(tmp_path.iterdir())


def test_a_signal_that_is_ignored_stays_so(tmp_path):
    """As nohup and a shell's background jobs want it."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        done = tripped("study.commands.run", signal.SIGHUP, "scenes", cwd=tmp_path)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert done.returncode == 0, done.stderr


def test_a_second_signal_ends_at_once(monkeypatch):
    """However long it takes to unwind from the first."""

    def leave(code):
        raise SystemExit(code)

    monkeypatch.setattr(signals, "_asked", [])
    monkeypatch.setattr(os, "_exit", leave)
    with pytest.raises(signals.Stopped, match="interrupted"):
        signals.stop(signal.SIGINT, None)
    with pytest.raises(SystemExit) as ended:
        signals.stop(signal.SIGINT, None)
    assert ended.value.code == 3


def test_a_second_run_into_a_folder_is_refused_at_once(tmp_path):
    with claimed(tmp_path / "out"):
        done = shell(f"{PROGRAM} {PAPER}", tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(
        f"liver-study: out: is being written by another run (process {os.getpid()})"
    )
    assert not list(tmp_path.iterdir())


def test_help_states_the_exit_codes(tmp_path):
    assert "3 ended by the" in shell(f"{PROGRAM} --help", tmp_path).stdout
