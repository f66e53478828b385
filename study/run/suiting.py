"""Adapting a scene to another organ: lengths follow the organ's size, the force its strain.

Lengths scale with the cube root of the volume and the tool keeps its pressure, so that an organ of
the same shape has the same strains at any size. A support also keeps its share of the surface on
its side, and the force is reduced until the linear reference at rest stays well within its limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh
from study.mesh.load import load_mesh
from study.models.linear_limits import ROTATION_LIMIT, STRAIN_LIMIT
from study.organ.geometry import Geometry
from study.scene import Organ, Scene, Side
from study.scene.file import read_scene
from study.scene.place import OUTWARD
from study.scene.problem import geometry_of, problem_of
from study.system.progress import Progress, Silent

Floats = NDArray[np.float64]

MARGIN = 0.7
"""Share of the limits of strain and rotation that is aimed at: finer meshes find larger values."""
DIGITS = 2
POWERS = {
    "support.depth": 1,
    "support.stiffness": -1,
    "tool.radius": 1,
    "tool.force": 2,
    "tool.displacement": 1,
    "lattice.spacing": 1,
    "reference.element_size": 1,
}
"""Exponent of the organ's size with which each key scales."""
UNITS = {"support.stiffness": (1e-6, "MPa/m"), "tool.force": (1.0, "N")}
MILLIMETRES = (1e3, "mm")


def read_suited(name: str, overrides: Sequence[str]) -> Scene:
    """The scene of `read_scene`, adapted to its organ. ValueError as there, or for a bad mesh."""
    return suited(read_scene(name, overrides), Silent())


def suited(scene: Scene, progress: Progress) -> Scene:
    """The scene with the keys of `organ.suit` adapted to its organ, and a remark that says so.

    ValueError if the organ cannot be used, or if the support or the tool misses it nevertheless.
    """
    keys = [key for key in scene.organ.suit if key in POWERS]
    if not keys or scene.organ.mesh is None:
        return scene
    with progress.stage("scene suited to the organ"):
        own = geometry_of(replace(scene.organ, mesh=None), scene.reference.element_size)
        size = _size(scene.organ, own)
        found = scene
        for key in keys:
            found = _with_value(found, key, _rounded(_value(scene, key) * size ** POWERS[key]))
        geometry = geometry_of(found.organ, found.reference.element_size)
        if "support.depth" in keys:
            held = _supported_share(own.surface, scene.support.side, scene.support.depth)
            depth = _depth_of_share(geometry.surface, found.support.side, held)
            found = _with_value(found, "support.depth", max(found.support.depth, _rounded(depth)))
        if "tool.force" in keys:
            found = _with_value(found, "tool.force", _rounded(_admissible_force(found), down=True))
    remark = _remark(found, keys, geometry.volume, own.volume)
    organ = replace(found.organ, suit=())
    return replace(found, organ=organ, remarks=(*found.remarks, remark))


def _size(organ: Organ, own: Geometry) -> float:
    """Size of the organ relative to the one that the scene was made for."""
    report = load_mesh(str(organ.mesh), organ.unit, organ.axes, organ.pieces)[1]
    return float(np.cbrt(report.volume / own.volume))


def _facing(surface: SurfaceMesh, side: Side) -> tuple[Floats, Floats]:
    """Depth [m] below the extreme point, and projected area [m^2], of faces toward a side."""
    corner = surface.points[surface.triangles]
    seen = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) @ OUTWARD[side]
    height = corner.mean(axis=1) @ OUTWARD[side]
    top = (surface.points @ OUTWARD[side]).max()
    return (top - height)[seen > 0], seen[seen > 0]


def _supported_share(surface: SurfaceMesh, side: Side, depth: float) -> float:
    """Share of the projected area on a side that lies within a depth [m]."""
    below, area = _facing(surface, side)
    return float(area[below <= depth].sum() / area.sum())


def _depth_of_share(surface: SurfaceMesh, side: Side, share: float) -> float:
    """Depth [m] within which a share of the projected area on a side lies."""
    below, area = _facing(surface, side)
    order = np.argsort(below)
    reached = np.cumsum(area[order]) >= share * area.sum() * (1.0 - 1e-9)
    return float(below[order][reached.argmax()])


def _admissible_force(scene: Scene) -> float:
    """The tool's force [N], reduced where strain or rotation at rest would exceed the margin."""
    from fem_reference.observation import largest_rotation, largest_strain
    from fem_reference.solvers import solve_static
    from study.models.finite_elements import reference_of

    prepared = reference_of(scene).prepare(problem_of(scene))
    body = prepared.body()
    u = solve_static(body)
    used = max(
        largest_strain(body, u) / (MARGIN * STRAIN_LIMIT),
        largest_rotation(body, u) / (MARGIN * ROTATION_LIMIT),
    )
    return scene.tool.force / max(1.0, used)


def _value(scene: Scene, key: str) -> float:
    table, name = key.split(".")
    return float(getattr(getattr(scene, table), name))


def _with_value(scene: Scene, key: str, value: float) -> Scene:
    table, name = key.split(".")
    changed = replace(getattr(scene, table), **{name: value})
    return replace(scene, **{table: changed})


def _rounded(value: float, *, down: bool = False) -> float:
    """Round to two digits, as one would write the value in a scene."""
    step = 10.0 ** (np.floor(np.log10(value)) - DIGITS + 1)
    count = np.floor(value / step + 1e-9) if down else np.round(value / step)
    return float(f"{count * step:.{DIGITS}g}")


def _remark(scene: Scene, keys: Sequence[str], volume: float, own: float) -> str:
    said = []
    for key in keys:
        factor, unit = UNITS.get(key, MILLIMETRES)
        said.append(f"{key} {factor * _value(scene, key):.3g} {unit}")
    return (
        f"Suited to an organ of {1e3 * volume:.3g} L in place of one of {1e3 * own:.3g} L: "
        f"{', '.join(said)}; state a key to have it otherwise."
    )
