"""Models that cannot finish their run: each is a result with a reason, and the others go on."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from study.models.lattice import LatticeModel
from study.models.model import Model, ModelRun, Prepared, Watch
from study.problem.problem import Problem
from study.problem.trajectory import empty_trajectory
from study.problem.unfinished import UnfinishedError
from study.results.records import ModelRecord
from study.system.progress import Advance, Progress

NO_MEMORY = UnfinishedError(
    "the memory that this machine gave did not suffice",
    "give it more, run fewer models side by side (--workers 1), or coarsen the model's mesh "
    "(reference.element_size, lattice.spacing)",
)


def with_time_limit(progress: Progress, minutes: float | None) -> Progress:
    """Progress that ends a model once it has taken so many minutes; None for no limit."""
    return progress if minutes is None else _TimeLimited(progress, minutes)


class _TimeLimited:
    """Raises an UnfinishedError when a model reports progress after its time limit."""

    def __init__(self, progress: Progress, minutes: float) -> None:
        self.progress, self.minutes = progress, minutes
        self.end = time.monotonic() + 60.0 * minutes

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:
        """See Progress."""
        self._stop_late(name, 0.0)
        with self.progress.stage(name) as advance:

            def on_time(share: float) -> None:
                advance(share)
                self._stop_late(name, share)

            yield on_time

    def _stop_late(self, name: str, share: float) -> None:
        if time.monotonic() > self.end:
            raise UnfinishedError(
                f"it took more than {self.minutes:g} min, with {100.0 * share:.0f} % done of the "
                f"stage {name!r}",
                "allow it more with --minutes, or coarsen its mesh (reference.element_size, "
                "lattice.spacing)",
            )


def run_or_unfinished(model: Model, prepared: Prepared, problem: Problem, watch: Watch) -> ModelRun:
    """Run a model; if it cannot finish, a run that states the reason and a remedy."""
    try:
        return prepared.run(watch)
    except UnfinishedError as error:
        return unfinished(model, problem, error)
    except MemoryError:
        return unfinished(model, problem, NO_MEMORY)


def unfinished(model: Model, problem: Problem, why: UnfinishedError) -> ModelRun:
    """A run without a motion, whose record states the reason; it has no numbers and no scores."""
    seen = problem.observation
    nothing = empty_trajectory(seen, len(problem.rigid_tools))
    record = ModelRecord(
        name=model.name,
        label=model.label,
        system=model.system if isinstance(model, LatticeModel) else None,
        simulated_s=float(seen.times[-1]),
        status="not finished",
        ended_at_s=float(seen.times[0]),
        reason=why.reason,
        remedy=why.remedy,
        time_step_errors={},
    )
    return ModelRun(replace(nothing, status="not finished", ended_at=record.ended_at_s), record)
