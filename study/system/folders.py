"""Folders and files that are written under a temporary name and moved into place at once.

A folder is claimed by a lock for as long as it is being written. What a killed program left beside
it is reported and removed by the next one that claims it.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from study.system import lock

Foreign = Callable[[set[str]], str | None]
"""Given the names in a folder, one that must not be lost, or None."""

OLD, NEW = "old", "new"
"""Names in the temporary folder: the replaced content, and the one that replaces it."""
OF_THE_MACHINE = {errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
"""Errors that another place or name does not remedy."""

NO_PLACE = (FileNotFoundError, NotADirectoryError, IsADirectoryError, PermissionError)
"""Errors of writing a file that another place remedies."""


class FolderError(ValueError):
    """A place that cannot be written or must not be replaced; the message states the remedy."""


@contextmanager
def replacing(folder: Path, foreign: Foreign, writer: str) -> Iterator[Path]:
    """A folder beside `folder` that replaces it when the block ends without an exception.

    FolderError before the block if `folder` holds content that no `writer` wrote, cannot be
    written, or is being written by another process. Files that somebody puts there meanwhile are
    preserved. A failure leaves nothing new. An OSError of the block names `folder`.
    """
    _check_name(folder, "--out")
    shown, folder = folder, folder.resolve()
    _check(folder, foreign, writer)
    with claimed(shown):
        aside = _aside(folder)
        try:
            partial = aside / NEW
            partial.mkdir()
            with naming(shown, aside):
                yield partial
                if folder.exists():
                    folder.replace(aside / OLD)
                partial.replace(folder)
                _bring_back(aside / OLD, folder, foreign)
        finally:
            _settle(aside, folder)


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Keep other processes from writing a folder, which need not exist, while the block runs.

    FolderError if another process writes it, or if it cannot exist. Parent folders are created, and
    removed again if they stay empty.
    """
    _check_name(folder, "--out")
    shown, folder = folder, folder.resolve()
    with _parents(folder), ExitStack() as stack:
        try:
            stack.enter_context(lock.held(folder.with_name(f".{folder.name}.lock")))
        except lock.HeldError as held:
            number = f" (process {held})" if str(held) else ""
            raise FolderError(
                f"{shown}: is being written by another run{number}; wait for it to end, or give "
                "--out another folder"
            ) from None
        except OSError as error:
            raise refusal(shown, error) from None
        _clear(folder)
        yield


@contextmanager
def naming(shown: Path, aside: Path | None = None) -> Iterator[None]:
    """Let an OSError of the block name `shown` if it names no file, or only a temporary one."""
    try:
        yield
    except OSError as error:
        if error.filename is None or (aside and str(error.filename).startswith(str(aside))):
            error.filename, error.filename2 = str(shown), None
        raise


@contextmanager
def making(folder: Path) -> Iterator[None]:
    """A folder to write files into in the block; a failure removes it, unless it existed before."""
    found = folder.exists()
    try:
        with naming(folder):
            folder.mkdir(parents=True, exist_ok=True)
            yield
    except BaseException:
        if not found:
            shutil.rmtree(folder, ignore_errors=True)
        raise


def check_file(path: Path) -> None:
    """Refuse a file of --out that could not be written. FolderError names the remedy."""
    _check_name(path, "--out")
    if path.is_dir():
        raise FolderError(f"--out {path}: is a folder; give a file")
    if path.exists():
        _check_access(path, os.W_OK, "--out")
    elif not path.parent.is_dir():
        raise FolderError(f"--out {path}: there is no folder {path.parent}; make it first")
    else:
        _check_access(path.parent, os.W_OK | os.X_OK, "--out")


def check_folder(folder: Path, flag: str = "--out") -> None:
    """Refuse a folder that could not be created or written. FolderError names the flag."""
    _check_name(folder, flag)
    above = next(path for path in (folder, *folder.absolute().parents) if os.path.lexists(path))
    if not above.is_dir():
        raise FolderError(f"{flag} {folder}: {above} is a file; give a folder")
    _check_access(above, os.W_OK | os.X_OK, flag)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file under a temporary name and move it into place; OSError names it.

    Nothing is half written. What is no regular file, such as /dev/stdout, is written directly.
    """
    path = path.resolve()
    with naming(path):
        if path.exists() and not path.is_file():
            path.write_bytes(content)
            return
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        aside = Path(name)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            aside.chmod(_mode(path))
            aside.replace(path)
        finally:
            aside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8 as `write_bytes` does; lines end in a line feed."""
    write_bytes(path, text.encode())


