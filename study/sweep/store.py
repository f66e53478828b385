"""Results of finished runs on disk, a file for each under its key.

A file is written aside and moved into place, so it is whole or absent, also when two sweeps share a
folder: they write equal results. What it holds is checked against its name and its own SHA-256, and
a file that fails is as good as none.
"""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from study.sweep.canonical import Plain, canonical, digest
from study.sweep.program import program
from study.sweep.task import Task, key


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
        """Make the folder. ValueError if it cannot be written, before anything is computed."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._unwritable(error) from None
        if not os.access(self.folder, os.W_OK | os.X_OK):
            raise ValueError(f"{self.folder}: may not be written; choose another folder")

    def get(self, task: Task) -> Stored | None:
        """The result of a task, or None if there is none that can be believed."""
        return _read(self._path(task.key))

    def put(self, task: Task, value: Plain, wall: float) -> None:
        """Keep the result of a task. ValueError if it cannot be written."""
        stored = Stored(task.function, task.arguments, program(task.module), value, wall)
        path = self._path(task.key)
        aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
        record = vars(stored)
        try:
            _write(aside, canonical(record | {"sha256": digest(record)}))
            aside.replace(path)
        except OSError as error:
            raise self._unwritable(error) from None
        finally:
            aside.unlink(missing_ok=True)

    def __iter__(self) -> Iterator[Stored]:
        """All results that can be believed, of any program."""
        paths = sorted(self.folder.glob("[!.]*.json")) if self.folder.is_dir() else []
        yield from (stored for stored in map(_read, paths) if stored is not None)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    def _unwritable(self, error: OSError) -> ValueError:
        return ValueError(
            f"{self.folder}: cannot be written ({error.strerror}); free space or choose another "
            "folder, and start again: what is kept is not computed twice"
        )


def _write(path: Path, text: str) -> None:
    """To the disk itself, so that a power cut leaves no empty file under a result's name."""
    with path.open("x", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _read(path: Path) -> Stored | None:
    """The result in a file, None if it is missing, damaged or another's."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        whole = record.pop("sha256") == digest(record)
        stored = Stored(**record)
        named = key(stored.function, stored.arguments, stored.program)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
    return stored if whole and named == path.stem else None
