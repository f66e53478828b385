"""Fields on a mesh over time, written as VTKHDF and read back by VTK's reader."""

import dataclasses
import os
from contextlib import suppress

import numpy as np
import pytest
import pyvista

from msm import model
from study.models.lattice_assembly import assembled
from study.models.tissue import elastic
from study.organ.block import block_mesh
from study.results import vtkhdf
from study.results.fields import Frames, Mesh, recording

pytestmark = pytest.mark.filterwarnings("ignore::pyvista.PyVistaDeprecationWarning")


def cube_lattice(counts=(3, 2, 1), h=0.01):
    """Nodes and cells of a small lattice, corners at the bits of their number, x the highest."""
    shape = np.array(counts) + 1
    nodes = h * np.argwhere(np.ones(shape)).astype(float)
    number = np.arange(len(nodes)).reshape(shape)
    lowest = np.argwhere(np.ones(counts, dtype=int))
    corners = [[(c >> 2) & 1, (c >> 1) & 1, c & 1] for c in range(8)]
    cells = np.stack([number[tuple((lowest + corner).T)] for corner in corners], axis=1)
    return Mesh(nodes, cells)


def tetrahedra():
    mesh = block_mesh((0.03, 0.02, 0.01), 0.01)
    return Mesh(mesh.points, mesh.tetrahedra)


def motion(mesh, sample):
    """A displacement and a velocity that differ at every node and sample."""
    u = (1.0 + sample) * mesh.points * [1.0, 2.0, 3.0] + 1e-17
    return u, -np.sqrt(2.0) * u[:, ::-1]


def record(tmp_path, mesh, samples, times):
    path = tmp_path / "body.vtkhdf"
    with recording(path, mesh, times, tmp_path / "raw") as frames:
        for sample in samples:
            frames.write(sample, *motion(mesh, sample))
    return path


def read_back(path):
    """The times, and the mesh at each of them."""
    reader = pyvista.get_reader(path)
    vtk_reader = reader.reader
    vtk_reader.UpdateInformation()
    count = vtk_reader.GetNumberOfSteps()
    found = []
    for step in range(count):
        vtk_reader.SetStep(step)
        vtk_reader.Update()
        grid = pyvista.wrap(vtk_reader.GetOutput()).copy()
        found.append((vtk_reader.GetTimeValue(), grid))
    return found


@pytest.mark.parametrize("mesh", [cube_lattice(), tetrahedra()], ids=["lattice", "tetrahedra"])
def test_mesh_times_and_fields_are_read_back_to_the_bit(mesh, tmp_path):
    times = np.linspace(0.0, 0.7, 8)
    found = read_back(record(tmp_path, mesh, range(8), times))
    assert len(found) == 8
    for sample, (at, grid) in enumerate(found):
        # The format as VTK writes it keeps times in single precision.
        assert at == pytest.approx(times[sample], rel=2.0**-23)
        u, v = motion(mesh, sample)
        np.testing.assert_array_equal(grid.points, mesh.points)
        np.testing.assert_array_equal(grid.point_data["displacement"], u)
        np.testing.assert_array_equal(grid.point_data["velocity"], v)
        assert grid.n_cells == len(mesh.cells)


@pytest.mark.parametrize("mesh", [cube_lattice(), tetrahedra()], ids=["lattice", "tetrahedra"])
def test_cells_have_their_corners_in_the_order_of_vtk(mesh, tmp_path):
    """Volumes are positive and add up; the same nodes in another order would give others."""
    _, grid = read_back(record(tmp_path, mesh, [0], np.zeros(1)))[0]
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    np.testing.assert_allclose(sizes, 6e-6 / len(mesh.cells), rtol=1e-12)
    corners = mesh.cells.shape[1]
    assert set(grid.celltypes) == {pyvista.CellType.HEXAHEDRON if corners == 8 else 10}
    connected = np.sort(grid.cell_connectivity.reshape(-1, corners), axis=1)
    np.testing.assert_array_equal(connected, np.sort(mesh.cells, axis=1))


def test_corners_in_the_order_of_the_lattice_would_be_seen(tmp_path, monkeypatch):
    """Negative control of the volumes."""
    monkeypatch.setattr(vtkhdf, "HEXAHEDRON", tuple(range(8)))
    mesh = cube_lattice()
    _, grid = read_back(record(tmp_path, mesh, [0], np.zeros(1)))[0]
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    assert not np.allclose(sizes, 1e-6, rtol=0.1)


def test_undone_samples_are_written_over_and_later_ones_left_out(tmp_path):
    mesh, times = cube_lattice(), np.arange(10.0)
    path = tmp_path / "body.vtkhdf"
    with recording(path, mesh, times, tmp_path / "raw") as frames:
        for sample in (0, 1, 2, 3, 4):
            frames.write(sample, *motion(mesh, 100 + sample))
        for sample in (1, 2):  # back to 1, lost after 2
            frames.write(sample, *motion(mesh, sample))
    found = read_back(path)
    assert [at for at, _ in found] == [0.0, 1.0, 2.0]
    for sample, shown in enumerate((100, 1, 2)):
        np.testing.assert_array_equal(
            found[sample][1].point_data["displacement"], motion(mesh, shown)[0]
        )


