"""Features of surface formats and of all VTK formats."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter, vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

from tests.mesh_features import Feature, Treatment
from tests.mesh_samples import cube, cube_surface, obj, polydata_ascii, stl_ascii, stl_binary

STL = "STL (.stl)"
OBJ = "Wavefront OBJ (.obj)"
PLY = "PLY (.ply)"
OFF = "OFF (.off)"
LEGACY = "VTK legacy (.vtk)"
XML = "VTK XML (.vtu, .vtp)"

POINTS, TRIANGLES = cube_surface()
QUADS = np.hstack([TRIANGLES[::2], TRIANGLES[1::2, 2:]]).tolist()
MIXED: list[list[int]] = [*QUADS[:3], *TRIANGLES[6:].tolist()]
# A cube whose first side is a pentagon with a re-entrant corner, which a fan round its first corner
# would fold, and the triangle in its notch.
NOTCH = np.vstack([POINTS, [0.0, 0.03, 0.06]])
NOTCHED = [[1, 3, 2, 0, 8], [0, 1, 8], *TRIANGLES[2:].tolist()]
Content = str | bytes


def _file(name: str, content: Content) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def _of(form: str, file: str) -> Callable[..., Feature]:
    """Maker of the features of one format from the content of a file."""

    def feature(name: str, treatment: Treatment, content: Content, words: str = "") -> Feature:
        return Feature(form, name, treatment, _file(file, content), words)

    return feature


def _rows(rows: Iterable[Iterable[Any]]) -> list[str]:
    return [" ".join(map(str, row)) for row in rows]


def _text(*parts: str | list[str]) -> str:
    lines = [line for part in parts for line in ([part] if isinstance(part, str) else part)]
    return "\n".join([*lines, ""])


# ---- STL ---------------------------------------------------------------------------------------

_stl = _of(STL, "cube.stl")
_ASCII = stl_ascii(POINTS, TRIANGLES)
_BINARY = stl_binary(POINTS, TRIANGLES)
_FACETS = _ASCII.split("\n")


def _count(number: int) -> bytes:
    return _BINARY[:80] + np.uint32(number).tobytes() + _BINARY[84:]


STL_FEATURES = [
    _stl("text", "read", _ASCII),
    _stl("text in upper case", "read", _ASCII.upper()),
    _stl("several solids that form one closed surface", "read",
         stl_ascii(POINTS, TRIANGLES[:4]) + stl_ascii(POINTS, TRIANGLES[4:])),
    _stl("several statements on a line", "read",
         _FACETS[0] + "\n" + " ".join(_FACETS[1:-2]) + "\n" + _FACETS[-2]),
    _stl("names with keywords, comments after them", "ignored",
         _ASCII.replace("organ", "vertex facet endfacet ; a")),
    _stl("line ends of any system", "read", _ASCII.replace("\n", "\r")),
    _stl("binary", "read", _BINARY),
    _stl("binary whose header begins with `solid`", "read",
         stl_binary(POINTS, TRIANGLES, b"solid facet")),
    _stl("colours in header and attributes", "ignored",
         stl_binary(POINTS, TRIANGLES, b"COLOR=\1\2\3\4") [:-2] + b"\xff\x7f"),
    _stl("unit in the header", "ignored with a note",
         stl_binary(POINTS, TRIANGLES, b"made by hand UNITS=mm"), "`UNITS=mm`"),
    _stl("bytes after the last triangle", "ignored with a note", _BINARY + bytes(100),
         "100 bytes after the last triangle ignored"),
    _stl("lines that STL does not have", "ignored with a note",
         _ASCII.replace("endfacet\n", "endfacet\nmade by hand\n", 1), "1 lines `made`"),
    _stl("a vertex of four numbers", "refused",
         _ASCII.replace(_FACETS[3], _FACETS[3] + " 0.1", 1), "line 4: a vertex has 3 numbers"),
    _stl("digits grouped by underscores", "refused",
         _ASCII.replace("0.12", "0.1_2", 1), "line 5: expected 3 numbers"),
    _stl("fewer triangles announced than there are", "refused", _count(11), "12 are there"),
    _stl("more triangles announced than there are", "refused", _count(13), "announces 13"),
    _stl("a second binary solid after the first", "refused", _BINARY + _BINARY, "second solid"),
    _stl("a facet without three vertices", "refused",
         _ASCII.replace(_FACETS[3] + "\n", "", 1), "line 7"),
    _stl("text without its `endsolid`", "refused", _text(_FACETS[:-2]), "`endsolid`"),
]  # fmt: skip

# ---- OBJ ---------------------------------------------------------------------------------------

_obj = _of(OBJ, "cube.obj")
_PLAIN = obj(POINTS, TRIANGLES)
_V = [f"v {row}" for row in _rows(POINTS.tolist())]
_F = [f"f {row}" for row in _rows(TRIANGLES + 1)]
_JOINED = [row.replace(" ", " \\\n  ", 1) for row in _F]

OBJ_FEATURES = [
    _obj("positions and triangles", "read", _PLAIN),
    _obj("keywords in upper case", "read", _PLAIN.upper()),
    _obj("polygons, cut into triangles", "read",
         _text(_V, [f"f {row}" for row in _rows(np.array(QUADS) + 1)])),
    _obj("polygons with a re-entrant corner", "read",
         _text([f"v {row}" for row in _rows(NOTCH.tolist())],
               ["f " + " ".join(str(i + 1) for i in face) for face in NOTCHED])),
    _obj("negative indices, counted backwards", "read", obj(POINTS, TRIANGLES - 9)),
    _obj("lines joined by a backslash", "read", _text(_V, _JOINED)),
    _obj("faces between the positions, `fo` faces", "read",
         _text(_V[:4], _F[:2], _V[4:], [row.replace("f", "fo") for row in _F[2:]])),
    _obj("groups, objects, smoothing groups, materials, comments", "ignored",
         _text("# a", "mtllib a.mtl", "o a", "g left right", _V, "s 1", "usemtl liver", _F[:5],
               "s off", "g", _F[5:], "# end")),
    _obj("any number of texture coordinates and normals", "ignored",
         _text("vt 0 0 0", "vn 0 0 1", "vp 1", obj(POINTS, TRIANGLES, "{0}/1/1").rstrip())),
    _obj("colour or weight after a position", "ignored",
         _text([f"{row} 0.5 0.5 0.5" for row in _V[:4]], [f"{row} 1.0" for row in _V[4:]], _F)),
    _obj("points `p` and lines `l`", "ignored", _text(_V, "p 1 2", "l 1 2 3", _F)),
    _obj("unit in a comment", "ignored with a note", "# units: mm\n" + _PLAIN, "`units: mm`"),
    _obj("keywords that OBJ does not have", "ignored with a note", _text(_V, "weight 1", _F),
         "1 lines `weight`"),
    _obj("a position of five numbers", "refused",
         _text(_V[:4], [f"{row} 0.5 0.5" for row in _V[4:]], _F),
         "line 5: `0.12 0.0 0.0 0.5 0.5` is no position"),
    _obj("a position of eight numbers", "refused",
         _text([f"{row} 1 2 3 4 5" for row in _V], _F), "line 1: `0.0 0.0 0.0 1 2 3 4 5` is no"),
    _obj("digits grouped by underscores", "refused",
         _text(_V, _F[0].replace("1", "0_1"), _F[1:]), "line 9: cannot read the face"),
    _obj("free-form surfaces `surf`", "refused",
         _text(_V, _F, "cstype bezier", "deg 1 1", "surf 0 1 0 1 1 2 3 4", "end"),
         "line 23: `surf`"),
    _obj("free-form curves `curv`, `curv2`", "refused",
         _text(_V, "curv 0 1 1 2", _F), "line 9: `curv`"),
    _obj("patches `bzp`, `bsp`", "refused", _text(_V, "bzp 1 2 3 4", _F), "line 9: `bzp`"),
    _obj("other files by `call`", "refused", _text("call a.obj", _V, _F), "line 1: `call`"),
]  # fmt: skip

# ---- PLY ---------------------------------------------------------------------------------------

_ply = _of(PLY, "cube.ply")
_NUMPY = {"float": "f4", "double": "f8", "uchar": "u1", "int": "i4", "ushort": "u2"}


def _header(form: str, *lines: str) -> str:
    return _text("ply", f"format {form} 1.0", list(lines), "end_header")


def ply_text(faces: list[list[int]], *, indices: str = "vertex_indices") -> str:
    """Plain PLY text of the cube."""
    return _header(
        "ascii",
        "element vertex 8", *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(faces)}", f"property list uchar int {indices}",
    ) + _text(_rows(POINTS.tolist()), _rows([len(face), *face] for face in faces))  # fmt: skip


def ply_binary(order: str, extra: bool, faces: list[list[int]]) -> bytes:
    """Binary PLY, with further properties and elements of all kinds if asked for."""

    def packed(kind: str, *values: float) -> bytes:
        return np.array(values, order + _NUMPY[kind]).tobytes()

    head = ["element vertex 8"]
    head += ["property list uchar ushort near", "property uchar red"] if extra else []
    head += [f"property double {axis}" for axis in ("zxy" if extra else "xyz")]
    head += ["property float nx"] if extra else []
    columns = [2, 0, 1] if extra else [0, 1, 2]
    body = b""
    for i, place in enumerate(POINTS):
        near = packed("uchar", i % 3) + packed("ushort", *range(i % 3)) + packed("uchar", 255)
        body += (near if extra else b"") + packed("double", *place[columns])
        body += packed("float", 0.5) if extra else b""
    if extra:
        head += ["element material 1", "property list uchar float shine", "property int id"]
        body += packed("uchar", 2) + packed("float", 0.1, 0.2) + packed("int", 7)
    head += [f"element face {len(faces)}"]
    head += ["property list uchar float texcoord"] if extra else []
    head += ["property list uchar int vertex_indices"]
    head += ["property uchar flag"] if extra else []
    for i, face in enumerate(faces):
        body += packed("uchar", i % 4) + packed("float", *[0.0] * (i % 4)) if extra else b""
        body += packed("uchar", len(face)) + packed("int", *face)
        body += packed("uchar", 1) if extra else b""
    if extra:
        head += ["element edge 1", "property int vertex1", "property int vertex2"]
        body += packed("int", 0, 1)
    form = "binary_little_endian" if order == "<" else "binary_big_endian"
    return _header(form, "comment a", *head).encode() + body


_PLY = ply_text(TRIANGLES.tolist())
_STRIP = [
    0,
    1,
    2,
    3,
    6,
    7,
    4,
    5,
    0,
    1,
]  # four sides of the cube; the others are [0 2 4 6], [1 5 3 7]
_ALL_STRIPS = [*_STRIP, -1, 0, 2, 4, 6, -1, 1, 5, 3, 7, -1]

PLY_FEATURES = [
    _ply("text", "read", _PLY),
    _ply("binary, little endian", "read", ply_binary("<", False, TRIANGLES.tolist())),
    _ply("binary, big endian", "read", ply_binary(">", False, TRIANGLES.tolist())),
    _ply("list named `vertex_index`", "read",
         ply_text(TRIANGLES.tolist(), indices="vertex_index")),
    _ply("polygons of any number of corners", "read", ply_text(MIXED)),
    _ply("properties in any order, of any type, before and after", "read",
         ply_binary("<", True, MIXED)),
    _ply("further elements, properties and lists", "ignored",
         ply_binary(">", True, TRIANGLES.tolist())),
    _ply("comments, `obj_info`, blank lines", "ignored",
         _PLY.replace("element vertex", "comment element face 3\nobj_info a b\n\nelement vertex")),
    _ply("elements with no rows", "ignored",
         _PLY.replace("end_header", "element edge 0\nproperty int vertex1\nend_header")),
    _ply("line ends of any system", "read", _PLY.replace("\n", "\r")),
    _ply("triangle strips", "read",
         _header("ascii", "element vertex 8", *(f"property float {axis}" for axis in "xyz"),
                 "element tristrips 1", "property list int int vertex_indices")
         + _text(_rows(POINTS.tolist()), _rows([[len(_ALL_STRIPS), *_ALL_STRIPS]]))),
    _ply("unit in a comment", "ignored with a note",
         _PLY.replace("element vertex", "comment unit: mm\nelement vertex"), "`unit: mm`"),
    _ply("bytes after the last element", "ignored with a note",
         ply_binary("<", False, TRIANGLES.tolist()) + b"abc", "3 bytes after the last element"),
    _ply("more values than announced", "refused", _PLY + "3 0 1 2\n", "4 more numbers"),
    _ply("fewer rows than announced", "refused",
         _PLY.replace("element face 12", "element face 13"), "13 rows of element face"),
    _ply("cells of another type", "refused",
         _PLY.replace("end_header", "element tet 1\nproperty list uchar int vertex_indices\n"
                      "end_header") + "4 0 1 2 4\n", "line 9: element tet"),
    _ply("grids of ranges", "refused",
         _PLY.replace("end_header", "element range_grid 1\nproperty list uchar int a\nend_header")
         + "1 0\n", "line 9: element range_grid"),
    _ply("unknown words in the header", "refused",
         _PLY.replace("element vertex", "elements vertex"), "line 3"),
    _ply("further words on a line of the header", "refused",
         _PLY.replace("property double z", "property double z w"), "line 6: cannot read"),
    _ply("digits grouped by underscores", "refused",
         _PLY.replace(" 0.12\n", " 0.0_12\n", 1), "`0.0_12`, word 5 (0-based) of the body"),
]  # fmt: skip

# ---- OFF ---------------------------------------------------------------------------------------

_off = _of(OFF, "cube.off")


def off(keyword: str = "OFF", point: str = "", face: str = "", counts: str = "8 12 18") -> str:
    """OFF text of the cube, with the same words after every point and every face."""
    rows = [f"{row} {point}" for row in _rows(POINTS.tolist())]
    return _text(keyword, counts, rows, [f"3 {row} {face}" for row in _rows(TRIANGLES)])


OFF_FEATURES = [
    _off("points and triangles", "read", off()),
    _off("counts on the first line", "read", off().replace("OFF\n", "OFF ")),
    _off("keyword missing, or in lower case", "read", off().replace("OFF\n", "")),
    _off("comments and blank lines", "ignored",
         "# a\n\n" + off().replace("8 12 18", "# b\n8 12 18 # c\n\n") + "# d\n"),
    _off("wrong or missing number of edges", "ignored", off(counts="8 12")),
    _off("colours of faces, whole or decimal", "ignored", off(face="255 0 0 128")),
    _off("colours of points (`COFF`)", "ignored", off("COFF", "0.5 0.5 0.5 1.0", "0.1 0.2 0.3")),
    _off("normals of points (`NOFF`, `CNOFF`)", "ignored", off("CNOFF", "0 0 1 255 0 0 255")),
    _off("texture coordinates (`STOFF`, `STCNOFF`)", "ignored", off("STOFF", "0.5 0.5", "7")),
    _off("polygons", "read",
         _text("OFF", "8 9 0", _rows(POINTS.tolist()), _rows([len(f), *f] for f in MIXED))),
    _off("faces of one or two corners", "ignored with a note",
         off(counts="8 13 0") + "2 0 1\n", "1 faces of one or two corners"),
    _off("a point of fewer numbers than the others", "refused",
         off("OFF", "0.5 0.5 0.5").replace(" 0.5", "", 1), "line 3: a point of 5 numbers, but 6"),
    _off("points of fewer numbers than `C`, `N` and `ST` announce", "refused",
         off("CNOFF", "0 0 1"), "line 3: a point of 6 numbers, but 9"),
    _off("digits grouped by underscores", "refused",
         off().replace("3 0 1 3", "3 0 0_1 3"), "line 11: not a face"),
    _off("more lines than announced", "refused", off() + "3 0 1 2\n", "21 lines found"),
    _off("fewer lines than announced", "refused", off(counts="8 13 0"), "20 lines found"),
    _off("coordinates in four or more dimensions (`4OFF`, `nOFF`)", "refused",
         off("4OFF", "1"), "`4OFF`"),
    _off("binary", "refused", b"OFF BINARY\n" + bytes(12), "line 1: `OFF BINARY`"),
]  # fmt: skip

# ---- VTK ---------------------------------------------------------------------------------------


def vtk_grid(extra: bool = False) -> vtkUnstructuredGrid:
    """The cube in 48 tetrahedra; with vertices, lines and data of many types if asked for."""
    points, tetrahedra = cube(2)
    grid = vtkUnstructuredGrid()
    grid.SetPoints(vtk_points(points))
    for cell in [(0,), (0, 1)] if extra else []:
        grid.InsertNextCell(1 if len(cell) == 1 else 3, len(cell), cell)
    for cell in tetrahedra.tolist():
        grid.InsertNextCell(10, 4, cell)
    if extra:
        _add_data(grid)
    return grid


def vtk_surface(
    faces: list[list[int]], strips: list[list[int]], extra: bool = False
) -> vtkPolyData:
    """The cube's surface by VTK."""
    surface = vtkPolyData()
    surface.SetPoints(vtk_points(POINTS))
    surface.AllocateEstimate(20, 4)
    for kind, cells in ((1, [[0]] * extra), (3, [[0, 1]] * extra), (7, faces), (6, strips)):
        for cell in cells:
            surface.InsertNextCell(kind, len(cell), cell)
    if extra:
        _add_data(surface)
    return surface


