"""A lattice in few vectors: as the lattice itself linear, by every integrator."""

import dataclasses

import numpy as np
import pytest

from msm import model as msm
from msm.damping import NodalDamping
from msm.integrators import INTEGRATORS
from msm.model import Counts
from msm.reduction import ReducedMotion, reduced, ritz_vectors
from msm.statics import static_displacement
from study.models.table import model
from study.problem.trajectory import Observation

SAMPLES, EVERY = 9, 16
DAMPINGS = {
    "heavy": NodalDamping(300.0),
    "light": NodalDamping(5.0),
    "rayleigh": NodalDamping(20.0, beta=2e-4),
}


@pytest.fixture(scope="module")
def lattice(small_scene, small_posed):
    return model(small_scene, "corrected").varied(spacing=0.02).coarse.prepare(small_posed)


def material(lattice, damping):
    return dataclasses.replace(lattice.springs.material, damping=DAMPINGS[damping])


def rising(times):
    return np.minimum(times / 0.05, 1.0)


def moved(lattice, damping, integrator, count):
    """Nodes [m] at the samples of the linear lattice, and of it in so many vectors."""
    assembly, made = lattice.assembly, material(lattice, damping)
    step = 0.8 * msm.critical_time_step(assembly, made, "symplectic-euler")
    times = EVERY * step * np.arange(SAMPLES)
    nothing = np.zeros((0, 3))
    seen = Observation(times, assembly.lattice.nodes, (SAMPLES - 1,), nothing, nothing)
    counts = Counts(np.full(SAMPLES - 1, EVERY))
    whole = msm.run(assembly, made, rising, seen, counts, integrator=integrator, linear=True)

    few = reduced(assembly, made, ritz_vectors(assembly, made, count))
    motion = ReducedMotion(few, made.damping, rising, integrator)
    found = [few.displacement(motion.coordinates)]
    for _ in range(SAMPLES - 1):
        motion.advance(EVERY, step)
        found.append(few.displacement(motion.coordinates))
    return whole.trajectory.displacement, np.array(found)


def apart(lattice, damping, integrator, count):
    whole, found = moved(lattice, damping, integrator, count)
    return np.linalg.norm(found - whole) / np.linalg.norm(whole)


@pytest.mark.parametrize("integrator", [name for name in INTEGRATORS if name != "xpbd"])
def test_few_vectors_move_as_the_linear_lattice_by_the_same_integrator(lattice, integrator):
    """But for split-volume, whose steps err otherwise in the part that it takes implicitly."""
    assert apart(lattice, "heavy", integrator, 24) < (
        2e-3 if integrator == "split-volume" else 1e-3
    )


@pytest.mark.parametrize("damping", ["light", "rayleigh"])
def test_few_vectors_are_damped_as_the_lattice(lattice, damping):
    few, more = (apart(lattice, damping, "symplectic-euler", count) for count in (10, 40))
    assert more < 1e-3
    assert few > 3.0 * more


def test_the_error_of_the_steps_is_that_of_the_lattice(lattice):
    """By steps of another integrator the difference is that of the steps, not of the vectors."""
    whole, _ = moved(lattice, "heavy", "symplectic-euler", 1)
    _, other = moved(lattice, "heavy", "runge-kutta-4", 24)
    by_steps = np.linalg.norm(other - whole) / np.linalg.norm(whole)
    assert by_steps > 10.0 * apart(lattice, "heavy", "symplectic-euler", 24)


def test_one_vector_holds_the_rest_exactly(lattice):
    made = material(lattice, "heavy")
    few = reduced(lattice.assembly, made, ritz_vectors(lattice.assembly, made, 1))
    found = few.displacement(few.load / few.squares)
    np.testing.assert_allclose(
        found, static_displacement(lattice.assembly, made), rtol=1e-6, atol=1e-12
    )


def test_vectors_are_orthonormal_in_the_mass_and_no_more_than_there_are(lattice):
    made, mass = material(lattice, "heavy"), np.repeat(lattice.assembly.mass, 3)
    vectors = ritz_vectors(lattice.assembly, made, 10_000)
    assert vectors.shape[1] <= len(mass)
    np.testing.assert_allclose(
        vectors.T @ (mass[:, None] * vectors), np.eye(vectors.shape[1]), atol=1e-9
    )


def test_a_step_too_long_for_a_mode_is_taken_in_parts(lattice):
    made = material(lattice, "heavy")
    few = reduced(lattice.assembly, made, ritz_vectors(lattice.assembly, made, 60))
    rests = few.displacement(few.load / few.squares)
    motion = ReducedMotion(few, made.damping, np.ones_like, "symplectic-euler")
    motion.advance(4000, 1.9 * motion.limit)
    np.testing.assert_allclose(
        few.displacement(motion.coordinates), rests, atol=1e-3 * np.abs(rests).max()
    )