def tell(text: str) -> None:
    """Print a message on a folder to stderr."""
    print(f"liver-study: {text}", file=sys.stderr, flush=True)  # noqa: T201 - its job


def refusal(path: Path, error: OSError) -> Exception:
    """The exception for a place that cannot be written, before anything is computed."""
    if error.errno in OF_THE_MACHINE:
        return error
    return FolderError(f"{path}: cannot be written ({error.strerror}); choose another folder")


# --- steps -------------------------------------------------------------------------------------


def _bring_back(old: Path, folder: Path, foreign: Foreign) -> None:
    """Move what no writer wrote from the replaced folder into the new one."""
    present = {path.name for path in old.iterdir()} if old.is_dir() else set[str]()
    while (found := foreign(present)) in present:
        present.discard(str(found))
        if not (folder / str(found)).exists():
            (old / str(found)).replace(folder / str(found))
            tell(f"{folder / str(found)} was put there meanwhile, and stays")


def refuse_unwritable(folder: Path, foreign: Foreign, writer: str) -> None:
    """Raise FolderError if `replacing` would refuse the folder; nothing is left behind."""
    check_folder(folder)
    _check(folder.resolve(), foreign, writer)


def _check(folder: Path, foreign: Foreign, writer: str) -> None:
    if folder == Path.cwd():
        raise FolderError(f"{folder}: is the current folder; give --out another")
    try:
        if folder.exists() and not folder.is_dir():
            raise FolderError(f"{folder}: is a file; give --out a folder")
        if not folder.is_dir():
            return
        if folder.is_mount() or not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
            what = "is where a disk is mounted" if folder.is_mount() else "may not be written"
            raise FolderError(f"{folder}: {what}; give --out another folder")
        found = foreign({path.name for path in folder.iterdir()})
    except OSError as error:  # the name is too long, or the folder not readable
        raise FolderError(f"{folder}: cannot be written ({error.strerror})") from None
    if found is not None:
        raise FolderError(
            f"{folder}: holds {found}, which no {writer} wrote; give --out another folder"
        )


def _check_access(place: Path, wanted: int, flag: str) -> None:
    if not os.access(place, wanted):
        raise FolderError(f"{flag}: {place} may not be written; give another place")


def _check_name(path: Path, flag: str) -> None:
    """A name may be too long, or empty."""
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise FolderError(f"{flag} {path}: {reason}; give another name") from None


@contextmanager
def _parents(folder: Path) -> Iterator[None]:
    """Create the parent folders; those created are removed again if they stay empty."""
    missing = [path for path in folder.parents if not path.exists()]
    try:
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            if not os.access(folder.parent, os.W_OK | os.X_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        except OSError as error:
            raise refusal(folder, error) from None
        yield
    finally:
        for path in missing:
            with suppress(OSError):
                path.rmdir()


def _aside(folder: Path) -> Path:
    try:
        return Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as error:
        raise refusal(folder, error) from None


def _clear(folder: Path) -> None:
    """Remove temporary folders of killed programs: the holder of the lock has none yet."""
    pattern = re.compile(rf"\.{re.escape(folder.name)}\.[a-z0-9_]{{8}}")
    for path in sorted(folder.parent.iterdir()):
        if pattern.fullmatch(path.name) and path.is_dir() and _is_aside(path):
            _settle(path, folder)
            tell(f"{path}: left by a run that was killed; removed")


def _is_aside(path: Path) -> bool:
    return {inner.name for inner in path.iterdir()} <= {OLD, NEW}


def _settle(aside: Path, folder: Path) -> None:
    """Remove a temporary folder; complete a move into place that was interrupted."""
    if (aside / OLD).exists() and (aside / NEW).exists() and not folder.exists():
        (aside / NEW).replace(folder)
    shutil.rmtree(aside, ignore_errors=True)


def _mode(path: Path) -> int:
    """Permissions that a file written in place would have."""
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0o022)
    os.umask(mask)
    return 0o666 & ~mask
