"""Time-step and rounding errors, from motions with half the step or in double precision."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.models.model import Model, ModelRun, Prepared, Watch
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.results.records import Check, CurveErrors, ModelRecord, largest

DISPLACEMENT_LIMIT, VELOCITY_LIMIT = 0.01, 0.05
ROUNDING = 1e-15
"""Root of a sum of squares in m, m/s or N below which a motion or force is rounding.

The coordinates of a body of 0.1 m are rounded to 1e-17 m. A body at rest that nothing touches moves
by less, and differences of that are no error of its steps.
"""


def time_step_errors(
    order: int, probes: tuple[str, ...], whole: Trajectory, half: Trajectory
) -> dict[str, CurveErrors]:
    """Relative L2 errors by control point due to the time step; empty if the half steps diverged.

    By Richardson extrapolation with the order of the integrator. Scores compare curve with curve,
    so the errors are those of each control point's curves.
    """
    if half.status != "finished":
        return {}
    share = 1.0 / (1.0 - 0.5**order)
    return {
        probe: CurveErrors(
            displacement=share * _difference(whole.displacement[:, i], half.displacement[:, i]),
            velocity=share * _difference(whole.velocity[:, i], half.velocity[:, i]),
        )
        for i, probe in enumerate(probes)
    }


def tool_force_errors(
    order: int, tools: tuple[str, ...], whole: Trajectory, half: Trajectory
) -> dict[str, float]:
    """Relative L2 error of each rigid tool's force due to the step, as `time_step_errors`."""
    if half.status != "finished":
        return {}
    share = 1.0 / (1.0 - 0.5**order)
    return {
        name: share * _difference(whole.tool_force[:, i], half.tool_force[:, i])
        for i, name in enumerate(tools)
    }


def mean_velocity_error(
    order: int, problem: Problem, whole: Trajectory, half: Trajectory
) -> float | None:
    """Largest relative L2 error, due to the time step, of a velocity averaged between samples.

    None without rigid tools. Where such a tool reaches or leaves a point, its velocity jumps
    (Moreau 1988, Unilateral contact and dry friction in finite freedom dynamics). Runs with
    different steps place a jump at different times, and a sample in between differs by all of it,
    however short the steps. The mean is an increment of displacement and converges like it.
    """
    if not problem.rigid_tools:
        return None
    share = 1.0 / (1.0 - 0.5**order)
    moved, other = (np.diff(one.displacement, axis=0) for one in (whole, half))
    return share * max(_difference(moved[:, i], other[:, i]) for i in range(moved.shape[1]))


def rounding_errors(
    probes: tuple[str, ...], single: Trajectory, double: Trajectory
) -> dict[str, CurveErrors]:
    """Relative L2 errors of single precision by control point; empty if double diverged."""
    if double.status != "finished":
        return {}
    return {
        probe: CurveErrors(
            displacement=_difference(single.displacement[:, i], double.displacement[:, i]),
            velocity=_difference(single.velocity[:, i], double.velocity[:, i]),
        )
        for i, probe in enumerate(probes)
    }


def _difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Relative L2 difference of two motions (samples, 3)."""
    return float(np.linalg.norm(a - b) / max(float(np.linalg.norm(b)), ROUNDING))


def step_checks(
    name: str, errors: dict[str, CurveErrors], mean_velocity: float | None = None
) -> Iterator[Check]:
    """Checks of whether the steps of a finished model were short enough.

    `mean_velocity`: the `mean_velocity_error`, which is checked instead of the velocity if given.
    """
    if not errors:
        meaning = "runs with halved steps that diverged although whole steps did not"
        yield Check(name=f"{name}: halved steps", value=1.0, limit=0.0, meaning=meaning)
        return
    of_displacement, of_velocity = _curve_checks(name, errors, "time step", "the ")
    if mean_velocity is not None:
        meaning = (
            "largest relative L2 error of a velocity, averaged between samples since contact makes "
            "it jump, by the time step"
        )
        of_velocity = replace(of_velocity, value=mean_velocity, meaning=meaning)
    yield from (of_displacement, of_velocity)


def rounding_checks(name: str, errors: dict[str, CurveErrors]) -> Iterator[Check]:
    """Checks of whether single precision was sufficient for a finished model."""
    if not errors:
        meaning = "runs in double precision that diverged although single precision did not"
        yield Check(name=f"{name}: double precision", value=1.0, limit=0.0, meaning=meaning)
        return
    yield from _curve_checks(name, errors, "single precision")


def _curve_checks(
    name: str, errors: dict[str, CurveErrors], cause: str, article: str = ""
) -> Iterator[Check]:
    worst = largest(errors)
    for kind, value, limit in (
        ("displacement", worst.displacement, DISPLACEMENT_LIMIT),
        ("velocity", worst.velocity, VELOCITY_LIMIT),
    ):
        meaning = f"largest relative L2 error of a {kind} curve by {article}{cause}"
        yield Check(name=f"{name}: {kind} by {cause}", value=value, limit=limit, meaning=meaning)


def place(trajectory: Trajectory) -> tuple[float, float, float] | None:
    """Where a run diverged [m], if that is known."""
    near = trajectory.ended_near
    return None if near is None else (float(near[0]), float(near[1]), float(near[2]))


def estimated_run(
    model: Model, prepared: Prepared, problem: Problem, watch: Watch, order: int | None = None
) -> ModelRun:
    """The run of a model from its own simulation, with what can be stated of any model.

    With the `order` of its integrator, the time-step error is estimated from half the step. No
    nodal fields are written, and a note says so where they were requested.
    """
    started = time.perf_counter()
    with watch.progress.stage(model.name):
        found = prepared.simulate()
    wall, errors = time.perf_counter() - started, dict[str, CurveErrors]()
    checks: tuple[Check, ...] = ()
    finished = found.trajectory.status == "finished"
    if order is not None and finished:
        with watch.progress.stage(f"{model.name}: halved steps"):
            half = prepared.simulate(0.5 * found.step).trajectory
        errors = time_step_errors(order, problem.probes, found.trajectory, half)
        mean = mean_velocity_error(order, problem, found.trajectory, half)
        checks = tuple(step_checks(model.name, errors, mean))
    record = ModelRecord(
        name=model.name,
        label=model.label,
        simulated_s=float(problem.observation.times[-1]),
        status=found.trajectory.status,
        ended_at_s=found.trajectory.ended_at,
        ended_near_m=place(found.trajectory),
        time_step_s=found.step,
        wall_s=wall,
        largest_strain=found.largest_strain,
        time_step_errors=errors,
    )
    wanted = watch.persistence is not None and watch.persistence.fields is not None
    notes = (f"Fields of {model.name} are not kept: only lattices and fem keep them.",)
    return ModelRun(found.trajectory, record, checks, notes if wanted else ())
