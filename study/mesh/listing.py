"""Lists shortened to one line of text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from study.mesh.kinds import IndexArray

MOST = 5
"""Items that a line of text shows."""
_NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")


def listing(numbers: IndexArray) -> str:
    """The first few numbers as text."""
    return some(numbers[: MOST + 1].tolist())


def some(things: Sequence[object]) -> str:
    """The first few items as text."""
    shown = ", ".join(str(thing) for thing in things[:MOST])
    return shown + (", ..." if len(things) > MOST else "")


def one_per_kind(notes: Iterable[str]) -> tuple[str, ...]:
    """The notes, with one of each group that differ only in numbers, and their count."""
    kinds: dict[str, list[str]] = {}
    for note in notes:
        kinds.setdefault(_NUMBER.sub("0", note), []).append(note)
    return tuple(
        same[0] if len(same) == 1 else f"{same[0]} (and {len(same) - 1} more such notes)"
        for same in kinds.values()
    )
