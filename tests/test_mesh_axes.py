"""One organ, its file written along any axes, lies the same way in a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from study.mesh.axes import AXES, MODELLING, is_mirrored, letters_of, to_scene
from study.mesh.kinds import MeshError
from study.mesh.load import load_mesh
from study.mesh.surface import enclosed_volume
from study.mesh.tetrahedra import boundary, volumes
from study.run.check import describe_mesh
from study.run.study import run_study
from study.scene import Place
from study.scene.file import SceneError, read_scene
from study.scene.place import OUTWARD, resolve
from tests.mesh_samples import box, ellipsoid_surface, obj, stl_binary, write_tetrahedra

SIZE = (0.12, 0.08, 0.06)
SIDES = {
    "L": (1, 0, 0),
    "R": (-1, 0, 0),
    "P": (0, 1, 0),
    "A": (0, -1, 0),
    "S": (0, 0, 1),
    "I": (0, 0, -1),
}


def lopsided():
    """A box in the scene's axes whose left, upper front corner is drawn out: nothing is alike."""
    points, tetrahedra = box((3, 2, 2), SIZE)
    points = points - points.min(axis=0)
    corner = np.linalg.norm(points - [SIZE[0], 0.0, SIZE[2]], axis=1).argmin()
    points[corner] += [0.01, -0.02, 0.03]
    return points, tetrahedra


def written(points, axes):
    """Coordinates as a file along the axes has them: along each, how far towards its side."""
    return np.stack([points @ np.array(SIDES[letter], dtype=float) for letter in axes], axis=1)


def as_file(path, axes, turned=True):
    points, tetrahedra = lopsided()
    handed = np.linalg.det([SIDES[letter] for letter in axes])
    if turned and handed < 0:  # a tool that thinks its axes right-handed winds them so
        tetrahedra = tetrahedra[:, [0, 1, 3, 2]]
    return write_tetrahedra(path, written(points, axes), tetrahedra)


def test_there_are_48_axes_half_of_them_left_handed():
    assert len(set(AXES)) == len(AXES) == 48
    assert sum(map(is_mirrored, AXES)) == 24
    assert not is_mirrored("LPS")
    assert not is_mirrored("RAS")
    assert is_mirrored("LAS")


@pytest.mark.parametrize("axes", AXES)
def test_an_organ_is_the_same_along_any_axes(tmp_path, axes):
    points, tetrahedra = lopsided()
    mesh, report = load_mesh(as_file(tmp_path / "organ.vtu", axes), "m", axes)
    assert np.array_equal(mesh.points, points)
    assert (volumes(mesh) > 0).all()
    assert report.volume == pytest.approx(volumes(replace(mesh, tetrahedra=tetrahedra)).sum())
    assert report.extent == pytest.approx([0.13, 0.10, 0.09])
    assert not any("wound" in note or "inverted" in note for note in report.notes)
    surface, original = boundary(mesh), boundary(replace(mesh, tetrahedra=tetrahedra))
    for side in OUTWARD:
        place = Place(side=side, at=(0.41, 0.63))
        for found, same in zip(resolve(place, surface), resolve(place, original), strict=True):
            assert found == pytest.approx(same, abs=1e-12)


@pytest.mark.parametrize("axes", ["LPS", "RAS", "ALI"])
def test_a_surface_stays_outward_along_any_axes(tmp_path, axes):
    points, triangles = ellipsoid_surface()
    points = points * [1.0, 0.8, 0.6]
    path = tmp_path / "organ.stl"
    path.write_bytes(stl_binary(written(points, axes), triangles))
    mesh, _ = load_mesh(path, "m", axes)
    assert enclosed_volume(mesh.points, mesh.triangles) > 0
    assert np.ptp(mesh.points, axis=0) == pytest.approx(np.ptp(points, axis=0), rel=1e-5)


def test_a_run_is_the_same_along_other_axes(tmp_path):
    settings = (
        'models=["fem"]',
        "support.side=inferior",
        "support.depth=5 mm",
        "reference.element_size=50 mm",
        "tool.radius=20 mm",
        "tool.force=0.1 N",
        "lattice.spacing=20 mm",
        "time.samples=16",
        "renders=false",
        "organ.unit=m",
        'control_points={tool={side="superior",at=[0.4,0.5]}}',
        'tool.place={side="superior",at=[0.4,0.5]}',
    )

    def motion(axes, stated):
        path = as_file(tmp_path / f"{axes}.vtu", axes)
        chosen = (f"organ.mesh={path}", f"organ.axes={stated}", *settings)
        found = run_study(read_scene("block", chosen))
        return np.array([row[3:] for row in found.curves]), found.record.notes

    own, notes = motion("LPS", "LPS")
    assert any(note.startswith("axes LPS") for note in notes)
    for axes in ("SRA", "RAS", "LSP"):
        same, notes = motion(axes, axes)
        # The solver stops at a residual, and nodes may be summed in another order.
        assert np.abs(same - own).max(axis=0) == pytest.approx(
            [0.0] * own.shape[1], abs=1e-6 * np.abs(own).max()
        )
        assert sum(note.startswith(f"axes {axes}") for note in notes) == 1
    wrong, _ = motion("RAS", "LPS")
    assert np.abs(wrong - own).max() > 1e-3 * np.abs(own).max()  # negative control


