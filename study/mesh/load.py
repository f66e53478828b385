"""Mesh files: read, checked, repaired and reported, or refused with the reason."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from study.mesh.abaqus import read_abaqus
from study.mesh.axes import SCENE, along_scene, letters_of, to_scene
from study.mesh.check import repair_tetrahedra
from study.mesh.draft import Draft, element_map, start_draft
from study.mesh.elsewhere import refusal
from study.mesh.gmsh import read_gmsh
from study.mesh.kinds import (
    MeshError,
    MeshReport,
    SurfaceMesh,
    SurfaceQuality,
    TetrahedralMesh,
    TetrahedronQuality,
)
from study.mesh.listing import one_per_kind
from study.mesh.medit import read_medit
from study.mesh.obj import read_obj
from study.mesh.off import read_off
from study.mesh.ply import read_ply
from study.mesh.quality import sliver_notes, surface_quality, tetrahedron_quality
from study.mesh.raw import RawMesh
from study.mesh.stl import read_stl
from study.mesh.surface import enclosed_volume, repair_surface
from study.mesh.tetrahedra import volumes
from study.mesh.unit import METRES, check_extent, choose_unit
from study.mesh.vtk_legacy import read_vtk_legacy
from study.mesh.vtk_xml import read_vtk_xml

MAX_BYTES = 2**30
MAX_ELEMENTS = 5_000_000

_MAX_COORDINATE = 1e6  # metres; anything beyond is a misread number
_READERS: dict[str, Callable[[bytes], RawMesh]] = {
    ".inp": read_abaqus,
    ".mesh": read_medit,
    ".meshb": read_medit,
    ".msh": read_gmsh,
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
    ".vtk": read_vtk_legacy,
    ".vtp": read_vtk_xml,
    ".vtu": read_vtk_xml,
}
# Files of VTK that say for themselves why they cannot be read: lattices, and lists of other files.
_READERS |= dict.fromkeys(
    [".vtm", ".pvtu", ".pvtp", ".pvd", ".vtmb", ".vti", ".vtr", ".vts"], read_vtk_xml
)
ENDINGS = frozenset(_READERS)
"""Endings of files that are read as meshes, or refused with a reason."""
FORMATS = (
    ".vtu, .vtp, .vtk (legacy), .msh (Gmsh), .inp (Abaqus), .mesh, .meshb (MEDIT), .stl, .obj, "
    ".ply, .off"
)


class Reading(NamedTuple):
    """How a file is read: its unit, its axes, and whether other pieces are dropped."""

    unit: str | None
    axes: str
    largest: bool


def load_mesh(
    path: str | Path, unit: str | None, axes: str | None = None, pieces: str = "one"
) -> tuple[TetrahedralMesh | SurfaceMesh, MeshReport]:
    """Tetrahedra, or else the closed surface, in a mesh file.

    `unit` names the file's length unit: m, dm, cm, mm, um or in; None guesses millimetres or
    metres from the volume, which then has to be a liver's. `axes` names the sides to which the
    file's axes point, those of a scene by default (`study.mesh.axes`). `pieces` "largest" keeps the
    largest of several, which are refused by default.

    Raises
    ------
    MeshError
        If the file cannot be read or its mesh cannot be used; the message names the file, the
        first bad elements and the remedy.
    """
    source = Path(path)
    try:
        letters = SCENE if axes is None else letters_of(axes)
        how = Reading(unit, letters, pieces == "largest")
        data = _content(source)
        return _checked(_read(source, data), how, source, hashlib.sha256(data).hexdigest())
    except MeshError as error:
        raise MeshError(f"{source}: {error}") from error


def _content(source: Path) -> bytes:
    try:
        if not source.exists():
            raise MeshError("no such file")
        if not source.is_file():
            raise MeshError("not a regular file; name the mesh file itself")
        size = source.stat().st_size
        if size == 0:
            raise MeshError("the file is empty")
        if size > MAX_BYTES:
            raise MeshError(f"{size} bytes, the limit is {MAX_BYTES}; coarsen the mesh")
        return source.read_bytes()
    except OSError as error:
        raise MeshError(f"cannot be opened: {error.strerror or error}") from error


def _read(source: Path, data: bytes) -> RawMesh:
    suffix = source.suffix.lower()
    if suffix in _READERS:
        return _READERS[suffix](data)
    raise MeshError(refusal(suffix, FORMATS))


def _checked(
    raw: RawMesh, how: Reading, source: Path, sha256: str
) -> tuple[TetrahedralMesh | SurfaceMesh, MeshReport]:
    solid = _is_solid(raw)
    draft = _repaired(raw, how, solid=solid)
    volume = _volume(draft)
    name, unit_notes = choose_unit(how.unit, volume)
    scale = METRES[name]
    points, elements = along_scene(draft.points * scale, draft.elements, how.axes)
    extent = np.ptp(points, axis=0)
    check_extent(extent, name, volume)
    mesh = (TetrahedralMesh if solid else SurfaceMesh)(points, elements)
    quality, shape_notes = _quality(mesh, draft)
    report = MeshReport(
        file=str(source),
        sha256=sha256,
        unit=name,
        scale=scale,
        kind="tetrahedra" if solid else "surface",
        volume=volume * scale**3,
        extent=extent,
        offset=to_scene(how.axes) @ draft.offset * scale,
        node_map=draft.node_map,
        element_map=element_map(draft, len(raw.tetrahedra if solid else raw.triangles)),
        quality=quality,
        notes=one_per_kind(
            (*raw.notes, *_unused(raw, solid=solid), *draft.notes, *unit_notes, *shape_notes)
        ),
    )
    return mesh, report


def _is_solid(raw: RawMesh) -> bool:
    """Whether the mesh consists of tetrahedra; refuses unusable volume cells."""
    if raw.solids:
        cells = ", ".join(f"{count} {name}" for name, count in raw.solids.items())
        beside = f" beside {len(raw.tetrahedra)} tetrahedra" if len(raw.tetrahedra) else ""
        raise MeshError(f"{cells} cells{beside}; only tetrahedra can be used: split them before")
    count = len(raw.tetrahedra) or len(raw.triangles)
    if count == 0:
        raise MeshError("neither tetrahedra nor triangles; export the volume or its surface")
    if count > MAX_ELEMENTS:
        raise MeshError(f"{count} elements, the limit is {MAX_ELEMENTS}; coarsen the mesh")
    return len(raw.tetrahedra) > 0


def _unused(raw: RawMesh, *, solid: bool) -> list[str]:
    if not solid or not len(raw.triangles):
        return []
    return [
        f"{len(raw.triangles)} triangles beside the tetrahedra not used: the boundary follows "
        "from the tetrahedra"
    ]


def _repaired(raw: RawMesh, how: Reading, *, solid: bool) -> Draft:
    # Without a declared unit, the finest one that can be guessed sets the limit.
    limit = _MAX_COORDINATE / METRES.get(how.unit or "mm", METRES["mm"])
    elements = raw.tetrahedra if solid else raw.triangles
    repair = repair_tetrahedra if solid else repair_surface
    return repair(start_draft(raw.points, elements, limit), largest=how.largest)


def _volume(draft: Draft) -> float:
    if draft.elements.shape[1] == 4:
        return float(volumes(TetrahedralMesh(draft.points, draft.elements)).sum())
    return enclosed_volume(draft.points, draft.elements)


def _quality(
    mesh: TetrahedralMesh | SurfaceMesh, draft: Draft
) -> tuple[TetrahedronQuality | SurfaceQuality, list[str]]:
    if isinstance(mesh, SurfaceMesh):
        return surface_quality(mesh), []
    quality = tetrahedron_quality(mesh, draft.element_ids)
    return quality, sliver_notes(quality)
