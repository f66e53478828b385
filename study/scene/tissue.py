"""The tissue of a scene placed on its organ: inclusions, and a map of stiffness from an image."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.mesh.axes import to_scene
from study.mesh.kinds import SurfaceMesh, TetrahedralMesh
from study.mesh.signed_distance import SignedDistance
from study.mesh.tetrahedra import boundary, volumes
from study.organ.geometry import Geometry
from study.problem.heterogeneous import (
    OUTLINE,
    SAMPLES,
    Ellipsoid,
    HeterogeneousTissue,
    Region,
    mapped_mean,
    of_tetrahedra,
)
from study.problem.tissue import Tissue
from study.scene.nifti import read_image
from study.scene.place import resolve
from study.scene.schema import Inclusion, OrganTissue, Place, StiffnessMap

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Distance = Callable[[Floats], Floats]

PASCALS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6}
"""Pascals in a unit that a map may be in."""
PIECES = re.compile(r"keep one piece \(`organ\.pieces`[^)]*\), or join them")
"""What is said of an organ of several pieces."""
FEWEST = 8
"""Sampling points that an inclusion needs: with fewer, its shares of elements are arbitrary."""
RANGE = (10.0, 1e9)
"""Young's moduli [Pa] that a map may have."""
MEAN_RANGE = (100.0, 1e6)
"""Those that it may have in the mean, as a tissue without a map."""


def tissue_of(table: OrganTissue, geometry: Geometry) -> Tissue:
    """The tissue with what differs in it; a plain one where nothing does.

    Files lie in the frame of the organ's file, from wherever that was moved to the origin.
    ValueError naming an inclusion that lies outside the organ, or what is wrong with a file.
    """
    base = Tissue(
        youngs_modulus=table.youngs_modulus,
        poisson_ratio=table.poisson_ratio,
        density=table.density,
    )
    if not table.inclusion and table.stiffness_map is None:
        return base
    found = HeterogeneousTissue(
        youngs_modulus=base.youngs_modulus,
        poisson_ratio=base.poisson_ratio,
        density=base.density,
        regions=tuple(
            _region(one, f"tissue.inclusion.{number}", geometry)
            for number, one in enumerate(table.inclusion, 1)
        ),
        mapped=None
        if table.stiffness_map is None
        else _mapped(table.stiffness_map, base, geometry),
    )
    _check(found, table, geometry.mesh)
    return found


def _region(one: Inclusion, name: str, geometry: Geometry) -> Region:
    distance, outline = _shape(one, name, geometry)
    return Region(
        name=name,
        distance=distance,
        youngs_modulus=one.youngs_modulus,
        poisson_ratio=one.poisson_ratio,
        density=one.density,
        outline=outline,
    )


def _shape(one: Inclusion, name: str, geometry: Geometry) -> tuple[Distance, Floats]:
    """Distance from an inclusion, and points of its surface."""
    if one.mesh is not None:
        from study.mesh.load import load_mesh

        try:
            loaded, report = load_mesh(one.mesh, one.unit, one.axes)
        except ValueError as error:
            raise ValueError(f"{name}.mesh: {_of_inclusion(str(error), name)}") from error
        shell = loaded if isinstance(loaded, SurfaceMesh) else boundary(loaded)
        # A small shape is soon far from the origin, for its size, and then is moved there.
        closed = replace(shell, points=shell.points + (report.offset - geometry.offset))
        some = np.linspace(0, len(closed.points) - 1, OUTLINE).astype(int)
        return SignedDistance(closed), closed.points[some]
    assert one.place is not None  # noqa: S101 - as was checked with the scene
    centre, _ = resolve(_unmoved(one.place), geometry.surface)
    semi_axes = one.semi_axes or (one.radius, one.radius, one.radius)
    shape = Ellipsoid(centre, np.array(semi_axes, dtype=float))
    return shape, shape.outline


def _of_inclusion(message: str, name: str) -> str:
    """What is wrong with a mesh file, in the keys of an inclusion; it has no `pieces`."""
    one_each = PIECES.sub("give each piece as an inclusion of its own", message)
    return one_each.replace("`organ.", f"`{name}.")


def _unmoved(place: Place) -> Place:
    """The place itself, which would move to the surface."""
    return Place(fraction=place.fraction, point=place.point, snap=False)


