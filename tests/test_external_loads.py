"""Gravity, weights and several loads on a lattice, by closed forms and by balances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from msm import dead_load, unloading
from msm.assembly import Assembly, arrays, with_external_loads
from msm.displacement_control import _MixedLattice
from msm.integrators import INTEGRATORS
from msm.stepper import LatticeStepper
from study.models.lattice import requested_step
from study.models.table import model
from study.problem.contact import Load
from study.problem.unfinished import UnfinishedError
from study.scene.file import read_scene
from study.scene.problem import problem_of

G = 9.81
COLUMN = (
    'organ.size=["40 mm", "40 mm", "80 mm"]',
    'models=["tissue"]',
    "support.side=superior",
    "support.stiffness=1 GPa/m",
    "tissue.poisson_ratio=0.25",
    "gravity.acceleration=9.81 m/s^2",
    "gravity.towards=inferior",
    'control_points={tip={side="inferior", at=[0.5, 0.5]}}',
    'tool.place={side="inferior", at=[0.5, 0.5]}',
    "tool.force=1e-9 N",
    "time.samples=51",
)


def prepared(*overrides):
    scene = read_scene("block", (*COLUMN, *overrides))
    return model(scene, "tissue").prepare(problem_of(scene))


def moved(*overrides):
    made = prepared(*overrides)
    return made, made._integrate(requested_step(made.model.lattice))


@pytest.mark.parametrize("geometry", ["linear", "nonlinear"])
def test_a_hanging_column_stretches_as_its_closed_form_says(geometry):
    """rho g L^2 / (2 E) at the free end, less up to 8 %: at the clamp it cannot narrow."""
    made, found = moved(f"lattice.geometry={geometry}", "gravity.acceleration=1 m/s^2")
    tissue, length = made.problem.tissue, 0.08
    expected = tissue.density * 1.0 * length**2 / (2.0 * tissue.youngs_modulus)
    sag = -found.trajectory.displacement[0, 0, 2]
    assert sag == pytest.approx(expected, rel=0.08)
    assert sag < expected  # the clamp holds it


def test_it_starts_and_stays_at_rest_under_gravity():
    _, found = moved()
    u = found.trajectory.displacement[:, 0]
    assert np.abs(u - u[0]).max() < 1e-6 * np.abs(u).max()
    assert np.abs(found.trajectory.velocity).max() < 1e-6


def test_the_support_bears_the_weight_of_all():
    made = prepared('weight=[{place={side="inferior", at=[0.5, 0.5]}, mass="50 g"}]')
    stepper = stepper_of(made)
    borne = (made.assembly.foundation @ stepper.u).sum(axis=0)
    problem = made.problem
    mass = problem.geometry.volume * problem.tissue.density + 0.05
    assert borne == pytest.approx([0.0, 0.0, -mass * G], rel=1e-6, abs=1e-6 * mass * G)


def stepper_of(made, **options):
    material = made.springs.material
    return LatticeStepper(made.assembly, material, made.problem.factor, **options)


@pytest.mark.parametrize("volume_term", ["false", "true"])
def test_the_unloaded_shape_loaded_again_is_the_given_one(volume_term):
    extra = ("tissue.poisson_ratio=0.45",) if volume_term == "true" else ()
    given = (f"lattice.volume_term={volume_term}", "gravity.given=loaded", *extra)
    _, found = moved(*given)
    size = 0.08
    assert np.abs(found.trajectory.displacement).max() < 1e-6 * size
    _, sagging = moved(*given[:1], *extra)
    assert np.abs(sagging.trajectory.displacement).max() > 0.01 * size


SOFT = (
    'organ.size=["40 mm", "40 mm", "40 mm"]',
    "support={side='inferior', kind='clamped', depth='1 mm'}",
    "tissue.youngs_modulus=800 Pa",
    "lattice.spacing=20 mm",
    "gravity.given=loaded",
)
"""A block that stands; the mixing of shapes finds none for its whole weight at once."""


def test_the_unloaded_shape_of_a_soft_block_is_found_in_increments():
    stepper = stepper_of(prepared(*SOFT))
    stepper.advance(200, 0.2 * stepper.limit_at_rest)
    assert np.abs(stepper.u).max() < 1e-6 * 0.04


def test_a_load_without_an_unloaded_shape_is_refused_with_what_was_reached():
    with pytest.raises(UnfinishedError, match=r"gravity\.given.* but for \d+ % of the load"):
        stepper_of(prepared(*SOFT, "tissue.youngs_modulus=400 Pa"))


SIDEWAYS = (
    'organ.size=["60 mm", "60 mm", "40 mm"]',
    "support={side='left', depth='1 mm', stiffness='20 MPa/m'}",
    "tissue={youngs_modulus='1 kPa', poisson_ratio=0.45, density='1054 kg/m^3'}",
    "lattice.spacing=20 mm",
    "lattice.volume_term=true",
    "gravity.given=loaded",
)
"""A soft block that sticks out of a wall; its unloaded shape is bent upwards."""


def given_network(*overrides):
    """Law, network and dead load of a scene, and its foundation."""
    made = prepared(*overrides)
    material = made.springs.material
    net = arrays(made.assembly, material)
    dead = made.assembly.external_loads.dead
    return material.law, net, dead, dead_load._foundation(net)


@pytest.mark.parametrize("volume_term", ["false", "true"])
def test_newtons_method_for_the_unloaded_shape_has_the_exact_derivative(volume_term):
    law, net, dead, foundation = given_network(*SIDEWAYS, f"lattice.volume_term={volume_term}")
    problem = unloading._InverseProblem(law, net, dead, foundation, unloading._independent(net))
    random = np.random.default_rng(3)
    x, d = (random.normal(0.0, 1e-3, problem.spread.shape[1]) for _ in range(2))

    def residual(step):
        return problem.residual((problem.spread @ (x + step * d)).reshape(-1, 3), 1.0)

    slope = (residual(1e-4) - residual(-1e-4)) / 2e-4
    tangent = problem.tangent((problem.spread @ x).reshape(-1, 3))
    assert tangent @ d == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(slope).max())


def test_newtons_method_finds_the_unloaded_shape_that_mixing_finds():
    law, net, dead, foundation = given_network(*SIDEWAYS)
    mixed = dead_load._by_mixing(law, net, 0.1 * dead)
    found = unloading.unload(law, net, 0.1 * dead, foundation)
    assert (mixed.failure, found.failure) == ("", "")
    assert np.abs(found.shape).max() > 5e-3
    assert found.shape == pytest.approx(mixed.shape, abs=1e-5 * np.abs(found.shape).max())


def test_the_unloaded_shape_ends_where_the_given_one_loses_its_stability():
    """By the lowest eigenvalue of the given shape's stiffness, which changes sign there."""
    law, net, dead, foundation = given_network(*SIDEWAYS)
    found = unloading.unload(law, net, dead, foundation)
    assert found.failure.startswith("the given shape would be an unstable equilibrium")
    problem = unloading._InverseProblem(law, net, dead, foundation, unloading._independent(net))
    beyond = unloading._newton(problem, found, found.factor + 1.0 / 32.0)
    assert beyond.residuals[-1] < 1e-9  # in balance, but
    assert lowest_stiffness(law, net, found.shape) > 0.0 > lowest_stiffness(law, net, beyond.shape)
    mixed = dead_load._by_mixing(law, net, dead)
    assert mixed.factor < found.factor < 1.0


