"""The stages of a run: each is taken from the store if it is there, else computed and kept.

A stage is a function with the key of all that it depends on. Those that depend on no other run side
by side.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Generic, TypeVar

from study.folders import tell
from study.progress import Progress
from study.results.records import StageRecord
from study.stages.job_pool import Job, JobPool
from study.stages.serialisation import flattened, restored
from study.stages.store import Entry, Store, shown_size
from study.sweep.status import duration

T = TypeVar("T")


@dataclass(frozen=True)
class RunOptions:
    """What a run may use: a store, read unless `fresh`, and so many processes side by side.

    `mesh`: file to keep the tetrahedra in, if they are wanted; `minutes`: most that a model may
    take, None for no end.
    """

    store: Store | None = None
    fresh: bool = False
    workers: int = 1
    mesh: Path | None = None
    minutes: float | None = None


SERIAL = RunOptions()
"""Nothing is kept, and one stage runs after another."""


@dataclass(frozen=True)
class Stage(Generic[T]):
    """What gives a value of a kind, under the key of all it depends on, None if it has no such.

    `readable`: whether what is kept will do; `lasting`: whether a value is worth keeping.
    """

    name: str
    kind: type[T]
    key: str | None
    work: Callable[[Progress], T]
    readable: bool = True
    lasting: Callable[[T], bool] = lambda _: True


@dataclass(frozen=True)
class _Found:
    """What a stage gave, and the record of it."""

    value: Any
    record: StageRecord


class Stages:
    """Stages of one run, on the lanes that it has."""

    def __init__(self, options: RunOptions, job_pool: JobPool, progress: Progress) -> None:
        self.options, self.job_pool, self.progress = options, job_pool, progress
        self.found: dict[str, _Found] = {}

    def kept(self, stage: Stage[T]) -> T | None:
        """What the store has of a stage, None if nothing, or if it must not be read."""
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

    def now(self, stage: Stage[T]) -> T:
        """The value of a stage, kept or computed here and now."""
        value = self.kept(stage)
        if value is None:
            self.found[stage.name] = found = _computed(stage, self.options.store, self.progress)
            value = found.value
        return value

    def start(self, stage: Stage[T]) -> None:
        """Compute a stage, beside others if there are lanes, and keep it."""
        store = self.options.store
        self.job_pool.start(Job(stage.name, lambda progress: _computed(stage, store, progress)))

    def beside(self, name: str, work: Callable[[], None]) -> None:
        """Let something be done on a lane that is free, by which what follows takes less time."""
        self.job_pool.start(Job(name, lambda _: work()))

    def results(self) -> dict[str, Any]:
        """Values of all stages by name, once those that were started have ended."""
        given = self.job_pool.results()
        self.found |= {name: one for name, one in given.items() if isinstance(one, _Found)}
        return {name: found.value for name, found in self.found.items()}

    def records(self) -> tuple[StageRecord, ...]:
        """Of all stages, how long each took, and when."""
        return tuple(found.record for found in self.found.values())


def _computed(stage: Stage[T], store: Store | None, progress: Progress) -> _Found:
    started = time.perf_counter()
    value = stage.work(progress)
    entry = Entry(None, {}, time.perf_counter() - started, time.time())
    if store is not None and stage.key is not None and stage.lasting(value):
        _keep(stage, value, store, entry.wall)
    return _Found(value, _record(stage.name, entry, kept=False))


def _keep(stage: Stage[T], value: T, store: Store, wall: float) -> None:
    """Keep what a stage gave; that it cannot be kept costs the next run time, and not this one."""
    assert stage.key is not None  # noqa: S101 - as was asked
    try:
        store.put(stage.key, *flattened(value), wall)
    except (OSError, TypeError) as error:
        tell(f"{stage.name}: not kept for the next run ({error})")


def _record(name: str, entry: Entry, *, kept: bool) -> StageRecord:
    at = datetime.fromtimestamp(entry.measured, UTC).isoformat(timespec="seconds")
    return StageRecord(name=name, wall_s=entry.wall, measured_at=at, kept=kept)


def store_summary(records: Sequence[StageRecord], store: Store) -> str:
    """For a person: which stages were kept from earlier runs, and how large the store is."""
    kept = [one.name for one in records if one.kept]
    seconds = sum(one.wall_s for one in records if one.kept)
    what = f"kept from earlier runs, {duration(seconds)} of work: {', '.join(kept)}"
    size = f"{shown_size(store.size())} of at most {shown_size(store.limit)}"
    return f"{what if kept else 'no stage was kept before'}; the store {store.folder} has {size}"
