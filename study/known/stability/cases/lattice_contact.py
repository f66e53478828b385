"""Rigid tools and gravity at the extremes: impacts, tools through the body, friction, many times g.

A small block is pressed by a moved tool. A motion that finishes is checked for the overlap of body
and tool, which is zero for exact impulses, and for the work of the tool: the body must not return
more than it received.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from msm.model import Automatic, Run, run
from study.known.case import Case, Family
from study.known.finding import Ending, Finding, at_most
from study.models.lattice import PreparedLattice
from study.models.table import model
from study.problem.problem import Problem
from study.scene.file import read_scene
from study.scene.problem import problem_of

OVERLAP = 1e-2
"""Admissible overlap of body and tool, over the tool's travel."""
GIVEN_BACK = 1e-2
"""Admissible work returned beyond the work received, over the tool's largest work."""
BEYOND = 0.0
LOST_FROM = 10.0
"""Multiple of g under which springs without a volume term collapse."""
FAMILY = Family("lattices in contact", __name__)
BLOCK = (
    'organ.size=["60 mm", "60 mm", "40 mm"]',
    'models=["tissue"]',
    "lattice.spacing=20 mm",
    "tool.shape=sphere",
    "tool.radius=20 mm",
    "tool.displacement=4 mm",
    "damping.ratio=0.3",
    "time.samples=101",
    "time.duration=0.5 s",
    "tool.history.ramp=0.15 s",
    "tool.history.hold=0.05 s",
    "tool.history.release=0.15 s",
)


def cases() -> Iterator[Case]:
    """Cases by what is extreme."""
    for speed in (0.1, 1.0, 10.0):
        ramp = 4e-3 / speed
        times = [f"tool.history.{part}={ramp:g} s" for part in ("ramp", "release")]
        samples = ["time.samples=401", "time.duration=0.1 s", "tool.history.hold=0.05 s"]
        yield _case(f"impact at {speed:g} m/s", [*times, *samples], quick=speed == 1.0)
    for shape in ("sphere", "punch", "plate"):
        through = [f"tool.shape={shape}", "tool.displacement=55 mm"]
        # A small tool inverts single cells of springs; a plate would invert all of them at once.
        yield _case(f"{shape} through the body", through, lost=shape == "plate")
    for friction in (0.0, 0.5, 1.0, 2.0):
        yield _case(f"friction {friction:g}", [f"tool.friction={friction:g}"])
    yield _case("zero gap, nothing pressed", ["tool.displacement=1e-6 m"])
    for times_g in (1.0, 3.0, 10.0):
        pull = [f"gravity.acceleration={9.81 * times_g:g} m/s^2", "gravity.towards=inferior"]
        lost = times_g >= LOST_FROM
        yield _case(f"pressed under {times_g:g} g", pull, lost=lost)
        name = f"the same, given loaded, under {times_g:g} g"
        yield _case(name, [*pull, "gravity.given=loaded"])


def _case(name: str, overrides: list[str], *, lost: bool = False, quick: bool = False) -> Case:
    return FAMILY.case(
        name,
        "pressed",
        {"overrides": overrides},
        BEYOND,
        expected="diverged" if lost else "bounded",
        quick=quick,
    )


def pressed(overrides: list[str]) -> Finding:
    """The worse of overlap and returned energy, over their limits; how the run ended."""
    scene = read_scene("block", (*BLOCK, *overrides))
    problem = problem_of(scene)
    prepared = model(scene, "tissue").prepare(problem)
    assert isinstance(prepared, PreparedLattice)  # noqa: S101 - as its kind makes
    found = run(
        prepared.assembly,
        prepared.springs.material,
        problem.factor,
        problem.observation,
        Automatic(),
    )
    ending: Ending = "bounded" if found.trajectory.status == "finished" else "diverged"
    travel = float(np.linalg.norm(_travels(problem), axis=1).max())
    overlap = found.overlap / (OVERLAP * travel)
    share = max(overlap, _given_back(problem, found) / GIVEN_BACK)
    return at_most(1.0, share, "overlap or work given back, over its limit", ending)


def _travels(problem: Problem) -> np.ndarray:
    return np.asarray(problem.rigid_tools[0].travel(problem.observation.times))


def _given_back(problem: Problem, found: Run) -> float:
    """Largest negative work of the tool over its largest positive work; zero without either."""
    force, travel = -found.trajectory.tool_force[:, 0], _travels(problem)
    kept = np.isfinite(force).all(axis=1)
    force, travel = force[kept], travel[kept]
    between = 0.5 * (force[1:] + force[:-1])
    work = np.cumsum((between * np.diff(travel, axis=0)).sum(axis=1))
    most = float(work.max(initial=0.0))
    return float(max(0.0, -work.min(initial=0.0))) / most if most > 0.0 else 0.0
