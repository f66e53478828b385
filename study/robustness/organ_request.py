"""`robustness SCENE`: draws of an organ run in blocks, kept, and summed up."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.results.tables import write_table
from study.robustness import rows, summary
from study.robustness.design import check_seed, check_size
from study.robustness.finer import TIMES, changes
from study.robustness.organ_block import (
    CONTENDERS,
    FUNCTION,
    MEASURED,
    Asked,
    prepared,
    usual_spacing,
)
from study.robustness.organ_unknowns import unknowns
from study.robustness.ranges import write_ranges
from study.robustness.unknowns import groups
from study.run.stated import arguments, stated
from study.run.suiting import read_suited
from study.scene import Scene
from study.sweep.canonical import Plain
from study.sweep.plan import plan
from study.sweep.runner import How, Outcome, run
from study.sweep.store import Store
from study.sweep.tally import Tell, silent
from study.sweep.task import Task

Floats = NDArray[np.float64]

NEAREST, DIFFERENCES, INDICES, FINER, RANGES = FILES = (
    "organ_nearest.csv",
    "organ_differences.csv",
    "organ_indices.csv",
    "organ_finer.csv",
    "organ_unknowns.csv",
)
POINTS_APART = 2
"""Of a row, those that have no unknown in common."""


@dataclass(frozen=True, kw_only=True)
class OrganRequest:
    """A scene with overrides, the size of the design and its seed, and where to write and run.

    `spacing` [m]: about which those of the lattices are drawn; `again`: how many draws are repeated
    on lattices twice as fine.
    """

    scene: str
    overrides: Sequence[str] = ()
    size: int = 64
    seed: int = 0
    spacing: float | None = None
    again: int = 32
    out: Path | None = None
    workers: int = 0
    scheduler: str | None = None

    @property
    def folder(self) -> Path:
        """Folder of the tables."""
        return self.out or Path("results") / f"{Path(self.scene).stem}-robustness"

    @property
    def store(self) -> Store:
        """Store of finished blocks, beside the folder."""
        return Store(self.folder.with_name(f"{self.folder.name}-runs"))

    @property
    def how(self) -> How:
        """Where to run."""
        return How(self.workers, self.scheduler)

    @cached_property
    def given(self) -> Plain:
        """The scene as every draw has it, as plain values. ValueError of one that will not do."""
        scene = read_suited(self.scene, self.overrides)
        _refuse_moved(scene)
        return arguments(prepared(scene))

    @cached_property
    def about(self) -> float:
        """Spacing [m] that the lattices have about."""
        return self.spacing or usual_spacing(stated(**self.given).problem)

    def tasks(self) -> list[Task]:
        """A task a row of the design. ValueError unless the size is a power of two."""
        check_size(self.size)
        check_seed(self.seed)
        points = len(groups(unknowns(self.about))) + POINTS_APART
        return [self._task(row, points) for row in range(self.size)]

    def again_tasks(self) -> list[Task]:
        """The first draw of the first rows once more, on finer lattices. ValueError below none."""
        if self.again < 0:
            raise ValueError(f"again: {self.again} is negative; give how many draws are repeated")
        return [self._task(row, 1, TIMES) for row in range(min(self.again, self.size))]

    def _task(self, row: int, points: int, finer: float = 1.0) -> Task:
        asked = Asked(self.seed, row, points, self.about, finer)
        return Task(FUNCTION, {"asked": asdict(asked), **self.given})


def _refuse_moved(scene: Scene) -> None:
    """ValueError for tools that are moved, whose force or place a draw cannot change."""
    if "travelling-loads" in scene.features:
        raise ValueError(
            "robustness: a draw changes place and radius of a tool, and the scene has one that "
            "travels; leave out its path, or use run"
        )
    if "moved-tools" in scene.features:
        raise ValueError(
            "robustness: a draw changes place and force of a blunt tool, and the scene has rigid "
            "tools that are moved; leave these out, or use run"
        )


def planned(request: OrganRequest) -> str:
    """What a request would run, and for how long. ValueError of one that cannot be run."""
    _ = request.how
    return str(plan([*request.tasks(), *request.again_tasks()], request.store))


@dataclass(frozen=True)
class Found:
    """The draws over the design, and what finer lattices change of some."""

    draws: summary.Draws
    finer: tuple[rows.Finer, ...]


def study(request: OrganRequest, progress: Tell = silent) -> Found:
    """Who is nearest to the benchmark in each draw; all tables are written to the folder.

    Raises ValueError for a scene with nothing to draw, a size that is no power of two, a folder
    that cannot be written, or a block that failed.
    """
    how = request.how
    tasks, again = request.tasks(), request.again_tasks()
    request.folder.mkdir(parents=True, exist_ok=True)
    outcomes = run([*tasks, *again], request.store, how, progress)
    found = _found(gathered(outcomes), len(tasks), request.about)
    _write(found, request)
    return found


def gathered(outcomes: Sequence[Outcome]) -> list[Plain]:
    """What every block found. ValueError of the first that failed."""
    values = [outcome.value for outcome in outcomes if outcome.value is not None]
    failed = [outcome for outcome in outcomes if outcome.value is None]
    if failed:
        raise ValueError(
            f"{len(failed)} of {len(outcomes)} blocks failed, the first with: {failed[0].message}; "
            "start again, what is kept is not computed twice"
        )
    return values


def _found(values: Sequence[Plain], rows_of: int, spacing: float) -> Found:
    together = tuple(groups(unknowns(spacing)))
    points = len(together) + POINTS_APART
    scores = _scores(values[:rows_of]).reshape(-1, points, len(CONTENDERS), len(MEASURED))
    moduli = np.concatenate([np.array(value["estimates"]) for value in values[:rows_of]])
    draws = summary.Draws(
        moduli.reshape(-1, points, moduli.shape[-1]), scores, together, CONTENDERS, MEASURED
    )
    again = values[rows_of:]
    finer = changes(scores[: len(again), 0], _scores(again), MEASURED) if again else ()
    return Found(draws, tuple(finer))


def _scores(values: Iterable[Plain]) -> Floats:
    found = [np.array(value["scores"], dtype=np.float64) for value in values]
    return np.concatenate(found).reshape(-1, len(CONTENDERS), len(MEASURED))


def _write(found: Found, request: OrganRequest) -> None:
    folder, draws = request.folder, found.draws
    write_table(folder / NEAREST, rows.Nearest, summary.nearest(draws))
    write_table(folder / DIFFERENCES, rows.Difference, summary.differences(draws))
    write_table(folder / INDICES, rows.Index, summary.indices(draws))
    write_table(folder / FINER, rows.Finer, found.finer)
    write_ranges(folder / RANGES, unknowns(request.about))


def lines(found: Found, request: OrganRequest) -> list[str]:
    """What is printed beside the sentences of the tables: the lattices, and what diverged."""
    draws = found.draws
    size = len(draws.scores) * draws.scores.shape[1]
    told = [f"{size} draws on lattices of about {1e3 * request.about:.3g} mm"]
    if draws.lost:
        told.append(
            f"in {100 * draws.lost:.1f} % a motion diverged or cells turned inside out: they count "
            "for no one"
        )
    return told
