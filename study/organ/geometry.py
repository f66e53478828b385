"""The organ of a scene: its meshes, its surface and its body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import MeshError, SurfaceMesh, TetrahedralMesh
from study.mesh.signed_distance import SignedDistance
from study.mesh.surface import enclosed_volume
from study.mesh.tetrahedra import (
    boundary,
    mean_edge,
    refined,
    smallest_dihedral_angle,
    volumes,
)
from study.organ import liver
from study.organ.block import block_of_cells, cell_counts
from study.organ.isosurface_stuffing import SignedFunction, Stuffed, lattice_round, stuffed
from study.organ.occupancy import ImplicitBody, MeshBody, SolidShape, SurfaceBody
from study.organ.projection import onto_surface

Floats = NDArray[np.float64]
Projection = Callable[[Floats], Floats]
Levels = Callable[[int], "Level | None"]
Cut = Callable[[TetrahedralMesh], Stuffed]

FINER = 4.0 / 3.0
"""Ratio of the element sizes of a level and the next finer one, where it can be chosen."""
BLOCK_PARTS = 4
REFINE_ABOVE = 1.3
"""A user's mesh is refined while its mean edge exceeds this multiple of the element size."""
MAX_TETRAHEDRA = 60_000
TETRAHEDRA_PER_CUBE = 12
"""For the body-centred lattice; a block has six."""
LOST = 0.03
"""Admissible volume error of a surface's mesh; curved elements have a far smaller one."""
LOST_AT_MOST = 0.15
"""Admissible volume error of the coarser meshes of a surface, which only serve convergence."""
COARSEST = 0.5
"""Largest element size over the cube root of the built-in liver's volume.

At this size a mesh has about a hundred tetrahedra and four fifths of the volume; slightly above,
its lobes are lost, then everything.
"""


@dataclass(frozen=True)
class Level:
    """A mesh of the organ, and its element size up to a factor that all levels share.

    `background`: the mesh that was cut along the surface to make it, None where it was not cut.
    """

    mesh: TetrahedralMesh
    size: float
    background: Background | None = None


@dataclass(frozen=True)
class Background:
    """A mesh around the organ, and the tetrahedron of it that each of the organ's is part of."""

    mesh: TetrahedralMesh
    origins: NDArray[np.int64]


@dataclass(frozen=True)
class Geometry:
    """`mesh` for all integrals, level 0 of the finite elements; `surface`: its boundary.

    `level`: meshes of the same organ, finer with the number, or None where there is none; `cut`:
    cuts a background mesh along its surface, None where the meshes have none; `body`: the exact
    shape if known, else the mesh; `project`: onto its surface, if it is known and curved; `volume`
    [m^3] of `mesh`; `notes`: what was found, repaired or assumed; `is_file`: whether it is from a
    user's file; `offset` [m] (3,): subtracted from the coordinates of that file, which may be far
    from the origin.
    """

    mesh: TetrahedralMesh
    level: Callable[[int], Level | None]
    surface: SurfaceMesh
    body: SolidShape
    volume: float
    notes: tuple[str, ...] = ()
    project: Projection | None = None
    cut: Cut | None = None
    is_file: bool = False
    offset: Floats = field(default_factory=lambda: np.zeros(3))


def block(size: tuple[float, float, float], element_size: float) -> Geometry:
    """A block of edges [m] in elements of about `element_size` [m].

    Level k divides the largest cells, of BLOCK_PARTS element sizes, into BLOCK_PARTS + k parts
    along each axis, at least 2. ValueError for elements so small that they are too many.
    """
    _check_count(float(np.prod(size)), element_size)
    parts = cell_counts(size, BLOCK_PARTS * element_size)

    @cache
    def level(k: int) -> Level | None:
        count = BLOCK_PARTS + k
        if count < 2 or 6 * count**3 * np.prod(parts) > MAX_TETRAHEDRA:
            return None
        return Level(block_of_cells(size, count * parts), 1.0 / count)

    return _geometry(level)


