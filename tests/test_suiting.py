"""A built-in scene takes on the size of a patient's organ, and says so once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference.observation import largest_rotation, largest_strain
from fem_reference.solvers import solve_static
from study.handover.export import ExportRequest, export
from study.models.finite_elements import reference_of
from study.models.linear_limits import ROTATION_LIMIT, STRAIN_LIMIT
from study.organ.geometry import built_in_liver
from study.run.check import describe_scene
from study.run.suiting import MARGIN, POWERS, read_suited
from study.scene.file import SceneError, read_scene, resolved, validate, write_scene
from study.scene.problem import problem_of
from study.system.progress import Silent
from tests.mesh_samples import write_tetrahedra

COARSE = ("reference.element_size=30 mm", 'models=["fem"]')

BLUNT = {key: power for key, power in POWERS.items() if key != "tool.displacement"}


def value(scene, key):
    table, name = key.split(".")
    return getattr(getattr(scene, table), name)


@pytest.fixture(scope="module")
def liver_of(tmp_path_factory):
    """File [mm] of the built-in shape, of a volume [L] and a stretch."""
    folder = tmp_path_factory.mktemp("livers")

    def write(litres, stretch=(1.0, 1.0, 1.0)):
        mesh = built_in_liver(1e-3 * litres, 0.024 * np.cbrt(litres / 1.5)).mesh
        path = folder / f"liver-{litres:g}-{'-'.join(map(str, stretch))}.vtu"
        return write_tetrahedra(path, 1e3 * mesh.points * stretch, mesh.tetrahedra)

    return write


def patient(path, *overrides):
    return read_suited("liver", (f"organ.mesh={path}", "organ.unit=mm", *overrides))


@pytest.mark.parametrize("litres", [0.6, 3.4])
def test_a_liver_of_another_size_has_the_strains_of_the_first(liver_of, litres):
    plain = read_scene("liver")
    scene = patient(liver_of(litres))
    size = np.cbrt(litres / 1.5)
    for key, power in BLUNT.items():
        found = value(scene, key) / value(plain, key)
        if key == "tool.force":
            assert 0.6 * size**power < found <= 1.03 * size**power
        else:  # two digits, and meshes that hold a little less than the shape
            assert found == pytest.approx(size**power, rel=0.06)
    problem = problem_of(scene)
    body = reference_of(scene).prepare(problem).body()
    assert largest_strain(body, solve_static(body)) <= MARGIN * STRAIN_LIMIT
    assert np.linalg.norm(problem.tool.direction) == pytest.approx(1.0)


def test_the_force_on_another_shape_uses_the_margin_and_no_more(liver_of):
    scene = patient(liver_of(1.5, (1.6, 0.7, 0.5)), *COARSE)
    body = reference_of(scene).prepare(problem_of(scene)).body()
    u = solve_static(body)
    used = max(largest_strain(body, u) / STRAIN_LIMIT, largest_rotation(body, u) / ROTATION_LIMIT)
    assert 0.9 * MARGIN < used <= MARGIN  # two digits, rounded down


def test_what_is_stated_stays(liver_of):
    stated = ("tool.force=1 N", "tool.radius=22 mm", "lattice.spacing=9 mm", *COARSE)
    scene = patient(liver_of(0.6), *stated)
    assert (scene.tool.force, scene.tool.radius) == (1.0, 0.022)
    assert (scene.lattice.spacing, scene.reference.element_size) == (0.009, 0.03)
    assert scene.support.depth < 0.035
    (remark,) = scene.remarks
    assert "support.depth" in remark
    assert "tool" not in remark
    everything = [f"{key}={value(read_scene('liver'), key)!r}" for key in BLUNT]
    assert patient(liver_of(0.6), *everything).remarks == ()


def test_a_suited_scene_is_whole_and_is_not_suited_again(liver_of):
    scene = patient(liver_of(0.6), *COARSE)
    table = resolved(scene)
    assert "suit" not in table["organ"]
    assert validate(table, "scene") == scene
    assert write_scene(scene).count("Suited to an organ of 0.5") == 1


def test_a_scene_of_ones_own_is_suited_where_it_asks_for_it(liver_of, tmp_path):
    path = tmp_path / "own.toml"
    text = f'[organ]\nmesh = "{liver_of(0.6)}"\nunit = "mm"\n'
    path.write_text(text)
    assert read_suited(str(path), ()).tool.radius == 0.025
    path.write_text(text + 'suit = ["tool.radius"]\n')
    found = read_suited(str(path), ())
    assert found.tool.radius < 0.02
    assert found.tool.force == 0.5
    path.write_text(text + 'suit = ["tool.history"]\n')
    with pytest.raises(SceneError, match=r"organ\.suit"):
        read_suited(str(path), ())
    with pytest.raises(SceneError, match=r"organ\.suit: has no effect without organ\.mesh"):
        read_scene("liver", ('organ.suit=["tool.radius"]',))


def test_a_tool_that_is_moved_has_a_displacement_suited_and_no_force(liver_of, tmp_path):
    given = (f"organ.mesh={liver_of(0.6)}", "organ.unit=mm", *COARSE)
    scene, plain = read_suited("press", given), read_scene("press")
    size = np.cbrt(0.6 / 1.5)
    assert scene.tool.displacement == pytest.approx(size * plain.tool.displacement, rel=0.06)
    assert scene.tool.radius == pytest.approx(size * plain.tool.radius, rel=0.06)
    assert scene.tool.force == plain.tool.force
    assert "tool.force" not in scene.remarks[0]
    text = write_scene(replace(plain, organ=replace(scene.organ, suit=("tool.force",))))
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(SceneError, match=r"organ\.suit: tool\.force has no effect in this scene"):
        read_scene(str(path))


def test_every_command_says_it_once(liver_of, tmp_path):
    given = (f"organ.mesh={liver_of(0.6)}", "organ.unit=mm", *COARSE)
    lines = describe_scene("liver", given)
    request = ExportRequest(target="liver", to="vtu", out=tmp_path / "out", overrides=given)
    told = (export(request, Silent()) / "README.txt").read_text().splitlines()
    for said in (lines, told):
        for text in ("Suited to an organ of", "axes not stated"):
            assert sum(text in line for line in said) == 1