def vtk_points(places: np.ndarray) -> vtkPoints:
    points = vtkPoints()
    points.SetData(numpy_to_vtk(places, deep=True))
    return points


def _add_data(mesh: Any) -> None:
    """Scalars, vectors, tensors, whole numbers, single bytes and words of points, cells and all."""
    for data, count in (
        (mesh.GetPointData(), mesh.GetNumberOfPoints()),
        (mesh.GetCellData(), mesh.GetNumberOfCells()),
        (mesh.GetFieldData(), 3),
    ):
        for width, dtype in ((1, "f4"), (3, "f8"), (9, "f8"), (1, "i8"), (4, "u1"), (2, "i2")):
            array = numpy_to_vtk(np.full((count, width), 7, dtype), deep=True)
            array.SetName(f"POINTS {width} {dtype}")
            data.AddArray(array)
        words = vtkStringArray()
        words.SetName("words")
        for _ in range(count):
            words.InsertNextValue("CELLS 9 9 of a liver")
        data.AddArray(words)
    mesh.GetPointData().SetActiveScalars("POINTS 1 f4")
    mesh.GetPointData().SetActiveTensors("POINTS 9 f8")


def legacy(mesh: Any, binary: bool, version: int = 51) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        path = folder / "cube.vtk"
        surface = isinstance(mesh, vtkPolyData)
        writer = vtkPolyDataWriter() if surface else vtkUnstructuredGridWriter()
        writer.SetFileVersion(version)
        writer.SetFileName(str(path))
        writer.SetInputData(mesh)
        (writer.SetFileTypeToBinary if binary else writer.SetFileTypeToASCII)()
        assert writer.Write()
        return path

    return write


