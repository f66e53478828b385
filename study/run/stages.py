"""The stages of a run: each result is taken from the store if present, else computed and stored.

A stage is a function, with a key of everything that it depends on. Stages that do not depend on
each other run side by side.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Generic, TypeVar

from study.results.records import StageRecord
from study.stages.job_pool import Job, JobPool
from study.stages.serialisation import flattened, restored
from study.stages.store import Entry, Store, shown_size
from study.sweep.status import duration
from study.system.folders import tell
from study.system.progress import Progress

T = TypeVar("T")


@dataclass(frozen=True)
class RunOptions:
    """Resources and options of a run.

    `store`: read unless `fresh`; `workers`: number of processes; `mesh`: file for the tetrahedra,
    None to write none; `minutes`: time limit of each model, None for no limit.
    """

    store: Store | None = None
    fresh: bool = False
    workers: int = 1
    mesh: Path | None = None
    minutes: float | None = None


SERIAL = RunOptions()
"""Nothing is stored, and one stage runs after another."""


@dataclass(frozen=True)
class Stage(Generic[T]):
    """A function that computes a value of type `kind`, with the key of everything it depends on.

    `key`: None for a stage that cannot be stored; `readable`: whether a stored value will do;
    `lasting`: whether a value is worth storing.
    """

    name: str
    kind: type[T]
    key: str | None
    work: Callable[[Progress], T]
    readable: bool = True
    lasting: Callable[[T], bool] = lambda _: True


@dataclass(frozen=True)
class _Found:
    """The value of a stage, and the record of how it was obtained."""

    value: Any
    record: StageRecord


class Stages:
    """The stages of one run, on its pool of processes."""

    def __init__(self, options: RunOptions, job_pool: JobPool, progress: Progress) -> None:
        self.options, self.job_pool, self.progress = options, job_pool, progress
        self.found: dict[str, _Found] = {}

    def cached(self, stage: Stage[T]) -> T | None:
        """The stored value of a stage; None if there is none, or if it must not be read."""
        store = self.options.store
        if store is None or stage.key is None or self.options.fresh or not stage.readable:
            return None
        entry = store.get(stage.key)
        if entry is None:
            return None
        try:
            value = restored(stage.kind, entry.value, entry.arrays)
        except ValueError:
            return None
        self.found[stage.name] = _Found(value, _record(stage.name, entry, kept=True))
        return value

    def compute(self, stage: Stage[T]) -> T:
        """The value of a stage, stored or computed in this process."""
        value = self.cached(stage)
        if value is None:
            self.found[stage.name] = found = _computed(stage, self.options.store, self.progress)
            value = found.value
        return value

    def start(self, stage: Stage[T]) -> None:
        """Compute a stage in the pool, and store it."""
        store = self.options.store
        self.job_pool.start(Job(stage.name, lambda progress: _computed(stage, store, progress)))

    def start_background(self, name: str, work: Callable[[], None]) -> None:
        """Let a free process do work whose only effect is to make later stages faster."""
        self.job_pool.start(Job(name, lambda _: work()))

    def results(self) -> dict[str, Any]:
        """Values of all stages by name, after those that were started have ended."""
        given = self.job_pool.results()
        self.found |= {name: one for name, one in given.items() if isinstance(one, _Found)}
        return {name: found.value for name, found in self.found.items()}

    def records(self) -> tuple[StageRecord, ...]:
        """Records of all stages: how long each took, and when."""
        return tuple(found.record for found in self.found.values())


def _computed(stage: Stage[T], store: Store | None, progress: Progress) -> _Found:
    started = time.perf_counter()
    value = stage.work(progress)
    entry = Entry(None, {}, time.perf_counter() - started, time.time())
    if store is not None and stage.key is not None and stage.lasting(value):
        _keep(stage, value, store, entry.wall)
    return _Found(value, _record(stage.name, entry, kept=False))


def _keep(stage: Stage[T], value: T, store: Store, wall: float) -> None:
    """Store the value of a stage; a failure costs the next run time, and does not end this one."""
    assert stage.key is not None  # noqa: S101 - as was asked
    try:
        store.put(stage.key, *flattened(value), wall)
    except (OSError, TypeError) as error:
        tell(f"{stage.name}: not kept for the next run ({error})")


def _record(name: str, entry: Entry, *, kept: bool) -> StageRecord:
    at = datetime.fromtimestamp(entry.measured, UTC).isoformat(timespec="seconds")
    return StageRecord(name=name, wall_s=entry.wall, measured_at=at, kept=kept)


def store_summary(records: Sequence[StageRecord], store: Store) -> str:
    """One line: the stages that were taken from the store, and the size of the store."""
    kept = [one.name for one in records if one.kept]
    seconds = sum(one.wall_s for one in records if one.kept)
    what = f"kept from earlier runs, {duration(seconds)} of work: {', '.join(kept)}"
    size = f"{shown_size(store.size())} of at most {shown_size(store.limit)}"
    return f"{what if kept else 'no stage was kept before'}; the store {store.folder} has {size}"
