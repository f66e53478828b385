"""The command `robustness` on the control point: draws run in blocks, stored and summarised."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.results.tables import write_table
from study.robustness import rows, summary
from study.robustness.design import check_seed, check_size, shares
from study.robustness.patient import SYSTEMS
from study.robustness.ranges import write_ranges
from study.robustness.spacing import over_spacing
from study.robustness.unknowns import UNKNOWNS, Draw, draws
from study.scene.file import read_scene
from study.similarity.batch import COLUMNS
from study.sweep.plan import plan
from study.sweep.runner import Backend, Outcome, run
from study.sweep.status import ReportStatus, silent
from study.sweep.store import Store
from study.sweep.task import Task

SCENE = "paper"
"""The scene whose reference spacing is varied alone."""
BLOCK = 32
"""Rows of the design per block, which take some seconds."""
NEAREST, DIFFERENCES, TABLE_III, INDICES, DRAWN, RANGES, SPACING = (
    "ranking_nearest.csv",
    "ranking_differences.csv",
    "ranking_table_iii.csv",
    "ranking_indices.csv",
    "ranking_nearest_draws.csv",
    "ranking_unknowns.csv",
    "ranking_spacing.csv",
)
FILES = (NEAREST, DIFFERENCES, TABLE_III, INDICES, DRAWN, RANGES, SPACING)


@dataclass(frozen=True, kw_only=True)
class RobustnessRequest:
    """Rows of the design, a power of two, its seed, the folder to write, where to run."""

    size: int = 4096
    seed: int = 0
    out: Path | None = None
    workers: int = 0
    scheduler: str | None = None

    @property
    def folder(self) -> Path:
        """Folder of the tables."""
        return self.out or Path("results") / "robustness"

    @property
    def store(self) -> Store:
        """Store of finished blocks, beside the folder."""
        return Store(self.folder.with_name(f"{self.folder.name}-runs"))

    def tasks(self) -> list[Task]:
        """A task per block. ValueError unless the size is a power of two."""
        check_size(self.size)
        check_seed(self.seed)
        return [
            Task(
                "study.robustness.block:run",
                {
                    "seed": self.seed,
                    "size": self.size,
                    "first": first,
                    "count": min(BLOCK, self.size - first),
                },
            )
            for first in range(0, self.size, BLOCK)
        ]


def planned(request: RobustnessRequest) -> str:
    """What a request would run, and for how long."""
    return str(plan(request.tasks(), request.store))


def study(request: RobustnessRequest, progress: ReportStatus = silent) -> list[rows.Nearest]:
    """How often each system is nearest to the benchmark; all tables are written to the folder.

    Raises ValueError for a size that is no power of two, a folder that cannot be written, or a
    block that failed.
    """
    backend = Backend(request.workers, request.scheduler)
    tasks = request.tasks()
    request.folder.mkdir(parents=True, exist_ok=True)
    found = _gathered(run(tasks, request.store, backend, progress))
    nearest, table_iii = list(summary.nearest(found)), list(summary.table_three(found))
    write_table(request.folder / NEAREST, rows.Nearest, nearest)
    write_table(request.folder / DIFFERENCES, rows.Difference, summary.differences(found))
    write_table(request.folder / TABLE_III, rows.TableThree, table_iii)
    write_table(request.folder / INDICES, rows.Index, summary.indices(found))
    write_table(request.folder / DRAWN, rows.Drawn, _drawn(request, table_iii))
    write_table(request.folder / SPACING, rows.AtSpacing, over_spacing(read_scene(SCENE)))
    write_ranges(request.folder / RANGES, UNKNOWNS)
    return nearest


def _gathered(outcomes: Sequence[Outcome]) -> summary.Draws:
    failed = [outcome for outcome in outcomes if outcome.value is None]
    if failed:
        raise ValueError(
            f"{len(failed)} of {len(outcomes)} blocks failed, the first with: {failed[0].message}; "
            "start again, what is kept is not computed twice"
        )
    values = [outcome.value for outcome in outcomes if outcome.value is not None]
    estimates = np.concatenate([np.array(value["estimates"]) for value in values])
    scores = np.concatenate([np.array(value["scores"], dtype=np.float64) for value in values])
    points = len(UNKNOWNS) + 2
    return summary.Draws(
        estimates.reshape(-1, points, len(SYSTEMS)),
        scores.reshape(-1, points, len(SYSTEMS), len(COLUMNS)),
    )


def _drawn(
    request: RobustnessRequest, table_iii: Sequence[rows.TableThree]
) -> Iterator[rows.Drawn]:
    """The unknowns of the draws that come nearest to Table III."""
    points = shares(request.seed, request.size).reshape(-1, len(UNKNOWNS))
    for row in table_iii:
        (draw,) = draws(points[row.draw : row.draw + 1])
        for name, value in zip(Draw._fields, draw, strict=True):
            yield rows.Drawn(row.curve, row.measure, row.draw, name, in_words(value))


def in_words(value: object) -> str:
    """A drawn value as text, joined if it has several parts."""
    if isinstance(value, tuple):
        return " ".join(map(str, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def lines(found: Sequence[rows.Nearest]) -> list[str]:
    """A line per measure: the share of draws in which each system is nearest to the benchmark."""
    count = found[0].draws
    told = [f"nearest to the benchmark in {count} draws of {len(UNKNOWNS)} unknowns:"]
    for curve, measure in COLUMNS:
        of_measure = [row for row in found if (row.curve, row.measure) == (curve, measure)]
        shares_of = ", ".join(
            f"{row.system} {100 * row.share:.1f} % [{100 * row.low:.1f}, {100 * row.high:.1f}]"
            for row in of_measure
        )
        told.append(f"{curve} {measure}: {shares_of}, tied {100 * of_measure[0].tied:.1f} %")
    return told