def xml(
    mesh: Any, mode: str = "Appended", compressor: str = "None", **settings: Any
) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        surface = isinstance(mesh, vtkPolyData)
        path = folder / ("cube.vtp" if surface else "cube.vtu")
        writer = vtkXMLPolyDataWriter() if surface else vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(path))
        writer.SetInputData(mesh)
        getattr(writer, f"SetDataModeTo{mode}")()
        getattr(writer, f"SetCompressorTypeTo{compressor}")()
        for name, value in settings.items():
            getattr(writer, f"Set{name}")(value)
        assert writer.Write()
        return path

    return write


def _edited(write: Callable[[Path], Path], old: str, new: str) -> Callable[[Path], Path]:
    def edit(folder: Path) -> Path:
        path = write(folder)
        data = path.read_bytes()
        assert old.encode() in data
        path.write_bytes(data.replace(old.encode(), new.encode()))
        return path

    return edit


def _cells(points: np.ndarray, *cells: tuple[int, list[int]]) -> vtkUnstructuredGrid:
    grid = vtkUnstructuredGrid()
    grid.SetPoints(vtk_points(points))
    for kind, nodes in cells:
        grid.InsertNextCell(kind, len(nodes), nodes)
    return grid


def _quadratic() -> vtkUnstructuredGrid:
    points, tetrahedra = cube(2)
    middles = points[tetrahedra[:, [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]]].mean(axis=2)
    rows = np.hstack([tetrahedra, len(points) + np.arange(6 * 48).reshape(-1, 6)])
    places = np.vstack([points, middles.reshape(-1, 3)])
    return _cells(places, *((24, row) for row in rows.tolist()))


