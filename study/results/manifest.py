"""SHA256SUMS: checksums of a results folder, which `sha256sum -c SHA256SUMS` verifies too.

The reports are not included, since they can be made again.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path

from study.results.errors import ResultsError
from study.results.tables import TABLES

NAME = "SHA256SUMS"
REPORT, PAGE = "report.pdf", "report.html"
FIELDS = ".vtkhdf"
MESH = "mesh.msh"
"""The tetrahedra of a run, if requested."""
DATA = frozenset(
    {
        *("results.json", "scene.toml", "fields.npz", "fuzzy.npz", MESH),
        *(table.file for table in TABLES),
    }
)
ALWAYS = DATA - {
    *("fields.npz", "fuzzy.npz", MESH),
    *(table.file for table in TABLES if table.of_tools),
}
"""Files of every run; fields, fuzzy systems and rigid tools depend on the scene."""
LINE = re.compile(r"(?P<digest>[0-9a-f]{64}) [ *](?P<name>[^/\0]+)")
REMEDY = "restore the folder as the run left it, or run the scene again"
HDF5 = b"\x89HDF\r\n\x1a\n"
HDF5_END = {0: 40, 1: 44, 2: 28, 3: 28}
"""Offset in a superblock of each version at which the length of the file is stated."""


def digest(path: Path) -> str:
    """SHA-256 of a file, read in pieces."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of each data file of a folder, by name."""
    return {name: digest(folder / name) for name in _present(folder)}


def write(folder: Path, sums: Mapping[str, str]) -> None:
    """Write the checksums of a folder's files."""
    lines = [f"{found}  {name}\n" for name, found in sorted(sums.items())]
    (folder / NAME).write_text("".join(lines), encoding="utf-8")


def read(folder: Path) -> dict[str, str]:
    """Checksums by name. ResultsError naming a malformed line, or a file that is omitted."""
    path = folder / NAME
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        raise ResultsError(f"{path}: is missing; {REMEDY}") from None
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: cannot be read ({error}); {REMEDY}") from None
    sums: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        found = LINE.fullmatch(line)
        if found is None or found["name"] in sums:
            raise ResultsError(f"{path}, line {number}: no checksum of another file; {REMEDY}")
        sums[found["name"]] = found["digest"]
    for name in sorted(ALWAYS - sums.keys()):
        raise ResultsError(f"{path}: has no checksum of {name}; {REMEDY}")
    return sums


def altered(folder: Path) -> tuple[str, ...]:
    """Names of files whose checksums differ from those of the run.

    Fields of all nodes may be large and are not read here, so only their length is checked.
    ResultsError for a file that is missing, truncated or not of the run.
    """
    sums = read(folder)
    for name in sorted(sums):
        if not (folder / name).is_file():
            raise ResultsError(f"{folder / name}: is missing; {REMEDY}")
    for name in _present(folder):
        if name not in sums:
            raise ResultsError(
                f"{folder / name}: is not of this run ({NAME} does not name it); remove it, or run "
                "the scene again"
            )
    large = [name for name in sums if name.endswith(FIELDS)]
    for name in large:
        _check_length(folder / name)
    small = sorted(sums.keys() - set(large))
    return tuple(name for name in small if digest(folder / name) != sums[name])


def _present(folder: Path) -> list[str]:
    """Data files of a folder; hidden ones are still being written."""
    names = (path.name for path in folder.iterdir())
    return sorted(
        name for name in names if name in DATA or (name.endswith(FIELDS) and name[0] != ".")
    )


def _check_length(path: Path) -> None:
    """An HDF5 file states its length in its header. ResultsError if it is shorter."""
    with path.open("rb") as file:
        head = file.read(64)
    at = HDF5_END.get(head[8]) if len(head) == 64 and head.startswith(HDF5) else None
    if at is None:
        raise ResultsError(f"{path}: is no HDF5 file; {REMEDY}")
    size, end = path.stat().st_size, int.from_bytes(head[at : at + 8], "little")
    if size < end:
        raise ResultsError(f"{path}: is cut, {size} bytes of {end}; {REMEDY}")
