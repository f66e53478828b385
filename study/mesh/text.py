"""Numbers from text lines, with errors that name the line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from study.mesh.kinds import FloatArray, MeshError

NumberedLine = tuple[int, list[str]]
"""1-based line number, and the words of the line after its keyword."""


def text_lines(data: bytes) -> list[str]:
    """Lines of a text file with any of the three line endings, without a byte order mark."""
    text = data.removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def unit_note(text: str) -> list[str]:
    """A note if a header or a comment names a unit, since only a declared one counts."""
    found = re.search(r"\bunits?\s*[:= ]\s*([a-z]{1,12})\b", text, re.IGNORECASE)
    return [f"`{found[0]}` in the file is not used: `organ.unit` says the unit"] if found else []


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
    # Python reads 1_0 as 10, which no mesh file means.
    grouped = any("_" in word for _, words in lines for word in words[:count])
    if rows.shape == (len(lines), count) and not grouped:
        return rows
    if not lines:
        return np.empty((0, count))
    raise MeshError(_complaint(lines, count))


def whole(word: str) -> int:
    """The whole number a word stands for; ValueError if it is none.

    Python reads 1_0 as 10, which no mesh file means.
    """
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", word):
        raise ValueError(f"`{word[:40]}` is not a whole number")
    return int(word)


def refuse_surplus(lines: Sequence[NumberedLine], count: int, what: str) -> None:
    """MeshError naming the first line with more words than it should have."""
    for number, words in lines:
        if len(words) > count:
            raise MeshError(
                f"line {number}: {what} has {count} numbers, found `{' '.join(words)[:60]}`: "
                "damaged, export it again"
            )


def numbers_of(words: Sequence[bytes], dtype: DTypeLike) -> NDArray[Any]:
    """Words as numbers of a type, shape (words,).

    Raises
    ------
    MeshError
        Naming the first word that is none; with an underscore it is none, though NumPy skips that.
    """
    kind = np.dtype(dtype)
    if not any(b"_" in word for word in words):
        with suppress(ValueError, OverflowError):
            return np.array(words, dtype=bytes).astype(kind) if words else np.empty(0, kind)
    word = next((one for one in words if not _fits(one, kind)), b"")
    what = "number" if kind.kind == "f" else f"whole number ({kind.name})"
    raise MeshError(f"`{word.decode('latin-1')[:40]}` is no {what}")


def _fits(word: bytes, kind: np.dtype[Any]) -> bool:
    try:
        np.array([word], dtype=bytes).astype(kind)
    except (ValueError, OverflowError):
        return False
    return b"_" not in word


def whole_numbers(found: NDArray[Any], what: str) -> NDArray[np.int64]:
    """Node numbers or offsets as integers; MeshError if a file has fractions of them."""
    with np.errstate(invalid="ignore"):
        taken = found.astype(np.int64)
    if np.any(taken != found):
        raise MeshError(f"{what} are not whole numbers: damaged, export it again")
    return taken


def _complaint(lines: Sequence[NumberedLine], count: int) -> str:
    for number, words in lines:
        if len(words) < count or not all(is_number(word) for word in words[:count]):
            return f"line {number}: expected {count} numbers, found `{' '.join(words)[:60]}`"
    raise AssertionError("every line is readable")  # pragma: no cover


def is_number(word: str | bytes) -> bool:
    """Whether a word is one number; with an underscore it is none, though Python takes it."""
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word if isinstance(word, bytes) else "_" not in word