def _beside() -> vtkUnstructuredGrid:
    points, tetrahedra = cube(2)
    return _cells(points, (5, [0, 1, 3]), *((10, row) for row in tetrahedra.tolist()))


def _ghost(grid: vtkUnstructuredGrid) -> vtkUnstructuredGrid:
    """The grid with a second copy of its first cell, elsewhere, marked as another piece's."""
    grid.GetPoints().InsertNextPoint(0.5, 0.5, 0.5)
    grid.InsertNextCell(10, 4, [0, 1, 2, grid.GetNumberOfPoints() - 1])
    mark = numpy_to_vtk(np.array([0] * 48 + [1], np.uint8), deep=True)
    mark.SetName("vtkGhostType")
    grid.GetCellData().AddArray(mark)
    return grid


PIXELS = [[0, 1, 2, 3], [4, 6, 5, 7], [0, 4, 1, 5], [2, 3, 6, 7], [0, 2, 4, 6], [1, 5, 3, 7]]
STRIPS = [_STRIP, [0, 2, 4, 6], [1, 5, 3, 7]]
HEXAHEDRON = [0, 4, 6, 2, 1, 5, 7, 3]
FIELD = "FIELD FieldData 3\na 2 1 int\n1 2\nwords 1 2 string\nPOINTS 8 double\nb\nc 1 1 bit\n1\n"
_TEXT = polydata_ascii(POINTS, TRIANGLES.tolist())


