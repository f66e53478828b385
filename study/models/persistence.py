"""What runs write to disk while they run: states to resume from, and nodal fields."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from msm.checkpoint import Checkpoint
from study.results.fields import Mesh, recording

Floats = NDArray[np.float64]
OnSample = Callable[[int, Floats, Floats], None]


@dataclass(frozen=True)
class Persistence:
    """Where runs write, and whether they resume.

    `state`: folder of the states; `resume`: whether to continue from them; `fields`: folder of the
    nodal fields, None to write none.
    """

    state: Path
    resume: bool = False
    fields: Path | None = None


def checkpoint(persistence: Persistence | None, name: str) -> Checkpoint | None:
    """Where the run of a name keeps its state; None if nothing is written."""
    if persistence is None:
        return None
    return Checkpoint(persistence.state / f"{name}.npz", resume=persistence.resume)


@contextmanager
def record_fields(
    persistence: Persistence | None, name: str, mesh: Mesh, times: Floats
) -> Iterator[OnSample]:
    """A function that records each sample; the fields are written to NAME.vtkhdf if wanted."""
    if persistence is None or persistence.fields is None:
        yield lambda *_: None
        return
    raw = persistence.state / f"{name}.frames"
    path = persistence.fields / f"{name}.vtkhdf"
    with recording(path, mesh, times, raw, resume=persistence.resume) as frames:
        yield frames.write


def write_motion(
    persistence: Persistence | None,
    name: str,
    mesh: Mesh,
    times: Floats,
    states: Iterable[Iterable[Floats]],
) -> None:
    """Write a finished motion, if fields are wanted.

    `states`: displacement [m] and velocity [m/s], each (n, 3), of every sample; evaluated only if
    they are written.
    """
    if persistence is None or persistence.fields is None:
        return
    afresh = replace(persistence, resume=False)
    with record_fields(afresh, name, mesh, times) as on_sample:
        for sample, (u, v) in enumerate(states):
            on_sample(sample, u, v)
