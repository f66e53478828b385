"""Places on the organ: from a side, by fractions of its bounding box, or by coordinates."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh
from study.scene import Place, Side

Floats = NDArray[np.float64]

OUTWARD: dict[Side, Floats] = {
    "right": np.array([-1.0, 0.0, 0.0]),
    "left": np.array([1.0, 0.0, 0.0]),
    "anterior": np.array([0.0, -1.0, 0.0]),
    "posterior": np.array([0.0, 1.0, 0.0]),
    "inferior": np.array([0.0, 0.0, -1.0]),
    "superior": np.array([0.0, 0.0, 1.0]),
}


def resolve(place: Place, surface: SurfaceMesh) -> tuple[Floats, Floats]:
    """Point [m] (3,) of a place, and the outward normal of the surface at or nearest to it."""
    lower, upper = surface.points.min(axis=0), surface.points.max(axis=0)
    if place.side is not None and place.at is not None:
        return _from_side(place.side, place.at, surface, lower, upper)
    if place.fraction is not None:
        point = lower + np.array(place.fraction) * (upper - lower)
    else:
        point = np.array(place.point, dtype=float)
    nearest, normal = _nearest(point, surface)
    return (nearest if place.snap else point), normal


def refuse_far(places: Mapping[str, Place], surface: SurfaceMesh, offset: Floats) -> None:
    """ValueError naming a point that is off the organ by more than its size.

    It would move to a surface that was not meant. `offset` [m] (3,): what was subtracted from the
    coordinates of the organ's file.
    """
    lower, upper = surface.points.min(axis=0), surface.points.max(axis=0)
    size = float(np.linalg.norm(upper - lower))
    for key, place in places.items():
        if place.point is None:
            continue
        point = np.array(place.point)
        away = float(np.linalg.norm(np.maximum(0.0, np.maximum(lower - point, point - upper))))
        if away > size:
            moved = ", ".join(f"{0.0 - 1e3 * one:.4g}" for one in offset)
            file = (
                f"; the organ's file was moved to the origin, by ({moved}) mm, and points are not"
            )
            raise ValueError(
                f"{key}.point: is {1e3 * away:.4g} mm off the organ, which is {1e3 * size:.4g} mm "
                f"across{file if offset.any() else ''}; move it"
            )


def refuse_long(lengths: Mapping[str, float], surface: SurfaceMesh) -> None:
    """ValueError naming a length [m] of more than twice the organ's size: another unit was meant.

    Beyond that a radius or a depth covers the whole organ, and a tool leaves it.
    """
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    for key, length in lengths.items():
        if length > 2.0 * size:
            raise ValueError(
                f"{key}: {1e3 * length:.4g} mm is more than twice the organ, which is "
                f'{1e3 * size:.4g} mm across; shorten it, or give its unit, as in "10 mm"'
            )


def _from_side(
    side: Side, at: tuple[float, float], surface: SurfaceMesh, lower: Floats, upper: Floats
) -> tuple[Floats, Floats]:
    """Where a ray from the side first meets the surface, or the point nearest to that ray."""
    outward = OUTWARD[side]
    axis = int(np.abs(outward).argmax())
    lateral = [i for i in range(3) if i != axis]
    target = lower[lateral] + np.array(at) * (upper - lower)[lateral]
    corner = surface.points[surface.triangles]
    normal = _unit_normals(corner)
    hit = _triangles_under(corner[:, :, lateral], target)
    facing = np.flatnonzero(hit & (normal @ outward > 0))
    if facing.size == 0:
        point = np.where(outward > 0, upper, lower)
        point[lateral] = target
        return _nearest(point, surface)
    a, n = corner[facing, 0], normal[facing]
    drop = ((a[:, lateral] - target) * n[:, lateral]).sum(axis=1) / n[:, axis]
    height = a[:, axis] + drop
    first = int((height * outward[axis]).argmax())
    point = np.empty(3)
    point[lateral], point[axis] = target, height[first]
    return point, n[first]


def depths(point: Floats, direction: Floats, surface: SurfaceMesh) -> Floats:
    """Distances [m] (hits,) along a unit vector at which a ray meets the surface facing it."""
    corner = surface.points[surface.triangles]
    normal = _unit_normals(corner)
    first = np.cross(direction, np.eye(3)[int(np.abs(direction).argmin())])
    first = first / np.linalg.norm(first)
    frame = np.stack([first, np.cross(direction, first)], axis=1)
    slope = normal @ direction
    met = (slope < 0.0) & _triangles_under((corner - point) @ frame, np.zeros(2))
    return np.asarray(((corner[met, 0] - point) * normal[met]).sum(axis=1) / slope[met])


def _triangles_under(corner: Floats, target: Floats) -> NDArray[np.bool_]:
    """Whether a projected triangle (k, 3, 2) contains a point; edges count."""
    a, b, c = (corner[:, i] - target for i in range(3))
    areas: Floats = np.stack([_cross(a, b), _cross(b, c), _cross(c, a)])
    slack = 1e-12 * np.abs(areas).sum(axis=0)
    return np.asarray((areas >= -slack).all(axis=0) | (areas <= slack).all(axis=0))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _unit_normals(corner: Floats) -> Floats:
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _nearest(point: Floats, surface: SurfaceMesh) -> tuple[Floats, Floats]:
    """Nearest point of the surface and its normal: on faces, edges or corners of triangles."""
    corner = surface.points[surface.triangles]
    normal = _unit_normals(corner)
    candidates = np.concatenate([_onto_plane(point, corner, normal), *_onto_edges(point, corner)])
    best = int(np.linalg.norm(candidates - point, axis=1).argmin())
    return candidates[best], normal[best % len(corner)]


def _onto_plane(point: Floats, corner: Floats, normal: Floats) -> Floats:
    """Projections that fall inside their triangle; elsewhere a corner in their place."""
    foot = point - np.einsum("kd,kd->k", point - corner[:, 0], normal)[:, None] * normal
    sides = np.roll(corner, -1, axis=1) - corner
    areas = (np.cross(sides, foot[:, None] - corner) @ normal[:, :, None])[..., 0]
    over = np.asarray((areas >= 0).all(axis=1))
    return np.where(over[:, None], foot, corner[:, 0])


def _onto_edges(point: Floats, corner: Floats) -> list[Floats]:
    feet = []
    for start, end in ((0, 1), (1, 2), (2, 0)):
        a, along = corner[:, start], corner[:, end] - corner[:, start]
        share = np.einsum("kd,kd->k", point - a, along) / np.einsum("kd,kd->k", along, along)
        feet.append(a + np.clip(share, 0.0, 1.0)[:, None] * along)
    return feet
