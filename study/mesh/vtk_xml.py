"""VTK's XML files of unstructured grids and of surfaces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import FloatArray, IndexArray, MeshError
from study.mesh.raw import RawMesh, raw_mesh
from study.mesh.text import whole_numbers
from study.mesh.vtk_arrays import vtk_array
from study.mesh.vtk_cells import EMPTY, LINES, POINTS, POLYGON, STRIP, vtk_blocks
from study.mesh.vtk_tags import Tag, count, vtk_tags

# Sections of the cells of a surface, in the order in which VTK numbers them.
_SURFACE = {"Verts": POINTS, "Lines": LINES, "Polys": POLYGON, "Strips": STRIP}
_READABLE = {"UnstructuredGrid": ("Cells",), "PolyData": tuple(_SURFACE)}
_GHOST = "vtkGhostType"  # of cells that another piece owns, or that are blanked out


class _Piece(NamedTuple):
    points: FloatArray
    types: IndexArray
    sizes: IndexArray
    nodes: IndexArray


def read_vtk_xml(data: bytes) -> RawMesh:
    """Points and cells of a .vtu or .vtp file; all its pieces, in whatever encoding.

    Arrays of data are not read. Cells marked as ghosts are left out, with a note.

    Raises
    ------
    MeshError
        If the file is damaged, of another kind, or holds other numbers of points or cells than it
        announces.
    """
    tags = vtk_tags(data)
    kind = tags[0].given.get("type", "") if tags and tags[0].name == "VTKFile" else ""
    _check_kind(kind)
    _refuse_time_steps(tags)
    pieces = [
        _piece(piece, _READABLE[kind], _arrays(i, tags, data))
        for i, piece in enumerate(tags)
        if piece.name == "Piece"
    ]
    return _joined(pieces)


def _check_kind(kind: str) -> None:
    if kind in _READABLE:
        return
    if not kind:
        raise MeshError("no tag VTKFile with a type: not an XML file of VTK, or damaged")
    if kind.startswith("PU") or kind == "PPolyData" or "Block" in kind or "Collection" in kind:
        raise MeshError(f"{kind[:40]} names other files that hold the mesh; merge them into a .vtu")
    raise MeshError(f"VTK data set {kind[:40]}; only UnstructuredGrid and PolyData can be read")


def _refuse_time_steps(tags: list[Tag]) -> None:
    for tag in tags:
        steps = len(tag.given.get("TimeValues", "").split())
        if steps > 1:
            raise MeshError(f"{steps} time steps (TimeValues) in one file; save the one to be used")


def _arrays(first: int, tags: list[Tag], data: bytes) -> dict[tuple[str, str], NDArray[Any]]:
    """Arrays of the piece with the given tag, by section and name; those of data are left out."""
    found: dict[tuple[str, str], NDArray[Any]] = {}
    for tag in tags[first + 1 :]:
        if tag.name == "Piece":
            break
        name = "" if tag.parent == "Points" else tag.given.get("Name", "")
        wanted = tag.parent in {"Points", "Cells", *_SURFACE} or name == _GHOST
        if tag.name == "DataArray" and wanted and tag.parent != "PointData":
            if (tag.parent, name) in found:
                raise MeshError(f"array {tag.parent} {name}".rstrip() + " is given twice")
            found[tag.parent, name] = vtk_array(tag, tags, data)
    return found


def _piece(
    piece: Tag, sections: tuple[str, ...], arrays: dict[tuple[str, str], NDArray[Any]]
) -> _Piece:
    points = _sized(arrays, "Points", "", 3 * count(piece, "Points")).reshape(-1, 3).astype(float)
    parts = [_cells(section, count(piece, section), arrays) for section in sections]
    types, sizes, nodes = (np.concatenate([part[i] for part in parts]) for i in range(3))
    if ("CellData", _GHOST) in arrays:
        types = np.where(_sized(arrays, "CellData", _GHOST, len(types)) != 0, EMPTY, types)
    return _Piece(points, types, sizes, nodes)


def _cells(
    section: str, number: int, arrays: dict[tuple[str, str], NDArray[Any]]
) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Types, numbers of nodes, and nodes of the cells of a section."""
    ends = whole_numbers(_sized(arrays, section, "offsets", number), f"offsets of {section}")
    given = arrays.get((section, "connectivity"), np.empty(0))
    nodes = whole_numbers(given, f"nodes of {section}")
    if np.any(np.diff(ends, prepend=0) < 0) or (ends[-1] if number else 0) != len(nodes):
        raise MeshError(
            f"offsets of {section} do not fit the {len(nodes)} nodes of the cells: damaged, "
            "export it again"
        )
    if section in _SURFACE:
        types = np.full(number, _SURFACE[section])
    else:
        types = _sized(arrays, section, "types", number).astype(np.int64)
    return types, np.diff(ends, prepend=0), nodes


def _sized(
    arrays: dict[tuple[str, str], NDArray[Any]], section: str, name: str, expected: int
) -> NDArray[Any]:
    array = arrays.get((section, name), np.empty(0))
    if len(array) != expected:
        raise MeshError(
            f"array {section} {name}".rstrip() + f" has {len(array)} numbers, but {expected} are "
            "announced: truncated or damaged, export it again"
        )
    return array


def _joined(pieces: list[_Piece]) -> RawMesh:
    if not pieces:
        raise MeshError("no Piece with points and cells: truncated, export it again")
    _check_nodes(pieces)
    first = np.cumsum([0, *(len(piece.points) for piece in pieces)])
    types = np.concatenate([piece.types for piece in pieces])
    sizes = np.concatenate([piece.sizes for piece in pieces])
    nodes = [piece.nodes + start for piece, start in zip(pieces, first[:-1], strict=True)]
    hidden = int(((types == EMPTY) & (sizes > 0)).sum())
    notes = [f"{hidden} cells marked as ghosts or hidden left out"] if hidden else []
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    blocks = vtk_blocks(types, offsets, np.concatenate(nodes))
    return raw_mesh(np.concatenate([piece.points for piece in pieces]), blocks, notes)


def _check_nodes(pieces: list[_Piece]) -> None:
    """Refuse a node number beyond its piece, which would refer to a point of the next piece."""
    for i, (points, _, _, nodes) in enumerate(pieces if len(pieces) > 1 else []):
        if len(nodes) and not (nodes.min() >= 0 and nodes.max() < len(points)):
            raise MeshError(
                f"piece {i} (0-based) has {len(points)} points, but its cells use node numbers "
                f"{nodes.min()} to {nodes.max()}: damaged, export it again"
            )
