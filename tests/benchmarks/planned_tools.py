"""What a plan foretells of lattices under moved tools, held against what was found.

    python -m tests.benchmarks.planned_tools

writes reports/data/planned_tools.csv, a row for each scene, quantity and spacing. Scenes that are
in the table are kept: started again, it goes on where it was stopped.

Foretold are relative errors by the spacing, as `study.plan.moved` tells them from three lattices of
2, 1.25 and 1 times the spacing of a scene, and as two of 2.5 and 1.25 times would at the same
order. The table has both without a factor. Found is the difference from a lattice of the finest
spacing here, taken for that share of the error which it does not have itself at order one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from study.models.spacing_error import COARSER, ESTIMATE, ORDER
from study.plan.motions import HISTORY, PEAK_FORCE, Motion, difference, motion
from study.plan.moved import BETWEEN, error_of_finest
from study.plan.prediction import Measure
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene import Require, Scene
from study.scene.file import read_scene
from study.scene.problem import problem_of
from tests.benchmarks.corrected_places import TABLE as PLACES
from tests.benchmarks.tables import complete

TABLE = PLACES.with_name("planned_tools.csv")
BRIEF = (
    "time.duration=0.3 s",
    "time.samples=61",
    "lattice.step_fraction=0.35",
    'models=["tissue"]',
)
HISTORY_OF = '{kind="ramp-hold-release", ramp="0.15 s", hold="0.05 s", release="0.1 s"}'
MIDDLE = '{side="superior", at=[0.5, 0.5]}'
RIGHT, FRONT, LEFT = (
    f'{{side="anterior", at={at}}}' for at in ("[0.30, 0.50]", "[0.50, 0.50]", "[0.65, 0.45]")
)
WEIGHED = "gravity.acceleration=9.81 m/s^2"
DOWN = '[{time="0 s", offset=[0, 0, 0]}, {time="0.1 s", offset=%s}, {time="0.3 s", offset=%s}]'
ACROSS_BLOCK = DOWN % ('[0, 0, "-6 mm"]', '["15 mm", 0, "-6 mm"]')
ACROSS_LIVER = DOWN % ('[0, "8 mm", 0]', '["15 mm", "8 mm", 0]')


def tool(radius: int, depth: int, place: str, shape: str = "sphere", more: str = "") -> str:
    """The table of a tool that is pressed in, lengths in mm."""
    return (
        f'tool={{shape="{shape}", radius="{radius} mm", displacement="{depth} mm", '
        f"place={place}, history={HISTORY_OF}{more}}}"
    )


def dragged(place: str, path: str, more: str = "") -> str:
    """The table of a sphere of 12 mm on a path."""
    return f'tool={{shape="sphere", radius="12 mm", place={place}, path={path}{more}}}'


BONDED, ROUGH = ', contact="bonded"', ", friction=0.3"
SCENES: dict[str, tuple[str, ...]] = {
    "block, sphere of 8 mm": ("block", tool(8, 5, MIDDLE)),
    "block, 10 mm": ("block", tool(10, 8, MIDDLE)),
    "block, 15 mm": ("block", tool(15, 6, MIDDLE)),
    "block, 8 mm, bonded": ("block", tool(8, 2, MIDDLE, more=BONDED)),
    "block, 12 mm, bonded": ("block", tool(12, 3, MIDDLE, more=BONDED)),
    "block, 12 mm, friction and gravity": (
        *("block", tool(12, 8, MIDDLE, more=ROUGH)),
        *(WEIGHED, "gravity.towards=inferior"),
    ),
    "block, 12 mm, dragged": ("block", dragged(MIDDLE, ACROSS_BLOCK)),
    "block, punch of 10 mm": ("block", tool(10, 5, MIDDLE, "punch")),
    "liver, sphere of 8 mm": ("liver", tool(8, 8, RIGHT)),
    "liver, 10 mm": ("liver", tool(10, 12, RIGHT)),
    "liver, 15 mm": ("liver", tool(15, 12, FRONT)),
    "liver, 12 mm, bonded": ("liver", tool(12, 4, LEFT, more=BONDED)),
    "liver, 15 mm, bonded": ("liver", tool(15, 5, RIGHT, more=BONDED)),
    "liver, 12 mm, gravity": (
        *("liver", tool(12, 10, FRONT)),
        *(WEIGHED, "gravity.towards=posterior"),
    ),
    "liver, 12 mm, dragged with friction": (
        "liver",
        dragged(RIGHT, ACROSS_LIVER, ", friction=0.2"),
    ),
    "liver, punch of 12 mm": ("liver", tool(12, 8, FRONT, "punch")),
}
SEED, DRAWN = 15, 7
"""Of random scenes, by which nothing was chosen: they only check."""


def drawn() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Random spheres on the block and the liver in turn, half of them with friction."""
    rng = np.random.default_rng(SEED)
    for k in range(DRAWN):
        base, side = (("block", "superior"), ("liver", "anterior"))[k % 2]
        radius = int(rng.integers(8, 16))
        depth = round(radius * rng.uniform(0.4, 0.8))
        at = [round(float(x), 2) for x in rng.uniform((0.3, 0.4), (0.7, 0.6))]
        place = f'{{side="{side}", at={at}}}'
        given = tool(radius, depth, place, more=ROUGH if k % 4 > 1 else "")
        yield f"{base}, drawn {k + 1}", (base, given)


