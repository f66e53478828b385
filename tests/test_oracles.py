"""The reference beside CalculiX, GetFEM and DOLFINx on the same meshes, see tests/oracles.

Where a program is installed it solves the problem now; its kept answers are compared always.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fem_reference.exchange.calculix_rule import integrated
from fem_reference.solvers import solve_static
from study.handover.export import frames
from study.problem.damping import RayleighDamping
from tests.oracles import calculix, matrices
from tests.oracles.cases import CASES, DYNAMIC, build, difference, kept, ramp

# CalculiX prints seven digits: half a unit of the seventh, relative to a mean number, is 1.5e-7.
PRINTED = 1e-6
# Rounding of the matrices, 1e-15, times some of the stiffness' condition.
ROUNDING = 1e-10
# Degree 10 on facets, where the support ends within elements and the tool's edge is no polynomial:
# up to 7e-4 was seen. Curved cells: the reference's degree 4 leaves 4e-5.
QUADRATURE = {"alone": 2e-3, "curved": 2e-4}
PLANTED = 1e-4

needs_calculix = pytest.mark.skipif(calculix.PROGRAM is None, reason="CalculiX is not installed")


def needs(program):
    if not matrices.installed(program):
        pytest.skip(f"{program} is not installed for {matrices.PYTHON}")


@cache
def case(name, modulus_factor=1.0):
    return build(name, modulus_factor)


@cache
def resting(name, modulus_factor=1.0):
    """Our displacement at rest, as CalculiX integrates."""
    found = case(name, modulus_factor)
    return solve_static(integrated(found.body, found.problem.tissue)).reshape(-1, 3)


@cache
def moving(modulus_factor=1.0):
    """Our displacement at the times that CalculiX prints."""
    found = case(DYNAMIC, modulus_factor)
    body = integrated(found.body, found.problem.tissue)
    return np.array([u.reshape(-1, 3) for _, u in frames(body, ramp())])


@pytest.mark.parametrize("name", CASES)
def test_displacement_at_rest_is_what_calculix_found(name):
    nodes, theirs = kept(f"calculix-{name}", case(name).problem)
    assert difference(resting(name)[nodes], theirs[0]) < PRINTED
    assert difference(resting(name, 1.0 + PLANTED)[nodes], theirs[0]) > 10 * PRINTED


@needs_calculix
@pytest.mark.parametrize("name", CASES)
def test_calculix_finds_the_same_displacement_at_rest(name):
    assert difference(resting(name), calculix.at_rest(case(name).problem)) < PRINTED


@needs_calculix
def test_calculix_shows_a_planted_modulus():
    wrong = calculix.at_rest(case("block-p1", 1.0 + PLANTED).problem)
    assert difference(resting("block-p1"), wrong) > 10 * PRINTED


def test_motion_is_what_calculix_found():
    nodes, theirs = kept(f"calculix-{DYNAMIC}", case(DYNAMIC).problem)
    for ours, planted, found in zip(moving(), moving(1.0 + PLANTED), theirs[1:], strict=True):
        assert difference(ours[nodes], found) < PRINTED
        assert difference(planted[nodes], found) > 10 * PRINTED


@needs_calculix
def test_calculix_finds_the_same_motion():
    for ours, theirs in zip(moving(), calculix.moving(case(DYNAMIC).problem, ramp()), strict=True):
        assert difference(ours, theirs) < PRINTED


def test_the_motion_shows_mass_damping_and_integrator():
    found = case(DYNAMIC)
    body = integrated(found.body, found.problem.tissue)
    nodes, theirs = kept(f"calculix-{DYNAMIC}", found.problem)
    slips = {
        "consistent mass": (replace(body, mass=found.body.mass), ramp()),
        "no damping by mass": (body, replace(ramp(), damping=RayleighDamping(0.0, 5e-4))),
        "no damping by stiffness": (body, replace(ramp(), damping=RayleighDamping(3.0))),
        "another alpha": (body, replace(ramp(), alpha=0.0)),
        "load a step late": (body, replace(ramp(), factors=np.roll(ramp().factors, 1))),
    }
    for name, slip in slips.items():
        wrong = frames(*slip)[0][1].reshape(-1, 3)[nodes]
        assert difference(wrong, theirs[1]) > 10 * PRINTED, name


def same(name, ours, theirs, program):
    """Every displacement by a program's matrices against ours."""
    curved = case(name).problem.curved and program == "dolfinx"
    for key, found in theirs.items():
        expected = ours.get(key, ours["rest"])
        tolerance = QUADRATURE.get(key, QUADRATURE["curved"] if curved else ROUNDING)
        assert difference(expected, found) < tolerance


def our_frames(name, program, modulus_factor=1.0):
    """By the quadrature that the program is told to use on curved elements."""
    found = case(name, modulus_factor)
    four_points = matrices.rule_for(program, found)
    return matrices.frames(
        integrated(found.body, found.problem.tissue) if four_points else found.body
    )


@pytest.mark.parametrize("program", matrices.PROGRAMS)
@pytest.mark.parametrize("name", CASES)
def test_stiffness_and_mass_give_what_other_codes_found(name, program):
    nodes, theirs = kept(f"{program}-{name}", case(name).problem)
    named = dict(zip(("rest", "shaken", "alone"), theirs, strict=False))
    ours = {key: u[nodes] for key, u in our_frames(name, program).items()}
    same(name, ours, named, program)


@pytest.mark.parametrize("program", matrices.PROGRAMS)
@pytest.mark.parametrize("name", CASES)
def test_other_codes_assemble_the_same_stiffness_and_mass(name, program):
    needs(program)
    found = case(name)
    theirs = matrices.assemble(program, found, matrices.rule_for(program, found))
    same(name, our_frames(name, program), theirs.frames(found.body), program)


@pytest.mark.parametrize("program", matrices.PROGRAMS)
def test_other_codes_show_a_planted_modulus(program):
    nodes, (rest, *_) = kept(f"{program}-block-p2", case("block-p2").problem)
    wrong = our_frames("block-p2", program, 1.0 + PLANTED)
    assert difference(wrong["rest"][nodes], rest) > 1e5 * ROUNDING
    needs(program)
    theirs = matrices.assemble(program, case("block-p2", 1.0 + PLANTED)).frames(
        case("block-p2").body
    )
    assert difference(our_frames("block-p2", program)["rest"], theirs["rest"]) > 1e5 * ROUNDING


def test_an_answer_kept_for_another_mesh_is_refused():
    with pytest.raises(ValueError, match="mesh has changed"):
        kept("calculix-block-p1", case("block-p2").problem)
