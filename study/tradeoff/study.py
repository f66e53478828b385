"""The work-precision study of one scene: errors by a sweep, then costs in this process."""

from __future__ import annotations

import json
import os
import time
import tracemalloc
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from study.models.model import Stepper
from study.results.provenance import provenance
from study.run.scene_problem import SceneProblem, scene_arguments, scene_problem
from study.scene import Scene
from study.scene.file import write_scene
from study.sweep.canonical import Plain, restored
from study.sweep.runner import Backend, Outcome, run
from study.sweep.status import on_stderr
from study.sweep.store import Store
from study.sweep.task import Task
from study.system import folders
from study.system.folders import replacing
from study.system.progress import Progress
from study.tradeoff import observation, reference, table
from study.tradeoff.comparison import Comparison, lattices, refuse_unlike, truth_of
from study.tradeoff.contenders import Configuration, is_moved
from study.tradeoff.reference import ReferenceSolution, SolvedReference
from study.tradeoff.table import Cost, Entry
from study.tradeoff.timing import Clock, in_turns

TABLE, RECORD = "tradeoff.csv", "tradeoff.json"
PICTURES = ("tradeoff.svg", "tradeoff.pdf")
"""Files that are drawn into the folder afterwards."""


@dataclass(frozen=True)
class Execution:
    """Where runs are kept, what computes them, and where their progress is shown."""

    store: Store
    backend: Backend
    progress: Progress

    def judged(
        self, scene: Scene, chosen: Sequence[Configuration]
    ) -> tuple[Comparison, list[Outcome]]:
        """See `judged`."""
        return judged(scene, chosen, self.store, self.backend)


@dataclass(frozen=True)
class Found:
    """Entries of the table, their reference, and its curves' errors by control point."""

    entries: list[Entry]
    comparison: Comparison
    curve_errors: dict[str, float]


def has_reference(scene: Scene) -> bool:
    """Whether finite elements are the reference: under moved tools only if the scene names them."""
    return not is_moved(scene) or "fem" in scene.models


def tasks(scene: Scene, chosen: Sequence[Configuration]) -> list[Task]:
    """The run of the reference, those of the finest lattices, and one for each configuration."""
    same = scene_arguments(scene)
    compared_with = [Task(reference.FUNCTION, same)] if has_reference(scene) else []
    runs: list[Plain] = [
        {"name": one.contender, "settings": dict(one.settings)}
        for one in (*_finest(scene, chosen), *chosen)
    ]
    return [*compared_with, *(Task(observation.FUNCTION, same | one) for one in runs)]


def _finest(scene: Scene, chosen: Sequence[Configuration]) -> list[Configuration]:
    """Lattices that others are compared with: only under moved tools."""
    if not is_moved(scene):
        return []
    return [one for family in lattices(scene, chosen).values() for one in family]


def judged(
    scene: Scene, chosen: Sequence[Configuration], store: Store, backend: Backend
) -> tuple[Comparison, list[Outcome]]:
    """What configurations are compared with, and the outcome of each.

    ValueError if the reference, or under moved tools the finest lattices, could not be solved.
    """
    if not has_reference(scene):
        refuse_unlike(scene, chosen)
    with on_stderr("reference and models solved") as tell:
        outcomes = run(tasks(scene, chosen), store, backend, tell)
    given, known, value, why = scene_problem(**scene_arguments(scene)), None, None, ""
    if has_reference(scene):
        first, *outcomes = outcomes
        value = first.value
        try:
            known = _reference(first, given)
        except ValueError as error:
            if not is_moved(scene):
                raise
            refuse_unlike(scene, chosen)
            why = str(error)
    finest = {}
    for springs, members in lattices(scene, chosen).items() if is_moved(scene) else ():
        finest[springs] = truth_of(outcomes[: len(members)], given)
        outcomes = outcomes[len(members) :]
    solved = None if value is None else restored(SolvedReference, value)
    return Comparison(given, known, solved, finest, why), outcomes


def _reference(outcome: Outcome, given: SceneProblem) -> ReferenceSolution:
    if outcome.value is None:
        raise ValueError(f"the reference could not be solved: {outcome.message}")
    return reference.truth(outcome.value, given)


def study(
    scene: Scene,
    chosen: Sequence[Configuration],
    store: Store,
    backend: Backend,
    repeats: int,
    progress: Progress,
    clock: Clock = time.perf_counter,
) -> Found:
    """Errors and costs of configurations on a scene of `study.tradeoff.problem.sampled`."""
    comparison, outcomes = judged(scene, chosen, store, backend)
    entries = compared(comparison, chosen, outcomes, repeats, progress, clock)
    known = comparison.reference
    own = [] if known is None else map(float, known.curve_errors)
    return Found(entries, comparison, dict(zip(comparison.given.problem.probes, own, strict=False)))


