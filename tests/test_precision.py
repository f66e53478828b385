"""Explicit steps in single precision: how far from those in double, and who is told."""

from dataclasses import replace

import numpy as np
import pytest

from msm.stepper import LatticeStepper
from study.models import table
from study.models.model import SILENT
from study.results.numerical import numerical_errors
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.tradeoff.prediction import Fit
from tests.conftest import SMALL
from tests.test_grid import apart, bodies, material

__all__ = ["bodies"]  # a fixture
EPS = float(np.finfo(np.float32).eps)
SINGLE = "lattice.precision=single"


def moved(assembly, made, load, *, single, integrator="symplectic-euler", linear=False, steps=100):
    stepper = LatticeStepper(
        replace(assembly, load=load * assembly.load) if load != 1.0 else assembly,
        made,
        np.ones_like,
        integrator,
        linear=linear,
        single=single,
    )
    stepper.advance(steps, 0.5 * stepper.limit_at_rest)
    return stepper.u, stepper.v


def check_close(assembly, made, load=1.0, **settings):
    """Velocities, what near balance forces leave over, keep fewer digits than displacements."""
    (u, v), (true_u, true_v) = (
        moved(assembly, made, load, single=one, **settings) for one in (True, False)
    )
    assert 0.0 < apart([u], [true_u]) < 30.0 * EPS
    assert apart([v], [true_v]) < 1e-4


@pytest.mark.parametrize("load", [1.0, 1e-6])
def test_a_small_load_loses_no_more_digits_than_a_large_one(bodies, load):
    """Strains of 1e-8, which differences of lengths of 4-byte numbers do not show at all."""
    assembly = bodies("liver")
    check_close(assembly, material(assembly), load)


@pytest.mark.parametrize(
    ("kind", "integrator", "linear"),
    [
        ("hooke", "symplectic-euler", True),
        ("basafa", "symplectic-euler", False),
        pytest.param("piecewise", "symplectic-euler", False, marks=pytest.mark.slow),
        pytest.param("hooke", "velocity-verlet", False, marks=pytest.mark.slow),
        pytest.param("hooke", "runge-kutta-4", False, marks=pytest.mark.slow),
    ],
)
def test_every_law_and_integrator_has_it(bodies, kind, integrator, linear):
    assembly = bodies("liver")
    made = material(assembly, kind)
    check_close(assembly, made, integrator=integrator, linear=linear)


def run_of(*overrides):
    scene = read_scene("block", (*SMALL, 'models=["tissue"]', *overrides))
    problem = problem_of(scene)
    return problem, table.model(scene, "tissue").prepare(problem).run(SILENT)


def test_a_run_states_what_single_precision_cost_it():
    """By the same steps in double: planted there, an error is seen at its size."""
    problem, single = run_of(SINGLE)
    _, double = run_of()
    lattice = single.record.lattice
    assert lattice.precision == "single"
    assert single.record.steps == double.record.steps
    for i, probe in enumerate(problem.probes):
        a, b = (run.trajectory.displacement[:, i] for run in (single, double))
        error = np.linalg.norm(a - b) / np.linalg.norm(b)
        assert lattice.rounding_errors[probe].displacement == pytest.approx(error, rel=1e-9)
        assert 0.0 < error < 1e-5
    said = [check for check in single.checks if "single precision" in check.name]
    assert [check.passed for check in said] == [True, True]
    assert double.record.lattice.rounding_errors == {}
    assert not [check for check in double.checks if "single precision" in check.name]
    probe = problem.probes[0]
    parts = numerical_errors(double.record, [single.record], probe, "displacement")
    assert lattice.rounding_errors[probe].displacement in parts


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (("lattice.springs=tetrahedra",), "set lattice.springs to lattice"),
        (("lattice.integrator=implicit-euler",), "set lattice.integrator to symplectic-euler, "),
        (("lattice.integrator=xpbd",), "xpbd steps in double precision only"),
    ],
)
def test_single_precision_is_refused_where_it_is_not_served(overrides, told):
    with pytest.raises(ValueError, match=r"lattice\.precision: .*" + told):
        read_scene("block", (*SMALL, 'models=["tissue"]', SINGLE, *overrides))


def test_a_lattice_that_is_no_grid_is_refused(bodies):
    assembly = bodies("block")
    with pytest.raises(ValueError, match=r"set lattice\.precision to double"):
        LatticeStepper(assembly, material(assembly), np.ones_like, "implicit-euler", single=True)


def test_other_settings_of_a_model_are_in_double_precision_unless_they_say_so():
    scene = read_scene("block", (*SMALL, 'models=["tissue"]', SINGLE))
    model = table.model(scene, "tissue")
    assert model.varied(integrator="implicit-euler").lattice.precision == "double"
    assert model.varied(precision="single").lattice.precision == "single"


def test_a_prediction_in_single_precision_includes_its_rounding():
    fit = Fit(1.0, 1.0, 0.1, 0.01)
    assert fit.prediction(0.2).with_rounding(0.05).bar == pytest.approx(
        fit.prediction(0.2).bar + 0.05
    )
