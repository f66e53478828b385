"""Quick motions of coarse lattices, by which a plan predicts those of finer ones.

A lattice that cannot follow the scene is left out of the plan, with the reason, and says nothing of
those of other spacings.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.assembly import arrays
from msm.model import Counts, Run
from study.models.lattice import LatticeModel
from study.models.remainder import plus
from study.models.spacing_error import force_differences
from study.models.table import model
from study.plan.candidates import Omitted, lattice_name, lattice_settings
from study.plan.prediction import Measure
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene import Lattice, Require, Scene
from study.similarity.fields import relative_l2, relative_l2_of_curves

Floats = NDArray[np.float64]

PEAK_FORCE, HISTORY = "peak-force", "history"


class Motion(NamedTuple):
    """The finished motion of a lattice of a `spacing` [m], and its cost.

    Number of `springs`, wall time [s] of its `setup`, bytes of its arrays.
    """

    spacing: float
    run: Run
    springs: int
    setup: float
    nbytes: int

    @property
    def step_wall(self) -> float:
        """Wall time of a step [s]."""
        return self.run.wall / self.run.steps


@dataclass(frozen=True)
class Motions:
    """Those that finished, by falling spacing, and those of `lost` spacings [m] with the reason."""

    finished: tuple[Motion, ...]
    lost: dict[float, Omitted]

    def stands_for(self, spacing: float) -> float:
        """Which of all spacings [m] is nearest in ratio to another."""
        tried = [*(one.spacing for one in self.finished), *self.lost]
        return min(tried, key=lambda one: abs(np.log(one / spacing)))


def motions(scene: Scene, problem: Problem, spacings: Sequence[float]) -> Motions:
    """Motions of lattices of these spacings [m]."""
    found = {spacing: motion(scene, problem, spacing) for spacing in spacings}
    return Motions(
        tuple(one for one in found.values() if isinstance(one, Motion)),
        {spacing: one for spacing, one in found.items() if isinstance(one, Omitted)},
    )


def motion(scene: Scene, problem: Problem, spacing: float) -> Motion | Omitted:
    """The motion of a lattice of a spacing [m], or why it is lost."""
    name, started = lattice_name(spacing), time.perf_counter()
    try:
        prepared = _lattice(scene, lattice_settings(scene, spacing)).prepare(problem)
        run = prepared.moved()
    except ValueError as error:  # a tool or support that misses it, or no equilibrium
        return Omitted(name, str(error))
    setup = time.perf_counter() - started - run.wall
    if run.trajectory.status != "finished":
        return Omitted(name, f"its motion diverges at {run.trajectory.ended_at:.3g} s")
    if run.inverted_cells:
        return Omitted(name, f"its motion inverts {run.inverted_cells} cells")
    net = arrays(prepared.assembly, prepared.springs.material)
    nbytes = sum(part.nbytes for part in net if isinstance(part, np.ndarray))
    return Motion(spacing, run, len(prepared.assembly.springs.weight), setup, nbytes)


def beyond_linear(scene: Scene, problem: Problem, given: Motion) -> Trajectory:
    """The nonlinear part of a lattice's motion, by the same steps."""
    linear = replace(lattice_settings(scene, given.spacing), geometry="linear")
    run = _lattice(scene, linear).prepare(problem).moved(Counts(given.run.substeps))
    return plus(given.run.trajectory, run.trajectory, -1.0)


def _lattice(scene: Scene, given: Lattice) -> LatticeModel:
    """The lattice of the tissue's modulus, with these settings."""
    tissue = model(scene, "tissue")
    assert isinstance(tissue, LatticeModel)  # noqa: S101 - it is one by its kind
    return replace(tissue, scene=replace(tissue.scene, lattice=given))


def difference(
    problem: Problem, required: Require, measure: Measure, coarse: Trajectory, fine: Trajectory
) -> float:
    """Largest relative difference of two motions in any of the required quantities."""
    found = list[float]()
    if HISTORY in required.quantities:
        curves = relative_l2_of_curves(coarse.displacement - fine.displacement, fine.displacement)
        found += curves[list(measure.probes)].tolist()
    if measure.volumes is not None:
        found.append(relative_l2(coarse.volume_field[0], fine.volume_field[0], measure.volumes))
    if PEAK_FORCE in required.quantities:
        # Over time too, for two lattices may meet in a single number by chance.
        found += force_differences(problem, coarse.tool_force, fine.tool_force).ravel().tolist()
    return max(found)
