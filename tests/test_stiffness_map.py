"""Maps of stiffness from images, and inclusions as a scene states them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fem_reference import model as fem
from fem_reference.solvers import solve_static
from study.mesh.axes import to_scene
from study.mesh.save import save
from study.mesh.tetrahedra import boundary, volumes
from study.organ.block import block_mesh
from study.problem.heterogeneous import HeterogeneousTissue, barycentric_samples, of_tetrahedra
from study.results.provenance import organ_sha256
from study.run.check import describe_scene
from study.scene.file import read_scene, resolved, validate, write_scene
from study.scene.nifti import read_image
from study.scene.problem import problem_of

nibabel = pytest.importorskip("nibabel")

BLOCK = (
    'organ.size=["60 mm", "40 mm", "30 mm"]',
    "tool.radius=15 mm",
    "tool.force=0.05 N",
    "reference.element_size=12 mm",
    "time.samples=101",
)
STEP = 2.0
"""Edge of a voxel [mm]."""


def image(path, modulus, shape=(34, 24, 19), origin=(2.0, 2.0, -2.0), mirrored=False):
    """An image of `modulus` at points [m] of the scene; x and y of RAS point the other way."""
    affine = np.diag([-STEP, -STEP, STEP, 1.0])
    affine[:3, 3] = origin
    if mirrored:  # the same voxels stored from the other end of x
        affine[0, 0], affine[0, 3] = STEP, origin[0] - STEP * (shape[0] - 1)
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    in_ras = index @ affine[:3, :3].T + affine[:3, 3]
    points = 1e-3 * in_ras * [-1.0, -1.0, 1.0]
    nibabel.save(nibabel.Nifti1Image(modulus(points), affine), path)
    return path


def scene_of(path, *overrides, unit="kPa", quantity="youngs-modulus"):
    table = f'{{file="{path}", quantity="{quantity}", unit="{unit}"}}'
    return read_scene("block", (*BLOCK, f"tissue.stiffness_map={table}", *overrides))


def halves(points):
    """5 kPa where x is less than 30 mm, else 20."""
    return np.where(points[..., 0] < 0.03, 5.0, 20.0)


@pytest.mark.parametrize("mirrored", [False, True])
def test_voxels_lie_where_their_affine_says(tmp_path, mirrored):
    path = image(tmp_path / "map.nii.gz", halves, mirrored=mirrored)
    problem = problem_of(scene_of(path))
    assert isinstance(problem.tissue, HeterogeneousTissue)
    at = np.array([[0.01, 0.02, 0.015], [0.05, 0.02, 0.015], [0.5, 0.0, 0.0]])
    found = problem.tissue.mapped(at)
    assert found[:2] == pytest.approx([5e3, 20e3])
    assert np.isnan(found[2])


def test_an_image_that_lies_askew_is_read_where_it_lies(tmp_path):
    """A field that is linear in place is what interpolation gives, whichever way voxels run."""

    def linear(points):
        return 50.0 + points @ [100.0, 200.0, -50.0]

    middle = np.array([-30.0, -20.0, 15.0])  # of the block, in RAS
    turned = STEP * Rotation.from_euler("xyz", [20.0, -35.0, 50.0], degrees=True).as_matrix()
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = turned, middle - turned @ np.full(3, 24.5)
    index = np.stack(np.meshgrid(*[np.arange(50)] * 3, indexing="ij"), axis=-1)
    points = 1e-3 * (index @ affine[:3, :3].T + affine[:3, 3]) * [-1.0, -1.0, 1.0]
    nibabel.save(nibabel.Nifti1Image(linear(points), affine), tmp_path / "askew.nii")
    found = problem_of(scene_of(tmp_path / "askew.nii")).tissue.mapped
    at = np.array([[0.01, 0.02, 0.015], [0.05, 0.03, 0.02], [0.03, 0.01, 0.005]])
    assert found(at) == pytest.approx(1e3 * linear(at))


def test_an_inclusion_counts_before_the_map_and_no_part_twice(tmp_path):
    path = image(tmp_path / "map.nii", lambda points: np.full(points.shape[:-1], 20.0))
    table = resolved(scene_of(path))
    table["tissue"]["inclusion"] = [BALL]
    problem = problem_of(validate(table, "made"))
    made = of_tetrahedra(problem.geometry.mesh, problem.tissue)
    assert np.abs(made.around).max() < 1e-12
    size, whole = volumes(problem.geometry.mesh), 4.0 / 3.0 * np.pi * 0.01**3
    assert size @ made.share[:, 0] == pytest.approx(whole, rel=0.02)
    assert size @ made.mapped_share == pytest.approx(size.sum() - whole, rel=0.02)


def test_a_uniform_map_is_the_tissue_of_its_modulus(tmp_path):
    path = image(tmp_path / "map.nii", lambda points: np.full(points.shape[:-1], 9.5))
    mapped, plain = (problem_of(one) for one in (scene_of(path), read_scene("block", BLOCK)))
    rest = [
        solve_static(fem.build(one.geometry.mesh, one.tissue, one.foundation, one.tool))
        for one in (mapped, plain)
    ]
    assert rest[0] == pytest.approx(rest[1], abs=1e-9 * np.abs(rest[1]).max())


def test_a_shear_modulus_is_a_third_or_so_of_youngs(tmp_path):
    path = image(tmp_path / "map.nii", lambda points: np.full(points.shape[:-1], 3.0))
    problem = problem_of(scene_of(path, quantity="shear-modulus"))
    nu = problem.tissue.poisson_ratio
    found = problem.tissue.mapped(np.array([[0.03, 0.02, 0.01]]))
    assert found == pytest.approx([2.0 * (1.0 + nu) * 3e3])


def test_noise_where_no_organ_is_does_not_refuse_a_map(tmp_path):
    """Elastograms have small values beside the body; at the organ they are a mistaken unit."""

    def noisy(points, at):
        away = np.linalg.norm(points - at, axis=-1)
        return np.where(away < 1.5e-3, 1e-3, 20.0)  # 1 Pa

    beside, within = np.array([-0.009, 0.046, 0.034]), np.array([0.03, 0.02, 0.015])
    origin = (12.0, 12.0, -12.0)
    shape = (44, 34, 29)
    path = image(tmp_path / "a.nii", lambda p: noisy(p, beside), shape, origin)
    assert problem_of(scene_of(path)).tissue.mapped(within[None]) == pytest.approx([20e3])
    path = image(tmp_path / "b.nii", lambda p: noisy(p, within), shape, origin)
    with pytest.raises(
        ValueError, match=r"unit: in kPa \d+ of 43384 voxels .* of 1 to 1 Pa, beyond"
    ):
        problem_of(scene_of(path))


def test_zeros_are_tissue_as_around_and_do_not_soften_what_is_beside_them(tmp_path):
    path = image(tmp_path / "map.nii", lambda p: np.where(p[..., 0] < 0.03, 0.0, 20.0))
    problem = problem_of(scene_of(path))
    mesh = problem.geometry.mesh
    made = of_tetrahedra(mesh, problem.tissue)
    known = made.mapped_share > 0.0
    assert (made.mapped_share[known] / made.mapped[known]) == pytest.approx(20e3)
    assert 0.3 < made.around.mean() < 0.7
    told = [line for line in problem.notes if "stiffness_map" in line]
    assert len(told) == 1
    assert "20 kPa" in told[0]
    with pytest.raises(ValueError, match=r"has no value in it; set its elsewhere"):
        problem_of(scene_of(path, "tissue.stiffness_map.elsewhere=refused"))


@pytest.mark.parametrize("shape", [(34, 24, 1), (34, 24, 2)])
def test_an_image_goes_to_the_faces_of_its_outer_voxels(tmp_path, shape):
    """Slices of 2 mm through a block of 30 mm have 2 mm of it each, half of them beyond centres."""
    path = image(tmp_path / "map.nii", lambda p: np.full(p.shape[:-1], 20.0), shape, (2, 2, 12))
    problem = problem_of(scene_of(path))
    made = of_tetrahedra(problem.geometry.mesh, problem.tissue)
    assert volumes(problem.geometry.mesh) @ made.mapped_share == pytest.approx(
        shape[2] * 2e-3 * 0.06 * 0.04, rel=0.03
    )


@pytest.mark.parametrize(
    ("make", "unit", "message"),
    [
        (lambda p: image(p / "m.nii", lambda x: 1e-3 * halves(x)), "MPa", None),
        (lambda p: image(p / "m.nii", halves), "MPa", r"in MPa .* Pa in the mean over the organ"),
        (lambda p: image(p / "m.nii", lambda x: 1e6 * halves(x)), "MPa", "stiffness_map.unit"),
        (lambda p: image(p / "m.nii", halves, origin=(900.0, 0.0, 0.0)), "kPa", "no voxel"),
        (lambda p: image(p / "m.nii", lambda x: halves(x) - 10), "kPa", r"\d+ voxels .* -5e\+03"),
        (lambda p: edited(p / "m.nii", in_metres), "kPa", r"voxels 2 m long .* unit of length"),
        (lambda p: p / "none.nii", "kPa", "no such file"),
        (lambda p: p / "text.nii", "kPa", "is no NIfTI image"),
        (lambda p: image(p / "m.nii", lambda x: np.stack([halves(x)] * 2, -1)), "kPa", "4 axes"),
    ],
)
def test_an_image_of_no_use_is_refused(tmp_path, make, unit, message):
    (tmp_path / "text.nii").write_text("not an image")
    scene = scene_of(make(tmp_path), unit=unit)
    if message is None:
        assert problem_of(scene)
        return
    with pytest.raises(ValueError, match=message):
        problem_of(scene)


def edited(path, change):
    """A sound image whose header, or whose bytes, are changed."""
    image(path, halves)
    if path.suffix == ".gz":
        path.write_bytes(change(path.read_bytes()))
        return path
    read = nibabel.load(path, mmap=False)  # it is written over
    nibabel.save(change(read) or read, path)
    return path


def without_place(read):
    read.header["sform_code"] = read.header["qform_code"] = 0
    return nibabel.Nifti1Image(read.dataobj, None, read.header)


def with_another_qform(read):
    moved = np.array(read.affine)
    moved[0, 3] += 3.0
    read.set_qform(moved, 1)


def in_metres(read):
    """Millimetres said to be metres."""
    read.header.set_xyzt_units("meter")


def stored(kind):
    return lambda read: nibabel.Nifti1Image(np.zeros(read.shape, kind), read.affine)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        # nibabel makes a place up where there is none, and takes the one of two.
        ("m.nii", without_place, "says not where its voxels are"),
        ("m.nii", with_another_qform, "its sform and its qform are up to 3 mm apart"),
        ("m.nii", stored(np.complex64), "holds complex numbers"),
        ("m.nii", stored([("R", "u1"), ("G", "u1"), ("B", "u1")]), "holds no numbers"),
        ("m.nii.gz", lambda data: data[: len(data) // 2], "is no NIfTI image"),
        ("m.nii.gz", lambda data: data[:100] + b"\xff" * 60 + data[160:], "is no NIfTI image"),
    ],
)
def test_an_image_that_is_damaged_or_nowhere_is_refused(tmp_path, name, change, message):
    path = edited(tmp_path / name, change)
    with pytest.raises(ValueError, match=rf"^tissue\.stiffness_map\.file: .*{message}"):
        read_image(path)


@pytest.mark.parametrize(
    ("offset", "patch"),
    [
        (40, b"\xff" * 4),
        (42, b"\xff\xff"),
        (42, b"\xff\x7f" * 3),
        (70, b"\x99\x99"),
        (123, b"\x07"),
    ],
)
def test_a_header_of_nonsense_is_refused(tmp_path, offset, patch):
    path = image(tmp_path / "m.nii", halves)
    data = bytearray(path.read_bytes())
    data[offset : offset + len(patch)] = patch
    path.write_bytes(data)
    with pytest.raises(ValueError, match="is no NIfTI image"):
        read_image(path)


@pytest.mark.parametrize(("unit", "factor"), [("meter", 1e-3), ("micron", 1e3), ("mm", 1.0)])
def test_the_unit_of_an_image_counts(tmp_path, unit, factor):
    def scaled(read):
        found = nibabel.Nifti1Image(read.dataobj, np.diag([factor] * 3 + [1.0]) @ read.affine)
        found.header.set_xyzt_units(unit)
        return found

    found, affine = read_image(edited(tmp_path / "m.nii", scaled))
    voxels, expected = read_image(image(tmp_path / "n.nii", halves))
    assert affine == pytest.approx(expected, rel=1e-6)
    assert (found == voxels).all()


# Inclusions as a scene states them -------------------------------------------------------------


def with_inclusions(*given):
    table = resolved(read_scene("block", BLOCK))
    table["tissue"]["inclusion"] = list(given)
    return validate(table, "made")


BALL = {
    "place": {"fraction": [0.5, 0.5, 0.5]},
    "radius": "10 mm",
    "youngs_modulus": "40 kPa",
}


def test_inclusions_are_read_placed_described_and_written():
    import tomllib

    oval = {
        "place": {"point": ["9 mm", "20 mm", "15 mm"]},
        "semi_axes": ["10 mm", "6 mm", "6 mm"],
        "youngs_modulus": "2 kPa",
        "poisson_ratio": 0.3,
    }
    scene = with_inclusions(BALL, oval)
    assert validate(tomllib.loads(write_scene(scene)), "again") == scene
    first, second = problem_of(scene).tissue.regions
    assert first.distance(np.array([0.03, 0.02, 0.015])) == pytest.approx(-0.01)
    assert second.distance(np.array([0.019, 0.02, 0.015])) == pytest.approx(0.0, abs=1e-12)
    notes = [line for line in problem_of(scene).notes if "tissue.inclusion" in line]
    assert [note.split(":")[0] for note in notes] == ["tissue.inclusion.1", "tissue.inclusion.2"]
    assert float(notes[0].split()[1]) == pytest.approx(4.19, rel=0.02)  # [ml]


def test_a_closed_mesh_is_an_inclusion(tmp_path):
    import meshio

    shell = boundary(block_mesh((0.02, 0.02, 0.02), 0.01))
    path = tmp_path / "cube.stl"
    points = 1e3 * (shell.points + np.array([0.02, 0.01, 0.005]))
    meshio.Mesh(points, [("triangle", shell.triangles)]).write(path)
    cube = {"mesh": str(path), "unit": "mm", "youngs_modulus": "40 kPa"}
    problem = problem_of(with_inclusions(cube))
    (region,) = problem.tissue.regions
    inside = np.array([[0.03, 0.02, 0.015], [0.03, 0.02, 0.026]])
    assert (region.distance(inside) < 0.0).tolist() == [True, False]
    before = organ_sha256(with_inclusions(cube))
    path.write_bytes(path.read_bytes() + b" ")
    assert organ_sha256(with_inclusions(cube)) != before


def small_cube(path, corner, axes="LPS"):
    """A cube of 20 mm as a file in millimetres whose axes point so, and as an inclusion."""
    import meshio

    shell = boundary(block_mesh((0.02, 0.02, 0.02), 0.01))
    points = 1e3 * (shell.points + np.array(corner)) @ to_scene(axes)  # its inverse transposed
    meshio.Mesh(points, [("triangle", shell.triangles)]).write(path)
    return {"mesh": str(path), "unit": "mm", "axes": axes, "youngs_modulus": "40 kPa"}


@pytest.mark.parametrize("axes", ["LPS", "y-up"])
def test_a_small_inclusion_far_from_the_origin_stays_where_it_is(tmp_path, axes):
    """Meshes are moved to the origin from ten times their size, which here is 0.35 m."""
    organ, path = tmp_path / "organ.msh", tmp_path / "cube.stl"
    corner = np.array([0.4, 0.3, -0.5])
    mesh = block_mesh((0.06, 0.04, 0.03), 0.01)
    save(replace(mesh, points=mesh.points + corner), organ)
    cube = small_cube(path, corner + np.array([0.02, 0.01, 0.005]), axes)
    table = resolved(with_inclusions(cube))
    table["organ"] = {"mesh": str(organ), "unit": "m"}
    (region,) = problem_of(validate(table, "made")).tissue.regions
    at = corner + np.array([[0.03, 0.02, 0.015], [0.03, 0.02, 0.026], [0.01, 0.02, 0.015]])
    assert region.distance(at) == pytest.approx([-0.01, 0.001, 0.01], abs=1e-6)
    with pytest.raises(ValueError, match=r"inclusion\.1: nothing of it lies in the organ"):
        problem_of(with_inclusions(cube))


def test_an_organ_that_was_moved_to_the_origin_takes_its_files_along(tmp_path):
    corner = np.array([3.0, 0.0, 0.0])
    mesh = block_mesh((0.06, 0.04, 0.03), 0.01)
    save(replace(mesh, points=mesh.points + corner), tmp_path / "organ.msh")
    cube = small_cube(tmp_path / "cube.stl", corner + np.array([0.02, 0.01, 0.005]))
    voxels = image(
        tmp_path / "map.nii", lambda p: 5.0 + 100.0 * (p[..., 0] - 3.0), origin=(-2998, 2, -2)
    )
    table = resolved(scene_of(voxels))
    table["organ"] = {"mesh": str(tmp_path / "organ.msh"), "unit": "m"}
    table["tissue"]["inclusion"] = [cube]
    tissue = problem_of(validate(table, "made")).tissue
    middle = np.zeros((1, 3))  # of the organ, and of the cube
    assert tissue.regions[0].distance(middle) == pytest.approx([-0.01], abs=1e-6)
    assert tissue.mapped(middle) == pytest.approx([8e3])


def test_what_is_wrong_with_the_mesh_of_an_inclusion_is_told_in_its_keys(tmp_path):
    import meshio

    cube = small_cube(tmp_path / "cube.stl", [0.02, 0.01, 0.005])
    with pytest.raises(
        ValueError, match=r"inclusion\.1\.mesh: .*correct `tissue\.inclusion\.1\.unit"
    ):
        problem_of(with_inclusions(cube | {"unit": "m"}))
    with pytest.raises(ValueError, match=r"inclusion\.1\.unit: give the length unit"):
        with_inclusions({key: value for key, value in cube.items() if key != "unit"})
    shell = boundary(block_mesh((0.02, 0.02, 0.02), 0.01))
    points = np.vstack([shell.points, np.array([0.03, 0.0, 0.0]) + shell.points])
    triangles = np.vstack([shell.triangles, shell.triangles + len(shell.points)])
    meshio.Mesh(1e3 * points, [("triangle", triangles)]).write(tmp_path / "cube.stl")
    with pytest.raises(ValueError, match="give each piece as an inclusion of its own"):
        problem_of(with_inclusions(cube))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": None}, r"tissue\.inclusion\.1: give one of radius, semi_axes and mesh"),
        ({"semi_axes": ["1 mm"] * 3}, r"not radius and semi_axes"),
        ({"place": None}, r"tissue\.inclusion\.1\.place: give fraction or point"),
        ({"place": {"side": "left", "at": [0.5, 0.5]}}, r"place: give fraction or point"),
        ({"unit": "mm"}, r"tissue\.inclusion\.1\.unit: has no effect"),
        ({"youngs_modulus": "0 Pa"}, r"tissue\.inclusion\.1\.youngs_modulus"),
        ({"place": {"point": [0.1, 0.0, 0.0]}}, r"tissue\.inclusion\.1: nothing of it lies in"),
        ({"place": {"point": [1.0, 1.0, 1.0]}}, r"tissue\.inclusion\.1\.place\.point: is .* off"),
    ],
)
def test_an_inclusion_that_is_none_is_refused(change, message):
    given = {key: value for key, value in (BALL | change).items() if value is not None}
    with pytest.raises(ValueError, match=message):
        problem_of(with_inclusions(given))


def test_an_inclusion_that_later_ones_cover_is_refused_as_such():
    small = BALL | {"radius": "8 mm"}
    assert problem_of(with_inclusions(BALL, small))
    with pytest.raises(ValueError, match=r"inclusion\.1: later inclusions, .*, cover all of it"):
        problem_of(with_inclusions(small, BALL))


def test_an_inclusion_that_a_point_tells_by_chance_is_refused():
    """Of 20 um about a point that tells shares, which counts for more than it has."""
    mesh = problem_of(read_scene("block", BLOCK)).geometry.mesh
    at = barycentric_samples()[100] @ mesh.points[mesh.tetrahedra[50]]
    tiny = BALL | {"place": {"point": at.tolist()}, "radius": 2e-5}
    with pytest.raises(ValueError, match=r"inclusion\.1: .* far smaller than an element"):
        problem_of(with_inclusions(tiny))
    assert problem_of(with_inclusions(tiny | {"radius": 1e-3}))


def test_check_tells_of_a_scene_with_inclusions(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(write_scene(with_inclusions(BALL)))
    assert any("tissue.inclusion.1: 4." in line for line in describe_scene(str(path), ()))
