"""Exported lattices step in plain NumPy as the run did; SOFA scenes have documented fields."""

from __future__ import annotations

import csv
import io
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from msm.assembly import arrays
from study.handover import step_lattice
from study.handover.export import ExportRequest, export
from study.handover.lattice import check_forces, lattices
from study.handover.lattice_files import ARRAYS
from study.handover.sofa import PLUGINS
from study.results.folder import write
from study.run.preparation import prepare_scene
from study.run.study import run_study
from study.scene.file import read_scene, write_scene
from study.system.progress import Silent

SMALL = (
    *('organ.size=["60 mm", "40 mm", "30 mm"]', "tool.radius=15 mm", "tool.force=0.2 N"),
    *('models=["basafa", "msm"]', 'fuzzy.systems=["mamdani"]', "fuzzy.sensitivity_readings=0"),
    *("lattice.spacing=10 mm", "time.samples=17", "time.duration=0.4 s", "renders=false"),
)
KINDS = {
    "springs": (),
    "volume term": ("lattice.volume_term=true", "tissue.poisson_ratio=0.45"),
    "body diagonals": ("lattice.body_diagonals=0.3", "lattice.flexion=0.4"),
    "law of Basafa": ('lattice.law={ kind = "basafa", cubic = 200.0, x_c = 0.2 }',),
    "on tetrahedra": ('lattice.springs="tetrahedra"', "reference.element_size=15 mm"),
}
# Data fields of SOFA's components as its generated pages and sources list them.
FIELDS = {
    "EulerExplicitSolver": {"symplectic"},
    "EulerImplicitSolver": {"rayleighMass", "rayleighStiffness"},
    "CGLinearSolver": {"iterations", "tolerance", "threshold"},
    "MechanicalObject": {"template", "position"},
    "PointSetTopologyContainer": {"position"},
    "TetrahedronSetTopologyContainer": {"position", "tetrahedra"},
    "DiagonalMass": {"vertexMass", "massDensity"},
    "SpringForceField": {"template", "spring"},
    "RestShapeSpringsForceField": {"points", "stiffness"},
    "DiagonalVelocityDampingForceField": {"dampingCoefficient"},
    "ConstantForceField": {"indices", "forces"},
    "TetrahedronFEMForceField": {"youngModulus", "poissonRatio", "method"},
}


def scene(*more):
    return read_scene("block", (*SMALL, *more))


def exported(folder, *more):
    path = folder / "scene.toml"
    path.write_text(write_scene(scene(*more)))
    return export(ExportRequest(target=str(path), to="lattice", out=folder / "out"), Silent())


@pytest.fixture(scope="module", params=KINDS, ids=lambda kind: kind.replace(" ", "-"))
def found(request, tmp_path_factory):
    return exported(tmp_path_factory.mktemp("lattice"), *KINDS[request.param])


def gap(curve, other):
    return np.abs(curve - other).max() / np.abs(other).max()


def names(folder):
    return list(json.loads((folder / "lattice.json").read_text())["models"])


def test_the_stepper_goes_as_the_run_did(found):
    for name in names(found):
        curve = np.load(found / f"lattice-{name}.npz")["curve"]
        assert np.abs(curve).max() > 1e-4
        assert gap(step_lattice.run(found, name), curve) < 1e-9


@pytest.fixture(scope="module")
def solid(tmp_path_factory):
    """A lattice with everything that the stepper knows."""
    return exported(tmp_path_factory.mktemp("solid"), *KINDS["volume term"])


@pytest.mark.parametrize("planted", ["mass", "scale", "load", "foundation", "gamma_0", "bulk"])
def test_a_constant_that_is_off_is_seen(planted, tmp_path, solid):
    """Negative control."""
    folder = shutil.copytree(solid, tmp_path / "off")
    for file in (folder / "lattice.npz", folder / "lattice-msm-mamdani.npz"):
        arrays = dict(np.load(file))
        if planted in arrays:
            np.savez(file, **arrays | {planted: arrays[planted] * (1.0 + 1e-5)})
    curve = np.load(folder / "lattice-msm-mamdani.npz")["curve"]
    assert gap(step_lattice.run(folder, "msm-mamdani"), curve) > 1e-9


def test_the_stepper_is_short_and_runs_alone_on_numpy(solid):
    folder = solid
    text = (folder / "step_lattice.py").read_text()
    assert len(text.splitlines()) <= 60
    done = subprocess.run(
        [sys.executable, "-I", "step_lattice.py", "msm-mamdani"],
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
    )
    assert float(done.stdout.split(": ")[1].split()[0]) < 1e-9


