"""Results of finished runs on disk, one file per key.

A file is written under a temporary name and moved into place, so that it is complete or absent,
also when two sweeps share a folder: they write equal results. Its content is verified against its
name and its own SHA-256, and a file that fails is treated as missing.
"""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from study.sweep.canonical import Plain, canonical, digest
from study.sweep.program import program
from study.sweep.task import Task, key
from study.system.folders import FolderError, naming, refusal


@dataclass(frozen=True)
class Stored:
    """A finished run: what was called, what it returned, in how many seconds."""

    function: str
    arguments: Plain
    program: str
    value: Plain
    wall: float


@dataclass(frozen=True)
class Store:
    """A folder of results."""

    folder: Path

    def prepare(self) -> None:
        """Create the folder. FolderError if it is not writable, before anything is computed."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise refusal(self.folder, error) from None
        if not os.access(self.folder, os.W_OK | os.X_OK):
            raise FolderError(f"{self.folder}: may not be written; choose another folder")

    def tidy(self) -> None:
        """Remove the folder if it is empty."""
        with suppress(OSError):
            self.folder.rmdir()

    def advice(self) -> str:
        """How to continue after an interruption."""
        if not any(self.folder.glob("[!.]*.json")):
            return "nothing was kept yet: start again"
        return f"start again: what is kept in {self.folder} is not computed twice"

    def get(self, task: Task) -> Stored | None:
        """The result of a task, or None if there is no valid one."""
        return _read(self._path(task.key))

    def put(self, task: Task, value: Plain, wall: float) -> None:
        """Store the result of a task. OSError that says how to continue if it cannot be written."""
        stored = Stored(task.function, task.arguments, program(task.module), value, wall)
        path = self._path(task.key)
        aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
        record = vars(stored)
        try:
            with naming(self.folder, aside):
                _write(aside, canonical(record | {"sha256": digest(record)}))
                aside.replace(path)
        finally:
            with suppress(OSError):  # the folder may not exist
                aside.unlink(missing_ok=True)

    def __iter__(self) -> Iterator[Stored]:
        """All valid results, of any program."""
        paths = sorted(self.folder.glob("[!.]*.json")) if self.folder.is_dir() else []
        yield from (stored for stored in map(_read, paths) if stored is not None)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"


def _write(path: Path, text: str) -> None:
    """Write and flush to the disk, so that a power cut leaves no empty file under a name."""
    with path.open("x", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _read(path: Path) -> Stored | None:
    """The result in a file, None if it is missing, damaged or of another key."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        whole = record.pop("sha256") == digest(record)
        stored = Stored(**record)
        named = key(stored.function, stored.arguments, stored.program)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
    return stored if whole and named == path.stem else None
