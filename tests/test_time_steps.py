"""Steps of the reference follow from its motion, not from how often that is sampled."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import fem_reference as fem
from fem_reference import dynamics
from fem_reference import superposition as module
from fem_reference.subspace import superposition
from fem_reference.time_steps import LEAST_STEPS, TimeSteps, steps_for_load
from study.models.finite_elements import reference_of
from study.models.model import SILENT
from study.problem.damping import RayleighDamping

DAMPING = RayleighDamping(mass=40.0, stiffness=4e-3)
DENSE = 1601


def wave(times):
    return np.sin(2.0 * np.pi * np.asarray(times))


@pytest.fixture(scope="module")
def coarse(small_posed):
    where = (small_posed.foundation, small_posed.tool)
    return fem.build(small_posed.geometry.level(-1).mesh, fem.Tissue(), *where)


def sampled(problem, samples):
    times = np.linspace(0.0, 1.0, samples)
    return dataclasses.replace(problem.observation, times=times, frames=(samples // 3, samples - 1))


@pytest.fixture
def counted(monkeypatch):
    """Solutions by factors in TR-BDF2 and HHT, and steps of a subspace, as they are taken."""
    counts = {"solved": 0, "advanced": 0}
    shifted, moved = dynamics.Oscillator.shifted, module.superposition

    def counting(self, *shares):
        solve = shifted(self, *shares)

        def solve_and_count(f):
            counts["solved"] += 1
            return solve(f)

        return solve_and_count

    def move_and_count(subspace, damping, factor, times, *inside):
        counts["advanced"] += len(times) - 1
        return moved(subspace, damping, factor, times, *inside)

    monkeypatch.setattr(dynamics.Oscillator, "shifted", counting)
    monkeypatch.setattr(module, "superposition", move_and_count)
    return counts


@pytest.mark.parametrize("method", ["tr-bdf2", "hht-alpha", "ritz-vectors"])
def test_solver_steps_do_not_grow_with_the_samples(method, coarse, small_posed, counted):
    taken = []
    for samples in (401, DENSE, 4 * (DENSE - 1) + 1):
        counted.update(solved=0, advanced=0)
        found = fem.run(
            coarse, DAMPING, wave, sampled(small_posed, samples), fem.Method(method, modes=5)
        )
        taken.append(counted["advanced"] if method == "ritz-vectors" else counted["solved"])
        assert np.isfinite(found.trajectory.displacement).all()
        assert np.isfinite(found.trajectory.velocity).all()
        assert np.isfinite(found.trajectory.volume_field).all()
    assert 0 < max(taken) < 2 * min(taken)


@pytest.mark.parametrize("method", ["tr-bdf2", "hht-alpha"])
def test_samples_within_steps_are_as_good_as_the_steps(method, coarse, small_posed):
    """Beside a step per sample: displacement and velocity within what halved steps estimate."""
    seen = sampled(small_posed, DENSE)

    def curves(one):
        found = fem.run(coarse, DAMPING, wave, seen, one).trajectory
        return found.displacement, found.velocity, found.volume_field

    own, half, exact = map(
        curves, (fem.Method(method), fem.Method(method, times=2), fem.Method(method, 1))
    )
    for a, b, c in zip(own, half, exact, strict=True):
        error, estimate = np.linalg.norm(a - c), 4 / 3 * np.linalg.norm(a - b)
        assert 0.0 < error < 1.2 * estimate
        assert error < 0.01 * np.linalg.norm(c)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.7, 1.0])
def test_a_cubic_motion_is_exact_within_a_step(share, rng):
    """Displacement and velocity between the ends of a step of 0.3 s."""
    motion = np.polynomial.Polynomial(rng.standard_normal(4))
    speed, step = motion.deriv(), 0.3
    start, end = ((motion(t), speed(t)) for t in (1.0, 1.0 + step))
    found = dynamics.hermite(start, end, share, step)
    at = 1.0 + share * step
    assert found == pytest.approx((motion(at), speed(at)), rel=1e-12)


def test_a_superposition_is_exact_within_its_steps(coarse):
    ritz = fem.ritz_subspace(coarse, 6)
    times = np.linspace(0.0, 0.5, 11)

    def bent(at):
        return np.interp(at, times, wave(times))

    found = superposition(ritz, DAMPING, bent, times, inside=8)
    finely = superposition(ritz, DAMPING, bent, np.linspace(0.0, 0.5, 81))
    for a, b in zip(found, finely, strict=True):
        assert np.abs(a - b).max() < 1e-11 * np.abs(b).max()


def test_a_load_that_own_steps_miss_shortens_them():
    times = np.linspace(0.0, 10.0, 6401)
    assert steps_for_load(np.ones_like, times) == TimeSteps(samples=32)
    # A whole number of periods in each of these steps, at whose ends the load is 0.
    assert steps_for_load(lambda t: np.sin(2.0 * np.pi * 20.0 * t), times) == TimeSteps()
    assert steps_for_load(np.ones_like, times[: 2 * LEAST_STEPS]) == TimeSteps()


def test_a_pace_is_quickened_by_powers_of_two():
    assert TimeSteps(samples=8).refined(2) == TimeSteps(samples=4)
    assert TimeSteps(samples=8).refined(16) == TimeSteps(per_sample=2)
    assert TimeSteps(samples=8).count(4001) == 501
    assert TimeSteps(per_sample=3).count(10) == 30
    assert TimeSteps(samples=4).step(0.1) == pytest.approx(0.4)


def test_steps_of_a_run_are_halved_until_their_error_passes(small_scene, small_posed):
    """A step load moves the velocity at once: 200 steps are too few where 1600 pass."""
    reference = dataclasses.replace(
        small_scene.reference, method="tr-bdf2", steps_per_sample=None, large_strain="none"
    )
    scene = dataclasses.replace(small_scene, reference=reference)
    posed = dataclasses.replace(
        small_posed, observation=sampled(small_posed, 1601), factor=np.ones_like
    )
    levels = {0: small_posed.geometry.level(-1)}
    posed = dataclasses.replace(
        posed, geometry=dataclasses.replace(small_posed.geometry, level=levels.get)
    )
    found = reference_of(scene).prepare(posed).run(SILENT).record
    assert found.steps > 2 * LEAST_STEPS
    assert all(check.velocity < 0.05 for check in found.time_step_errors.values()) or (
        found.steps == 1600
    )


def test_steps_that_are_given_are_taken(coarse, small_posed):
    found = fem.run(coarse, DAMPING, wave, sampled(small_posed, 801), fem.Method("tr-bdf2", 1))
    assert found.steps == 800
