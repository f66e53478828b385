"""Restrictions of lattices of graded cells, with their remedies."""

from __future__ import annotations

from collections.abc import Iterator

from study.problem.features import BESIDE_ONE_LOAD
from study.scene.schema import Lattice, Scene

NO_TOLERANCE = (
    "region.radius: a tolerance is kept at rest under a single load of a given force, and the "
    "scene has more; give how far the finest cells reach"
)


def has_graded(scene: Scene) -> bool:
    """Whether a model of a scene has graded cells."""
    return "region" in scene.models or (
        "corrected" in scene.models and scene.corrected.coarse == "graded"
    )


def contradictions(scene: Scene) -> Iterator[str]:
    """Keys that contradict each other where a model has graded cells."""
    if scene.corrected.coarse == "graded" and scene.corrected.spacing is not None:
        yield "corrected.spacing: a graded lattice has that of the table region; remove it"
    if not has_graded(scene):
        return
    yield from unfit(scene.lattice)
    sized = "region" in scene.models and scene.region.radius is None
    if sized and set(scene.features) & set(BESIDE_ONE_LOAD):
        yield NO_TOLERANCE
    for name in scene.region.at:
        if name not in scene.probes:
            yield (f"region.at: {name!r} is no control point; there are {', '.join(scene.probes)}")


def unfit(lattice: Lattice) -> Iterator[str]:
    """Settings that a lattice of graded cells does not support."""
    from msm.integrators import INTEGRATORS

    if lattice.springs == "tetrahedra":
        yield "lattice.springs: a graded lattice has cubic cells; set it to lattice"
    if lattice.body_diagonals > 0.0:
        yield (
            "lattice.body_diagonals: of a graded lattice they push in shear where cells of two "
            "sizes meet; set it to 0"
        )
    if lattice.precision == "single":
        yield (
            "lattice.precision: a graded lattice is stepped in double precision only; leave it out"
        )
    able = [name for name, method in INTEGRATORS.items() if method.on_grid is not None]
    if lattice.integrator not in able:
        yield (
            f"lattice.integrator: {lattice.integrator} takes cells of one size only; for a graded "
            f"lattice set it to {', '.join(able[:-1])} or {able[-1]}"
        )
