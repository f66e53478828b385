"""Checkpoints of a run on disk, from which it resumes bit for bit.

A checkpoint is written at a sample up to which all steps have been accepted, so nothing in it can
be rejected later. It holds everything that changes in a run: the motion, the step control, the
tracking of the critical step, and the recorded samples.
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
"""Wall time between two checkpoints."""
IDENTITY, DIGEST = "identity", "digest"
DAMAGED = (
    *(OSError, ValueError, EOFError, KeyError, NotImplementedError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)
"""Exceptions of numpy and zipfile for a truncated or altered file."""
CHANGING = {
    "progress": ("sample", "repeated", "wall"),
    "stepper": ("u", "v", "t", "unchecked"),
    "steps": ("fraction", "substeps", "current", "at_rest", "margin", "halvings"),
    "contact_state": ("body_force", "previous_gap", "wake_travel", "totals", "tool_force"),
    "tracker": ("updates", "omega", "mode", "bound", "last_bound", "last_displacement"),
    "recorder": ("strain", "inverted", "overlap"),
    "trajectory": ("displacement", "velocity", "volume_field", "surface_field", "tool_force"),
}
"""Attributes that change in a run, by the name of the object that has them."""


@dataclass(frozen=True)
class Checkpoint:
    """A file for the state of a run, written every `seconds` of wall time.

    With `resume`, the run continues from the state in the file, if there is one.
    """

    path: Path
    seconds: float = SECONDS
    resume: bool = False


class Keeper:
    """Writes the state of one run at intervals of wall time.

    `parts`: the objects named in CHANGING; `identity`: hash of the run from `identity`.
    """

    def __init__(self, checkpoint: Checkpoint, identity: str, parts: Mapping[str, object]) -> None:
        self.checkpoint, self.identity, self.parts = checkpoint, identity, parts
        self.written = time.perf_counter()

    def resume(self) -> None:
        """Restore the state in the file, if the checkpoint is to be resumed and the file exists."""
        if self.checkpoint.resume and self.checkpoint.path.exists():
            put_back(self.parts, read(self.checkpoint.path, self.identity))

    def keep(self, *, last: bool = False) -> None:
        """Write the state if it is due, and always after the `last` sample."""
        if last or time.perf_counter() - self.written >= self.checkpoint.seconds:
            write(self.checkpoint.path, self.identity, gather(self.parts))
            self.written = time.perf_counter()


def gather(parts: Mapping[str, object]) -> Arrays:
    """All attributes of CHANGING, by keys `part.attribute`."""
    return {
        f"{part}.{name}": np.asarray(getattr(parts[part], name))
        for part, names in CHANGING.items()
        for name in names
    }


def put_back(parts: Mapping[str, object], arrays: Arrays) -> None:
    """Restore what `gather` returned; arrays in place, since the parts share them."""
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
    """SHA-256 of the sources of this package, of numpy's and of numba's version.

    The source files of the functions `used` enter too: laws and integrators may be of the user.
    """
    files = {Path(inspect.unwrap(function).__code__.co_filename) for function in used}
    files |= set(Path(__file__).parent.rglob("*.py"))
    texts = tuple(
        (source.name, source.read_text(encoding="utf-8"))
        for source in sorted(files)
        if source.is_file()  # a function typed into a prompt has none
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


def write(path: Path, run_identity: str, arrays: Arrays) -> None:
    """Write a state atomically: a crash leaves the previous one."""
    aside = path.with_name(f".{path.name}")
    marks = {IDENTITY: np.array(run_identity), DIGEST: np.array(digest(arrays))}
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
        reason = str(error) or type(error).__name__
        raise ValueError(
            f"{path}: damaged state of a run ({reason}); run without --resume"
        ) from None
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