CHECKS = dict(drawn())
SPACINGS = (0.025, 0.02, 0.015, 0.0125, 0.01, 0.008, 0.00625, 0.005)
FINEST = {"block": 0.004, "liver": 0.005}
GROUPS = ("chosen by", "checked by", "random")
"""Of scenes: those that the factor was chosen by, the others, and random ones."""
FINEST_OF_CHECKS = 0.005
OF_SCENES = (0.01, 0.005)
"""Spacings of scenes, by which their plans look and of which their candidates are; of the random
ones the first alone."""
TIMES = (0.5, 2.0)
"""Of candidates: least and largest, times the spacing of the scene."""
TOLD_FROM = 1.5
"""Spacings of which an error can be found, times the finest."""
TWO = 1.25
"""Spacing of the finer of two lattices, times that of the scene."""


class Row(NamedTuple):
    """Relative errors of a lattice of a `spacing_m`, in a scene whose own is `of_scene_m`.

    `group`: one of GROUPS; `quantity`: the force, or the history of the control point under the
    tool or of all of them.
    By Richardson extrapolation from three lattices and from two, both without a factor.
    """

    scene: str
    group: str
    of_scene_m: float
    spacing_m: float
    quantity: str
    by_three: float
    by_two: float
    found: float

    @property
    def foretold(self) -> float:
        """What a plan predicts."""
        return ESTIMATE * self.by_three


def group_of(name: str) -> str:
    """Which of GROUPS a scene is in: of SCENES, a random half is what the factor was chosen by."""
    if name in CHECKS:
        return GROUPS[2]
    order = np.random.default_rng(0).permutation(len(SCENES))
    return GROUPS[int(list(SCENES).index(name) not in order[: len(SCENES) // 2])]


def rows(name: str) -> Iterator[Row]:
    """All of a scene."""
    base, *overrides = (SCENES | CHECKS)[name]
    scene = read_scene(base, (*overrides, *BRIEF))
    problem = problem_of(scene)
    finest, of_scenes = FINEST[base], OF_SCENES
    if name in CHECKS:
        finest, of_scenes = FINEST_OF_CHECKS, OF_SCENES[:1]
    spacings = [h for h in SPACINGS if h > finest and h >= TIMES[0] * min(of_scenes)]
    runs = {h: moved_by(scene, problem, h) for h in (*spacings, finest)}
    wanted = {
        "force": (PEAK_FORCE, ()),
        "at the tool": (HISTORY, (problem.tool_probe,)),
        "at all points": (HISTORY, tuple(range(len(problem.probes)))),
    }
    for quantity, (kind, probes) in wanted.items():
        required = Require(quantities=(kind,))
        apart = partial(difference, problem, required, Measure(probes, None))
        for of_scene in of_scenes:
            three = [_near(runs, times * of_scene) for times in (COARSER, BETWEEN, 1.0)]
            by_three = error_of_finest(three, apart) / ESTIMATE
            by_two = apart(*(_near(runs, times * TWO * of_scene) for times in (COARSER, 1.0)))
            for h in spacings:
                own = finest / h
                if not TIMES[0] <= h / of_scene <= TIMES[1] or own > 1.0 / TOLD_FROM:
                    continue
                found = apart(runs[h], runs[finest]) / (1.0 - own**ORDER)
                told = by_three * h / of_scene, by_two * h / (TWO * of_scene)
                yield Row(name, group_of(name), of_scene, h, quantity, *told, found)


def moved_by(scene: Scene, problem: Problem, spacing: float) -> Trajectory:
    """The motion of a lattice. ValueError where it does not reach the end."""
    found = motion(scene, problem, spacing)
    if isinstance(found, Motion):
        return found.run.trajectory
    raise ValueError(f"{found}; make the scene's motion smaller")


def _near(runs: Mapping[float, Trajectory], spacing: float) -> Trajectory:
    """That of a spacing [m], but for rounding."""
    found = min(runs, key=lambda h: abs(h - spacing))
    assert abs(found - spacing) < 1e-9
    return runs[found]


def main() -> None:
    """Write what is missing of the table."""
    tasks = {name: partial(rows, name) for name in (*SCENES, *CHECKS)}
    complete(TABLE, Row, tasks, lambda one: one.scene)


if __name__ == "__main__":
    main()
