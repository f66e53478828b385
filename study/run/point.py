"""The paper's own scene: one control mass point, eqs. (1), (2) against eqs. (5)-(9)."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from msm import control_point
from msm.calibration import reference_stiffness
from msm.damping import NodalDamping, eq_2, eq_9
from msm.laws import Basafa, Hooke, Law, initial_stiffness
from study.problem.problem import PointProblem
from study.problem.trajectory import Trajectory
from study.progress import Progress
from study.run.outcome import Outcome, model_record
from study.scene import Scene

if TYPE_CHECKING:
    from fuzzy.stiffness import Estimate


def benchmark_law(scene: Scene) -> Basafa:
    """Eq. (6) of a spring as long as the reference spacing."""
    h_0 = scene.damping.reference_spacing
    return Basafa(scene.basafa.k1 / h_0, scene.basafa.k2 / h_0, scene.basafa.x_c)


def run_point(
    scene: Scene, point: PointProblem, estimates: dict[str, Estimate], progress: Progress
) -> Outcome:
    """Run the benchmark and one oscillator per estimate."""
    outcome = Outcome()
    m, h_0 = point.mass, point.rest_length
    outcome.extra["control_point"] = {"mass_kg": m, "rest_length_m": h_0}
    if "basafa" in scene.models:
        damping = eq_9(scene.basafa.gamma_0, scene.basafa.gamma_1, m)
        _run(scene, point, "basafa", benchmark_law(scene), damping, outcome, progress)
    if "msm" in scene.models:
        for system, estimate in estimates.items():
            name = f"msm-{system}"
            trajectory = _fuzzy_tuned(scene, point, name, estimate.estimate, outcome, progress)
            if estimate.interval is not None:
                ends = [
                    _fuzzy_tuned(scene, point, name, modulus, Outcome(), progress)
                    for modulus in estimate.interval
                ]
                outcome.bounds[name] = (ends[0], ends[1])
            outcome.runs[name] = trajectory
    return outcome


def _fuzzy_tuned(
    scene: Scene,
    point: PointProblem,
    name: str,
    modulus: float,
    outcome: Outcome,
    progress: Progress,
) -> Trajectory:
    k = reference_stiffness(modulus, scene.damping.reference_spacing)
    damping = eq_2(scene.damping.ratio, k, point.mass)
    return _run(scene, point, name, Hooke(k), damping, outcome, progress)


def _run(
    scene: Scene,
    point: PointProblem,
    name: str,
    law: Law,
    damping: NodalDamping,
    outcome: Outcome,
    progress: Progress,
) -> Trajectory:
    m, h_0 = point.mass, point.rest_length

    def force(t: float) -> float:
        return float(point.force(np.asarray(t)))

    started = time.perf_counter()
    with progress.stage(name):
        trajectory = control_point.run(law, h_0, m, damping, force, point.times)
    wall = time.perf_counter() - started
    outcome.runs[name] = trajectory
    k = initial_stiffness(law)
    outcome.models.append(
        model_record(name, scene, trajectory)
        | {
            "nodes": 1,
            "springs": 1,
            "time_step_s": None,  # chosen by the solver, step by step
            "critical_time_step_s": None,
            "steps": None,
            "wall_s": wall,
            "time_step_error": control_point.RELATIVE_TOLERANCE,
            "stiffness_n_per_m": k,
            "node_mass_kg": m,
            "damping_rate_per_s": damping.gamma_0,
            "damping_ratio": damping.gamma_0 / (2.0 * float(np.sqrt(k / m))),
        }
    )
    return trajectory