def _check(tissue: HeterogeneousTissue, table: OrganTissue, mesh: TetrahedralMesh) -> None:
    made = of_tetrahedra(mesh, tissue)
    assert made is not None  # noqa: S101 - of varied tissue
    for number, (region, share) in enumerate(zip(tissue.regions, made.share.T, strict=True)):
        if share.sum() * SAMPLES >= FEWEST:
            continue
        alone = replace(tissue, regions=(region,), mapped=None)
        if number + 1 < len(tissue.regions) and _lies_in(mesh, alone):
            raise ValueError(
                f"{region.name}: later inclusions, which count where two meet, cover all of it; "
                "put it behind them, or remove it"
            )
        raise ValueError(
            f"{region.name}: nothing of it lies in the organ, or it is far smaller than an "
            "element; move its place, enlarge it or reduce reference.element_size"
        )
    if table.stiffness_map is None:
        return
    if not made.mapped_share.any():
        raise ValueError(
            "tissue.stiffness_map: no voxel with a value lies in the organ; its affine, or "
            "organ.axes and organ.unit, are of another frame"
        )
    mean = mapped_mean(volumes(mesh), made)
    low, high = MEAN_RANGE
    if not low <= mean <= high:
        raise ValueError(
            f"tissue.stiffness_map.unit: in {table.stiffness_map.unit} Young's modulus is "
            f"{mean:.3g} Pa in the mean over the organ, and that of a tissue is {low:g} to "
            f"{high:g}; give the unit of the image"
        )
    if table.stiffness_map.elsewhere == "refused" and (made.around > 0.0).any():
        share = float(volumes(mesh) @ made.around) / float(volumes(mesh).sum())
        raise ValueError(
            f"tissue.stiffness_map: {100 * share:.2g} % of the organ has no value in it; set its "
            "elsewhere to around, or give an image of all of the organ"
        )


def _lies_in(mesh: TetrahedralMesh, tissue: HeterogeneousTissue) -> bool:
    made = of_tetrahedra(mesh, tissue)
    return made is not None and bool(made.share.sum() * SAMPLES >= FEWEST)


def _mapped(given: StiffnessMap, tissue: Tissue, geometry: Geometry) -> Distance:
    """Young's modulus [Pa] at points of the scene, NaN where the image has none."""
    voxels, affine = read_image(Path(given.file))
    of_young = 1.0 if given.quantity == "youngs-modulus" else 2.0 * (1.0 + tissue.poisson_ratio)
    modulus = voxels * PASCALS[given.unit] * of_young
    known = np.isfinite(modulus) & (modulus > 0.0)
    low, high = RANGE
    _refuse_coarse(affine, geometry)
    numbers = ~np.isnan(modulus) & (modulus != 0.0)
    odd = np.argwhere(numbers & ((modulus < low) | (modulus > high)))
    odd = odd[_are_near(odd, affine, geometry)]
    if len(odd):
        found = modulus[tuple(odd.T)]
        raise ValueError(
            f"tissue.stiffness_map.unit: in {given.unit} {len(odd)} of {numbers.sum()} voxels with "
            f"a value lie at the organ and have a Young's modulus of {found.min():.3g} to "
            f"{found.max():.3g} Pa, beyond {low:g} to {high:g}; give the unit of the image, or set "
            "voxels that were not measured to 0"
        )
    inverse = np.asarray(np.linalg.inv(affine), dtype=np.float64)
    offset = geometry.offset
    return _Sampled(np.where(known, modulus, 0.0), known.astype(np.float64), inverse, offset)


def _refuse_coarse(affine: Floats, geometry: Geometry) -> None:
    """ValueError for voxels larger than the organ, as with millimetres that are said to be metres.

    One such voxel would give all of the organ its value.
    """
    longest = 1e-3 * float(np.linalg.norm(affine[:3, :3], axis=0).max())
    extent = float(np.ptp(geometry.mesh.points, axis=0).max())
    if longest > extent:
        raise ValueError(
            f"tissue.stiffness_map.file: voxels {longest:.3g} m long for an organ of {extent:.3g} "
            "m; correct the unit of length in the header, or the affine"
        )


def _are_near(voxels: Ints, affine: Floats, geometry: Geometry) -> Booleans:
    """Which voxels (n, 3), by number, are in the box of the organ or within one of them of it.

    Noise of an image where no organ is says nothing of its unit.
    """
    in_ras = voxels @ affine[:3, :3].T + affine[:3, 3]
    points = 1e-3 * in_ras @ to_scene("RAS") - geometry.offset  # which is its own inverse
    reach = 1e-3 * np.abs(affine[:3, :3]).sum(axis=1)
    vertices = geometry.mesh.points
    low, high = vertices.min(axis=0) - reach, vertices.max(axis=0) + reach
    return np.asarray(((low <= points) & (points <= high)).all(axis=1))


class _Sampled:
    """Values of voxels between their centres: the mean of those that are known round a point."""

    def __init__(self, values: Floats, known: Floats, to_voxels: Floats, offset: Floats) -> None:
        self.values, self.known, self.to_voxels = values, known, to_voxels
        self.offset = offset

    def __call__(self, points: Floats) -> Floats:
        """At points [m] (..., 3), NaN where less than half of a voxel's weight is known."""
        from scipy.ndimage import map_coordinates

        millimetres = 1e3 * (points + self.offset) @ to_scene("RAS")  # which is its own inverse
        place = millimetres @ self.to_voxels[:3, :3].T + self.to_voxels[:3, 3]
        at = np.moveaxis(place, -1, 0)
        known = map_coordinates(self.known, at, order=1, mode="grid-constant", cval=0.0)
        values = map_coordinates(self.values, at, order=1, mode="grid-constant", cval=0.0)
        return np.where(known >= 0.5, values / np.maximum(known, 0.5), np.nan)
