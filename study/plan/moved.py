"""The plan of a scene with moved tools, gravity, weights or several loads: by three quick motions.

The discretisation error of a lattice is estimated from motions on three coarse ones, at the order
of a run's own estimate. Errors of contact vary irregularly with the position of the cells, so that
two lattices may agree by chance, and the largest difference of any two is taken. That by itself is
the error in the median; its factor covers the scatter. The error that springs have at any spacing
is not estimated. Where corrected lattices support the scene, as under tools that travel, their
error is estimated from the nonlinear parts of two of these motions, and from finite elements on two
meshes at rest.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from fem_reference.error_estimate import ASSUMED_ORDER
from fem_reference.observation import at_points, evaluation
from fem_reference.solvers import solver
from study.models.finite_elements import PreparedElements
from study.models.remainder import plus
from study.models.spacing_error import COARSER, ESTIMATE, ORDER
from study.models.table import kind
from study.plan.candidates import (
    SIZES,
    SPACINGS,
    Candidate,
    Omitted,
    lattice_name,
    lattice_settings,
    on_elements,
)
from study.plan.look import ElementsLook, Look, Rest, meshes
from study.plan.motions import Motion, Motions, beyond_linear, difference, motions
from study.plan.prediction import (
    CAUTION,
    MESH,
    NONLINEAR_ORDER,
    REMAINDER,
    SPACING,
    SUBSPACE,
    TRUNCATION,
    Measure,
    Part,
    Prediction,
)
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene import Scene
from study.similarity.fields import norm, relative_l2_of_curves

Floats = NDArray[np.float64]

LOOK = 1.0
"""Spacing of the finest of these lattices, times that of the scene.

Coarser ones underestimate the error of the nonlinear part: on a block under a tool of 12 mm, it is
an eighth of the difference between lattices of 10 and 5 mm if estimated from those of 12.5 and 25
mm, and two thirds from those of 10 and 20 mm.
"""
BETWEEN = 1.25
"""Spacing of the third lattice, times that of the finest.

