"""`robustness SCENE`: draws of an organ, run in blocks, stored and summarised."""

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
    DesignRow,
    prepared,
    usual_spacing,
)
from study.robustness.organ_unknowns import unknowns
from study.robustness.ranges import write_ranges
from study.robustness.unknowns import groups
from study.run.scene_problem import scene_arguments, scene_problem
from study.run.suiting import read_suited
from study.scene import Scene
from study.sweep.canonical import Plain
from study.sweep.plan import plan
from study.sweep.runner import Backend, Outcome, run
from study.sweep.status import ReportStatus, silent
from study.sweep.store import Store
from study.sweep.task import Task

Floats = NDArray[np.float64]

NEAREST, DIFFERENCES, INDICES, FINER, RANGES = FILES = (
    "organ_nearest.csv",
    "organ_differences.csv",
    "organ_indices.csv",
    "organ_finer.csv",
    "organ_unknowns.csv",
)
FINER_BY, COARSER_BY = 10.0, 2.0
"""How far a given spacing may be from the usual one, of which a body has five to its size."""
POINTS_APART = 2
"""Number of points of a row that share no unknown."""


@dataclass(frozen=True, kw_only=True)
class OrganRequest:
    """A scene with overrides, the size and seed of the design, and where to write and run.

    `spacing` [m]: about which those of the lattices are drawn; `again`: number of draws that are
    repeated on lattices twice as fine.
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
    def backend(self) -> Backend:
        """Where the blocks are computed: here, in processes, or by a scheduler."""
        return Backend(self.workers, self.scheduler)

    @cached_property
    def given(self) -> Plain:
        """The scene as used by every draw, as plain values. ValueError if it is unsuitable."""
        scene = read_suited(self.scene, self.overrides)
        _refuse_moved(scene)
        return scene_arguments(prepared(scene))

    @cached_property
    def about(self) -> float:
        """Spacing [m] about which the lattices' are drawn. ValueError if it does not suit."""
        usual = usual_spacing(scene_problem(**self.given).problem)
        if self.spacing is None:
            return usual
        low, high = usual / FINER_BY, usual * COARSER_BY
        if not low <= self.spacing <= high:
            raise ValueError(
                f"spacing: {1e3 * self.spacing:.3g} mm does not suit the organ; give "
                f"{1e3 * low:.2g} to {1e3 * high:.2g} mm, or leave it out for {1e3 * usual:.2g} mm"
            )
        return self.spacing

    def tasks(self) -> list[Task]:
        """A task per row of the design. ValueError unless the size is a power of two."""
        check_size(self.size)
        check_seed(self.seed)
        points = len(groups(unknowns(self.about))) + POINTS_APART
        return [self._task(row, points) for row in range(self.size)]

    def again_tasks(self) -> list[Task]:
        """The first draw of the first rows again, on finer lattices. ValueError if negative."""
        if self.again < 0:
            raise ValueError(f"again: {self.again} is negative; give how many draws are repeated")
        return [self._task(row, 1, TIMES) for row in range(min(self.again, self.size))]

    def _task(self, row: int, points: int, finer: float = 1.0) -> Task:
        drawn = DesignRow(self.seed, row, points, self.about, finer)
        return Task(FUNCTION, {"row": asdict(drawn), **self.given})


def _refuse_moved(scene: Scene) -> None:
    """Raise ValueError for moved tools, whose force a draw cannot change."""
    if "moved-tools" in scene.features:
        raise ValueError(
            "robustness: a draw changes place and force of a blunt tool, and the scene has rigid "
            "tools that are moved; leave these out, or use run"
        )


def planned(request: OrganRequest) -> str:
    """What a request would run, and for how long. ValueError if it cannot be run."""
    _ = request.backend
    return str(plan([*request.tasks(), *request.again_tasks()], request.store))


@dataclass(frozen=True)
class OrganDraws:
    """The draws over the design, and the changes of some on finer lattices."""

    draws: summary.Draws
    finer: tuple[rows.Finer, ...]


def study(request: OrganRequest, progress: ReportStatus = silent) -> OrganDraws:
    """The nearest contender to the benchmark in each draw; all tables are written to the folder.

    Raises ValueError for a scene with nothing to draw, a size that is no power of two, a folder
    that cannot be written, or a block that failed.
    """
    backend = request.backend
    tasks, again = request.tasks(), request.again_tasks()
    request.folder.mkdir(parents=True, exist_ok=True)
    outcomes = run([*tasks, *again], request.store, backend, progress)
    found = _organ_draws(gathered(outcomes), len(tasks), request.about)
    _write(found, request)
    return found


def gathered(outcomes: Sequence[Outcome]) -> list[Plain]:
    """The values of every block. ValueError for the first that failed."""
    values = [outcome.value for outcome in outcomes if outcome.value is not None]
    failed = [outcome for outcome in outcomes if outcome.value is None]
    if failed:
        raise ValueError(
            f"{len(failed)} of {len(outcomes)} blocks failed, the first with: {failed[0].message}; "
            "start again, what is kept is not computed twice"
        )
    return values


def _organ_draws(values: Sequence[Plain], rows_of: int, spacing: float) -> OrganDraws:
    together = tuple(groups(unknowns(spacing)))
    points = len(together) + POINTS_APART
    scores = _scores(values[:rows_of]).reshape(-1, points, len(CONTENDERS), len(MEASURED))
    moduli = np.concatenate([np.array(value["estimates"]) for value in values[:rows_of]])
    draws = summary.Draws(
        moduli.reshape(-1, points, moduli.shape[-1]), scores, together, CONTENDERS, MEASURED
    )
    again = values[rows_of:]
    finer = changes(scores[: len(again), 0], _scores(again), MEASURED) if again else ()
    return OrganDraws(draws, tuple(finer))


def _scores(values: Iterable[Plain]) -> Floats:
    found = [np.array(value["scores"], dtype=np.float64) for value in values]
    return np.concatenate(found).reshape(-1, len(CONTENDERS), len(MEASURED))


def _write(found: OrganDraws, request: OrganRequest) -> None:
    folder, draws = request.folder, found.draws
    write_table(folder / NEAREST, rows.Nearest, summary.nearest(draws))
    write_table(folder / DIFFERENCES, rows.Difference, summary.differences(draws))
    write_table(folder / INDICES, rows.Index, summary.indices(draws))
    write_table(folder / FINER, rows.Finer, found.finer)
    write_ranges(folder / RANGES, unknowns(request.about))


def lines(found: OrganDraws, request: OrganRequest) -> list[str]:
    """Lines on the lattices and on divergences, for beside the sentences of the tables."""
    draws = found.draws
    size = len(draws.scores) * draws.scores.shape[1]
    told = [f"{size} draws on lattices of about {1e3 * request.about:.3g} mm"]
    if draws.lost:
        told.append(
            f"in {100 * draws.lost:.1f} % a motion diverged, cells turned inside out or a way left "
            "the surface: they count for no one"
        )
    return told