def lowest_stiffness(law, net, shape):
    """Lowest eigenvalue [N/m] of the stiffness in the given shape, from an unloaded one."""
    unloaded = unloading.from_shape(net, shape)
    lattice = _MixedLattice(law, unloaded, np.full_like(shape, np.nan))
    at = lattice.linearised(np.zeros_like(shape))
    return np.linalg.eigvalsh(lattice.matrix(at, unloaded.bulk * at.swelling).toarray())[0]


def test_a_refusal_of_a_loaded_shape_tells_why():
    with pytest.raises(UnfinishedError, match=r"\d+ % of the load \(the given shape would be"):
        stepper_of(prepared(*SIDEWAYS))


def test_a_missing_part_of_the_foundation_is_seen(monkeypatch):
    """Negative control: without what the support bears the body is not at rest as given."""
    genuine = dead_load.unloaded_network
    monkeypatch.setattr(
        "msm.stepper.unloaded_network", lambda law, net, dead: (genuine(law, net, dead)[0], dead)
    )
    _, found = moved("gravity.given=loaded", "support.stiffness=2 MPa/m")
    assert np.abs(found.trajectory.displacement).max() > 1e-5


def test_linear_forces_of_the_given_loaded_shape_are_those_without_gravity():
    load = ("lattice.geometry=linear", "tool.force=0.05 N")
    _, loaded = moved("gravity.given=loaded", *load)
    _, weightless = moved("gravity.acceleration=0 m/s^2", *load)
    assert loaded.trajectory.displacement == pytest.approx(
        weightless.trajectory.displacement, abs=1e-12
    )


