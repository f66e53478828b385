"""What a stage depends on, as one text: the values it is given, and the program that it runs.

A value is told by what is in it, with the names of its classes and functions, whose sources, and
all that these import, are the program. What has no such text, such as a function made within
another, makes a stage that is not kept.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import platform
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import FunctionType, MethodType, NoneType
from typing import Any

from study.sweep.canonical import digest
from study.sweep.program import program

KEEPING = ("study.stages.serialisation", "study.stages.store")
"""Modules that what is kept passes through."""


class NoFingerprintError(TypeError):
    """A value that has no text of its own."""


def key(stage: str, *things: object, modules: tuple[str, ...] = ()) -> str | None:
    """SHA-256 of a stage's name, of what it is given, and of the program; None if it has none.

    `modules`: names of those that the stage runs beside the classes and functions in its values.
    """
    found: set[str] = {*modules, *KEEPING}
    try:
        descriptions = [_description(thing, found) for thing in things]
        programs = {name: program(name) for name in sorted(found)}
    except (NoFingerprintError, ValueError):
        return None
    return digest([stage, descriptions, programs, machine()])


def text(thing: object) -> str:
    """SHA-256 of a value alone. NotToldError if it has no text."""
    return digest(_description(thing, set()))


@functools.cache
def machine() -> list[str]:
    """What rounding depends on beside the program, and what a wall time is one of."""
    return [platform.system(), platform.machine(), platform.processor(), *_processor()]


def _processor() -> list[str]:
    """Name and instructions of the processor as Linux tells them."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
    return sorted({line for line in lines if line.startswith(("model name", "flags"))})


@functools.singledispatch
def _description(thing: Any, modules: set[str]) -> Any:
    """Of an object: its fields, or the array that it is."""
    if dataclasses.is_dataclass(thing):
        return [_class(thing, modules), *_fields(thing, modules)]
    array = getattr(thing, "__array__", None)
    if array is None:
        raise NoFingerprintError(f"a {type(thing).__name__} has no text")
    values = array()
    if values.dtype.hasobject:
        raise NoFingerprintError(f"an array of {values.dtype} has no text")
    return [values.dtype.str, list(values.shape), hashlib.sha256(values.tobytes()).hexdigest()]


@_description.register(NoneType)
@_description.register(int)
@_description.register(str)
def _plain(thing: int | str | None, _: set[str]) -> Any:
    return thing


@_description.register(float)
def _number(thing: float, _: set[str]) -> Any:
    return thing.hex()


@_description.register(tuple)
@_description.register(list)
def _sequence(thing: Sequence[Any], modules: set[str]) -> Any:
    return [_class(thing, modules), *(_description(one, modules) for one in thing)]


@_description.register(Mapping)
def _mapping(thing: Mapping[Any, Any], modules: set[str]) -> Any:
    return [
        "by name",
        *([_description(k, modules), _description(v, modules)] for k, v in thing.items()),
    ]


@_description.register(functools.partial)
def _partial(thing: functools.partial[Any], modules: set[str]) -> Any:
    return [
        "partial",
        *(_description(x, modules) for x in (thing.func, thing.args, thing.keywords)),
    ]


@_description.register(MethodType)
def _method(thing: MethodType, modules: set[str]) -> Any:
    return ["method", thing.__name__, _description(thing.__self__, modules)]


@_description.register(type)
@_description.register(FunctionType)
def _named(thing: Any, modules: set[str]) -> Any:
    """Module and name of what stands at the top of a module."""
    if thing.__module__ == "builtins":
        return thing.__qualname__
    if "<" in thing.__qualname__:  # within a function, and so of what that was given
        raise NoFingerprintError(f"{thing.__qualname__} is made within a function")
    modules.add(thing.__module__)
    return f"{thing.__module__}:{thing.__qualname__}"


def _fields(thing: Any, modules: set[str]) -> Iterator[Any]:
    for one in dataclasses.fields(thing):
        yield [one.name, _description(getattr(thing, one.name), modules)]


def _class(thing: object, modules: set[str]) -> Any:
    return _named(type(thing), modules)