def test_every_array_is_described_and_no_other(found):
    for name in names(found):
        own = set(np.load(found / f"lattice-{name}.npz").files)
        assert own == set(ARRAYS["lattice-MODEL.npz"])
    assert set(np.load(found / "lattice.npz").files) == set(ARRAYS["lattice.npz"])


def test_results_are_exported_with_their_own_curves_and_those_of_another_run_refused(tmp_path):
    results = run_study(scene())
    for name in ("own", "other"):
        (tmp_path / name).mkdir()
    write(results, tmp_path / "own")
    folder = export(ExportRequest(target=str(tmp_path / "own"), to="lattice"), Silent())
    rows = csv.DictReader(io.StringIO((tmp_path / "own" / "curves.csv").read_text()))
    tool = [
        float(r["displacement_m"]) for r in rows if (r["model"], r["probe"]) == ("basafa", "tool")
    ]
    at = json.loads((folder / "lattice.json").read_text())["probes"].index("tool")
    assert gap(step_lattice.run(folder, "basafa")[:, at], np.array(tool)) < 1e-9
    curves = tuple(
        row._replace(displacement_m=1.0001 * row.displacement_m) for row in results.curves
    )
    write(replace(results, curves=curves), tmp_path / "other")
    with pytest.raises(ValueError, match="moves otherwise than its results say"):
        export(ExportRequest(target=str(tmp_path / "other"), to="lattice"), Silent())


def test_a_force_that_the_stepper_does_not_support_is_refused():
    given = prepare_scene(scene('models=["basafa"]'))
    one = given.models["basafa"]
    found = lattices(scene('models=["basafa"]'), Silent())
    net, law = arrays(one.assembly, one.springs.material), one.springs.material.law
    check_forces(net, law, found.shared, found.models[0])
    other = net._replace(value=1.0001 * net.value)
    with pytest.raises(ValueError, match="forces that the exported stepper does not know"):
        check_forces(other, law, found.shared, found.models[0])


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ('lattice.integrator="velocity-verlet"', r"lattice\.integrator"),
        ('lattice.geometry="linear"', r"lattice\.geometry"),
        ('lattice.precision="single"', r"lattice\.precision"),
        ('models=["fem"]', "models: none of them is a lattice"),
    ],
)
def test_what_the_stepper_cannot_follow_is_refused_by_its_key(key, said):
    with pytest.raises(ValueError, match=said):
        lattices(scene(key), Silent())


# --- SOFA ----------------------------------------------------------------------------------------


def root_of(path):
    return Xml.fromstring(path.read_text())  # noqa: S314 - written by the line before


def components(path):
    return {part.tag: part.attrib for part in root_of(path).iter()}


def test_scenes_have_documented_components_fields_and_their_plugins(found):
    for name in names(found):
        for kind in ("lattice", "tetrahedra"):
            root = root_of(found / f"{kind}-{name}.scn")
            plugins = {one.get("name") for one in root.iter("RequiredPlugin")}
            inner = list(root.find("Node"))
            assert {f"Sofa.Component.{PLUGINS[one.tag]}" for one in inner} == plugins
            for one in inner:
                assert set(one.attrib) - {"name"} <= FIELDS[one.tag]


def test_springs_of_the_scene_are_those_of_the_lattice(solid):
    folder = solid
    scn = components(folder / "lattice-msm-mamdani.scn")
    arrays = np.load(folder / "lattice.npz")
    springs = np.array(scn["SpringForceField"]["spring"].split(), dtype=float).reshape(-1, 5)
    ends = springs[:, :2].astype(int)
    assert (ends == arrays["ends"]).all()
    nodes = np.array(scn["MechanicalObject"]["position"].split(), dtype=float).reshape(-1, 3)
    lengths = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
    assert springs[:, 4] == pytest.approx(lengths, rel=1e-7)
    law = json.loads((folder / "lattice.json").read_text())["models"]["msm-mamdani"]["law"]
    stretch = 1e-3 * lengths
    ours = arrays["scale"] * step_lattice.tension(law, stretch / lengths)
    assert springs[:, 2] * stretch == pytest.approx(ours, rel=1e-7)


def test_load_and_support_of_both_scenes_add_up_to_those_of_the_run(solid):
    folder = solid
    arrays = np.load(folder / "lattice.npz")
    for kind in ("lattice", "tetrahedra"):
        scn = components(folder / f"{kind}-msm-mamdani.scn")
        forces = np.array(scn["ConstantForceField"]["forces"].split(), dtype=float).reshape(-1, 3)
        held = np.array(scn["RestShapeSpringsForceField"]["stiffness"].split(), dtype=float)
        assert forces.sum(axis=0) == pytest.approx(arrays["load"].sum(axis=0), abs=1e-8)
        assert held.sum() == pytest.approx(arrays["foundation"].sum(), rel=1e-6)