def test_a_weight_hangs_on_its_patch_and_swings_with_it():
    """Its inertia lowers the frequency; its pull stretches the column by m g L / (E A)."""
    made, found = moved(
        "gravity.acceleration=1 m/s^2",
        'weight=[{place={side="inferior", at=[0.5, 0.5]}, mass="20 g", radius="20 mm"}]',
    )
    _, bare = moved("gravity.acceleration=1 m/s^2")
    more = bare.trajectory.displacement[0, 0, 2] - found.trajectory.displacement[0, 0, 2]
    along = 0.02 * 1.0 * 0.08 / (made.problem.tissue.youngs_modulus * 0.04**2)
    assert along < more < 1.6 * along  # more at the patch itself
    assert made.assembly.mass.sum() == pytest.approx(0.04 * 0.04 * 0.08 * 1054.0 + 0.02, rel=0.01)


def test_the_tissue_does_not_damp_a_weight():
    made = prepared('weight=[{place={side="inferior", at=[0.5, 0.5]}, mass="1 kg"}]')
    stepper = stepper_of(made)
    bare = prepared()
    assert stepper.net.gamma_0 == pytest.approx(stepper_of(bare).net.gamma_0)


@pytest.mark.parametrize("integrator", sorted(INTEGRATORS))
def test_every_integrator_takes_a_second_load_as_if_it_were_the_first(integrator):
    """Half of the tool's force by the first load, half by a further one with its history."""
    own = ("lattice.volume_term=true",) if integrator == "split-volume" else ()
    scene = read_scene(
        "block",
        (
            'organ.size=["40 mm", "40 mm", "40 mm"]',
            'models=["tissue"]',
            "lattice.spacing=20 mm",
            "tissue.poisson_ratio=0.3",
            f"lattice.integrator={integrator}",
            "time.samples=21",
            "time.duration=0.2 s",
            "tool.history.ramp=0.1 s",
            "tool.history.hold=0.05 s",
            "tool.history.release=0.05 s",
            *own,
        ),
    )
    problem = problem_of(scene)
    half = replace(problem.tool, force=0.5 * problem.tool.force)
    shared = replace(problem, tool=half, loads=(Load(half, problem.factor),))
    whole, parts = (model(scene, "tissue").prepare(one) for one in (problem, shared))
    step = requested_step(scene.lattice)
    one, other = (each._integrate(step).trajectory.displacement for each in (whole, parts))
    assert np.abs(one).max() > 1e-6
    assert other == pytest.approx(one, rel=1e-9, abs=1e-9 * np.abs(one).max())


def test_a_body_that_nothing_holds_against_its_weight_is_refused():
    with pytest.raises(ValueError, match=r"gravity.*come to rest|come to rest"):
        dead_load.rest_under_dead_load(*falling())


def falling():
    made = prepared()
    stepper = stepper_of(made)
    net = stepper.net._replace(value=np.zeros_like(stepper.net.value))
    return stepper.law, net, made.assembly.external_loads.dead


def test_a_load_beside_the_body_is_refused(small_posed):
    made = prepared()
    beside = replace(small_posed.tool, centre=np.array([1.0, 1.0, 1.0]))
    load = Load(beside, np.ones_like)
    bare: Assembly = replace(made.assembly, external_loads=None)
    with pytest.raises(ValueError, match="touches no surface"):
        with_external_loads(bare, made.problem.surface_rule, np.zeros(3), [load])