def _check_count(volume: float, element_size: float) -> None:
    """Refuse a mesh that would take minutes to build only to be too large to solve."""
    count = TETRAHEDRA_PER_CUBE * volume / element_size**3
    if count > MAX_TETRAHEDRA:
        fits = (TETRAHEDRA_PER_CUBE * volume / MAX_TETRAHEDRA) ** (1.0 / 3.0)
        raise ValueError(
            f"reference.element_size: {1e3 * element_size:.3g} mm makes about {count:.0f} "
            f"tetrahedra, the limit is {MAX_TETRAHEDRA}; {1e3 * fits:.2g} mm fits"
        )


def _check_coarseness(volume: float, element_size: float, largest: float) -> None:
    if element_size > largest:
        raise ValueError(
            f"reference.element_size: {1e3 * element_size:.3g} mm is too large for an organ.volume "
            f"of {1e3 * volume:.3g} L, of whose shape nothing would be left; "
            f"{1e3 * largest * (1.0 - 1e-3):.2g} mm fits"
        )


def built_in_liver(volume: float, element_size: float) -> Geometry:
    """The built-in liver of a volume [m^3] in elements of about `element_size` [m].

    ValueError for elements so small that they are too many, or so large that they lose the shape.
    """
    _check_count(volume, element_size)
    largest = COARSEST * volume ** (1.0 / 3.0)
    _check_coarseness(volume, element_size, largest)
    body = ImplicitBody(lambda points: liver.signed_function(points, volume))
    box = liver.bounding_box(volume)
    note = (
        f"The built-in liver ({volume * 1e3:.2f} L) is a smooth test shape with two lobes, not an "
        "anatomy; its quadratic finite elements are curved along the surface."
    )
    level = _levels(body.signed, box, volume, element_size, largest)
    return _geometry(level, body, (note,), partial(onto_surface, body.signed), body.signed)


def _levels(
    signed: SignedFunction, box: tuple[Floats, Floats], volume: float, size: float, largest: float
) -> Levels:
    """Meshes cut from lattices: level 0 of a size [m], coarser and finer ones within the limits."""

    @cache
    def level(k: int) -> Level | None:
        edge = size / FINER**k
        if edge > largest or TETRAHEDRA_PER_CUBE * volume / edge**3 > MAX_TETRAHEDRA:
            return None
        lattice = lattice_round(signed, *box, edge)
        found = stuffed(signed, lattice)
        return Level(found.mesh, edge, Background(lattice, found.origins))

    return level


def enclosed(surface: SurfaceMesh, element_size: float, notes: tuple[str, ...] = ()) -> Geometry:
    """The volume within a closed surface, in elements of about `element_size` [m].

    They are smaller where the organ is too thin for them. The meshes depend on the arguments alone.
    MeshError for a surface that needs too many.
    """
    volume = enclosed_volume(surface.points, surface.triangles)
    box = surface.points.min(axis=0), surface.points.max(axis=0)
    signed, size = SignedDistance(surface), element_size
    while True:
        if TETRAHEDRA_PER_CUBE * volume / size**3 > MAX_TETRAHEDRA:
            raise MeshError(_too_thin(element_size, size))
        level = _levels(signed, box, volume, size, np.inf)
        base = level(0)
        if base is not None and abs(_lost(base, volume)) <= LOST:
            break
        size /= FINER

    @cache
    def usable(k: int) -> Level | None:
        found = level(k)
        return None if found is None or abs(_lost(found, volume)) > LOST_AT_MOST else found

    found = _filled_note(base, size, element_size, volume)
    body = SurfaceBody(surface)
    return _geometry(usable, body, (*notes, found), signed.nearest, signed)


def _lost(level: Level, volume: float) -> float:
    """Relative error of a mesh's volume against a volume [m^3]."""
    return 1.0 - float(volumes(level.mesh).sum()) / volume


