"""Arrays of VTK's XML files: as text, base64 or raw bytes, plain or compressed."""

from __future__ import annotations

import lzma
import re
import zlib
from base64 import b64decode
from binascii import Error as Base64Error
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import MeshError
from study.mesh.text import numbers_of
from study.mesh.vtk_tags import Tag

_TYPES = {
    **{f"Int{8 * size}": f"i{size}" for size in (1, 2, 4, 8)},
    **{f"UInt{8 * size}": f"u{size}" for size in (1, 2, 4, 8)},
    "Float32": "f4",
    "Float64": "f8",
}
_MAX_BYTES = 2**30


class _Stored(NamedTuple):
    """The stored bytes of an array, and what follows them."""

    content: bytes
    raw: bool

    def size(self, count: int) -> int:
        """Space that `count` bytes take in the file."""
        return count if self.raw else -(-count // 3) * 4

    def take(self, start: int, count: int) -> bytes:
        """Bytes from a place in the file on; as base64 they fill whole groups of four letters."""
        part = self.content[start : start + self.size(count)]
        try:
            taken = part if self.raw else b64decode(part, validate=True)
        except Base64Error:
            taken = b""
        if len(taken) < count:
            raise MeshError(f"{count} bytes are announced, {len(taken)} found")
        return taken[:count]


def vtk_array(tag: Tag, tags: list[Tag], data: bytes) -> NDArray[Any]:
    """Numbers of one array of a file, flat.

    VTK itself ends the process on some damaged sizes and takes what is left of a truncated array
    for the whole; here every size is checked before it is used.

    Raises
    ------
    MeshError
        If the array is damaged or truncated, naming it.
    """
    try:
        return _array(tag, tags, data)
    except (MeshError, ValueError, OverflowError) as error:
        name = f"{tag.parent} {tag.given.get('Name', '')[:40]}".strip()
        raise MeshError(f"array {name} cannot be read ({error}): truncated or damaged") from error


def _array(tag: Tag, tags: list[Tag], data: bytes) -> NDArray[Any]:
    kind, file = tag.given.get("type", ""), tags[0].given
    if kind not in _TYPES:
        raise MeshError(f"type {kind[:40]!r} is not one of {', '.join(_TYPES)}")
    order = ">" if file.get("byte_order") == "BigEndian" else "<"
    if tag.given.get("format", "ascii") == "ascii":
        return numbers_of(_content(tag, data).split(), _TYPES[kind])
    word = np.dtype(order + ("u8" if file.get("header_type") == "UInt64" else "u4"))
    stored = _stored(tag, tags, data)
    if "compressor" in file:
        unpacked = _compressed(stored, word, _unpacker(file["compressor"]))
    else:
        unpacked = _plain(stored, word)
    return np.frombuffer(unpacked, np.dtype(order + _TYPES[kind]))


def _content(tag: Tag, data: bytes) -> bytes:
    """Text of an array element, without its child elements, which describe it."""
    return re.sub(rb"<(\w+)\b.*</\1\s*>|<[^>]*>", b"", data[tag.start : tag.end], flags=re.DOTALL)


def _stored(tag: Tag, tags: list[Tag], data: bytes) -> _Stored:
    if tag.given["format"] != "appended":
        return _Stored(b"".join(_content(tag, data).split()), raw=False)
    section, offset = tags[-1], tag.given.get("offset", "")
    start = data.find(b"_", section.start)
    if section.name != "AppendedData" or start < 0 or not re.fullmatch(r"[0-9]{1,12}", offset):
        raise MeshError(f"no appended data at offset {offset[:40]!r}")
    return _Stored(data[start + 1 + int(offset) :], section.given.get("encoding") == "raw")


def _plain(stored: _Stored, word: np.dtype[Any]) -> bytes:
    header = stored.content[: stored.size(word.itemsize)]
    (count,) = np.frombuffer(stored.take(0, word.itemsize), word).tolist()
    _check_room(count, stored)
    if count and not stored.raw and header.endswith(b"=" * (-word.itemsize % 3)):
        # Encoded by itself, as some writers do.
        return stored.take(len(header), count)
    return stored.take(0, word.itemsize + count)[word.itemsize :]


def _check_room(count: int, stored: _Stored) -> None:
    if count > len(stored.content):
        raise MeshError(f"{count} bytes are announced, {len(stored.content)} found")


def _compressed(
    stored: _Stored, word: np.dtype[Any], unpack: Callable[[bytes, int], bytes]
) -> bytes:
    """Compressed blocks of equal size, except perhaps the last; their sizes come first."""
    first = np.frombuffer(stored.take(0, 3 * word.itemsize), word).tolist()
    blocks, block, last = first
    _check_room(blocks, stored)
    header = stored.take(0, (3 + blocks) * word.itemsize)
    packed = np.frombuffer(header, word).tolist()[3:]
    sizes = [block] * (blocks - bool(last)) + [last] * bool(last and blocks)
    _check_room(sum(packed), stored)
    if sum(sizes) > _MAX_BYTES:
        raise MeshError(f"{sum(sizes)} bytes are announced, the limit is {_MAX_BYTES}")
    body = stored.take(stored.size(len(header)), sum(packed))
    ends = np.cumsum([0, *packed]).tolist()
    return b"".join(
        _exactly(unpack(body[a:b], size), size)
        for a, b, size in zip(ends, ends[1:], sizes, strict=False)
    )


def _exactly(unpacked: bytes, size: int) -> bytes:
    if len(unpacked) != size:
        raise MeshError(f"a block of {size} bytes has {len(unpacked)}")
    return unpacked


def _unpacker(name: str) -> Callable[[bytes, int], bytes]:
    known = {
        "vtkZLibDataCompressor": _unpack_zlib,
        "vtkLZMADataCompressor": _unpack_lzma,
        "vtkLZ4DataCompressor": _unpack_lz4,
    }
    if name not in known:
        raise MeshError(f"compressor {name[:40]} is not one of {', '.join(known)}")
    return known[name]


def _unpack_zlib(block: bytes, size: int) -> bytes:
    try:
        return zlib.decompressobj().decompress(block, max(size, 1))
    except zlib.error as error:
        raise MeshError(str(error)) from error


def _unpack_lzma(block: bytes, size: int) -> bytes:
    try:
        return lzma.LZMADecompressor().decompress(block, max(size, 1))
    except lzma.LZMAError as error:
        raise MeshError(str(error)) from error


def _unpack_lz4(block: bytes, size: int) -> bytes:
    from vtkmodules.vtkCommonCore import vtkCommand
    from vtkmodules.vtkIOCore import vtkLZ4DataCompressor

    unpacked = bytearray(size)
    compressor = vtkLZ4DataCompressor()
    problems: list[str] = []
    compressor.AddObserver(  # or the error goes to the terminal
        vtkCommand.ErrorEvent, lambda _source, _event: problems.append("damaged block")
    )
    found = compressor.Uncompress(block, len(block), unpacked, size)
    return bytes(unpacked[: 0 if problems else found])
