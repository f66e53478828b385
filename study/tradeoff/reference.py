"""The converged reference of a scene and its own error, as a run of a sweep."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.progress import Silent
from study.run.outcome import Outcome
from study.run.reference import run_reference
from study.tradeoff.problem import Stated, plain, stated

Floats = NDArray[np.float64]

FUNCTION = f"{__name__}:solve"


@dataclass(frozen=True)
class Reference:
    """What contenders are compared with.

    `field` [m] (q, 3) at the peak; `curves` [m] (samples, probes, 3); relative errors of both,
    `field_error` and `curve_errors` (probes,).
    """

    field: Floats
    curves: Floats
    field_error: float
    curve_errors: Floats


def solve(scene: dict[str, Any], mesh_sha256: str | None) -> dict[str, Any]:
    """Field at the peak, curves of displacement, and relative errors of both.

    An error is the sum of those by the mesh, by the subspace and by the steps of the load. None
    where the organ has no other mesh to tell it.
    """
    given = stated(scene, mesh_sha256)
    posed = given.problem
    linear = replace(given.scene.reference, large_strain="none")
    outcome = Outcome()
    run_reference(replace(given.scene, reference=linear), posed, outcome, Silent())
    (record,), found = outcome.models, outcome.runs["fem"]
    rest = (record["truncation_error"] or 0.0) + max(
        kinds["displacement"] for kinds in record["time_step_error_by_probe"].values()
    )
    mesh = record.get("mesh_error")
    return {
        "field": plain(found.volume_field[0]),
        "curves": plain(found.displacement),
        "field_error": mesh and mesh["field_peak"] + rest,
        "curve_errors": mesh
        and [record["mesh_error_by_probe"][p]["displacement"] + rest for p in posed.probes],
        "unknowns": record["unknowns"],
        "element": record["element"],
        "levels": record["mesh_levels"],
    }


def restored(value: dict[str, Any], given: Stated) -> Reference:
    """The reference of a stored value. ValueError if its error is unknown."""
    if value["field_error"] is None:
        raise ValueError(
            "the organ has one mesh only, so the error of its reference is unknown and none of a "
            "model can be told from it; refine organ.mesh or give a surface"
        )
    seen = given.problem.observation
    return Reference(
        np.reshape(value["field"], (-1, 3)),
        np.reshape(value["curves"], (len(seen.times), len(seen.probes), 3)),
        value["field_error"],
        np.array(value["curve_errors"]),
    )
