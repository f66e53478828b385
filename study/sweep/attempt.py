"""Call the function of one task, in this process or in a worker."""

from __future__ import annotations

import importlib
import json
import time
from typing import Literal, NamedTuple

from study.sweep.canonical import Plain, canonical
from study.sweep.program import program

Status = Literal["done", "failed", "crashed"]


class Attempt(NamedTuple):
    """How one call ended, after `wall` seconds; `value` only if it succeeded."""

    status: Status
    value: Plain | None
    message: str
    wall: float


def attempt(function: str, arguments: str, identity: str) -> Attempt:
    """Call a function with the arguments in a JSON text.

    Whatever it raises is an outcome. ValueError only if the program of this process differs from
    that of `identity`, since the result would not belong to it.
    """
    module, _, name = function.partition(":")
    if program(module) != identity:
        raise ValueError(
            "its sources or libraries differ from those here, or were edited since the sweep began"
        )
    start = time.perf_counter()
    try:
        called = getattr(importlib.import_module(module), name)
        start = time.perf_counter()  # a first import is no part of the run
        value = _plain(called(**json.loads(arguments)))
    except Exception as error:  # the run's own, whatever it is
        message = f"{type(error).__name__}: {error}"
        return Attempt("failed", None, message, time.perf_counter() - start)
    return Attempt("done", value, "", time.perf_counter() - start)


def _plain(value: object) -> Plain:
    """The value as it would be read back from the store, wherever it was computed."""
    if not isinstance(value, dict):
        raise TypeError(f"returned {type(value).__name__}, not a dictionary")
    return dict(json.loads(canonical(value)))
