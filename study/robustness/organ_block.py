"""A row of draws of an organ: lattices moved under its tool, and scored against the benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.stiffness import StiffnessEstimate
from fuzzy.liver.table1 import AETIOLOGIES
from msm.dead_load import NoEquilibriumError
from study.models.model import Simulation
from study.models.table import models_of
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.robustness.block import Block, plain
from study.robustness.design import shares
from study.robustness.organ_unknowns import OrganDraw, as_drawn, draws, unknowns
from study.robustness.patient import SYSTEMS, estimates, readings
from study.run.scene_problem import scene_problem
from study.scene import Place, Scene
from study.scene.place import resolve
from study.scene.problem import problem_of
from study.scene.travel import OffSurfaceError, travelling
from study.similarity.batch import COLUMNS, scores
from study.similarity.fields import norm, relative_l2
from study.sweep.canonical import Plain

Floats = NDArray[np.float64]

FUNCTION = f"{__name__}:run"
READING = "reading"
CONTENDERS = (*SYSTEMS, READING)
"""The fuzzy systems, then the reading without one."""
FIELD = ("field", "relative-l2")
MEASURED = (*COLUMNS, FIELD)
"""Curve and measure of every score: means over control points, then the field at the peak."""
SAMPLES = 201
"""Largest number of samples: more change a score by less than its interval."""
SIZES = 5.0
"""Default number of spacings in the cube root of the organ's volume."""
DIVERGED = np.full(len(MEASURED), np.nan)


@dataclass(frozen=True)
class DesignRow:
    """A row of a design, with `points` draws, on an organ.

    `spacing` [m] about which the lattices' are drawn; `finer`: refinement factor on each draw's own
    spacing. The size of the design is not part of it: the rows of a smaller design are among those
    of a larger one, so that a study can be enlarged without repeating them.
    """

    seed: int
    row: int
    points: int
    spacing: float
    finer: float = 1.0

    def draws(self) -> list[OrganDraw]:
        """The draws of the row."""
        of = unknowns(self.spacing)
        size = 2 ** max(1, self.row.bit_length())  # the smallest design that contains the row
        found = draws(shares(self.seed, size, of)[self.row, : self.points], of)
        return [draw._replace(spacing=draw.spacing / self.finer) for draw in found]


def prepared(scene: Scene) -> Scene:
    """The scene as used by every draw: the models that are compared, on cubic lattices.

    ValueError naming the key of a scene that has nothing to draw.
    """
    if scene.is_point:
        raise ValueError(
            'organ.shape: "point" has no organ; leave SCENE out to draw the control point of the '
            "paper, or give one with an organ"
        )
    if scene.fuzzy.rule_base is not None:
        raise ValueError(
            "fuzzy.rule_base: what is open of the paper's systems is not open of one of your own; "
            "leave the key out"
        )
    lattice = replace(scene.lattice, springs="lattice", volume_term=True, time_step=None)
    return replace(
        scene,
        models=("basafa", "msm", READING),
        tool=replace(scene.tool, direction=_direction(scene)),
        lattice=replace(lattice, step_rate=None),
        time=replace(scene.time, samples=min(scene.time.samples, SAMPLES)),
    )


def _direction(scene: Scene) -> tuple[float, float, float]:
    """The push of the scene, which a moved tool keeps."""
    x, y, z = map(float, problem_of(scene).tool.direction)
    return x, y, z


def usual_spacing(problem: Problem) -> float:
    """Spacing [m] of a lattice coarse enough for very many draws."""
    return float(problem.geometry.volume ** (1.0 / 3.0) / SIZES)


def run(row: Plain, scene: Plain, mesh_sha256: str | None) -> Plain:
    """Estimates and scores of a row of the design, as plain lists."""
    given = scene_problem(scene, mesh_sha256)
    return plain(
        evaluated(DesignRow(**row).draws(), given.scene, _sparsely_observed(given.problem))
    )


def _sparsely_observed(problem: Problem) -> Problem:
    """The problem with one observed point of the surface: a score needs none."""
    surface = problem.observation.surface_points[:1]
    return replace(problem, observation=replace(problem.observation, surface_points=surface))