def test_frames_of_an_interrupted_run_are_carried_on(tmp_path):
    mesh, times = tetrahedra(), np.arange(6.0)
    path, raw = tmp_path / "body.vtkhdf", tmp_path / "raw"
    with suppress(KeyboardInterrupt), recording(path, mesh, times, raw) as frames:
        for sample in range(4):
            frames.write(sample, *motion(mesh, sample))
        os.write(frames.file.fileno(), b"half a frame")
        raise KeyboardInterrupt
    assert not path.exists()
    with recording(path, mesh, times, raw, resume=True) as frames:
        for sample in (2, 3, 4, 5):
            frames.write(sample, *motion(mesh, sample))
    assert len(read_back(path)) == 6
    assert {file.name for file in tmp_path.iterdir()} == {"body.vtkhdf", "raw"}


def test_frames_before_the_one_that_a_run_continues_from_must_be_there(tmp_path):
    mesh = tetrahedra()
    frames = Frames(tmp_path / "raw", len(mesh.points), resume=True)
    with frames.file, pytest.raises(ValueError, match=r"0 samples.*run without --resume"):
        frames.write(3, *motion(mesh, 3))


@pytest.mark.parametrize("damage", ["cut", "altered"])
def test_frames_that_are_not_as_they_were_written_are_not_carried_on(damage, tmp_path):
    """Of four, the third: two are left to go on from."""
    mesh, path = cube_lattice(), tmp_path / "raw"
    frames = Frames(path, len(mesh.points))
    with frames.file:
        for sample in range(4):
            frames.write(sample, *motion(mesh, sample))
    data = bytearray(path.read_bytes())
    at = len(data) // 4 * 2 + 100
    path.write_bytes(data[:at] if damage == "cut" else data[:at] + b"\xff" + data[at + 1 :])
    frames = Frames(path, len(mesh.points), resume=True)
    with frames.file:
        assert frames.count == 2
        u, v = motion(mesh, 1)
        np.testing.assert_array_equal(frames.read(1)["velocity"], v)
        with pytest.raises(ValueError, match=r"2 samples, .* or are damaged; run without --resume"):
            frames.write(3, u, v)


def test_without_resume_old_frames_are_dropped(tmp_path):
    mesh = tetrahedra()
    record(tmp_path, mesh, range(3), np.arange(3.0))
    frames = Frames(tmp_path / "raw", len(mesh.points))
    with frames.file, pytest.raises(ValueError, match="0 samples"):
        frames.write(2, *motion(mesh, 2))


def test_a_fault_while_reading_frames_leaves_no_file(tmp_path, monkeypatch):
    def failing(*_):
        raise OSError("disk gone")

    monkeypatch.setattr(Frames, "read", failing)
    with pytest.raises(OSError, match="disk gone"):
        record(tmp_path, cube_lattice(), range(2), np.arange(2.0))
    assert {file.name for file in tmp_path.iterdir()} == {"raw"}


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    mesh = cube_lattice()
    with (
        pytest.raises(OSError, match="nowhere"),
        recording(tmp_path / "nowhere" / "a.vtkhdf", mesh, np.zeros(1), tmp_path / "raw") as frames,
    ):
        frames.write(0, *motion(mesh, 0))


def test_other_cells_are_refused(tmp_path):
    mesh = Mesh(np.zeros((6, 3)), np.arange(6)[None])
    with pytest.raises(ValueError, match="not cells of 6"):
        record(tmp_path, mesh, [0], np.zeros(1))


def test_the_mesh_is_written_once(tmp_path, rng):
    """Random fields do not compress: the file grows by them alone, not by points and cells."""
    mesh = cube_lattice((12, 12, 12))
    frame = 3 * 8 * len(mesh.points)

    def size(samples):
        path = tmp_path / f"{samples}.vtkhdf"
        times = np.arange(float(samples))
        vtkhdf.write(path, *mesh, times, lambda _: {"u": rng.standard_normal(mesh.points.shape)})
        return path.stat().st_size

    # A mesh in each would make it four times as much.
    assert size(60) - size(30) == pytest.approx(30 * frame, rel=0.3)


def test_a_lattice_run_is_seen_whole_in_its_file(small_scene, small_posed, tmp_path):
    """At a lattice node the file holds what the run recorded of the same place."""
    body = assembled(small_posed, small_scene.lattice)
    material = elastic(body.lattice, 9e3, 0.45)
    nodes = body.lattice.nodes
    seen = dataclasses.replace(small_posed.observation, probes=nodes[[0, 7]])
    path = tmp_path / "msm.vtkhdf"
    mesh = Mesh(nodes, body.lattice.cells)
    with recording(path, mesh, seen.times, tmp_path / "raw") as frames:
        found = model.run(body, material, small_posed.factor, seen, on_sample=frames.write)
    shown = read_back(path)
    assert len(shown) == len(seen.times)
    for sample in (1, 50, 100):
        grid = shown[sample][1]
        # Trilinear weights at a node are 1 and 0 up to the rounding of its place.
        scale = np.abs(found.trajectory.displacement).max()
        np.testing.assert_allclose(
            grid.point_data["displacement"][[0, 7]],
            found.trajectory.displacement[sample],
            atol=1e-9 * scale,
        )
