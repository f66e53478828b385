"""The organ of a scene: its meshes, its surface and its body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh, TetrahedralMesh
from study.mesh.tetrahedra import boundary, mean_edge, refined, volumes
from study.organ import liver
from study.organ.block import block_of_cells, cell_counts
from study.organ.isosurface_stuffing import stuff
from study.organ.occupancy import ImplicitBody, MeshBody, SolidShape
from study.organ.projection import onto_surface

Projection = Callable[[NDArray[np.float64]], NDArray[np.float64]]

FINER = 4.0 / 3.0
"""Ratio of the element sizes of a level and the next finer one, where it is free."""
BLOCK_PARTS = 4
REFINE_ABOVE = 1.3
"""A user's mesh is refined while its mean edge exceeds this many element sizes."""
MAX_TETRAHEDRA = 60_000
TETRAHEDRA_PER_CUBE = 12
"""Of the body-centred lattice; a block has six."""
COARSEST = 0.5
"""Largest element size over the cube root of the built-in liver's volume. There a mesh has about a
hundred tetrahedra and four fifths of the volume; a little above, its lobes are lost, then all."""


@dataclass(frozen=True)
class Level:
    """A mesh of the organ, and the size of its elements up to a factor that all levels share."""

    mesh: TetrahedralMesh
    size: float


@dataclass(frozen=True)
class Geometry:
    """`mesh` for all integrals, level 0 of the finite elements; `surface`: its boundary.

    `level`: meshes of the same organ, finer as the number grows, or None where there is none;
    `body`: the exact shape if it is known, else the mesh; `project`: onto its surface, if it is
    known and curved; `volume` [m^3] of `mesh`; `notes`: what was found, repaired or assumed.
    """

    mesh: TetrahedralMesh
    level: Callable[[int], Level | None]
    surface: SurfaceMesh
    body: SolidShape
    volume: float
    notes: tuple[str, ...] = ()
    project: Projection | None = None


def block(size: tuple[float, float, float], element_size: float) -> Geometry:
    """A block of edges [m] in elements of about `element_size` [m].

    All axes are cut into as many parts more from level to level, from 2 to 4 and on. ValueError for
    elements so small that they are too many.
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

    @cache
    def level(k: int) -> Level | None:
        size = element_size / FINER**k
        if size > largest or TETRAHEDRA_PER_CUBE * volume / size**3 > MAX_TETRAHEDRA:
            return None
        return Level(stuff(body.signed, *box, size), size)

    note = (
        f"The built-in liver ({volume * 1e3:.2f} L) is a smooth test shape with two lobes, not an "
        "anatomy; its quadratic finite elements are curved along the surface."
    )
    return _geometry(level, body, (note,), partial(onto_surface, body.signed))


def from_file(path: Path, unit: str | None, element_size: float) -> Geometry:
    """The organ of a mesh file in its unit, in elements of about `element_size` [m].

    Raises MeshError, a ValueError, for a file that cannot be used.
    """
    from study.mesh.load import load_mesh
    from study.mesh.tetrahedralise import tetrahedralise

    loaded, report = load_mesh(path, unit)
    if isinstance(loaded, SurfaceMesh):
        filled, more = tetrahedralise(loaded, element_size)
        coarsely, _ = tetrahedralise(loaded, FINER * element_size)
        # Each filling takes half a minute, so there are no more levels.
        levels = {0: Level(filled, element_size), -1: Level(coarsely, FINER * element_size)}
        return _geometry(levels.get, MeshBody(filled), (*report.notes, *more))
    return _refined(loaded, element_size, report.notes)


def _refined(given: TetrahedralMesh, element_size: float, notes: tuple[str, ...]) -> Geometry:
    """A user's mesh, refined by halves until its elements are as small as asked."""
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
    level: Callable[[int], Level | None],
    body: SolidShape | None = None,
    notes: tuple[str, ...] = (),
    project: Projection | None = None,
) -> Geometry:
    base = level(0)
    if base is None:
        raise ValueError("the organ has no mesh")
    mesh = base.mesh
    volume = float(volumes(mesh).sum())
    return Geometry(mesh, level, boundary(mesh), body or MeshBody(mesh), volume, notes, project)
