"""Standard streams that survive their readers: closed ones are opened, broken ones fall silent."""

from __future__ import annotations

import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class _Output(io.FileIO):
    """Standard output. Its reader may leave, as `head` does; the rest is then discarded.

    Another error is raised once, since Python flushes again at exit.
    """

    lost = False

    def write(self, data: ReadableBuffer, /) -> int:
        """See io.RawIOBase."""
        try:
            if not self.lost:
                return super().write(data) or 0
        except BrokenPipeError:
            self.lost = True
        except OSError as error:
            self.lost = True
            error.filename = "standard output"
            raise
        return memoryview(data).nbytes


class _Messages(io.FileIO):
    """Standard error. A message that cannot be written is dropped, and the work continues."""

    def write(self, data: ReadableBuffer, /) -> int:
        """See io.RawIOBase."""
        try:
            return super().write(data) or 0
        except OSError:
            return memoryview(data).nbytes


def prepare() -> None:
    """Make stdout and stderr safe, so that a write to them cannot cost results.

    A closed stream is opened to the null device; otherwise the next opened file would take its
    number and receive the output. A full disk below stdout is still an error.
    """
    if os.name != "posix":
        return
    _open_closed()
    sys.stdout = _guarded(sys.stdout, _Output, 1)
    sys.stderr = _guarded(sys.stderr, _Messages, 2)


def _open_closed() -> None:
    number = os.open(os.devnull, os.O_RDWR)
    while number <= 2:
        os.set_inheritable(number, True)
        number = os.open(os.devnull, os.O_RDWR)
    os.close(number)


def _guarded(stream: TextIO | None, kind: type[io.FileIO], number: int) -> TextIO:
    """A stream with the same settings; one that is not the process's own is left alone."""
    if stream is not None and _number(stream) != number:
        return stream
    return io.TextIOWrapper(
        io.BufferedWriter(kind(number, "w", closefd=False)),
        encoding=None if stream is None else stream.encoding,
        errors="backslashreplace",  # for terminals without Greek letters
        line_buffering=number == 2 or os.isatty(number),
    )


def _number(stream: TextIO) -> int | None:
    try:
        return stream.fileno()
    except (OSError, ValueError):
        return None
