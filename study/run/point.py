"""The paper's own scene: one control mass point, eqs. (1), (2) against eqs. (5)-(9)."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from msm import control_point
from msm.calibration import reference_stiffness
from msm.damping import Damping, eq_2, eq_9
from msm.laws import Basafa, Hooke, Law, initial_stiffness
from study.history import load_factor
from study.progress import Progress
from study.run.comparison import Lens
from study.run.outcome import Outcome, model_record
from study.scene import Scene
from study.trajectory import Trajectory

if TYPE_CHECKING:
    from fuzzy.stiffness import Estimate

PROBE = "control-point"


def lens(scene: Scene) -> Lens:
    """How the point's motion is looked at: along its spring."""
    times = np.linspace(0.0, scene.time.duration, scene.time.samples)
    return Lens(times, (PROBE,), np.array([1.0, 0.0, 0.0]), np.zeros(0))


def benchmark_law(scene: Scene) -> Basafa:
    """Eq. (6) of a spring as long as the reference spacing."""
    h_0 = scene.damping.reference_spacing
    return Basafa(scene.basafa.k1 / h_0, scene.basafa.k2 / h_0, scene.basafa.x_c)


def mass(scene: Scene) -> float:
    """Mass [kg] of the point: declared, or that for which eq. (2) meets the benchmark's gamma_0."""
    if scene.organ.mass is not None:
        return scene.organ.mass
    k = initial_stiffness(benchmark_law(scene))
    return control_point.mass_that_meets(scene.basafa.gamma_0, scene.damping.ratio, k)


def run_point(scene: Scene, estimates: dict[str, Estimate], progress: Progress) -> Outcome:
    """Run the benchmark and one oscillator per estimate."""
    outcome = Outcome()
    m, h_0 = mass(scene), scene.damping.reference_spacing
    outcome.extra["control_point"] = {"mass_kg": m, "rest_length_m": h_0}
    if "basafa" in scene.models:
        damping = eq_9(scene.basafa.gamma_0, scene.basafa.gamma_1, m)
        _run(scene, "basafa", benchmark_law(scene), damping, outcome, progress)
    if "msm" in scene.models:
        for system, estimate in estimates.items():
            name = f"msm-{system}"
            trajectory = _fuzzy_tuned(scene, name, estimate.estimate, outcome, progress)
            if estimate.interval is not None:
                ends = [
                    _fuzzy_tuned(scene, name, modulus, Outcome(), progress)
                    for modulus in estimate.interval
                ]
                outcome.bounds[name] = (ends[0], ends[1])
            outcome.runs[name] = trajectory
    return outcome


def _fuzzy_tuned(
    scene: Scene, name: str, modulus: float, outcome: Outcome, progress: Progress
) -> Trajectory:
    k = reference_stiffness(modulus, scene.damping.reference_spacing)
    damping = eq_2(scene.damping.ratio, k, mass(scene))
    return _run(scene, name, Hooke(k), damping, outcome, progress)


def _run(
    scene: Scene, name: str, law: Law, damping: Damping, outcome: Outcome, progress: Progress
) -> Trajectory:
    m, h_0 = mass(scene), scene.damping.reference_spacing

    def force(t: float) -> float:
        factor = load_factor(scene.tool.history, np.asarray(t))
        return scene.tool.force * float(factor)

    started = time.perf_counter()
    with progress.stage(name):
        trajectory = control_point.run(law, h_0, m, damping, force, lens(scene).times)
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
