"""The only place that touches meshio, which ends the process on files it cannot read."""

from __future__ import annotations

import re
import warnings
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np

from study.mesh.kinds import MeshError
from study.mesh.raw import RawMesh, raw_mesh

_MAX_COUNT = 20_000_000


def read_with_meshio(path: Path, data: bytes, file_format: str) -> RawMesh:
    """Read with one of meshio's readers, quietly.

    The content is looked at first for what these readers get wrong: they wait for ever on a
    truncated PLY or OFF header, take a cut-off file for complete and believe any announced count.

    Raises
    ------
    MeshError
        Whatever goes wrong, including the reader's attempt to exit.
    """
    _PRECHECKS[file_format](data)
    import meshio

    printed = StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = meshio.read(path, file_format)
    except (Exception, SystemExit) as error:
        reason = " ".join(printed.getvalue().split()) or f"{type(error).__name__}: {error}"
        raise MeshError(f"cannot be read as {file_format} ({reason[:300]})") from error
    points = np.asarray(mesh.points)
    if points.ndim != 2 or points.shape[1] != 3:
        raise MeshError(f"node coordinates have shape {points.shape} instead of (n, 3)")
    if file_format == "vtk":
        sizes = [np.size(block.data) for block in mesh.cells]
        _compare_counts(data, sum(len(block.data) for block in mesh.cells), sum(sizes))
    return raw_mesh(points, [(block.type, block.data) for block in mesh.cells])


def _check_vtu(data: bytes) -> None:
    """An XML document without declarations of its own: those can unfold without bound."""
    start = data.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not start.startswith(b"<") or b"\0" in start[:4]:
        raise MeshError("not a VTU file in an ASCII-compatible encoding; export it as UTF-8")
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise MeshError("declares a DOCTYPE, which no VTU file needs; remove it")


def _check_vtk(data: bytes) -> None:
    found = re.search(rb"^\s*DATASET\s+(\w+)", data[:4096], re.MULTILINE | re.IGNORECASE)
    name = found[1].decode() if found else "missing"
    if name.upper() != "UNSTRUCTURED_GRID":
        raise MeshError(f"VTK data set {name}; only UNSTRUCTURED_GRID and POLYDATA can be read")
    _check_announced(data, rb"^(?:POINTS|CELLS|CELL_TYPES)\s+(\d+)(?:\s+(\d+))?")


def _compare_counts(data: bytes, cells: int, entries: int) -> None:
    """Compare cells and node numbers read with those announced; older files count sizes too."""
    announced = re.search(
        rb"^CELLS\s+\d+\s+(\d+).*^CELL_TYPES\s+(\d+)", data, re.MULTILINE | re.DOTALL
    )
    if not announced:
        raise MeshError("no CELLS or no CELL_TYPES: truncated, export it again")
    if int(announced[2]) != cells or int(announced[1]) not in {entries, entries + cells}:
        raise MeshError(
            f"{int(announced[2])} cells with {int(announced[1])} entries are announced, but "
            f"{cells} with {entries} node numbers found: truncated, or a type that cannot be read"
        )


def _check_ply(data: bytes) -> None:
    header, end, _ = data[:65536].partition(b"end_header")
    if not end or not re.search(rb"\n\s*\Z", header):
        raise MeshError("no `end_header` in the first 64 kB: truncated, or not a PLY file")
    _check_announced(header, rb"^element\s+\w+\s+(\d+)")


def _check_off(data: bytes) -> None:
    if not re.match(rb"OFF\s*\n(?:\s*(?:#[^\n]*)?\n)*\s*\d+ \d+ \d+\s*\n", data):
        raise MeshError("does not begin with OFF and a line `nodes faces edges`: truncated?")
    _check_announced(data[:65536], rb"^\s*(\d+) (\d+) \d+\s*$")


def _check_announced(data: bytes, pattern: bytes) -> None:
    for found in re.finditer(pattern, data, re.MULTILINE):
        largest = max(int(count[:20]) for count in found.groups(b"0"))
        if largest > _MAX_COUNT:
            raise MeshError(f"announces {largest} entries, the limit is {_MAX_COUNT}")


_PRECHECKS = {
    "vtu": _check_vtu,
    "vtk": _check_vtk,
    "ply": _check_ply,
    "off": _check_off,
}
