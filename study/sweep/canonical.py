"""One text for equal plain values, and its SHA-256."""

from __future__ import annotations

import hashlib
import json


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