def _lattice(name: str) -> Feature:
    text = _text("# vtk DataFile Version 3.0", "a", "ASCII", f"DATASET {name}", "DIMENSIONS 2 2 2")
    return Feature(LEGACY, f"`{name}`", "refused", _file("cube.vtk", text), name)


LEGACY_FEATURES = [
    Feature(LEGACY, "`UNSTRUCTURED_GRID` as text", "read", legacy(vtk_grid(), False, 42)),
    Feature(LEGACY, "`UNSTRUCTURED_GRID`, binary", "read", legacy(vtk_grid(), True, 42)),
    Feature(LEGACY, "version 5.1 as text", "read", legacy(vtk_grid(), False)),
    Feature(LEGACY, "version 5.1, binary", "read", legacy(vtk_grid(), True)),
    Feature(LEGACY, "`POLYDATA` as text", "read", _file("cube.vtk", _TEXT)),
    Feature(LEGACY, "`POLYDATA`, binary", "read",
            legacy(vtk_surface(TRIANGLES.tolist(), []), True, 42)),
    Feature(LEGACY, "polygons", "read", legacy(vtk_surface(MIXED, []), True)),
    Feature(LEGACY, "triangle strips", "read", legacy(vtk_surface([], STRIPS), False, 42)),
    Feature(LEGACY, "quadrilaterals, pixels, polygons, strips among cells", "read",
            legacy(_cells(POINTS, (9, QUADS[0]), (8, PIXELS[1]), (7, QUADS[2]), (6, PIXELS[3]),
                           *((5, row) for row in TRIANGLES[8:].tolist())), True)),
    Feature(LEGACY, "keywords in any case", "read",
            _file("cube.vtk", _TEXT.replace("POINTS", "points").replace("POLYGONS", "Polygons"))),
    Feature(LEGACY, "vertices, lines; point, cell and field data; strings", "ignored",
            legacy(vtk_grid(extra=True), True)),
    Feature(LEGACY, "the same in a surface, as text", "ignored",
            legacy(vtk_surface(TRIANGLES.tolist(), [], extra=True), False)),
    Feature(LEGACY, "fields of numbers, strings and bits before the points", "ignored",
            _file("cube.vtk", _TEXT.replace("POINTS 8", FIELD + "POINTS 8", 1))),
    Feature(LEGACY, "quadratic tetrahedra: their mid-side nodes", "ignored with a note",
            legacy(_quadratic(), True), "48 cells of type tetra10: mid-side nodes not used"),
    Feature(LEGACY, "triangles beside tetrahedra", "ignored with a note",
            legacy(_beside(), True), "1 triangles beside the tetrahedra not used"),
    Feature(LEGACY, "cells marked as ghosts or hidden", "ignored with a note",
            legacy(_ghost(vtk_grid()), True), "1 cells marked as ghosts or hidden"),
    Feature(LEGACY, "cells marked so in an array of colours", "refused",
            _edited(legacy(_ghost(vtk_grid()), False), "FIELD FieldData 1\nvtkGhostType 1 49",
                    "COLOR_SCALARS vtkGhostType 1"), "save as .vtu"),
    Feature(LEGACY, "a second section of points", "refused",
            _file("cube.vtk", _TEXT.replace("POLYGONS", "POINTS 1 double\n0 0 0\nPOLYGONS")),
            "second section POINTS"),
    Feature(LEGACY, "decimal commas", "refused",
            _file("cube.vtk", _TEXT.replace("0.12", "0,12")), "`0,12` is no number"),
    Feature(LEGACY, "node numbers with fractions", "refused",
            _edited(legacy(vtk_grid(), False), "vtktypeint64\n0 9 12", "float\n0.5 9 12"),
            "nodes of cells are not whole"),
    Feature(LEGACY, "digits grouped by underscores", "refused",
            _file("cube.vtk", _TEXT.replace("0.12", "0.1_2", 1)), "`0.1_2` is no number"),
    Feature(LEGACY, "hexahedra and other solids", "refused",
            legacy(_cells(POINTS, (12, HEXAHEDRON)), True), "1 hexahedron cells"),
    Feature(LEGACY, "other curved faces", "refused",
            legacy(_cells(POINTS, (36, QUADS[0])), True), "1 VTK type 36 cells"),
    Feature(LEGACY, "unknown sections", "refused",
            _file("cube.vtk", _TEXT.replace("POLYGONS", "POLIGONS")), "`POLIGONS`"),
    *map(_lattice, ("STRUCTURED_POINTS", "STRUCTURED_GRID", "RECTILINEAR_GRID", "FIELD")),
]  # fmt: skip


