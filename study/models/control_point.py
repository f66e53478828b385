"""A single control mass point on one spring, as the paper compares its models."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from msm import control_point
from msm.calibration import reference_stiffness
from msm.damping import NodalDamping, eq_2
from msm.laws import Hooke, Law, initial_stiffness
from study.models.errors import place
from study.models.model import ModelRun, Watch
from study.problem.problem import PointProblem
from study.problem.trajectory import Trajectory
from study.results.records import CurveErrors, ModelRecord, PointRecord


@dataclass(frozen=True)
class SpringDashpot:
    """Law of the spring, damping of the point, and the Young's modulus [Pa] they represent."""

    law: Law
    damping: NodalDamping
    modulus: float | None = None


Make = Callable[[PointProblem], SpringDashpot]


def oscillator_of(modulus: float, zeta: float, problem: PointProblem) -> SpringDashpot:
    """A spring of eq. (1) for a Young's modulus [Pa], with the damping of eq. (2)."""
    k = reference_stiffness(modulus, problem.rest_length)
    return SpringDashpot(Hooke(k), eq_2(zeta, k, problem.mass), modulus)


@dataclass(frozen=True, kw_only=True)
class PointSpring:
    """A spring and a dashpot on a point, made by `make`; `bounds` make two other stiffnesses.

    `system`: the fuzzy system that estimated the stiffness.
    """

    name: str
    label: str
    make: Make
    bounds: tuple[Make, Make] | None = None
    system: str | None = None

    def refuse(self, problem: PointProblem) -> None:
        """Raise ValueError for an inadmissible spring or dashpot, at the bounds too."""
        for make in (self.make, *(self.bounds or ())):
            make(problem)

    def run(self, problem: PointProblem, watch: Watch) -> ModelRun:
        """The motion, by a solver with a tight tolerance, also at both bounds of the stiffness."""
        oscillator = self.make(problem)
        started = time.perf_counter()
        with watch.progress.stage(self.name):
            found = _moved(oscillator, problem)
        record = self._record(oscillator, problem, found, time.perf_counter() - started)
        if self.bounds is None:
            return ModelRun(found, record)
        low, high = (_moved(make(problem), problem) for make in self.bounds)
        return ModelRun(found, record, bounds=(low, high))

    def _record(
        self, oscillator: SpringDashpot, problem: PointProblem, found: Trajectory, wall: float
    ) -> ModelRecord:
        k, m = initial_stiffness(oscillator.law), problem.mass
        rate, tolerance = oscillator.damping.gamma_0, control_point.RELATIVE_TOLERANCE
        errors = CurveErrors(displacement=tolerance, velocity=tolerance)
        return ModelRecord(
            name=self.name,
            label=self.label,
            system=self.system,
            simulated_s=float(problem.times[-1]),
            status=found.status,
            ended_at_s=found.ended_at,
            ended_near_m=place(found),
            nodes=1,
            wall_s=wall,
            small_strain_modulus_pa=oscillator.modulus,
            damping_rate_per_s=rate,
            time_step_errors=dict.fromkeys(problem.probes, errors),
            point=PointRecord(
                stiffness_n_per_m=k,
                mass_kg=m,
                damping_ratio=rate / (2.0 * float(np.sqrt(k / m))),
            ),
        )


def _moved(oscillator: SpringDashpot, problem: PointProblem) -> Trajectory:
    def force(t: float) -> float:
        return float(problem.force(np.asarray(t)))

    spring = (oscillator.law, problem.rest_length, problem.mass, oscillator.damping)
    return control_point.run(*spring, force, problem.times)
