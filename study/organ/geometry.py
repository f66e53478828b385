"""The organ of a scene: its meshes, its surface and its body."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.mesh.kinds import SurfaceMesh, TetrahedralMesh
from study.mesh.tetrahedra import boundary, mean_edge, refined, volumes
from study.organ import liver
from study.organ.block import block_mesh, cell_counts
from study.organ.isosurface_stuffing import stuff
from study.organ.occupancy import Body, ImplicitBody, MeshBody
from study.scene import Organ

COARSENING = 4.0 / 3.0
"""Element size of the coarser mesh, which shows the reference's discretisation error."""
LEAST_COARSENING = 1.2
REFINE_ABOVE = 1.3
"""A user's mesh is refined while its mean edge exceeds this many element sizes."""
MAX_TETRAHEDRA = 60_000
TETRAHEDRA_PER_CUBE = 12
"""Of the body-centred lattice; a block has six."""


@dataclass(frozen=True)
class Geometry:
    """`mesh` for the finite elements and all integrals; `coarser`, one for its error, if any.

    `coarsening`: ratio of their element sizes; `surface`: boundary of `mesh`; `body`: the exact
    shape if it is known, else the mesh; `volume` [m^3] of `mesh`; `notes`: what was found, repaired
    or assumed.
    """

    mesh: TetrahedralMesh
    coarser: TetrahedralMesh | None
    surface: SurfaceMesh
    body: Body
    volume: float
    coarsening: float
    notes: tuple[str, ...] = ()


def build(organ: Organ, element_size: float) -> Geometry:
    """Geometry of an organ with finite elements of about `element_size` [m].

    Raises MeshError, a ValueError, for a mesh file that cannot be used.
    """
    if organ.mesh is not None:
        return _from_file(Path(organ.mesh), organ.unit, element_size)
    volume = float(np.prod(organ.size)) if organ.shape == "block" else organ.volume
    _check_count(volume, element_size)
    if organ.shape == "block":
        return _block(organ.size, element_size)
    return _liver(organ.volume, element_size)


def _block(size: tuple[float, float, float], element_size: float) -> Geometry:
    """A block; its coarser mesh must be coarser along each axis, or it would tell nothing."""
    mesh = block_mesh(size, element_size)
    fine, coarse = (cell_counts(size, h) for h in (element_size, COARSENING * element_size))
    ratio = float((fine / coarse).min())
    coarser = block_mesh(size, COARSENING * element_size) if ratio >= LEAST_COARSENING else None
    return _geometry(mesh, coarser, MeshBody(mesh), coarsening=ratio)


def _check_count(volume: float, element_size: float) -> None:
    """Refuse a mesh that would take minutes to build only to be too large to solve."""
    count = TETRAHEDRA_PER_CUBE * volume / element_size**3
    if count > MAX_TETRAHEDRA:
        fits = (TETRAHEDRA_PER_CUBE * volume / MAX_TETRAHEDRA) ** (1.0 / 3.0)
        raise ValueError(
            f"reference.element_size: {1e3 * element_size:.3g} mm makes about {count:.0f} "
            f"tetrahedra, the limit is {MAX_TETRAHEDRA}; {1e3 * fits:.2g} mm fits"
        )


def _liver(volume: float, element_size: float) -> Geometry:
    body = ImplicitBody(lambda points: liver.signed_function(points, volume))
    box = liver.bounding_box(volume)
    mesh = stuff(body.signed, *box, element_size)
    coarser = stuff(body.signed, *box, COARSENING * element_size)
    note = (
        f"The built-in liver ({volume * 1e3:.2f} L) is a smooth test shape with two lobes, not an "
        "anatomy; the finite-element mesh approximates its curved surface by flat facets and holds "
        f"{volumes(mesh).sum() * 1e3:.2f} L."
    )
    return _geometry(mesh, coarser, body, (note,))


def _from_file(path: Path, unit: str | None, element_size: float) -> Geometry:
    from study.mesh.load import load_mesh
    from study.mesh.tetrahedralise import tetrahedralise

    loaded, report = load_mesh(path, unit)
    notes = list(report.notes)
    if isinstance(loaded, SurfaceMesh):
        filled, more = tetrahedralise(loaded, element_size)
        coarsely, _ = tetrahedralise(loaded, COARSENING * element_size)
        return _geometry(filled, coarsely, MeshBody(filled), (*notes, *more))
    mesh: TetrahedralMesh = loaded
    coarser: TetrahedralMesh | None = None
    while (
        mean_edge(mesh) > REFINE_ABOVE * element_size and 8 * len(mesh.tetrahedra) < MAX_TETRAHEDRA
    ):
        mesh, coarser = refined(mesh), mesh
        notes.append(
            f"Tetrahedra refined to {len(mesh.tetrahedra)} (mean edge {mean_edge(mesh) * 1e3:.1f} "
            "mm) so that quadratic elements follow the load."
        )
    return _geometry(mesh, coarser, MeshBody(mesh), tuple(notes), coarsening=2.0)


def _geometry(
    mesh: TetrahedralMesh,
    coarser: TetrahedralMesh | None,
    body: Body,
    notes: tuple[str, ...] = (),
    coarsening: float = COARSENING,
) -> Geometry:
    volume = float(volumes(mesh).sum())
    return Geometry(mesh, coarser, boundary(mesh), body, volume, coarsening, notes)
