"""A given count of numbers from a stream, as text or binary."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from study.mesh.kinds import MeshError
from study.mesh.text import numbers_of


def read_numbers(stream: BytesIO, dtype: DTypeLike, count: int, binary: bool) -> NDArray[Any]:
    """Next `count` numbers; as text they fill whole lines.

    Nothing is allocated before the numbers are there, so an absurd count does no harm.

    Raises
    ------
    MeshError
        If there are fewer, or something other than numbers.
    """
    kind = np.dtype(dtype)
    return _binary(stream, kind, count) if binary else _text(stream, kind, count)


def _binary(stream: BytesIO, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
    available = stream.getbuffer().nbytes - stream.tell()
    if count * dtype.itemsize > available:
        raise MeshError(_cut_off(count, available // dtype.itemsize))
    return np.frombuffer(stream.read(count * dtype.itemsize), dtype)


def _text(stream: BytesIO, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
    words: list[bytes] = []
    while len(words) < count and (line := stream.readline()):
        words += line.split()
    if len(words) != count:
        raise MeshError(_cut_off(count, len(words)))
    return numbers_of(words, dtype)


def _cut_off(announced: int, found: int) -> str:
    return f"{announced} numbers are announced but {found} found: damaged, export it again"
