"""One program at a time: a lock that the system drops when its holder ends, however it ends."""

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
"""Byte that is locked on Windows, beyond what is written: a locked one cannot be read."""
UNKNOWN = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}
"""What a file system answers that knows no locks."""


class HeldError(ValueError):
    """Another process holds the lock; the text is its number, empty if that is not known."""


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the lock of a file, which is there only meanwhile.

    HeldError if another process, or this one, holds it; OSError if the file cannot be made. A
    process that dies leaves the file behind, not the lock. A file system without locks grants all.
    """
    descriptor = _taken(path)
    try:
        with suppress(OSError):  # on a full disk it is held without a name
            os.ftruncate(descriptor, 0)
            os.write(descriptor, str(os.getpid()).encode())
        yield
    finally:
        with suppress(OSError):  # as on Windows, which removes no open file, and in a lost folder
            path.unlink()
        os.close(descriptor)


def _taken(path: Path) -> int:
    """Descriptor of the locked file that is at the path.

    Whoever held it before may have removed the file that was opened here.
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
    """Lock an open file. BlockingIOError if another has."""
    try:
        if sys.platform == "win32":
            os.lseek(descriptor, FAR, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            os.lseek(descriptor, 0, os.SEEK_SET)
        else:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in {errno.EACCES, errno.EDEADLOCK}:  # Windows says so
            os.lseek(descriptor, 0, os.SEEK_SET)
            raise BlockingIOError from None
        if error.errno not in UNKNOWN:
            raise


def _is_at(descriptor: int, path: Path) -> bool:
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), path.stat())
    return False