def test_axes_of_modelling_tools_show_the_front():
    """Upright, and looking at the viewer: along -z where y is up, along +y where z is."""
    assert to_scene("y-up") @ [0.0, 1.0, 0.0] == pytest.approx([0.0, 0.0, 1.0])
    assert to_scene("y-up") @ [0.0, 0.0, 1.0] == pytest.approx([0.0, -1.0, 0.0])
    assert to_scene("Z-Up") @ [0.0, 0.0, 1.0] == pytest.approx([0.0, 0.0, 1.0])
    assert not any(map(is_mirrored, MODELLING))


@pytest.mark.parametrize("axes", ["LP", "LLS", "XYZ", "LPSA", "", "x-up", "LRS"])
def test_other_words_are_refused(tmp_path, axes):
    with pytest.raises(MeshError, match=r"`organ.axes` = .*three letters"):
        letters_of(axes)
    with pytest.raises(SceneError, match=r"organ\.axes"):
        read_scene("liver", (f"organ.mesh={tmp_path}/organ.stl", f"organ.axes={axes!r}"))


def test_axes_pieces_and_units_without_a_mesh_are_refused():
    for key, value in (("axes", "RAS"), ("pieces", "largest"), ("unit", "mm")):
        with pytest.raises(SceneError, match=rf"organ.{key}: has no effect without organ.mesh"):
            read_scene("liver", (f"organ.{key}={value}",))


def test_check_says_the_axes_it_took(tmp_path):
    path = as_file(tmp_path / "organ.vtu", "LAS")
    assert sum("axes not stated, taken as LPS" in x for x in describe_mesh(path, "m")) == 1
    lines = describe_mesh(path, "m", "las")
    assert sum("left-handed ones: the coordinates are mirrored back" in x for x in lines) == 1


# --- pieces and holes --------------------------------------------------------------------------


def pieces(kind):
    """An ellipsoid's surface with what a segmentation leaves beside or inside it."""
    points, triangles = ellipsoid_surface()
    small = 0.1 * points
    stray = {"stray": small + np.ptp(points, axis=0), "cavity": small, "both": small}[kind]
    groups = [(points, triangles), (stray, triangles[:, ::-1] if kind != "stray" else triangles)]
    if kind == "both":
        groups.append((small + np.ptp(points, axis=0), triangles[1:]))  # open as well
    starts = np.cumsum([0, *(len(p) for p, _ in groups)])
    return (
        np.concatenate([p for p, _ in groups]),
        np.concatenate([t + start for start, (_, t) in zip(starts, groups, strict=False)]),
    )


@pytest.mark.parametrize("kind", ["stray", "cavity", "both"])
def test_pieces_are_named_once_and_the_largest_is_kept_where_it_is_asked_for(tmp_path, kind):
    path = tmp_path / "organ.obj"
    path.write_text(obj(*pieces(kind)))
    with pytest.raises(MeshError) as caught:
        load_mesh(path, "m")
    message, count = str(caught.value), 3 if kind == "both" else 2
    assert message.count(f"{count} separate surfaces") == 1
    assert ("1 of them inside the largest" in message) == (kind != "stray")
    assert message.count("open edges in 1 holes") == (kind == "both")
    mesh, report = load_mesh(path, "m", None, "largest")
    alone, triangles = ellipsoid_surface()
    assert report.volume == pytest.approx(enclosed_volume(alone, triangles), rel=1e-5)
    assert len(mesh.triangles) == len(triangles)
    dropped = [note for note in report.notes if "pieces dropped for the largest" in note]
    assert len(dropped) == 1
    assert dropped[0].startswith(f"{count - 1} of {count} pieces")


def test_the_largest_of_several_solids_is_kept(tmp_path):
    points, tetrahedra = lopsided()
    more, few = box((1, 1, 1), (0.01, 0.01, 0.01))
    path = write_tetrahedra(
        tmp_path / "organ.vtu",
        np.concatenate([points, more + 1.0]),
        np.concatenate([tetrahedra, few + len(points)]),
    )
    with pytest.raises(MeshError, match="2 pieces without a common face"):
        load_mesh(path, "m")
    mesh, report = load_mesh(path, "m", None, "largest")
    assert len(mesh.tetrahedra) == len(tetrahedra)
    assert sum("1 of 2 pieces dropped" in note for note in report.notes) == 1


def test_holes_are_counted_and_measured(tmp_path):
    points, triangles = ellipsoid_surface()
    fan = (triangles == triangles[0, 0]).any(axis=1)
    far = np.linalg.norm(points[triangles].mean(axis=1) - points[triangles[0, 0]], axis=1).argmax()
    kept = ~fan
    kept[far] = False
    path = tmp_path / "organ.obj"
    path.write_text(obj(points, triangles[kept]))
    with pytest.raises(MeshError) as caught:
        load_mesh(path, "m")
    assert f"{fan.sum() + 3} open edges in 2 holes, of {fan.sum()}, 3 edges" in str(caught.value)
    assert str(caught.value).count("fill its holes") == 1