Two lattices may agree by chance, and the prediction would fall short more often.
"""


@dataclass(frozen=True)
class MovedLook:
    """Motions of lattices of once, BETWEEN and COARSER times LOOK of the scene's spacing.

    `error`: estimated relative error of the required quantities on the finest of those that
    finished; infinite for fewer than two. `beyond`: largest difference of the nonlinear parts on
    the coarsest and the finest, relative to the whole motion of the latter. `elements`: coarse
    finite elements at rest, and `mesh` their estimated discretisation error. `beyond` and
    `elements` are None where a corrected lattice does not support the scene.
    """

    motions: Motions
    error: float = math.inf
    beyond: float | None = None
    elements: Look | None = None
    mesh: float = math.inf

    @property
    def finest(self) -> Motion:
        """Of those that finished. IndexError for none."""
        return self.motions.finished[-1]


@dataclass(frozen=True)
class AtRest:
    """Elements, displacements [m] of control points (loads, p, 3) and over the organ (loads, q, 3).

    Under each load by itself, in full, gravity among them.
    """

    look: ElementsLook
    probes: Floats
    field: Floats


def look(scene: Scene, problem: Problem, measure: Measure) -> MovedLook:
    """Motions of three lattices, and errors as far as two of them finish."""
    spacings = [times * LOOK * scene.lattice.spacing for times in (COARSER, BETWEEN, 1.0)]
    found = motions(scene, problem, spacings)
    if len(found.finished) < 2:
        return MovedLook(found)
    assert scene.require is not None  # noqa: S101 - as something is planned for
    apart = partial(difference, problem, scene.require, measure)
    curves = [one.run.trajectory for one in found.finished]
    ratio = found.finished[0].spacing / found.finished[-1].spacing
    seen = MovedLook(found, error_of_finest(curves, apart, ratio))
    if not _is_correctable(scene):
        return seen
    before, last = (beyond_linear(scene, problem, found.finished[n]) for n in (0, -1))
    elements = [_at_rest(*one) for one in meshes(scene, problem)]
    strain = seen.finest.run.largest_strain
    return replace(
        seen,
        beyond=_by_motion(measure, plus(before, last, -1.0), curves[-1]),
        elements=Look(problem, (), tuple(one.look for one in elements), strain, 0.0),
        mesh=_by_mesh(measure, elements),
    )


def error_of_finest(
    motions: Sequence[Trajectory],
    apart: Callable[[Trajectory, Trajectory], float],
    ratio: float = COARSER,
) -> float:
    """Relative error of the last of several lattices of falling spacing.

    By Richardson extrapolation at order one of the largest difference, as if it were that of the
    first and the last, whose spacings have this `ratio`. The order that three lattices show is not
    used: under tools of the size of a few cells they are not in the asymptotic range. `apart`:
    relative difference of a motion from one on a finer lattice.
    """
    largest = max(apart(one, finer) for one, finer in combinations(motions, 2))
    return float(ESTIMATE * largest / (ratio**ORDER - 1.0))


def _is_correctable(scene: Scene) -> bool:
    """Whether a corrected lattice follows a scene, and large displacements are asked for."""
    able = kind("corrected").supported_features
    nonlinear = scene.lattice.geometry == "nonlinear" and scene.lattice.integrator != "xpbd"
    return nonlinear and able.issuperset(scene.features)


def _by_motion(measure: Measure, apart: Trajectory, whole: Trajectory) -> float:
    """Largest relative size of a difference of motions, over time or of the kept field."""
    curves = relative_l2_of_curves(apart.displacement, whole.displacement)
    found = curves[list(measure.probes)].tolist()
    if measure.volumes is not None:
        field = norm(apart.volume_field[0], measure.volumes)
        found.append(field / norm(whole.volume_field[0], measure.volumes))
    return float(max(found))


def _at_rest(level: int, size: float, prepared: PreparedElements) -> AtRest:
    """Elements at rest under gravity and each load alone, of one that travels at each station."""
    started, body = time.perf_counter(), prepared.body()
    solve, seen = solver(body), prepared.problem.observation
    dead = () if body.dead is None else (body.dead,)
    rests = np.array([solve(load) for load in (*body.loads.T, *dead)])
    wall = (time.perf_counter() - started) / len(rests)
    probes, field = (
        np.array([at_points(weights, u) for u in rests])
        for weights in (evaluation(body, seen.probes), evaluation(body, seen.volume_points))
    )
    whole = Rest(probes.sum(axis=0), field.sum(axis=0))
    return AtRest(ElementsLook(level, size, body.unknowns, wall, whole), probes, field)


def _by_mesh(measure: Measure, elements: Sequence[AtRest]) -> float:
    """Error of the finest of these elements by Richardson extrapolation; infinite for one mesh.

    Over all loads together, since a control point hardly moves once a tool has left it.
    """
    if len(elements) < 2:
        return math.inf
    before, last = elements[-2:]
    gain = (before.look.size / last.look.size) ** ASSUMED_ORDER - 1.0
    chosen = list(measure.probes)
    apart = relative_l2_of_curves(last.probes - before.probes, last.probes)[chosen].tolist()
    if measure.volumes is not None:
        fields = zip(last.field, before.field, strict=True)
        size = math.hypot(*(norm(one, measure.volumes) for one in last.field))
        apart.append(math.hypot(*(norm(a - b, measure.volumes) for a, b in fields)) / size)
    return float(CAUTION * max(apart) / gain)


def corrected(scene: Scene, seen: MovedLook) -> Iterator[Candidate]:
    """Lattices corrected by elements, with predicted errors and costs, where they apply."""
    if seen.beyond is None or seen.elements is None:
        return
    last, base = seen.elements.elements[-1].size, seen.elements.problem.geometry.level(0)
    assert base is not None  # noqa: S101 - the organ was built of it
    first, finest = seen.motions.finished[0].spacing, seen.finest.spacing
    gain = (first / finest) ** NONLINEAR_ORDER - 1.0
    loads = 1 + len(seen.elements.problem.loads)
    for coarse in lattices(scene, seen):
        if isinstance(coarse, Omitted):
            continue
        spacing = coarse.scene.lattice.spacing
        left = CAUTION * seen.beyond / gain * (spacing / finest) ** NONLINEAR_ORDER
        for times in SIZES:
            fine = on_elements(scene, seen.elements, times)
            mesh = seen.mesh * (times * base.size / last) ** ASSUMED_ORDER
            parts = Part(REMAINDER, left), Part(MESH, mesh), Part(TRUNCATION, SUBSPACE)
            chosen = replace(scene.corrected, spacing=spacing, coarse="uniform")
            size = f"{1e3 * fine.scene.reference.element_size:.3g} mm"
            yield replace(
                coarse,
                name=f"{coarse.name}, corrected by finite elements of {size}",
                scene=replace(fine.scene, models=("corrected",), corrected=chosen),
                prediction=Prediction(parts),
                step_wall=coarse.step_wall + 2.0 * loads * fine.step_wall,
                setup=coarse.setup + loads * fine.setup,
                memory=2.0 * coarse.memory + fine.memory,
                leaves_out=("any other path of the loads",),
            )


def lattices(scene: Scene, seen: MovedLook) -> Iterator[Candidate | Omitted]:
    """Lattices of the tissue's modulus by their spacing, with predicted errors and costs.

    Where the motion of the nearest spacing is lost, that of a lattice is expected to be.
    """
    for times in SPACINGS:
        spacing = times * scene.lattice.spacing
        nearest = seen.motions.stands_for(spacing)
        if nearest in seen.motions.lost:
            yield _lost(spacing, nearest, seen.motions.lost[nearest])
        elif math.isinf(seen.error):
            why = "its error is unknown, since no lattice of another spacing finishes its motion"
            yield Omitted(lattice_name(spacing), why)
        else:
            yield _lattice(scene, seen, spacing)


def _lost(spacing: float, nearest: float, lost: Omitted) -> Omitted:
    """A lattice of a spacing [m] whose motion is lost, or is expected to be as the `nearest`."""
    if math.isclose(spacing, nearest):
        return lost
    return Omitted(lattice_name(spacing), f"not tried, as a {lost.name} is lost")


def _lattice(scene: Scene, seen: MovedLook, spacing: float) -> Candidate:
    """A lattice of a spacing [m], by the finest whose motion is known."""
    known = seen.finest
    finer = known.spacing / spacing
    return Candidate(
        name=lattice_name(spacing),
        scene=replace(scene, models=("tissue",), lattice=lattice_settings(scene, spacing)),
        prediction=Prediction((Part(SPACING, seen.error / finer**ORDER),)),
        step=known.run.smallest_step / finer,
        step_wall=known.step_wall * finer**3,
        setup=known.setup * finer**3,
        memory=known.nbytes * finer**3,
        leaves_out=("the error of springs that does not decrease with the spacing",),
    )
