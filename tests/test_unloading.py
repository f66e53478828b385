"""The shape without stress that sags into a given one: its derivative, closed form and limits."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import unloading
from fem_reference.contact.equilibrium import ContactState, EquilibriumSolver, Increment
from fem_reference.contact.large_motion import Integrator, contact_body, contact_problem, unloaded
from fem_reference.elasticity import discretise
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue

DOWN = np.array([0.0, 0.0, -1.0])
SIZE = (0.06, 0.06, 0.03)
TISSUE = Tissue(poisson_ratio=0.45)
GRAVITY = 9.81


@pytest.fixture(scope="module")
def body():
    blunt = ToolPatch(np.array([0.03, 0.03, 0.03]), DOWN, 0.02, 0.0)
    base = Foundation(DOWN, 0.0, 1e-3, 1e7)
    return discretise(block_mesh(SIZE, 0.015), TISSUE, base, blunt, "taylor-hood")


@pytest.fixture(scope="module")
def bare(body):
    return contact_body(body, TISSUE, (), np.array([0.0, 1.0]))


def weight(body, times):
    """Of the body under so many times gravity, aslant."""
    pull = times * np.array([3.0, 0.0, -GRAVITY])
    return np.asarray(body.mass @ np.tile(pull, body.node_count))


def test_the_tangent_is_the_derivative_of_what_does_not_balance(body, bare):
    load, random, solid = weight(body, 1.0), np.random.default_rng(0), bare.solid
    sizes = np.where(np.arange(len(bare.free)) < solid.size, 1e-4, 100.0)
    z, way = (sizes * random.standard_normal(len(sizes)) for _ in range(2))

    def off(there):
        return unloading._residual(
            solid, load, bare.free, there, unloading._point_values(solid, there)
        )

    tangent = unloading._tangent(solid, z, unloading._point_values(solid, z), bare.free)
    found = (off(z - 1e-4 * way) - off(z + 1e-4 * way)) / 2e-4
    assert np.abs(solid.volume_ratio(z) - 1.0).max() > 0.01
    for part in (slice(0, solid.size), slice(solid.size, None)):
        size = np.linalg.norm(found[part])
        assert (tangent @ way)[part] == pytest.approx(found[part], rel=0.0, abs=1e-7 * size)


@pytest.mark.parametrize("times", [1.0, 15.0])
def test_the_unloaded_shape_loaded_from_nothing_is_the_given_one(body, bare, times):
    """Iteration on shapes ends at ten times gravity, where they sag by a quarter of the height."""
    load = weight(body, times)
    hanging = unloaded(bare, load)
    sag = np.abs(hanging.origin).max()
    begun = np.zeros(len(bare.free))
    solver, at = EquilibriumSolver(hanging), ContactState(begun, np.zeros(0))
    for share in np.linspace(0.0, 1.0, 5)[1:]:
        at = solver.solve(at, Increment(0.0, 0.0, share * load), float(np.linalg.norm(load)))
    assert sag > 2e-4 * times
    assert np.abs(hanging.given(at.w)).max() < 1e-5 * sag


def test_what_is_found_balances_in_the_equations_of_motion(body, bare):
    load = weight(body, 15.0)
    hanging = unloaded(bare, load)
    given = contact_problem(
        body, TISSUE, (), RayleighDamping(30.0), np.zeros_like, np.array([0.0, 1.0]), load
    )
    start = Integrator(given).start()
    assert start.w[: len(load)] == pytest.approx(hanging.origin, abs=1e-9)


def test_newtons_method_is_not_ended_close_to_equilibrium(monkeypatch):
    """A soft block under three times gravity, sideways: it was lost at 88 % of the load by 1e-9."""
    soft, size = Tissue(youngs_modulus=500.0, poisson_ratio=0.499), (0.03, 0.03, 0.02)
    blunt = ToolPatch(np.array([0.015, 0.015, 0.02]), DOWN, 0.01, 0.0)
    base = Foundation(DOWN, 0.0, 1e-3, 2e7)
    block = discretise(block_mesh(size, 0.01), soft, base, blunt, "taylor-hood")
    free, newton, lost = contact_body(block, soft, (), np.array([0.0, 1.0])), unloading._newton, []

    def watched(*given):
        found = newton(*given)
        if found.failure:
            lost.append(found.residuals[-1])
        return found

    monkeypatch.setattr(unloading, "_newton", watched)
    load = block.mass @ np.tile([3.0 * GRAVITY, 0.0, 0.0], block.node_count)
    assert unloading.unload(free.solid, load, free.free).reached == 1.0
    assert min(lost) > 1e-2


def test_a_load_for_which_there_is_no_shape_is_refused_with_what_was_reached(body, bare):
    with pytest.raises(ValueError, match=r"gravity\.given.* \d.* % of the load"):
        unloaded(bare, weight(body, 1000.0))