def _too_thin(asked: float, reached: float) -> str:
    return (
        f"organ.mesh: tetrahedra of {1e3 * asked:.3g} mm, and of {1e3 * reached:.2g} mm, change "
        f"the volume by more than {100 * LOST:.0f} %: the surface is too thin, or crosses itself; "
        "repair it, reduce reference.element_size, or give the organ as tetrahedra"
    )


def _filled_note(base: Level, size: float, asked: float, volume: float) -> str:
    mesh = base.mesh
    smaller = f" as {1e3 * asked:.3g} mm would change the volume more" if size < asked else ""
    return (
        f"{len(mesh.tetrahedra)} tetrahedra inside the surface, cut from a lattice of "
        f"{1e3 * size:.3g} mm{smaller}: volume {-100 * _lost(base, volume):+.1f} %, smallest "
        f"dihedral angle {smallest_dihedral_angle(mesh).min():.1f} degrees; quadratic finite "
        "elements are curved along it."
    )


def from_file(
    path: Path,
    unit: str | None,
    element_size: float,
    axes: str | None = None,
    pieces: str = "one",
) -> Geometry:
    """The organ of a mesh file in its unit and axes, in elements of about `element_size` [m].

    `pieces` "largest" drops all others. The last organs are cached, since commands request them
    several times. Raises MeshError, a ValueError, for an unusable file.
    """
    try:
        state = path.stat()
    except OSError:
        return _from_file(path, unit, element_size, axes, pieces, (0, 0))
    key = (state.st_mtime_ns, state.st_size)
    return _from_file(path, unit, element_size, axes, pieces, key)


@lru_cache(maxsize=2)
def _from_file(
    path: Path,
    unit: str | None,
    element_size: float,
    axes: str | None,
    pieces: str,
    state: tuple[int, int],
) -> Geometry:
    from study.mesh.axes import axes_note
    from study.mesh.load import load_mesh

    del state  # part of the cache key: a rewritten file is read again
    loaded, report = load_mesh(path, unit, axes, pieces)
    notes = (*report.notes, axes_note(axes))
    if isinstance(loaded, SurfaceMesh):
        found = enclosed(loaded, element_size, notes)
    else:
        found = _refined(loaded, element_size, notes)
    return replace(found, is_file=True, offset=np.asarray(report.offset))


def _refined(given: TetrahedralMesh, element_size: float, notes: tuple[str, ...]) -> Geometry:
    """A user's mesh, bisected until its elements are as small as requested."""
    meshes, found = [given], list(notes)
    while mean_edge(meshes[-1]) > REFINE_ABOVE * element_size and _can_refine(meshes[-1]):
        meshes.append(refined(meshes[-1]))
        found.append(
            f"Tetrahedra refined to {len(meshes[-1].tetrahedra)} (mean edge "
            f"{mean_edge(meshes[-1]) * 1e3:.1f} mm) so that quadratic elements follow the load."
        )
    base = len(meshes) - 1

    @cache
    def level(k: int) -> Level | None:
        while len(meshes) <= base + k and _can_refine(meshes[-1]):
            meshes.append(refined(meshes[-1]))
        at = base + k
        return Level(meshes[at], 0.5**at) if 0 <= at < len(meshes) else None

    return _geometry(level, MeshBody(meshes[base]), tuple(found))


def _can_refine(mesh: TetrahedralMesh) -> bool:
    return 8 * len(mesh.tetrahedra) < MAX_TETRAHEDRA


def _geometry(
    level: Levels,
    body: SolidShape | None = None,
    notes: tuple[str, ...] = (),
    project: Projection | None = None,
    signed: SignedFunction | None = None,
) -> Geometry:
    base = level(0)
    if base is None:
        raise ValueError("the organ has no mesh")
    mesh = base.mesh
    volume = float(volumes(mesh).sum())
    cut = None if signed is None else partial(stuffed, signed)
    solid = body or MeshBody(mesh)
    return Geometry(mesh, level, boundary(mesh), solid, volume, notes, project, cut)
