"""Folders that are written aside and moved into place at once."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

Foreign = Callable[[set[str]], str | None]
"""Of the names in a folder, one that it must not lose, if there is any."""


class FolderError(ValueError):
    """A folder that cannot be written or must not be replaced; the message says what to do."""


@contextmanager
def replacing(folder: Path, foreign: Foreign, writer: str) -> Iterator[Path]:
    """A folder beside `folder` that takes its place when the block ends without an exception.

    FolderError before the block if `folder` holds what no `writer` wrote, or cannot be written.
    """
    folder = folder.resolve()
    _check(folder, foreign, writer)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as error:
        raise FolderError(f"{folder}: cannot be written ({error.strerror})") from None
    try:
        partial = aside / "new"
        partial.mkdir()
        yield partial
        if folder.exists():
            folder.replace(aside / "old")
        partial.replace(folder)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def refuse_unwritable(folder: Path, foreign: Foreign, writer: str) -> None:
    """FolderError if `replacing` would refuse the folder; nothing is left behind."""
    folder = folder.resolve()
    _check(folder, foreign, writer)
    parent = folder.parent
    while not parent.exists():
        parent = parent.parent
    try:
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=parent):
            pass
    except OSError as error:
        raise FolderError(f"{folder}: cannot be written ({error.strerror})") from None


def refuse_unwritable_file(path: Path, flag: str) -> None:
    """FolderError if a file cannot be made or replaced, which is tried and left as it was."""
    try:
        if path.is_dir():
            raise FolderError(f"{flag} {path}: is a folder; name a file in it")
        if not path.parent.is_dir():
            raise FolderError(f"{flag} {path}: there is no folder {path.parent}; make it first")
        is_new = not path.exists()
        with path.open("ab"):
            pass
        if is_new:
            path.unlink()
    except OSError as error:
        raise FolderError(f"{flag} {path}: cannot be written ({error.strerror})") from None


def _check(folder: Path, foreign: Foreign, writer: str) -> None:
    if folder == Path.cwd():
        raise FolderError(f"{folder}: is the current folder; give --out another")
    try:
        if folder.exists() and not folder.is_dir():
            raise FolderError(f"{folder}: is a file; give --out a folder")
        found = foreign({path.name for path in folder.iterdir()}) if folder.is_dir() else None
    except OSError as error:  # a name too long, a folder that may not be looked into
        raise FolderError(f"{folder}: cannot be written ({error.strerror})") from None
    if found is not None:
        raise FolderError(
            f"{folder}: holds {found}, which no {writer} wrote; give --out another folder"
        )
