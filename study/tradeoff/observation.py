"""The motion of one configuration, as a run of a sweep."""

from __future__ import annotations

from typing import Any

import numpy as np

from study.tradeoff.lineup import contender
from study.tradeoff.problem import plain, stated

FUNCTION = f"{__name__}:observe"


def observe(
    name: str, settings: dict[str, Any], scene: dict[str, Any], mesh_sha256: str | None
) -> dict[str, Any]:
    """Field at the peak and curves of displacement of a contender by name, None if it diverged.

    `step_s`: the shortest it took; `margin`: smallest ratio of the critical step to one it took,
    None without a critical step; `diverged_at_s`, `inverted_cells`.
    """
    given = stated(scene, mesh_sha256)
    found = contender(name).run(given.scene, given.problem, settings)
    run = found.trajectory
    whole = run.status == "finished" and bool(np.isfinite(run.volume_field[0]).all())
    return {
        "status": run.status,
        "diverged_at_s": run.diverged_at,
        "inverted_cells": found.inverted_cells,
        "margin": found.margin if np.isfinite(found.margin) else None,
        "step_s": found.step if np.isfinite(found.step) else None,
        "field": plain(run.volume_field[0]) if whole else None,
        "curves": plain(run.displacement) if whole else None,
    }
