"""Surface and VTK files written by other libraries with every option, cut off and garbled."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOGeometry import vtkOBJWriter, vtkSTLWriter
from vtkmodules.vtkIOPLY import vtkPLYWriter

from study.mesh.kinds import MeshError
from study.mesh.load import load_mesh
from study.mesh.raw import fan, raw_mesh, strip_triangles
from study.mesh.surface import enclosed_volume
from tests.mesh_features import Feature
from tests.mesh_features_surface import (
    FEATURES,
    LEGACY,
    NOTCH,
    NOTCHED,
    STRIPS,
    XML,
    legacy,
    vtk_grid,
    vtk_points,
    vtk_surface,
    xml,
)
from tests.mesh_samples import CUBE_VOLUME, cube_surface, ellipsoid_surface, truncations

SINGLE = 1e-6  # files with 32-bit floats
READ = [feature for feature in FEATURES if feature.treatment != "refused"]
CUTS = 12
seeds = st.integers(0, 2**32 - 1)


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = points[triangles].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@pytest.mark.parametrize("turn", range(5))
def test_a_polygon_with_a_re_entrant_corner_is_not_folded(turn):
    pentagon = np.roll(NOTCHED[0], turn)
    triangles = fan(NOTCH, pentagon[None])
    expected = 0.12**2 - 0.5 * 0.12 * 0.03  # the square without its notch
    assert areas(NOTCH, triangles).sum() == pytest.approx(expected, rel=1e-12)


def test_the_fan_round_the_first_corner_of_that_polygon_would_fold():
    """Negative control."""
    first = [[NOTCHED[0][0], *NOTCHED[0][i : i + 2]] for i in (1, 2, 3)]
    assert areas(NOTCH, np.array(first)).sum() > 0.12**2


def test_triangles_of_strips_are_wound_alike():
    triangles = np.concatenate([strip_triangles(np.array([strip])) for strip in STRIPS])
    points, _ = cube_surface()
    assert enclosed_volume(points, triangles) == pytest.approx(CUBE_VOLUME, rel=1e-14)


def test_cells_of_a_type_without_a_name_are_counted():
    mesh = raw_mesh(np.zeros((4, 3)), [("VTK type 36", np.arange(4)[None])])
    assert mesh.solids == {"VTK type 36": 1}


def shuffled(seed: int) -> tuple[np.ndarray, np.ndarray, np.random.Generator]:
    """The ellipsoid with nodes, triangles and their first corners in random order."""
    rng = np.random.default_rng(seed)
    points, triangles = ellipsoid_surface(1)
    order = rng.permutation(len(points))
    triangles = np.argsort(order)[triangles][rng.permutation(len(triangles))]
    turn = (rng.integers(3, size=(len(triangles), 1)) + np.arange(3)) % 3
    return points[order], np.take_along_axis(triangles, turn, axis=1), rng


def compare(path, points: np.ndarray, triangles: np.ndarray) -> None:
    mesh, report = load_mesh(path, "m")
    assert (len(mesh.points), len(mesh.triangles)) == (len(points), len(triangles))
    assert report.volume == pytest.approx(enclosed_volume(points, triangles), rel=SINGLE)


@settings(max_examples=5, deadline=None)
@given(seed=seeds)
@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "off", "vtk", "vtu"])
@pytest.mark.parametrize("binary", [False, True])
def test_what_meshio_writes_is_read(tmp_path_factory, ending, binary, seed):
    points, triangles, rng = shuffled(seed)
    path = tmp_path_factory.mktemp("meshio") / f"organ.{ending}"
    data = {"a": rng.normal(size=len(points)), "b": rng.integers(9, size=len(points))}
    offers_data = ending in {"ply", "vtk", "vtu"}
    mesh = meshio.Mesh(points, [("triangle", triangles)], data if offers_data else None)
    mesh.write(path, **({} if ending in {"obj", "off"} else {"binary": binary}))
    compare(path, points, triangles)


@settings(max_examples=5, deadline=None)
@given(seed=seeds, binary=st.booleans())
@pytest.mark.parametrize(
    ("ending", "kind"), [("stl", vtkSTLWriter), ("ply", vtkPLYWriter), ("obj", vtkOBJWriter)]
)
def test_what_vtk_writes_is_read(tmp_path_factory, ending, kind, seed, binary):
    points, triangles, _ = shuffled(seed)
    path = tmp_path_factory.mktemp("vtk") / f"organ.{ending}"
    surface = vtkPolyData()
    surface.SetPoints(vtk_points(points))
    surface.AllocateEstimate(len(triangles), 3)
    for triangle in triangles.tolist():
        surface.InsertNextCell(5, 3, triangle)
    writer = kind()
    if ending != "obj":
        (writer.SetFileTypeToBinary if binary else writer.SetFileTypeToASCII)()
    writer.SetFileName(str(path))
    writer.SetInputData(surface)
    writer.Write()
    compare(path, points, triangles)


OPTIONS = {
    "mode": st.sampled_from(["Ascii", "Binary", "Appended"]),
    "compressor": st.sampled_from(["None", "ZLib", "LZ4", "LZMA"]),
    "EncodeAppendedData": st.booleans(),
    "ByteOrder": st.sampled_from([0, 1]),
    "HeaderType": st.sampled_from([32, 64]),
    "BlockSize": st.sampled_from([64, 264, 32768]),  # small ones make several blocks
}


@settings(max_examples=40, deadline=None)
@given(solid=st.booleans(), extra=st.booleans(), options=st.fixed_dictionaries(OPTIONS))
def test_every_encoding_of_vtk_is_read(tmp_path_factory, solid, extra, options):
    mesh = vtk_grid(extra) if solid else vtk_surface(cube_surface()[1].tolist(), [], extra)
    loaded, report = load_mesh(xml(mesh, **options)(tmp_path_factory.mktemp("xml")), "m")
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=1e-14)
    assert len(loaded.tetrahedra if solid else loaded.triangles) == (48 if solid else 12)
    assert report.notes == ()


@settings(max_examples=16, deadline=None)
@given(
    solid=st.booleans(),
    extra=st.booleans(),
    binary=st.booleans(),
    version=st.sampled_from([42, 51]),
)
def test_every_legacy_form_of_vtk_is_read(tmp_path_factory, solid, extra, binary, version):
    mesh = vtk_grid(extra) if solid else vtk_surface([], STRIPS, extra)
    path = legacy(mesh, binary, version)(tmp_path_factory.mktemp("legacy"))
    loaded, report = load_mesh(path, "m")
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=1e-14)
    assert len(loaded.tetrahedra if solid else loaded.triangles) == (48 if solid else 12)
    assert report.notes == ()


def outcomes(path, versions: list[bytes]) -> list[float | None]:
    """Volume of every version of a file, None where it is refused."""
    found: list[float | None] = []
    for data in versions:
        path.write_bytes(data)
        try:
            found.append(load_mesh(path, "m")[1].volume)
        except MeshError:
            found.append(None)
    return found


@pytest.mark.parametrize("feature", READ, ids=[f"{one.format}: {one.name}" for one in READ])
def test_what_is_cut_off_is_refused_or_whole(feature: Feature, tmp_path, capfd):
    path = feature.write(tmp_path)
    cuts = truncations(path.read_bytes())
    chosen = np.unique(np.linspace(0, len(cuts) - 1, CUTS).astype(int)).tolist()
    volumes = outcomes(path, [cuts[i] for i in [*chosen, -2, -1]])
    assert volumes.count(None) >= 3  # data that come after the mesh may be missing
    for volume in volumes:
        assert volume is None or volume == pytest.approx(CUBE_VOLUME, rel=SINGLE)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("form", [LEGACY, XML])
def test_garbled_vtk_files_end_in_an_error_or_a_mesh_in_silence(form, tmp_path, capfd):
    rng = np.random.default_rng(3)
    for feature in [one for one in READ if one.format == form]:
        path = feature.write(tmp_path)
        sound = np.frombuffer(path.read_bytes(), np.uint8)
        versions = []
        for _ in range(8):
            data = sound.copy()
            data[rng.integers(len(data), size=3)] = rng.integers(256, size=3)
            versions.append(data.tobytes())
        for volume in outcomes(path, versions):
            assert volume is None or volume > 0
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("kind", ["float", "int"])
def test_ply_node_numbers_have_to_be_whole(tmp_path, kind):
    points, triangles = cube_surface()
    rows = [f"{x} {y} {z}" for x, y, z in points.tolist()]
    faces = ["3 0.5 1 3", *(f"3 {a} {b} {c}" for a, b, c in triangles[1:].tolist()), "4 0 1 2 3"]
    head = ["ply", "format ascii 1.0", "element vertex 8", *(f"property float {a}" for a in "xyz")]
    head += ["element face 13", f"property list uchar {kind} vertex_index", "end_header"]
    path = tmp_path / "organ.ply"
    path.write_text("\n".join([*head, *rows, *faces, ""]))
    with pytest.raises(MeshError, match="not whole"):
        load_mesh(path, "m")


def test_ply_positions_may_be_whole_numbers(tmp_path):
    points, triangles = cube_surface()
    head = b"ply\nformat binary_big_endian 1.0\nelement vertex 8\nproperty short z\n"
    head += b"property uchar y\nproperty int x\nelement face 12\n"
    head += b"property list char ushort vertex_index\nend_header\n"
    body = b"".join(
        int(z).to_bytes(2, "big") + int(y).to_bytes(1, "big") + int(x).to_bytes(4, "big")
        for x, y, z in np.rint(1000 * points)
    )
    body += b"".join(b"\3" + row.astype(">u2").tobytes() for row in triangles)
    path = tmp_path / "organ.ply"
    path.write_bytes(head + body)
    assert load_mesh(path, "mm")[1].volume == pytest.approx(CUBE_VOLUME, rel=1e-12)


def test_appended_data_without_any_tag_before_them_are_refused(tmp_path):
    path = tmp_path / "organ.vtu"
    path.write_bytes(b'<!-- <AppendedData encoding="raw"> --><VTKFile type="PolyData"/>')
    with pytest.raises(MeshError, match="no tag VTKFile"):
        load_mesh(path, "m")