def evaluated(drawn: Sequence[OrganDraw], scene: Scene, problem: Problem) -> Block:
    """Estimates and scores of draws; NaN where a motion diverged or cells inverted.

    Also where a body has no rest under its weight, or the path of a tool that travels leaves the
    surface. Gravity, weights and further loads are those of the scene in every draw.
    """
    moduli = estimates(drawn)
    found = [
        _scores(draw, dict(zip(SYSTEMS, map(float, row), strict=True)), scene, problem)
        for draw, row in zip(drawn, moduli, strict=True)
    ]
    return Block(moduli, np.array(found))


def _scores(draw: OrganDraw, moduli: Mapping[str, float], scene: Scene, problem: Problem) -> Floats:
    """Scores (contenders, measures) of a draw."""
    drawn = as_drawn(replace(scene, patient=replace(scene.patient, **_patient(draw))), draw)
    models = models_of(drawn, {name: _estimate(name, e) for name, e in moduli.items()})
    try:
        posed = _posed(draw, drawn, problem)
        found = {model.name: model.prepare(posed).simulate() for model in models}
    except (NoEquilibriumError, OffSurfaceError):
        return np.tile(DIVERGED, (len(CONTENDERS), 1))
    truth = found.pop("basafa")
    named = {READING: found[READING]} | {name: found[f"msm-{name}"] for name in SYSTEMS}
    return np.stack([_compared(posed, named[name], truth) for name in CONTENDERS])


def _patient(draw: OrganDraw) -> dict[str, float | None]:
    return dict.fromkeys(AETIOLOGIES) | readings(draw)


def _estimate(system: str, modulus: float) -> StiffnessEstimate:
    """An estimate without its interval, since the bounds are not run."""
    return StiffnessEstimate(system, modulus, None, 0.0, (), "")


def _posed(draw: OrganDraw, drawn: Scene, problem: Problem) -> Problem:
    """The problem with tool, support and tissue of a draw."""
    own, tissue = drawn.tool, drawn.tissue
    centre = _moved(draw, problem)
    tool = replace(problem.tool, centre=centre, radius=own.radius, force=own.force)
    posed = replace(
        problem,
        foundation=problem.foundation.scaled(draw.support),
        tool=tool,
        tissue=replace(
            problem.tissue,
            youngs_modulus=tissue.youngs_modulus,
            poisson_ratio=tissue.poisson_ratio,
        ),
    )
    if not own.travels:
        return posed
    first, *others = travelling(own, tool, problem.geometry.surface)
    further = (load for load in problem.loads if load.tool.name != tool.name)
    return replace(posed, tool=first.tool, factor=first.factor, loads=(*others, *further))


def _moved(draw: OrganDraw, problem: Problem) -> Floats:
    """Centre [m] (3,) of the tool, shifted across its push and projected onto the surface."""
    tool = problem.tool
    first = np.cross(tool.direction, np.eye(3)[int(np.abs(tool.direction).argmin())])
    first /= np.linalg.norm(first)
    across = draw.across * first + draw.along * np.cross(tool.direction, first)
    x, y, z = map(float, tool.centre + tool.radius * across)
    return resolve(Place(point=(x, y, z)), problem.geometry.surface)[0]


def _compared(problem: Problem, found: Simulation, truth: Simulation) -> Floats:
    """Scores (measures,) of a motion, NaN unless both motions finished."""
    runs = found.trajectory, truth.trajectory
    if found.inverted_cells or truth.inverted_cells or not all(map(_is_whole, runs)):
        return DIVERGED
    of_curves = np.mean(
        [_curve_scores(problem, k, *runs) for k in range(len(problem.probes))], axis=0
    )
    own, true, volumes = (
        runs[0].volume_field[0],
        runs[1].volume_field[0],
        problem.volume_rule.weights,
    )
    apart = relative_l2(own, true, volumes) if norm(true, volumes) > 0.0 else np.nan
    return np.asarray(np.append(of_curves, max(0.0, 1.0 - apart)))


def _is_whole(run: Trajectory) -> bool:
    return run.status == "finished" and bool(np.isfinite(run.volume_field[0]).all())


def _curve_scores(problem: Problem, probe: int, run: Trajectory, truth: Trajectory) -> Floats:
    """Scores (7,) of the curves of a control point."""
    one, other = (problem.response.motion(each, probe) for each in (run, truth))
    own, true = (one.displacement, one.velocity), (other.displacement, other.velocity)
    return np.asarray(scores(*own, *true))
