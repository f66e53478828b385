"""Numbers out of text lines, with errors that name the line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from study.mesh.kinds import FloatArray, MeshError

NumberedLine = tuple[int, list[str]]
"""1-based line number, and the words of the line after its keyword."""


def lines_starting(text: str, keyword: str) -> list[NumberedLine]:
    """Every line whose first word is the keyword."""
    split = ((number, line.split()) for number, line in enumerate(text.split("\n"), start=1))
    return [(number, words[1:]) for number, words in split if words and words[0] == keyword]


def floats(lines: Sequence[NumberedLine], count: int) -> FloatArray:
    """First `count` numbers of every line, shape (lines, count).

    Raises
    ------
    MeshError
        Naming the first line that has too few words or something other than a number.
    """
    try:
        rows = np.array([words[:count] for _, words in lines], dtype=float)
    except ValueError:
        rows = np.empty((0, 0))
    if rows.shape == (len(lines), count):
        return rows
    if not lines:
        return np.empty((0, count))
    raise MeshError(_complaint(lines, count))


def _complaint(lines: Sequence[NumberedLine], count: int) -> str:
    for number, words in lines:
        if len(words) < count or not all(_is_number(word) for word in words[:count]):
            return f"line {number}: expected {count} numbers, found `{' '.join(words)[:60]}`"
    raise AssertionError("every line is readable")  # pragma: no cover


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
