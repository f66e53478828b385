"""The converged reference of a scene and its own error, as a run of a sweep."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from study.models.finite_elements import reference_of
from study.models.model import SILENT
from study.results.records import ElementsRecord, MeshLevel
from study.run.stated import Stated, stated
from study.sweep.canonical import Plain, restored
from study.tradeoff.problem import plain

Floats = NDArray[np.float64]

FUNCTION = f"{__name__}:solve"


@dataclass(frozen=True)
class SolvedReference:
    """A reference as plain values: field at the peak and curves of displacement, flat.

    An error is the sum of those by the mesh, by the subspace and by the steps of the load; None
    where the organ has no other mesh to tell it.
    """

    field: list[float]
    curves: list[float]
    field_error: float | None
    curve_errors: list[float] | None
    unknowns: int
    element: str
    levels: tuple[MeshLevel, ...]


@dataclass(frozen=True)
class Truth:
    """What contenders are compared with.

    `field` [m] (q, 3) at the peak; `curves` [m] (samples, probes, 3); relative errors of both,
    `field_error` and `curve_errors` (probes,).
    """

    field: Floats
    curves: Floats
    field_error: float
    curve_errors: Floats


def solve(scene: Plain, mesh_sha256: str | None) -> Plain:
    """The reference of a scene, as plain values of `SolvedReference`."""
    given = stated(scene, mesh_sha256)
    reference = reference_of(given.scene).varied(large_strain="none")
    run = reference.prepare(given.problem).run(SILENT)
    elements, steps = run.record.elements, run.record.time_step_errors
    assert isinstance(elements, ElementsRecord)  # noqa: S101 - finite elements have one
    rest = (elements.truncation_error or 0.0) + max(one.displacement for one in steps.values())
    mesh = elements.mesh_error
    probes = given.problem.probes
    return asdict(
        SolvedReference(
            field=plain(run.trajectory.volume_field[0]),
            curves=plain(run.trajectory.displacement),
            field_error=None if mesh is None else mesh.field_peak + rest,
            curve_errors=(
                None if mesh is None else [mesh.by_probe[p].displacement + rest for p in probes]
            ),
            unknowns=elements.unknowns,
            element=elements.element,
            levels=elements.levels,
        )
    )


def truth(value: Plain, given: Stated) -> Truth:
    """The reference of a stored value. ValueError if its error is unknown."""
    found = restored(SolvedReference, value)
    if found.field_error is None or found.curve_errors is None:
        raise ValueError(
            "the organ has one mesh only, so the error of its reference is unknown and none of a "
            "model can be told from it; refine organ.mesh or give a surface"
        )
    seen = given.problem.observation
    return Truth(
        np.reshape(found.field, (-1, 3)),
        np.reshape(found.curves, (len(seen.times), len(seen.probes), 3)),
        found.field_error,
        np.array(found.curve_errors),
    )