def vtu_pieces(extra: str = "") -> str:
    """The cube in two pieces, as text, each with the nodes of its own."""
    points, tetrahedra = cube(2)
    pieces = [
        _text(
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(half)}"><Points>',
            f'<DataArray type="Float64" NumberOfComponents="3" format="ascii"{extra}>',
            _rows(points.tolist()),
            '</DataArray></Points><Cells><DataArray type="Int64" Name="connectivity">',
            _rows(half.tolist()),
            '</DataArray><DataArray type="Int64" Name="offsets">',
            _rows([range(4, 4 * len(half) + 1, 4)]),
            '</DataArray><DataArray type="UInt8" Name="types">',
            _rows([[10] * len(half)]),
            "</DataArray></Cells></Piece>",
        )
        for half in (tetrahedra[:17], tetrahedra[17:])
    ]
    start = '<VTKFile type="UnstructuredGrid">'
    return _text(start, "<UnstructuredGrid>", pieces, "</UnstructuredGrid>", "</VTKFile>")


def _listed(ending: str, kind: str) -> Feature:
    text = f'<VTKFile type="{kind}"><{kind}><DataSet file="a.vtu"/></{kind}></VTKFile>\n'
    write = _file(f"cube{ending}", text)
    name = f"other files named by a `{ending}`"
    return Feature(XML, name, "refused", write, f"{kind} names other files")


