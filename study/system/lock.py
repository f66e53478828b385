"""A file lock for one process at a time, which the system releases when its holder ends."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

FAR = 1 << 30
"""Offset of the byte locked on Windows, beyond the content: a locked byte cannot be read."""
UNKNOWN = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}
"""Errors of file systems without locks."""


class HeldError(ValueError):
    """Another process holds the lock; the text is its process id, empty if unknown."""


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the lock of a file, which exists only meanwhile.

    HeldError if another process, or this one, holds it; OSError if the file cannot be created. A
    process that dies leaves the file behind, but not the lock. On a file system without locks every
    process gets the lock.
    """
    descriptor = _taken(path)
    try:
        with suppress(OSError):  # on a full disk the lock is held without a process id
            os.ftruncate(descriptor, 0)
            os.write(descriptor, str(os.getpid()).encode())
        yield
    finally:
        with suppress(OSError):  # Windows removes no open file, and the folder may be gone
            path.unlink()
        os.close(descriptor)


def _taken(path: Path) -> int:
    """Descriptor of the locked file at the path.

    The previous holder may have removed the file between opening and locking it.
    """
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            _lock(descriptor)
        except BlockingIOError:
            holder = os.read(descriptor, 20).decode(errors="replace").strip()
            os.close(descriptor)
            raise HeldError(holder) from None
        if _is_at(descriptor, path):
            return descriptor
        os.close(descriptor)


def _lock(descriptor: int) -> None:
    """Lock an open file. BlockingIOError if another process has locked it."""
    try:
        if sys.platform == "win32":
            os.lseek(descriptor, FAR, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            os.lseek(descriptor, 0, os.SEEK_SET)
        else:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in {errno.EACCES, errno.EDEADLOCK}:  # the errors on Windows
            os.lseek(descriptor, 0, os.SEEK_SET)
            raise BlockingIOError from None
        if error.errno not in UNKNOWN:
            raise


def _is_at(descriptor: int, path: Path) -> bool:
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), path.stat())
    return False
