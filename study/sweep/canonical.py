"""Plain values: a canonical text, its SHA-256, and dataclasses restored from them."""

from __future__ import annotations

import hashlib
import json
from typing import Any, TypeVar

Plain = dict[str, Any]
"""JSON values by name: arguments and results of runs that go to other processes."""
Value = TypeVar("Value")


def canonical(thing: object) -> str:
    """JSON with sorted keys and no spaces. ValueError if the value is not plain or not finite."""
    try:
        return json.dumps(thing, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError(
            f"{error}; give numbers (none infinite or NaN), texts, lists and dictionaries by text, "
            "and None for what is missing"
        ) from None


def digest(thing: object) -> str:
    """SHA-256 of the canonical text."""
    return hashlib.sha256(canonical(thing).encode()).hexdigest()


def restored(kind: type[Value], value: Plain) -> Value:
    """A dataclass from the plain values that a run returned or a store kept."""
    from pydantic import TypeAdapter

    return TypeAdapter(kind).validate_python(value)
