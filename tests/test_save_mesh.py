"""A run keeps the tetrahedra that it was on, and a scene may take them for its organ."""

from __future__ import annotations

import numpy as np
import pytest

from study.commands.run import RunFlags, run
from study.mesh.load import load_mesh
from study.run import study
from study.run.stages import RunOptions
from study.scene.file import read_scene
from study.scene.problem import geometry_of

SMALL = [
    'models=["msm"]',
    "reference.element_size=40 mm",
    "lattice.spacing=20 mm",
    "time.duration=0.1 s",
    "time.samples=16",
    "lattice.step_fraction=0.2",
    "fuzzy.sensitivity_readings=0",
    'fuzzy.systems=["sugeno"]',
]


@pytest.fixture(autouse=True)
def _own_store(tmp_path, monkeypatch):
    monkeypatch.setenv("LIVER_STUDY_STORE", str(tmp_path / "store"))


def test_the_mesh_of_a_run_is_kept_to_the_bit_and_read_again(tmp_path):
    run("block", set_=SMALL, out=tmp_path / "a", flags=RunFlags(report=False, save_mesh=True))
    scene = read_scene("block", SMALL)
    wanted = geometry_of(scene.organ, scene.reference.element_size).mesh
    found, _ = load_mesh(tmp_path / "a" / "mesh.msh", "m")
    np.testing.assert_array_equal(found.points, wanted.points)
    np.testing.assert_array_equal(found.tetrahedra, wanted.tetrahedra)
    assert "mesh.msh" in (tmp_path / "a" / "SHA256SUMS").read_text()
    # All else is kept; a run without the mesh takes its place.
    run("block", set_=SMALL, out=tmp_path / "a", flags=RunFlags(report=False))
    assert not (tmp_path / "a" / "mesh.msh").exists()


def test_a_mesh_that_a_mesher_makes_otherwise_each_time_is_not_passed_off(tmp_path, monkeypatch):
    scene = read_scene("block", SMALL)
    builder = "study.run.problem_record.ProblemBuilder.mesh"
    made = iter(["first", "first", "other", "other"])
    monkeypatch.setattr(builder, property(lambda _: next(made, "other")))
    with pytest.raises(ValueError, match="--save-mesh: the mesher made another mesh"):
        study.run_study(scene, options=RunOptions(mesh=tmp_path / "mesh.msh"))
    assert not (tmp_path / "mesh.msh").exists()


def test_a_point_has_no_mesh_to_keep(tmp_path):
    with pytest.raises(ValueError, match="--save-mesh: a single point has none"):
        run("paper", out=tmp_path / "a", flags=RunFlags(save_mesh=True))
