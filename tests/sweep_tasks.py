"""Functions that tests of the sweep runner have run, here and in workers."""

import os
import signal
import time
from pathlib import Path


def note(log, x):
    """Tell a log file that a run has begun, and in which process, so that a test can count."""
    with Path(log).open("a") as file:
        file.write(f"{x} {os.getpid()}\n")


def square(x, log=None, seconds=0.0):
    if log is not None:
        note(log, x)
    time.sleep(seconds)
    return {"square": x * x, "nothing": None, "list": (x, str(x))}


def fail(x):
    raise ValueError(f"{x} is odd")


def die(x, log):
    """Kill the process that runs it."""
    note(log, x)
    os.kill(os.getpid(), signal.SIGKILL)


def leave(x):
    os._exit(x)


def spin(x, seconds):
    """Keep a core busy for so many seconds of processor time."""
    start = time.thread_time()
    while time.thread_time() - start < seconds:
        pass
    return {"x": x}


def threads():
    return {name: os.environ.get(f"{name}_NUM_THREADS") for name in ("OPENBLAS", "NUMBA")}


def answer(kind):
    """Answers that are not plain, and one that is."""
    return {"nan": {"x": float("nan")}, "set": {"x": {1}}, "number": 3, "plain": {"x": 3}}[kind]
