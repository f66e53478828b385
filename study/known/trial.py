"""One case, run so that it ends: in findings, a refusal, an error, or at its time limit."""

from __future__ import annotations

import ctypes
import math
import threading
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from importlib import import_module
from typing import Any

from study.known.finding import Finding
from study.sweep.canonical import Plain


class OverrunError(Exception):
    """A case exceeded its time limit."""


def trial(function: str, arguments: Plain, seconds: float) -> Plain:
    """The findings of a case as plain values; a number that is not finite is None."""
    return {"findings": [_plain(found) for found in attempted(function, arguments, seconds)]}


def attempted(function: str, arguments: Mapping[str, Any], seconds: float) -> tuple[Finding, ...]:
    """The findings of a case; those before a failure are discarded.

    A ValueError is a refusal. Any other exception is an error, and so is a warning: in a run it
    would reach the user from a library and not from the program.
    """
    try:
        with warnings.catch_warnings(), time_limit(seconds):
            warnings.simplefilter("error")
            module, name = function.split(":")
            found = getattr(import_module(module), name)(**arguments)
            return (found,) if isinstance(found, Finding) else tuple(found)
    except ValueError as error:
        return (Finding("refused", message=str(error)),)
    except OverrunError:
        return (Finding("error", message=f"did not end within {seconds:g} s"),)
    except Exception as error:  # whatever it is, it is what the case found
        return (Finding("error", message=f"{type(error).__name__}: {error}"),)


def _plain(finding: Finding) -> Plain:
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in asdict(finding).items()
    }


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise OverrunError in this thread after `seconds`, wherever Python code is running.

    A signal would work in the main thread only, and workers run their tasks in others. Compiled
    code is not interrupted: the error is raised when it returns.
    """
    here, lock, ended = threading.get_ident(), threading.Lock(), False

    def interrupt() -> None:
        with lock:
            if not ended:
                _raise_in(here, OverrunError)

    timer = threading.Timer(seconds, interrupt)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            ended = True
        timer.cancel()


def _raise_in(thread: int, error: type[Exception]) -> None:
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(error))
