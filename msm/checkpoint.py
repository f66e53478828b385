"""The state of a run on disk, from which it continues to the same bits.

A state is written at a sample up to which the steps were found short enough, so nothing in it can
be undone. It holds whatever changes in a run: the motion, how the step is chosen, what the limit is
followed from, and what was recorded.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import struct
import time
import zipfile
import zlib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]

SECONDS = 60.0
"""Of wall time between two states."""
IDENTITY, DIGEST = "identity", "digest"
DAMAGED = (
    *(OSError, ValueError, EOFError, KeyError, NotImplementedError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)
"""What numpy and zipfile raise for a file that is cut or altered."""
CHANGING = {
    "motion": ("sample", "repeated", "wall"),
    "stepper": ("u", "v", "t", "unseen"),
    "pace": ("fraction", "substeps", "now", "at_rest", "margin", "halvings"),
    "standing": ("push", "before", "due", "sums", "force"),
    "follower": ("found", "omega", "mode", "bound", "bound_then", "then"),
    "recorder": ("strain", "inverted", "overlap"),
    "trajectory": ("displacement", "velocity", "volume_field", "surface_field", "tool_force"),
}
"""Attributes of the parts of a run that change as it goes."""


@dataclass(frozen=True)
class Checkpoint:
    """A file that a run keeps its state in, every so many seconds of wall time.

    With `resume` it goes on from the state in the file, if there is one.
    """

    path: Path
    seconds: float = SECONDS
    resume: bool = False


class Keeper:
    """Writes the state of one run from time to time.

    `parts`: the objects named in CHANGING; `identity`: of the run, see `identity`.
    """

    def __init__(self, checkpoint: Checkpoint, identity: str, parts: Mapping[str, object]) -> None:
        self.checkpoint, self.identity, self.parts = checkpoint, identity, parts
        self.written = time.perf_counter()

    def resume(self) -> None:
        """Take the parts to the state in the file, if that is wanted and there is one."""
        if self.checkpoint.resume and self.checkpoint.path.exists():
            put_back(self.parts, read(self.checkpoint.path, self.identity))

    def keep(self, *, last: bool = False) -> None:
        """Write the state if it is time to, and after the `last` sample in any case."""
        if last or time.perf_counter() - self.written >= self.checkpoint.seconds:
            write(self.checkpoint.path, self.identity, gather(self.parts))
            self.written = time.perf_counter()


def gather(parts: Mapping[str, object]) -> Arrays:
    """All that changes in the parts of a run, as part.attribute."""
    return {
        f"{part}.{name}": np.asarray(getattr(parts[part], name))
        for part, names in CHANGING.items()
        for name in names
    }


def put_back(parts: Mapping[str, object], arrays: Arrays) -> None:
    """Set what `gather` took: arrays in place, for they are shared between the parts."""
    for part, names in CHANGING.items():
        for name in names:
            value = arrays[f"{part}.{name}"]
            if value.ndim:
                getattr(parts[part], name)[...] = value
            else:
                setattr(parts[part], name, value.item())


def identity(*things: object) -> str:
    """SHA-256 of nested tuples of arrays, numbers and texts, types and shapes included."""
    digest = hashlib.sha256()
    for piece in _pieces(things):
        digest.update(piece)
    return digest.hexdigest()


def program(*used: Callable[..., object]) -> str:
    """SHA-256 of this package's sources and the versions of what runs them.

    And of the files of functions that are `used`, for laws and integrators may come from elsewhere.
    """
    files = {Path(inspect.unwrap(function).__code__.co_filename) for function in used}
    files |= set(Path(__file__).parent.rglob("*.py"))
    texts = tuple(
        (source.name, source.read_text(encoding="utf-8"))
        for source in sorted(files)
        if source.is_file()  # and not typed into a prompt
    )
    return identity(texts, np.__version__, numba.__version__)


def _pieces(thing: object) -> Iterable[bytes]:
    yield type(thing).__name__.encode() + b" "
    if isinstance(thing, tuple):
        for part in thing:
            yield from _pieces(part)
        yield b"end "
    elif isinstance(thing, np.ndarray | np.generic):
        yield f"{thing.dtype.str} {thing.shape} ".encode()
        yield np.ascontiguousarray(thing).tobytes()
    elif isinstance(thing, str | int | float | None):
        yield f"{thing!r} ".encode()
    else:
        raise TypeError(f"cannot identify a run by a {type(thing).__name__}")


def write(path: Path, found: str, arrays: Arrays) -> None:
    """Write a state aside and move it into place, so that a crash leaves the one before."""
    aside = path.with_name(f".{path.name}")
    marks = {IDENTITY: np.array(found), DIGEST: np.array(digest(arrays))}
    try:
        with aside.open("wb") as file:
            np.savez(file, allow_pickle=False, **marks, **arrays)
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    except BaseException:
        with suppress(OSError):
            aside.unlink(missing_ok=True)
        raise


def digest(arrays: Arrays) -> str:
    """SHA-256 of the names and contents of arrays."""
    return identity(tuple((name, arrays[name]) for name in sorted(arrays)))


def read(path: Path, wanted: str) -> Arrays:
    """The state in a file. ValueError if it is damaged or of another run than `wanted`."""
    try:
        arrays = _load(path)
        content = str(arrays.pop(DIGEST, ""))
    except DAMAGED as error:
        told = str(error) or type(error).__name__
        raise ValueError(f"{path}: damaged state of a run ({told}); run without --resume") from None
    if str(arrays.pop(IDENTITY, "")) != wanted:
        raise ValueError(
            f"{path}: the state of another run: the organ, a material, the load, the step, what is "
            "recorded or the program has changed since; undo that, or run without --resume"
        )
    if content != digest(arrays):
        raise ValueError(
            f"{path}: damaged state of a run (its arrays are not those that were written); run "
            "without --resume"
        )
    return arrays


def _load(path: Path) -> Arrays:
    with path.open("rb") as raw:
        found = np.load(raw, allow_pickle=False)
        if not isinstance(found, np.lib.npyio.NpzFile):
            raise ValueError("it is no .npz file")  # noqa: TRY004 - the file is at fault
        with found as file:
            return {name: file[name] for name in file.files}