def compared(
    comparison: Comparison,
    chosen: Sequence[Configuration],
    outcomes: Sequence[Outcome],
    repeats: int,
    progress: Progress,
    clock: Clock = time.perf_counter,
) -> list[Entry]:
    """An entry per configuration; those that ran are timed in turns."""
    given = comparison.given
    found = [comparison.errors(one, outcome) for one, outcome in zip(chosen, outcomes, strict=True)]
    sound = [k for k, one in enumerate(found) if one.status in {"resolved", "not resolved"}]
    steps = [step_of(outcomes[k]) for k in sound]
    costed = costs(given, [chosen[k] for k in sound], steps, repeats, progress, clock)
    by_place = dict(zip(sound, costed, strict=True))
    bars = [comparison.truth(one) for one in chosen]
    return [
        Entry(one, error, bar.field_error, by_place.get(k), bar.force_bar)
        for k, (one, error, bar) in enumerate(zip(chosen, found, bars, strict=True))
    ]


def costs(
    given: SceneProblem,
    chosen: Sequence[Configuration],
    steps: Sequence[float],
    repeats: int,
    progress: Progress,
    clock: Clock = time.perf_counter,
    *,
    sized: bool = False,
) -> list[Cost]:
    """Setup time and cost of configurations, at the steps [s] that their runs took.

    `sized`: with the memory that each holds, which makes the setup slower.
    """
    with progress.stage("setting up") as advance:
        for name in dict.fromkeys(
            one.contender for one in chosen
        ):  # compile kernels before anything is timed
            _stepper(given, next(one for one in chosen if one.contender == name))
        ready, setups, memories = [], [], []
        for one in chosen:
            started = clock()
            stepper, memory = _weighed(given, one) if sized else (_stepper(given, one), None)
            ready.append(stepper)
            memories.append(memory)
            setups.append(clock() - started)
            advance(len(ready) / len(chosen))
    with progress.stage("timing") as advance:
        timings = in_turns(ready, repeats, clock, advance)
    return [
        Cost(one.unknowns, setup, min(step, one.step), timing, memory)
        for one, setup, step, timing, memory in zip(
            ready, setups, steps, timings, memories, strict=True
        )
    ]


def _weighed(given: SceneProblem, one: Configuration) -> tuple[Stepper, int]:
    """A stepper, and the bytes of arrays and objects that it holds, without factors in C."""
    tracemalloc.start()
    try:
        stepper = _stepper(given, one)
        return stepper, tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()


def _stepper(given: SceneProblem, one: Configuration) -> Stepper:
    """Set up anew, since a lattice caches what it assembled for the same problem."""
    return one.model(given.scene).prepare(replace(given.problem)).stepper()


def step_of(outcome: Outcome) -> float:
    """Shortest step [s] of a run that finished."""
    found = restored(observation.Observed, outcome.value or {})
    return float("inf") if found.step_s is None else found.step_s


def write(found: Found, scene: Scene, repeats: int, folder: Path) -> None:
    """Write table, record and scene into an empty folder; see `place`."""
    text, comparison = write_scene(scene), found.comparison
    record = {
        "against": comparison.words,
        "reference": None if comparison.reference is None else _solved(found),
        "repeats": repeats,
        "modulus_pa": scene.tissue.youngs_modulus,
        "load_average": os.getloadavg(),
        "machine": asdict(provenance(text, scene.organ.mesh)),
    }
    table.write(found.entries, folder / TABLE)
    content = json.dumps(record, indent=1, allow_nan=False)
    (folder / RECORD).write_text(content + "\n", encoding="utf-8")
    (folder / "scene.toml").write_text(text, encoding="utf-8")


def _solved(found: Found) -> Plain:
    solved = found.comparison.solved
    assert solved is not None  # noqa: S101 - where it is compared with
    return {
        "element": solved.element,
        "unknowns": solved.unknowns,
        "field_error": solved.field_error,
        "levels": [asdict(level) for level in solved.levels],
        "curve_errors": found.curve_errors,
        **({"force_errors": solved.force_errors} if solved.force_errors else {}),
    }


def place(folder: Path) -> AbstractContextManager[Path]:
    """A folder beside `folder` that replaces it when the block ends without an exception.

    FolderError before the block if `folder` holds anything but a study, or cannot be written.
    """
    return replacing(folder, _foreign, "trade-off study")


def refuse_unwritable(folder: Path) -> None:
    """Raise FolderError if `write` would refuse the folder; nothing is left behind."""
    folders.refuse_unwritable(folder, _foreign, "trade-off study")


def _foreign(names: Iterable[str]) -> str | None:
    """A file that the study did not write."""
    others = sorted(set(names) - {TABLE, RECORD, "scene.toml", *PICTURES})
    return others[0] if others else None
