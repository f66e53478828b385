"""Plain values: one text for equal ones, its SHA-256, and dataclasses made of them again."""

from __future__ import annotations

import hashlib
import json
from typing import Any, TypeVar

Plain = dict[str, Any]
"""What JSON can say, by name: arguments and values of runs that go to other processes."""
Value = TypeVar("Value")


def canonical(thing: object) -> str:
    """JSON with sorted keys and no spaces. ValueError if the thing is not plain, or not finite."""
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
    """A dataclass from its plain values, as a run returned or a store kept them."""
    from pydantic import TypeAdapter

    return TypeAdapter(kind).validate_python(value)
