"""Results of stages on disk: one file per key, the least recently used removed beyond a size limit.

A file is written under a temporary name and moved into place, so that it is complete or absent
however a run ends and however many run at once; two runs of the same stage write equal files. It is
an .npz of plain arrays, read without unpickling, and is verified against its own SHA-256 and its
key. A file that fails is treated as missing, and removed.
"""

from __future__ import annotations

import json
import os
import stat
import struct
import sys
import time
import uuid
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study.sweep.canonical import Plain, canonical, digest
from study.system.folders import FolderError, naming, refusal, tell

if TYPE_CHECKING:
    from study.stages.serialisation import Arrays

FOLDER, LIMIT = "LIVER_STUDY_STORE", "LIVER_STUDY_STORE_LIMIT"
"""Environment variables: the folder of the store, and its limit with a unit, such as "4 GB"."""
DEFAULT_LIMIT = 2_000_000_000
UNITS = {"B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
SUFFIX = ".npz"
RECORD, CHECKSUM = "record", "sha256"
STALE_AFTER = 3600.0
"""Age [s] beyond which a temporary file is taken for that of a killed run."""
DAMAGED = (
    *(OSError, ValueError, EOFError, KeyError, TypeError, NotImplementedError, RuntimeError),
    *(MemoryError, RecursionError, AttributeError, zipfile.BadZipFile, zlib.error, struct.error),
)
"""Exceptions of numpy, zipfile and json for truncated or altered files."""


@dataclass(frozen=True)
class Entry:
    """A stored result: a plain value, its arrays, seconds of work, and when it ended [s, UTC]."""

    value: Any
    arrays: Arrays
    wall: float
    measured: float


@dataclass(frozen=True)
class Store:
    """A folder of results, limited to `limit` bytes after each addition."""

    folder: Path
    limit: int = DEFAULT_LIMIT

    def prepare(self) -> None:
        """Create the folder, accessible to its owner only.

        FolderError if it is not writable, or if others could write to it, whose content would be
        trusted.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            state = self.folder.stat()
        except OSError as error:
            raise refusal(self.folder, error) from None
        if not os.access(self.folder, os.R_OK | os.W_OK | os.X_OK):
            raise FolderError(f"{self.folder}: may not be written; give {FOLDER} another folder")
        if _is_open_to_others(state):
            raise FolderError(
                f"{self.folder}: others may write there, so its stages cannot be believed; "
                f"chmod 700 it, or give {FOLDER} another folder"
            )

    def get(self, key: str) -> Entry | None:
        """The result stored under a key, None if there is no valid one."""
        path = self._path(key)
        if not path.exists():
            return None
        found = _read(path, key)
        with suppress(OSError):  # another run may remove it
            if found is None:
                path.unlink()
            else:
                os.utime(path)  # most recently used: removed last
        return found

    def put(self, key: str, value: Any, arrays: Arrays, wall: float) -> Entry:
        """Store a result. OSError naming the folder if it cannot be written."""
        entry = Entry(value, arrays, wall, time.time())
        path = self._path(key)
        aside = path.with_name(f".{uuid.uuid4().hex}{SUFFIX}")
        try:
            with naming(self.folder, aside):
                _write(aside, key, entry)
                aside.replace(path)
        finally:
            with suppress(OSError):
                aside.unlink(missing_ok=True)
        self._evict(path)
        return entry

    def size(self) -> int:
        """Total size of all results in bytes."""
        return sum(state.st_size for _, state in self._files())

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{SUFFIX}"

    def _files(self) -> Iterator[tuple[Path, os.stat_result]]:
        for path in self.folder.glob(f"*{SUFFIX}"):
            with suppress(OSError):  # another run may have removed it
                yield path, path.stat()

    def _evict(self, newest: Path) -> None:
        """Remove the least recently used results beyond the limit, and files of killed runs.

        The newest stays: otherwise a result larger than the limit would be computed for nothing.
        """
        files = sorted(self._files(), key=lambda file: file[1].st_mtime)
        excess = sum(state.st_size for _, state in files) - self.limit
        for path, state in files:
            is_left = path.name.startswith(".") and state.st_mtime < time.time() - STALE_AFTER
            if is_left or (excess > 0 and path != newest and not path.name.startswith(".")):
                excess -= state.st_size
                with suppress(OSError):
                    path.unlink()


def user_store() -> Store | None:
    """The store of this user, as the environment names it, ready for use.

    ValueError for an unsuitable folder or limit in the environment. If the user's own cache folder
    is unsuitable, there is no store, and a message says so.
    """
    named = os.environ.get(FOLDER)
    store = Store(Path(named).absolute() if named else _user_cache(), _limit())
    try:
        store.prepare()
    except (FolderError, OSError) as error:
        if named:
            raise
        tell(f"stages are not kept for the next run: {error}")
        return None
    return store


def _user_cache() -> Path:
    """The operating system's folder for data that a program can recompute."""
    given = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    if given and Path(given).is_absolute():
        return Path(given) / "liver-study"
    home = Path.home()
    return home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "liver-study"


def _limit() -> int:
    text = os.environ.get(LIMIT)
    if not text:
        return DEFAULT_LIMIT
    number, unit = text.strip().rstrip("BKMGTbkmgt "), text.strip().lstrip("0123456789. ").upper()
    try:
        return round(float(number) * UNITS[unit])
    except (ValueError, KeyError, OverflowError):
        raise ValueError(
            f'{LIMIT}: {text} is no size; give a number and one of {", ".join(UNITS)}, "4 GB"'
        ) from None


def shown_size(count: int) -> str:
    """A number of bytes as text: "12 MB"."""
    unit = max((u for u in UNITS if UNITS[u] <= max(count, 1)), key=UNITS.__getitem__)
    return f"{count / UNITS[unit]:.3g} {unit}"


# --- files ---------------------------------------------------------------------------------------


def _is_open_to_others(state: os.stat_result) -> bool:
    """Whether another user may write to a folder, where the system has such permissions."""
    if not hasattr(os, "geteuid"):
        return False
    return state.st_uid != os.geteuid() or bool(state.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


def _write(path: Path, key: str, entry: Entry) -> None:
    """Write and flush to the disk, so that a power cut leaves no empty file under a key."""
    import numpy as np

    text = canonical({"key": key, "value": entry.value, "wall": entry.wall, "at": entry.measured})
    arrays = entry.arrays
    marks = {RECORD: np.array(text), CHECKSUM: np.array(_checksum(text, arrays))}
    with path.open("xb") as file:
        np.savez(file, allow_pickle=False, **marks, **arrays)
        file.flush()
        os.fsync(file.fileno())


def _read(path: Path, key: str) -> Entry | None:
    import numpy as np

    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
            arrays: Arrays = {name: found[name] for name in found.files}
        text, seal = str(arrays.pop(RECORD)), str(arrays.pop(CHECKSUM))
        record: Plain = json.loads(text)
        if seal != _checksum(text, arrays) or record["key"] != key:
            return None
        return Entry(record["value"], arrays, record["wall"], record["at"])
    except DAMAGED:
        return None


def _checksum(text: str, arrays: Arrays) -> str:
    """SHA-256 of the record and of each array with its name, type and shape."""
    import hashlib

    return digest(
        [text]
        + [
            [name, a.dtype.str, list(a.shape), hashlib.sha256(a.tobytes()).hexdigest()]
            for name, a in sorted(arrays.items())
        ]
    )
