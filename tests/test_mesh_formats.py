"""Reading: every format round trip, every trap of a format, and truncation at every line."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from study.mesh.kinds import MeshError, MeshReport, SurfaceMesh, TetrahedralMesh
from study.mesh.load import MAX_BYTES, load_mesh
from tests.mesh_samples import (
    ALL_FORMATS,
    CUBE_VOLUME,
    cube,
    cube_surface,
    gmsh_1,
    gmsh_2,
    obj,
    polydata_ascii,
    stl_ascii,
    stl_binary,
    truncations,
    write_cells,
    write_format,
    write_surface,
)

# Coordinates pass through decimal text with 16 or 17 digits, or through 64-bit floats.
EXACT = 1e-15
# A binary STL stores 32-bit floats: half a unit in the last place of 0.12.
SINGLE = 4e-9


def loaded_elements(mesh: TetrahedralMesh | SurfaceMesh) -> np.ndarray:
    return mesh.tetrahedra if isinstance(mesh, TetrahedralMesh) else mesh.triangles


def corner_sets(points: np.ndarray, elements: np.ndarray) -> set[tuple[tuple[float, ...], ...]]:
    """Every element by the coordinates of its corners, whatever their order and numbers."""
    micrometres = np.rint(1e6 * points).astype(int)
    return {tuple(sorted(map(tuple, corners))) for corners in micrometres[elements].tolist()}


def load_text(folder: Path, name: str, text: str) -> tuple[SurfaceMesh, MeshReport]:
    path = folder / name
    path.write_text(text)
    mesh, report = load_mesh(path, "m")
    return mesh, report


@pytest.mark.parametrize(("kind", "name"), ALL_FORMATS)
def test_round_trip(tmp_path, kind, name):
    path, points, elements = write_format(tmp_path, kind, name)
    mesh, report = load_mesh(path, "m")
    single = name == "stl"
    assert report.kind == kind
    # The cube's volume moves by three relative coordinate errors.
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=1e-7 if single else 1e-14)
    if name.startswith("stl"):
        # Corner c of triangle t is node 3 t + c of the file.
        np.testing.assert_allclose(
            mesh.points[report.node_map.reshape(-1, 3)], points[elements], atol=SINGLE, rtol=0
        )
    else:
        np.testing.assert_allclose(mesh.points, points, atol=EXACT, rtol=0)
        assert np.array_equal(loaded_elements(mesh), elements)
        assert report.notes == ()


@pytest.mark.parametrize(("kind", "name"), ALL_FORMATS)
def test_a_cut_off_file_gives_an_error_or_true_elements(tmp_path, kind, name):
    path, points, elements = write_format(tmp_path, kind, name)
    whole = corner_sets(points, elements)
    refused = 0
    for data in truncations(path.read_bytes()):
        path.write_bytes(data)
        try:
            mesh, report = load_mesh(path, "m")
        except MeshError:
            refused += 1
            continue
        found = corner_sets(mesh.points, loaded_elements(mesh))
        # An Abaqus file does not announce its number of elements, so fewer whole lines are a file.
        assert found <= whole if name == "abaqus" else found == whole
        assert report.kind == kind
    assert refused > 50


@pytest.mark.parametrize(("kind", "name"), ALL_FORMATS)
def test_garbled_bytes_give_an_error_or_a_mesh(tmp_path, kind, name):
    path, _, _ = write_format(tmp_path, kind, name)
    sound = np.frombuffer(path.read_bytes(), np.uint8)
    rng = np.random.default_rng(7)
    for _ in range(60):
        data = sound.copy()
        data[rng.integers(len(data), size=3)] = rng.integers(256, size=3)
        path.write_bytes(data.tobytes())
        try:
            mesh, report = load_mesh(path, "m")
        except MeshError:
            continue
        assert np.isfinite(mesh.points).all()
        assert report.volume > 0
        assert loaded_elements(mesh).max() < len(mesh.points)


# ---- STL ---------------------------------------------------------------------------------------


def test_binary_stl_that_begins_with_solid_and_has_trailing_bytes(tmp_path):
    path = tmp_path / "organ.stl"
    path.write_bytes(stl_binary(*cube_surface(), header=b"solid facet organ") + b"abc")
    _, report = load_mesh(path, "m")
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=1e-7)
    assert "3 bytes after the last triangle ignored" in report.notes


def test_ascii_stl_names_the_line_of_a_bad_number(tmp_path):
    text = stl_ascii(*cube_surface()).replace("  vertex 0.0", "  vertex 0.x", 1)
    with pytest.raises(MeshError, match=r"line 4: expected 3 numbers, found `0.x"):
        load_text(tmp_path, "organ.stl", text)


# ---- OBJ ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("corner", ["{0}", "{0}/1", "{0}//1", "{0}/1/1"])
def test_obj_corners_with_textures_and_normals_of_another_count(tmp_path, corner):
    text = "mtllib a.mtl\nvt 0 0\nvn 0 0 1\nvn 0 1 0\n" + obj(*cube_surface(), corner=corner)
    mesh, _ = load_text(tmp_path, "organ.obj", text)
    assert np.array_equal(mesh.triangles, cube_surface()[1])


def test_obj_negative_numbers_count_back(tmp_path):
    points, triangles = cube_surface()
    text = obj(points, triangles - 2 * 4 - 1)  # written as i - 8, since obj() adds one
    mesh, _ = load_text(tmp_path, "organ.obj", text)
    assert np.array_equal(mesh.triangles, triangles)


def test_obj_quads_become_fans(tmp_path):
    points, triangles = cube_surface()
    quads = np.hstack([triangles[::2], triangles[1::2, 2:]])
    mesh, report = load_text(tmp_path, "organ.obj", obj(points, quads))
    assert np.array_equal(mesh.triangles, triangles)
    assert "6 faces of type polygon cut into triangles" in report.notes[0]


@pytest.mark.parametrize(
    ("face", "message"),
    [
        ("f 1 2 99", r"refers to position 99, but there are only 8"),
        ("f 1 2 -9", r"line 21: face refers to position -9"),
        ("f 0 1 2", r"line 21: face refers to position 0"),
        ("f 1 2", r"line 21: a face needs three corners"),
        ("f 1 2 x", r"line 21: cannot read the face"),
    ],
)
def test_obj_bad_faces(tmp_path, face, message):
    with pytest.raises(MeshError, match=message):
        load_text(tmp_path, "organ.obj", obj(*cube_surface()) + face + "\n")


@pytest.mark.parametrize("value", ["nan", "inf", "1e38"])
def test_obj_numbers_that_are_no_coordinates(tmp_path, value):
    text = obj(*cube_surface()).replace("v 0.0 0.0 0.0", f"v {value} 0 0")
    with pytest.raises(MeshError, match="not finite or beyond"):
        load_text(tmp_path, "organ.obj", text)


@pytest.mark.parametrize("word", ["0_0.0", "1_0"])
def test_a_number_with_an_underscore_is_none(tmp_path, word):
    text = obj(*cube_surface()).replace("v 0.0 0.0 0.0", f"v {word} 0 0")
    with pytest.raises(MeshError, match=rf"expected 3 numbers, found `{word} 0 0`"):
        load_text(tmp_path, "organ.obj", text)


# ---- VTK ---------------------------------------------------------------------------------------


def test_polydata_with_polygons(tmp_path):
    points, triangles = cube_surface()
    quads = np.hstack([triangles[::2], triangles[1::2, 2:]]).tolist()
    mesh, _ = load_text(tmp_path, "organ.vtk", polydata_ascii(points, quads))
    assert np.array_equal(mesh.triangles, triangles)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("POLYGONS 12", "POLYGONS 11", "11 cells are announced"),
        ("POINTS 8", "POINTS 9", "`POLYGONS` is no number"),
        ("double", "complex", "unknown VTK number type `complex`"),
        ("POLYGONS", "POLIGONS", "unknown VTK section"),
        ("ASCII", "ASKII", "line 3: expected ASCII or BINARY"),
        ("3 0 1 3", "3 0 1.5 3", "`1.5` is no whole number"),
        ("3 0 1 3", "3 0 1e9 3", "`1e9` is no whole number"),
        ("3 0 1 3", "3 0 99999999999999999999 3", "`9{20}` is no whole number"),
    ],
)
def test_polydata_that_contradicts_itself(tmp_path, old, new, message):
    points, triangles = cube_surface()
    text = polydata_ascii(points, triangles.tolist())
    assert old in text
    with pytest.raises(MeshError, match=message):
        load_text(tmp_path, "organ.vtk", text.replace(old, new))


def test_vtk_lattices_are_refused_before_they_are_unfolded(tmp_path):
    text = "# vtk DataFile Version 3.0\na\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 999999 " * 2
    with pytest.raises(MeshError, match="only UNSTRUCTURED_GRID and POLYDATA"):
        load_text(tmp_path, "organ.vtk", text)


# ---- Gmsh --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("first", "step"), [(1, 1), (0, 1), (10, 7)])
def test_gmsh_node_numbers_may_start_anywhere_and_have_gaps(tmp_path, first, step):
    mesh, _ = load_text(tmp_path, "organ.msh", gmsh_1(*cube(), first=first, step=step))
    assert np.array_equal(mesh.tetrahedra, cube()[1])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (gmsh_1(*cube()).replace("0 4 1 1 4 1 ", "0 4 1 1 4 77 "), "node number 77"),
        (gmsh_1(*cube()).replace("0 4 1 1 4 1 ", "0 4 1 1 5 1 "), "line 14: element of type 4"),
        (gmsh_1(*cube()).replace("$ELM \n6", "$ELM \n7"), r"\$ELM announces 7 rows but has 6"),
        (gmsh_1(*cube()).replace("\n2 0.0", "\n1 0.0"), "node number 1 is given more than once"),
        (gmsh_2(*cube()).replace("3 4 2 7 1", "3 4 3 7 1"), "element of type 4"),
        (gmsh_2(*cube()).replace("$EndElements", ""), r"section \$Elements ... \$EndElements"),
    ],
)
def test_gmsh_that_contradicts_itself(tmp_path, text, message):
    with pytest.raises(MeshError, match=message):
        load_text(tmp_path, "organ.msh", text)


# ---- What readers get wrong -------------------------------------------------------------------


def test_every_node_block_of_an_abaqus_file_counts(tmp_path):
    path, _, _ = write_format(tmp_path, "tetrahedra", "abaqus")
    path.write_text(path.read_text().replace("*ELEMENT", "*NODE\n9, 0., 0., 0.\n*ELEMENT"))
    mesh, report = load_mesh(path, "m")
    assert np.array_equal(mesh.tetrahedra, cube()[1])
    assert report.notes == ("1 nodes that no element uses dropped; first: 8 (0-based)",)


def test_abaqus_file_that_includes_another_is_refused(tmp_path):
    path, _, _ = write_format(tmp_path, "tetrahedra", "abaqus")
    path.write_text(path.read_text() + "*INCLUDE, INPUT=other.inp\n")
    with pytest.raises(MeshError, match=r"\*INCLUDE refers to another file"):
        load_mesh(path, "m")


def test_xml_declarations_are_refused(tmp_path):
    path, _, _ = write_format(tmp_path, "tetrahedra", "vtu")
    path.write_text('<!DOCTYPE a [<!ENTITY b "c">]>' + path.read_text().split("?>", 1)[1])
    with pytest.raises(MeshError, match="DOCTYPE"):
        load_mesh(path, "m")


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("gmsh 4 text", b"$Nodes\n1 8 1 8\n3 0 0 8", b"$Nodes\n1 8 1 8\n3 0 0 99999999999"),
        ("vtk 4.2 text", b"POINTS 8", b"POINTS 99999999999"),
        ("medit", b"Vertices\n8", b"Vertices 99999999999"),
    ],
)
def test_absurd_counts_are_refused_without_allocating(tmp_path, name, old, new):
    path, _, _ = write_format(tmp_path, "tetrahedra", name)
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new))
    with pytest.raises(
        MeshError,
        match=r"announces 99999999999 entries|99999999999 numbers are announced",
    ):
        load_mesh(path, "m")


@pytest.mark.parametrize(
    "suffix", [".vtu", ".vtk", ".msh", ".inp", ".mesh", ".meshb", ".ply", ".off"]
)
@pytest.mark.parametrize("content", [b"\n", b"nonsense\n" * 9, bytes(range(256)) * 4])
def test_unreadable_content_raises_and_stays_quiet(tmp_path, capfd, suffix, content):
    path = tmp_path / f"organ{suffix}"
    path.write_bytes(content)
    with pytest.raises(MeshError, match="organ"):
        load_mesh(path, "m")
    assert capfd.readouterr() == ("", "")


# ---- Cells and files ---------------------------------------------------------------------------


def test_triangles_beside_tetrahedra_are_not_used(tmp_path):
    points, tetrahedra = cube()
    cells = [("triangle", cube_surface()[1]), ("tetra", tetrahedra), ("line", [[0, 1]])]
    path = write_cells(tmp_path / "organ.vtu", points, cells)
    mesh, report = load_mesh(path, "m")
    assert np.array_equal(mesh.tetrahedra, tetrahedra)
    assert report.notes[0].startswith("12 triangles beside the tetrahedra not used")


def test_quadratic_tetrahedra_keep_their_corners(tmp_path):
    points, tetrahedra = cube()
    edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]
    middles = points[tetrahedra[:, edges]].mean(axis=2).reshape(-1, 3)
    rows = np.hstack([tetrahedra, len(points) + np.arange(len(middles)).reshape(-1, 6)])
    path = write_cells(tmp_path / "organ.vtu", np.vstack([points, middles]), [("tetra10", rows)])
    mesh, report = load_mesh(path, "m")
    assert np.array_equal(mesh.tetrahedra, tetrahedra)
    assert "6 cells of type tetra10" in report.notes[0]
    assert "36 nodes that no element uses dropped" in report.notes[1]


@pytest.mark.parametrize("beside", [[], [("tetra", cube()[1])]])
def test_hexahedra_are_refused(tmp_path, beside):
    hexahedron = [[0, 4, 6, 2, 1, 5, 7, 3]]
    path = write_cells(tmp_path / "organ.vtu", cube()[0], [("hexahedron", hexahedron), *beside])
    with pytest.raises(MeshError, match=r"1 hexahedron cells.*split them"):
        load_mesh(path, "m")


def test_a_file_without_faces_is_refused(tmp_path):
    with pytest.raises(MeshError, match="neither tetrahedra nor triangles"):
        load_text(tmp_path, "organ.obj", "v 0 0 0\n")


def test_unknown_ending_lists_what_can_be_read(tmp_path):
    with pytest.raises(MeshError, match=r"`\.step`; can be read: \.vtu"):
        load_text(tmp_path, "organ.step", "ISO-10303")


def test_missing_empty_and_irregular_files(tmp_path):
    empty = tmp_path / "empty.stl"
    empty.touch()
    pipe = tmp_path / "pipe.stl"
    os.mkfifo(pipe)
    for path, message in [
        (tmp_path / "none.stl", "no such file"),
        (tmp_path, "not a regular file"),
        (pipe, "not a regular file"),
        (empty, "empty"),
    ]:
        with pytest.raises(MeshError, match=message):
            load_mesh(path, "m")


def test_a_huge_file_is_refused_unread(tmp_path):
    path = tmp_path / "organ.stl"
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)  # sparse: takes no room
    with pytest.raises(MeshError, match="coarsen the mesh"):
        load_mesh(path, "m")


def test_the_operating_systems_refusal_is_passed_on(tmp_path, monkeypatch):
    path = write_surface(tmp_path / "organ.obj", *cube_surface())

    def refuse(_: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(MeshError, match="cannot be opened: Permission denied"):
        load_mesh(path, "m")


def test_the_report_identifies_the_file(tmp_path):
    path = write_surface(tmp_path / "organ.obj", *cube_surface())
    first = load_mesh(path, "m")[1]
    path.write_text(path.read_text() + "# another\n")
    second = load_mesh(path, "m")[1]
    assert first.file == str(path)
    assert first.sha256 != second.sha256