XML_FEATURES = [
    Feature(XML, "text", "read", xml(vtk_grid(), "Ascii")),
    Feature(XML, "base64", "read", xml(vtk_grid(), "Binary")),
    Feature(XML, "appended, base64", "read", xml(vtk_grid())),
    Feature(XML, "appended, raw", "read", xml(vtk_grid(), EncodeAppendedData=False)),
    Feature(XML, "compressed by zlib", "read", xml(vtk_grid(), compressor="ZLib")),
    Feature(XML, "compressed by LZ4", "read", xml(vtk_grid(), "Binary", "LZ4")),
    Feature(XML, "compressed by LZMA, raw", "read",
            xml(vtk_grid(), compressor="LZMA", EncodeAppendedData=False)),
    Feature(XML, "big endian", "read", xml(vtk_grid(), compressor="ZLib", ByteOrder=0)),
    Feature(XML, "headers of 32 or 64 bits", "read", xml(vtk_grid(), "Binary", HeaderType=64)),
    Feature(XML, "several pieces, joined", "read", _file("cube.vtu", vtu_pieces())),
    Feature(XML, "surfaces (`PolyData`)", "read",
            xml(vtk_surface(TRIANGLES.tolist(), []), compressor="LZ4")),
    Feature(XML, "polygons and triangle strips", "read",
            xml(vtk_surface(QUADS[:4], STRIPS[1:]), "Ascii")),
    Feature(XML, "vertices, lines, data of any type, strings", "ignored",
            xml(vtk_grid(extra=True), compressor="ZLib")),
    Feature(XML, "the same in a surface, as text", "ignored",
            xml(vtk_surface(TRIANGLES.tolist(), [], extra=True), "Ascii")),
    Feature(XML, "data of a type that VTK does not know", "ignored",
            _edited(xml(vtk_grid(extra=True), "Ascii"), 'type="Float32"', 'type="Float16"')),
    Feature(XML, "quadratic tetrahedra: their mid-side nodes", "ignored with a note",
            xml(_quadratic()), "48 cells of type tetra10: mid-side nodes not used"),
    Feature(XML, "cells marked as ghosts or hidden", "ignored with a note",
            xml(_ghost(vtk_grid())), "1 cells marked as ghosts or hidden"),
    Feature(XML, "several time steps", "refused",
            _edited(_file("cube.vtu", vtu_pieces()), "<UnstructuredGrid>",
                    '<UnstructuredGrid TimeValues="0 1">'), "2 time steps"),
    Feature(XML, "hexahedra and other solids", "refused",
            xml(_cells(POINTS, (12, HEXAHEDRON))), "1 hexahedron cells"),
    Feature(XML, "fewer values than announced", "refused",
            _edited(_file("cube.vtu", vtu_pieces()), 'NumberOfPoints="27"', 'NumberOfPoints="28"'),
            "array Points has 81 numbers, but 84 are announced"),
    Feature(XML, "more values than announced", "refused",
            _edited(xml(vtk_grid(), compressor="ZLib"), 'OfCells="48"', 'OfCells="47"'),
            "array Cells offsets has 48 numbers, but 47 are announced"),
    Feature(XML, "node numbers with fractions", "refused",
            _edited(_edited(_file("cube.vtu", vtu_pieces()), 'Int64" Name="c', 'Float64" Name="c'),
                    "\n0 9 ", "\n0.5 9 "), "nodes of Cells are not whole"),
    Feature(XML, "an array given twice", "refused",
            _edited(_file("cube.vtu", vtu_pieces()), "<Cells>",
                    '<Cells><DataArray type="Int64" Name="connectivity">0 1 2 3</DataArray>'),
            "array Cells connectivity is given twice"),
    Feature(XML, "decimal commas", "refused",
            _edited(_file("cube.vtu", vtu_pieces()), " 0.12\n", " 0,12\n"),
            "array Points cannot be read (`0,12` is no number)"),
    Feature(XML, "digits grouped by underscores", "refused",
            _edited(_file("cube.vtu", vtu_pieces()), " 0.12\n", " 0.1_2\n"),
            "`0.1_2` is no number"),
    Feature(XML, "cells that use nodes of another piece", "refused",
            _edited(_file("cube.vtu", vtu_pieces()), "\n0 9 ", "\n27 9 "), "piece 0 (0-based)"),
    Feature(XML, "structured grids", "refused",
            _edited(_file("cube.vtu", vtu_pieces()), "UnstructuredGrid", "ImageData"), "ImageData"),
    Feature(XML, "declarations (`DOCTYPE`)", "refused",
            _file("cube.vtu", "<!DOCTYPE a>\n" + vtu_pieces()), "DOCTYPE"),
    _listed(".vtm", "vtkMultiBlockDataSet"),
    _listed(".pvtu", "PUnstructuredGrid"),
    _listed(".pvtp", "PPolyData"),
    _listed(".pvd", "Collection"),
]  # fmt: skip

FEATURES: list[Feature] = [
    *STL_FEATURES,
    *OBJ_FEATURES,
    *PLY_FEATURES,
    *OFF_FEATURES,
    *LEGACY_FEATURES,
    *XML_FEATURES,
]
