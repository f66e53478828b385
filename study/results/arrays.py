"""Arrays of a results folder: read from .npz, and checked for their names and shapes."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]
Shapes = Mapping[str, str]
"""Names of arrays, and a letter per dimension: equal letters are equal numbers."""

DAMAGED = (
    *(OSError, ValueError, EOFError, KeyError, NotImplementedError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)
"""Exceptions of numpy and zipfile for truncated or altered files."""


def read(path: Path) -> Arrays:
    """Arrays of a file, empty if it is missing. ValueError naming a file that holds no arrays."""
    if not path.exists():
        return {}
    try:
        with path.open("rb") as file:  # numpy leaves a file open that it takes for no .npz
            found = np.load(file, allow_pickle=False)
            if not isinstance(found, np.lib.npyio.NpzFile):
                raise ValueError("it is no .npz file")  # noqa: TRY004 - the file is at fault
            with found:
                return {name: found[name] for name in found.files}
    except DAMAGED as error:
        raise ValueError(f"{path.name}: cannot be read ({error or type(error).__name__})") from None


def check_names(file: str, arrays: Arrays, wanted: list[str]) -> None:
    """Raise ValueError for a missing or unexpected array."""
    for name in wanted:
        if name not in arrays:
            raise ValueError(f"{file}: array {name} is missing")
    for name in arrays:
        if name not in wanted:
            raise ValueError(f"{file}: array {name} is of no model or system of the scene")


def check_shapes(file: str, arrays: Arrays, shapes: Shapes, known: Mapping[str, int]) -> None:
    """Raise ValueError for an array of another shape; a name ending in ? may be empty instead.

    `known`: numbers that letters stand for; the others are taken from the first array that has
    them. A digit stands for itself.
    """
    sizes = {str(digit): digit for digit in range(10)} | dict(known)
    for name, letters in shapes.items():
        array = arrays[name.removesuffix("?")]
        if name.endswith("?") and array.size == 0:
            continue
        if array.ndim == len(letters):
            for letter, size in zip(letters, array.shape, strict=True):
                sizes.setdefault(letter, size)
        wanted = tuple(sizes.get(letter) for letter in letters)
        if array.shape != wanted:
            shown = tuple(sizes.get(letter, letter) for letter in letters)
            raise ValueError(
                f"{file}: array {name.removesuffix('?')} has shape {array.shape}, not {shown}"
            )


def check_numbers(file: str, arrays: Arrays, texts: tuple[str, ...] = ()) -> None:
    """Raise ValueError for an array that is not of finite numbers, or of texts where required."""
    for name, array in arrays.items():
        kinds = "U" if name.endswith(texts or ("\0",)) else "fiub"
        if array.dtype.kind not in kinds and array.size:
            raise ValueError(f"{file}: array {name} is of {array.dtype}")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ValueError(f"{file}: array {name} holds what is no finite number")
