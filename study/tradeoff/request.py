"""Requests of the commands `tradeoff` and `recommend`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.models.table import model
from study.problem.problem import Problem
from study.run.preparation import prepare_models
from study.run.scene_problem import scene_arguments, scene_problem
from study.run.suiting import read_suited
from study.scene import Scene
from study.sweep.plan import plan
from study.sweep.runner import Backend
from study.sweep.store import Store
from study.system.folders import check_file, write_text
from study.system.progress import Progress
from study.tradeoff import recommend, recommendation, study, table
from study.tradeoff.contenders import configurations, is_moved
from study.tradeoff.demand import Demand, as_share, demand, length
from study.tradeoff.problem import sampled
from study.tradeoff.timing import QUICK_REPEATS, REPEATS

YIELDS = "tissue's lattice yields"


@dataclass(frozen=True, kw_only=True)
class TradeoffRequest:
    """A scene by name or file with overrides, what to write, and where to run."""

    scene: str
    overrides: Sequence[str] = ()
    contenders: Sequence[str] = ()
    out: Path | None = None
    workers: int = 0
    scheduler: str | None = None
    quick: bool = False

    @property
    def name(self) -> str:
        """Name of the scene, without its folder."""
        return Path(self.scene).stem

    @property
    def backend(self) -> Backend:
        """Where to run."""
        return Backend(self.workers, self.scheduler)

    @property
    def folder(self) -> Path:
        """Folder of the table."""
        return self.out or Path("results") / f"{self.name}-tradeoff"

    def read(self) -> Scene:
        """The scene."""
        return read_suited(self.scene, self.overrides)


def _ready(request: TradeoffRequest) -> Scene:
    """The scene as the study samples it.

    ValueError, before anything is run, for an unsuitable scene, folder or workers.
    """
    scene = sampled(request.read())
    _ = request.backend
    study.refuse_unwritable(request.folder)
    _set_up(scene)
    return scene


def _set_up(scene: Scene) -> Problem:
    """The problem of a scene, on which its reference can run. ValueError if it cannot."""
    problem = scene_problem(**scene_arguments(scene)).problem
    compared_with = "fem" if study.has_reference(scene) else "tissue"
    prepare_models([model(scene, compared_with)], problem)
    return problem


def planned(request: TradeoffRequest) -> list[str]:
    """What the study would run."""
    scene = _ready(request)
    chosen = configurations(scene, request.contenders)
    return [str(plan(study.tasks(scene, chosen), _store(request.folder)))]


def measure(request: TradeoffRequest, progress: Progress) -> list[str]:
    """Run the study and write its folder; lines for a terminal."""
    scene, folder = _ready(request), request.folder
    chosen = configurations(scene, request.contenders)
    repeats = QUICK_REPEATS if request.quick else REPEATS
    backend = request.backend
    with study.place(folder) as partial:  # refuse the folder before the work
        found = study.study(scene, chosen, _store(folder), backend, repeats, progress)
        study.write(found, scene, repeats, partial)
    return [*table.lines(found.entries), *_against(found), f"table in {folder / study.TABLE}"]


def _against(found: study.Found) -> list[str]:
    """The criterion and reference of the errors, and the reference's own error."""
    comparison = found.comparison
    if comparison.reference is not None and not comparison.finest:
        own = 100 * comparison.reference.field_error
        return [f"errors are for the tissue's own modulus; the reference's own is {own:.2g} %"]
    bars = [one.force_bar for one in found.entries if one.force_bar is not None]
    why = [f"not against the scene's finite elements: {comparison.why}"] if comparison.why else []
    return [
        f"errors are of the force of the tools over time, against {comparison.words}; its own is "
        f"{100 * min(bars):.2g} to {100 * max(bars):.2g} %",
        *why,
    ]


def advise(
    request: TradeoffRequest,
    rate: str | None,
    error: str | None,
    progress: Progress,
    *,
    known_place: bool = False,
) -> tuple[bool, list[str]]:
    """Whether the demand can be met, and lines; writes the scene if it can.

    An `error` that is a length is taken as a share of the largest displacement at rest.
    """
    absolute, preamble = length(error), list[str]()
    given = request.read()
    _refuse_demand(given, absolute, known_place=known_place)
    wanted = demand(rate, "1" if absolute else error)
    path = request.out or Path(f"{request.name}-{_suffix(wanted, absolute)}.toml")
    check_file(path)
    problem = _set_up(recommend.with_finer_reference(sampled(given)))
    lattice = model(given, "tissue").varied().prepare(problem)  # with the scene's own spacing
    if absolute is not None:
        at_rest = model(given, "fem").prepare(problem) if problem.has_further_loads else lattice
        reach = float(np.linalg.norm(at_rest.rest(), axis=1).max())
        share = as_share(absolute, reach)
        wanted = demand(rate, share)
        at_rest_name = "elements yield" if problem.has_further_loads else YIELDS
        preamble = [
            f"an error of {1e3 * absolute:.3g} mm is taken as {share} of the {1e3 * reach:.3g} mm "
            f"by which the {at_rest_name} at most at rest; errors are of the whole field"
        ]
    store = _store(Path("results") / f"{request.name}-tradeoff")
    if known_place:
        model(given, "corrected").prepare(problem)
    execution = study.Execution(store, request.backend, progress)
    found = recommend.recommend(sampled(given), wanted, execution, known_place=known_place)
    noted = dict.fromkeys((*given.remarks, *problem.notes))
    notes = (f"note: {note}" for note in noted)
    lines = [*preamble, *notes, *recommendation.lines(found), *_busy()]
    if not found.met:
        return False, [f"cannot: no lattice tried meets {wanted}; the nearest is", *lines]
    write_text(path, recommendation.recommended_scene(given, found))
    return True, [*lines, f"scene in {path}"]


def _refuse_demand(scene: Scene, absolute: float | None, *, known_place: bool) -> None:
    """Raise ValueError for demands that are undefined for tools that are moved."""
    if known_place and is_moved(scene):
        raise ValueError(
            "--known-place: what follows one place is made of the vectors of a load of a given "
            "force, and the force of a tool that is moved is a result; leave it out"
        )
    if absolute is not None and is_moved(scene):
        raise ValueError(
            "--error: where tools are moved it is that of their force; give a share such as 5 %"
        )


def _busy() -> list[str]:
    """A line if other processes were using the machine too."""
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    if load <= cores:
        return []
    return [
        f"The machine was busy (load {load:.1f} on {cores} cores): frames that waited for others "
        "count as slow ones; repeat this when it is idle."
    ]


def _suffix(wanted: Demand, absolute: float | None = None) -> str:
    """Part of a file name, with an error [m] as it was given."""
    rate = [] if wanted.rate is None else [f"{wanted.rate:g}Hz"]
    if absolute is not None:
        return "-".join([*rate, f"{1e3 * absolute:g}mm"])
    return "-".join(rate + ([] if wanted.error is None else [f"{100 * wanted.error:g}percent"]))


def _store(folder: Path) -> Store:
    """Beside the folder, which is replaced as a whole while finished runs stay."""
    return Store(folder.with_name(f"{folder.name}-runs"))
