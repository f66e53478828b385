"""The motion of one configuration, as a task of a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study.models.model import Simulation
from study.run.scene_problem import scene_problem
from study.sweep.canonical import Plain
from study.tradeoff.contenders import Configuration
from study.tradeoff.problem import plain

FUNCTION = f"{__name__}:observe"


@dataclass(frozen=True)
class Observed:
    """Field at the peak and displacement curves, flattened; None for a motion that did not finish.

    `force` [N]: on the moved tools, (samples, tools, 3). `step_s`: the shortest step taken;
    `margin`: smallest ratio of the critical step to a step taken, None without a critical step.
    """

    ended_at_s: float | None
    inverted_cells: int
    margin: float | None
    step_s: float | None
    field: list[float] | None
    curves: list[float] | None
    force: list[float] | None = None


def observe(name: str, settings: Plain, scene: Plain, mesh_sha256: str | None) -> Plain:
    """The observed motion of a contender by name, as plain values of `Observed`."""
    given = scene_problem(scene, mesh_sha256)
    configuration = Configuration(name, settings)
    return vars(_observed(configuration.model(given.scene).prepare(given.problem).simulate()))


def _observed(found: Simulation) -> Observed:
    run = found.trajectory
    whole = run.status == "finished" and bool(np.isfinite(run.volume_field[0]).all())
    return Observed(
        ended_at_s=run.ended_at,
        inverted_cells=found.inverted_cells,
        margin=found.margin if np.isfinite(found.margin) else None,
        step_s=found.step if np.isfinite(found.step) else None,
        field=plain(run.volume_field[0]) if whole else None,
        curves=plain(run.displacement) if whole else None,
        force=plain(run.tool_force) if whole else None,
    )
