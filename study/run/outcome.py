"""What the models of a scene did, collected model by model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.problem.trajectory import Trajectory
from study.scene import Scene

STRAIN_LIMIT = 0.05
"""Largest strain of the linear reference above which it is not to be trusted."""
ROTATION_LIMIT = 0.2
"""Largest rotation [rad] of it: half its square is a strain that linear elasticity invents."""
TIME_STEP_LIMITS = {"displacement": 0.01, "velocity": 0.05}
TINY = 1e-300


@dataclass
class Outcome:
    """Filled while the models run.

    `runs`: trajectory by model; `bounds`: runs at the two ends of a stiffness interval, by model;
    `models`, `checks`, `extra`: records for results.json; `notes`: sentences for the report.
    """

    runs: dict[str, Trajectory] = field(default_factory=dict)
    bounds: dict[str, tuple[Trajectory, Trajectory]] = field(default_factory=dict)
    models: list[dict[str, Any]] = field(default_factory=list)
    checks: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    extra: dict[str, Any] = field(default_factory=dict)

    def add_check(self, name: str, value: float, limit: float, meaning: str) -> None:
        """Record a check that passes at or below its limit."""
        passed = bool(value <= limit)
        self.checks.append(
            {"name": name, "value": value, "limit": limit, "passed": passed, "meaning": meaning}
        )

    def add_time_step_errors(
        self,
        record: dict[str, Any],
        probes: tuple[str, ...],
        whole: Trajectory,
        half: Trajectory,
        order: int,
    ) -> None:
        """Record and check the error of whole steps, by Richardson from a run with half steps.

        Scores compare curve with curve, so the errors are those of each control point's curves; the
        record holds the largest beside them.
        """
        name = record["name"]
        if half.status != "finished":
            meaning = "runs with halved steps that diverged although whole steps did not"
            self.add_check(f"{name}: halved steps", 1.0, 0.0, meaning)
            return
        found = curve_errors(1.0 / (1.0 - 0.5**order), probes, whole, half)
        record["time_step_error_by_probe"] = found
        for kind, limit in TIME_STEP_LIMITS.items():
            worst = max(errors[kind] for errors in found.values())
            record["time_step_error" + ("" if kind == "displacement" else f"_{kind}")] = worst
            meaning = f"largest relative L2 error of a {kind} curve by the time step"
            self.add_check(f"{name}: {kind} by time step", worst, limit, meaning)


def model_record(name: str, scene: Scene, trajectory: Trajectory) -> dict[str, Any]:
    """What results.json says of every model."""
    near = trajectory.diverged_near
    return {
        "name": name,
        "simulated_s": scene.time.duration,
        "status": trajectory.status,
        "diverged_at_s": trajectory.diverged_at,
        "diverged_near_m": None if near is None else [float(x) for x in near],
    }


def curve_errors(
    share: float, probes: tuple[str, ...], run: Trajectory, other: Trajectory
) -> dict[str, dict[str, float]]:
    """`share` of the relative L2 difference between two runs, by probe and kind of curve."""
    return {
        probe: {
            "displacement": share * _difference(run.displacement[:, i], other.displacement[:, i]),
            "velocity": share * _difference(run.velocity[:, i], other.velocity[:, i]),
        }
        for i, probe in enumerate(probes)
    }


def _difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Relative L2 difference of two motions (samples, 3)."""
    return float(np.linalg.norm(a - b) / max(float(np.linalg.norm(b)), TINY))
