"""Dataclasses as plain JSON values and arrays, and back by their type annotations.

An array is represented by its name among the arrays, and a number that is not finite, for which
JSON has no notation, by its text. The type of a restored value is the one that the reader requests,
never one that the stored text names.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]
Value = TypeVar("Value")

ARRAY, NUMBER = "array", "number"
NUMERIC = (bool, int, float)


def flattened(thing: object) -> tuple[Any, Arrays]:
    """A plain value of nested dataclasses, tuples and dictionaries, and the arrays in it.

    TypeError for anything else than these, numbers, texts, arrays and None.
    """
    arrays: Arrays = {}
    return _plain(thing, arrays), arrays


def _plain(thing: object, arrays: Arrays) -> Any:
    if isinstance(thing, np.generic):
        thing = thing.item()
    if thing is None or isinstance(thing, bool | int | str):
        return thing
    if isinstance(thing, float):
        return thing if math.isfinite(thing) else {NUMBER: repr(thing)}
    if isinstance(thing, np.ndarray):
        name = f"{ARRAY}{len(arrays)}"
        arrays[name] = thing
        return {ARRAY: name}
    return _of_many(thing, arrays)


def _of_many(thing: object, arrays: Arrays) -> Any:
    if isinstance(thing, tuple | list):
        return [_plain(one, arrays) for one in thing]
    if isinstance(thing, dict):
        return [[_plain(key, arrays), _plain(value, arrays)] for key, value in thing.items()]
    if dataclasses.is_dataclass(thing):
        return {f.name: _plain(getattr(thing, f.name), arrays) for f in dataclasses.fields(thing)}
    raise TypeError(f"cannot keep a {type(thing).__name__}")


def restored(kind: type[Value], plain: Any, arrays: Mapping[str, NDArray[Any]]) -> Value:
    """A value of type `kind` from the output of `flattened`. ValueError if it has another type."""
    try:
        found: Value = _made(kind, plain, arrays)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"holds no {kind.__name__} ({error})") from None
    return found


def _made(kind: Any, plain: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in {Union, UnionType}:
        (other,) = (one for one in arguments if one is not NoneType)
        return None if plain is None else _made(other, plain, arrays)
    if origin is np.ndarray:
        return arrays[plain[ARRAY]]
    if origin is tuple:
        kinds = arguments[:1] * len(plain) if arguments[-1] is ... else arguments
        return tuple(_made(one, value, arrays) for one, value in zip(kinds, plain, strict=True))
    if origin is dict:
        key, value = arguments
        return {_made(key, k, arrays): _made(value, v, arrays) for k, v in plain}
    if origin is Literal:
        return _among(plain, arguments)
    return _of_class(kind, plain, arrays)


def _of_class(kind: Any, plain: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    hints = _hints(kind)
    if dataclasses.is_dataclass(kind):
        return kind(**{name: _made(hints[name], value, arrays) for name, value in plain.items()})  # type: ignore[operator] # a class
    if hints:  # a named tuple
        pairs = zip(hints.values(), plain, strict=True)
        return kind(*(_made(hint, value, arrays) for hint, value in pairs))
    if kind is float and isinstance(plain, dict):
        return float(plain[NUMBER])
    if type(plain) is not kind and not (kind is float and type(plain) is int):
        raise TypeError(f"{plain!r} is no {kind.__name__}")
    return plain


def _among(plain: Any, allowed: tuple[Any, ...]) -> Any:
    if plain not in allowed:
        raise KeyError(plain)
    return plain


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return {} if kind in {*NUMERIC, str, NoneType} else get_type_hints(kind)
