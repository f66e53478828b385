"""The key of a stage: a hash of the values that it is given and of the program that it runs.

A value is described by its content and by the names of its classes and functions. The program is
the source of these and of everything that they import. A value that cannot be described, such as a
function defined within another, makes a stage that is not stored.
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
"""Modules that every stored value passes through."""


class NoFingerprintError(TypeError):
    """A value that cannot be described."""


def key(stage: str, *things: object, modules: tuple[str, ...] = ()) -> str | None:
    """SHA-256 of a stage's name, of the values given and of the program; None if there is none.

    `modules`: names of the modules that the stage runs beside the classes and functions in its
    values.
    """
    found: set[str] = {*modules, *KEEPING}
    try:
        descriptions = [_description(thing, found) for thing in things]
        programs = {name: program(name) for name in sorted(found)}
    except (NoFingerprintError, ValueError):
        return None
    return digest([stage, descriptions, programs, machine()])


def fingerprint(thing: object) -> str:
    """SHA-256 of a value alone. NoFingerprintError if it cannot be described."""
    return digest(_description(thing, set()))


@functools.cache
def machine() -> list[str]:
    """What rounding and wall times depend on beside the program."""
    return [platform.system(), platform.machine(), platform.processor(), *_processor()]


def _processor() -> list[str]:
    """Name and instruction set of the processor, as reported by Linux."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
    return sorted({line for line in lines if line.startswith(("model name", "flags"))})


@functools.singledispatch
def _description(thing: Any, modules: set[str]) -> Any:
    """Description of an object: its fields, or the array that it is."""
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
    """Module and name of a class or function defined at the top level of a module."""
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
