"""The dozen figures that matter, each as a multiple of the calibration loop."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from fem_reference.assembly import elastic
from fem_reference.elasticity import Body, discretise
from fem_reference.grid import straight
from fem_reference.solvers import solve_static
from fem_reference.subspace import ritz_subspace
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.systems.compiled import compiled
from fuzzy.systems.options import InferenceOptions
from msm.assembly import Material, arrays, assemble
from msm.calibration import reference_stiffness
from msm.laws import Hooke
from msm.network import Network
from msm.stability import critical_time_step
from msm.timestep import LOOK
from msm.volume import volume_term
from study.models.damping import nodal_damping
from study.problem.problem import Problem
from study.problem.response import Motion
from study.scene import Scene
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.similarity.score import scores
from tests.benchmarks.bench_lattice import FRACTION, stepping
from tests.conftest import SMALL

from .calibration import times_calibration

UNIT = "calibration loops"
ELEMENT = "16 mm"
SYSTEMS = ("mamdani", "sugeno", "interval-type-2")
ROWS, VECTORS, SAMPLES, MOTIONS = 20_000, 4, 400, 3


@cache
def posed(element: str = ELEMENT) -> tuple[Scene, Problem]:
    """The built-in liver."""
    scene = read_scene("liver", (f"reference.element_size={element}",))
    return scene, problem_of(scene)


@cache
def body() -> Body:
    """Its quadratic tetrahedra."""
    scene, problem = posed()
    mesh = problem.geometry.mesh
    return discretise(mesh, scene.tissue, problem.foundation, problem.tool, element="p2")


@cache
def lattice(spacing_mm: float) -> tuple[object, Hooke, Network, float]:
    """Its lattice with volume term: cells, law, arrays, and the step [s]."""
    scene, problem = posed()
    h, tissue = 1e-3 * spacing_mm, scene.tissue
    geometry = problem.geometry
    made = assemble(
        geometry.body,
        problem.surface_rule,
        tissue.density,
        h,
        problem.foundation,
        problem.tool,
    )
    law = Hooke(reference_stiffness(tissue.youngs_modulus, h, tissue.poisson_ratio))
    term = volume_term(made.lattice, tissue.youngs_modulus, tissue.poisson_ratio)
    material = Material(law, term, nodal_damping(scene, tissue.youngs_modulus))
    net = arrays(made, material)
    return made.lattice, law, net, FRACTION * critical_time_step(made, material)


class Lattice:
    """A step of the lattice as a run takes it, by spacing [mm]."""

    params = ((10.0, 6.6667, 5.0),)
    param_names = ("spacing",)
    unit = UNIT

    def track_step(self, spacing):
        cells, law, net, dt = lattice(spacing)
        return times_calibration(stepping(law, net, dt, LOOK, cells)) / LOOK

    def track_step_without_volume_term(self, spacing):
        """What the term adds is the difference."""
        cells, law, net, dt = lattice(spacing)
        springs = net._replace(cells=net.cells[:0], bulk=net.bulk[:0])
        return times_calibration(stepping(law, springs, dt, LOOK, cells)) / LOOK


class Reference:
    """The finite elements on one mesh of the built-in liver."""

    unit = UNIT

    def track_assembly(self):
        scene, problem = posed()
        mesh = straight(problem.geometry.mesh)
        return times_calibration(lambda: elastic(mesh, "p2", scene.tissue))

    def track_solution(self):
        return times_calibration(lambda: solve_static(body()))

    def track_ritz_vectors(self):
        return times_calibration(lambda: ritz_subspace(body(), VECTORS))


class Fuzzy:
    """The liver's rules by each system, one reading and many."""

    params = (SYSTEMS,)
    param_names = ("system",)
    unit = UNIT
    readings = np.random.default_rng(5).uniform(4.0, 40.0, (ROWS, 5))

    def setup(self, kind):
        system = liver_system(LiverSettings(knowledge="severity"))
        self.model = compiled(system, kind, InferenceOptions())

    def track_one(self, _):
        first = self.readings[0].tolist()
        return times_calibration(lambda: self.model.one(first))

    def track_batch(self, _):
        return times_calibration(lambda: self.model.evaluate(self.readings))


def track_similarity_matrix():
    """Every measure of some motions against each other."""
    time = np.linspace(0.0, 1.0, SAMPLES)
    motions = [
        Motion(time, np.sin(w * time), w * np.cos(w * time)) for w in 5.0 + np.arange(MOTIONS)
    ]
    return times_calibration(lambda: [scores(a, b) for a in motions for b in motions])


def track_estimate_command():
    """`liver-study estimate`, interpreter and imports included."""
    command = [sys.executable, "-m", "study", "estimate", "--hcv", "9.5", "--json"]
    root = Path(__file__).resolve().parents[4]
    return times_calibration(
        lambda: subprocess.run(command, check=True, capture_output=True, cwd=root)
    )


def track_report():
    """`liver-study report` of a small block."""
    with tempfile.TemporaryDirectory() as folder:
        study = [sys.executable, "-m", "study"]
        root = Path(__file__).resolve().parents[4]
        small = [word for override in SMALL for word in ("--set", override)]
        subprocess.run(
            [*study, "run", "block", *small, "--no-report", "--out", f"{folder}/block"],
            check=True,
            capture_output=True,
            cwd=root,
        )
        report = [*study, "report", f"{folder}/block"]
        return times_calibration(
            lambda: subprocess.run(report, check=True, capture_output=True, cwd=root)
        )


for _track in (track_similarity_matrix, track_estimate_command, track_report):
    _track.unit = UNIT
