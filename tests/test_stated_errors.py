"""Errors that are stated beside results, of motions and fields whose error is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.elements import ELEMENTS
from fem_reference.error_estimate import (
    ASSUMED_ORDER,
    SAFETY,
    SAFETY_ASSUMED,
    SAFETY_GRADED,
)
from fem_reference.superposition import CurveChange
from study.models.errors import (
    DISPLACEMENT_LIMIT,
    VELOCITY_LIMIT,
    rounding_errors,
    step_checks,
    time_step_errors,
    tool_force_errors,
)
from study.models.mesh_error import (
    LARGEST_JUMP,
    MeshSolution,
    is_too_coarse,
    mesh_error,
    next_size,
)
from study.models.model import ModelRun
from study.models.remainder import relative_sizes
from study.problem.trajectory import Trajectory
from study.results.numerical import numerical_errors, whole_error
from study.results.records import CurveErrors, DiscretisationError, ElementsRecord
from study.run.budget import Difference, _shares, _time_step_part
from study.run.limits import LatticeAtRest, ReferenceAtRest, lattice_limits
from study.similarity.fields import norm
from tests.report_samples import LATTICE, model_record

PROBES = ("tool", "far")
EXACT = np.random.default_rng(5).normal(size=(6, 2, 3))
BY_STEP = np.array([[0.02], [0.003]])  # of each control point or tool, at a step of 1
OF_VELOCITY = 3.0  # times that of the displacement


def motion(step, order, status="finished"):
    """EXACT, times 1 + error, which falls with the order of the step."""
    error = BY_STEP * step**order
    nothing = np.zeros((1, 0, 3))
    return Trajectory(
        (1.0 + error) * EXACT,
        (1.0 + OF_VELOCITY * error) * EXACT,
        (1.0 + error[:1]) * EXACT[:1, 0][None],
        nothing,
        (1.0 + error[::-1]) * EXACT,
        status,
    )


def beside_half(error, order):
    """Of a whole step, relative to the motion by half the step."""
    return error / (1.0 + error * 0.5**order)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_error_of_a_step_is_that_of_the_whole_step(order):
    given = order, PROBES, motion(1.0, order), motion(0.5, order)
    for name, error in zip(PROBES, BY_STEP[:, 0], strict=True):
        found = time_step_errors(*given)[name]
        assert found.displacement == pytest.approx(beside_half(error, order))
        assert found.velocity == pytest.approx(beside_half(OF_VELOCITY * error, order))
        force = tool_force_errors(order, PROBES[::-1], *given[2:])[name]
        assert force == pytest.approx(beside_half(error, order))


def test_rounding_is_the_whole_difference_from_double_precision():
    single, double = motion(1.0, 1), motion(0.0, 1)
    for name, error in zip(PROBES, BY_STEP[:, 0], strict=True):
        found = rounding_errors(PROBES, single, double)[name]
        assert found.displacement == pytest.approx(error)
        assert found.velocity == pytest.approx(OF_VELOCITY * error)


def test_a_run_that_ended_early_tells_no_error_and_fails_its_check():
    lost = motion(0.5, 1, "diverged")
    assert time_step_errors(1, PROBES, motion(1.0, 1), lost) == {}
    assert tool_force_errors(1, PROBES, motion(1.0, 1), lost) == {}
    assert rounding_errors(PROBES, motion(1.0, 1), lost) == {}
    (check,) = step_checks("msm", {})
    assert check.value > check.limit


def test_checks_of_the_steps_take_the_worst_control_point_of_each_curve():
    errors = {"tool": CurveErrors(displacement=0.02, velocity=0.01)}
    errors["far"] = CurveErrors(displacement=0.004, velocity=0.06)
    found = [(check.value, check.limit) for check in step_checks("msm", errors)]
    assert found == [(0.02, DISPLACEMENT_LIMIT), (0.06, VELOCITY_LIMIT)]


def test_a_share_of_a_part_is_told_over_the_whole():
    part, whole = motion(1.0, 1), motion(0.0, 1)
    found = relative_sizes(PROBES, part, whole, 0.5)["far"]
    assert found.displacement == pytest.approx(0.5 * (1.0 + BY_STEP[1, 0]))
    assert found.velocity == pytest.approx(0.5 * (1.0 + OF_VELOCITY * BY_STEP[1, 0]))


# --- the mesh that is asked for -------------------------------------------------------------------


def of_mesh(displacement):
    """An error of the mesh, larger in one of two control points."""
    errors = [CurveErrors(displacement=share * displacement, velocity=1.0) for share in (1.0, 0.3)]
    return DiscretisationError(
        field_peak=0.01,
        field_order=2.0,
        formal_order=2.0,
        by_probe=dict(zip(PROBES, errors, strict=True)),
        order_by_probe={},
    )


def test_a_mesh_is_too_coarse_where_the_worst_curve_is_or_none_is_known():
    assert not is_too_coarse(None, None)
    assert is_too_coarse(0.01, None)
    assert is_too_coarse(0.01, of_mesh(0.011))
    assert not is_too_coarse(0.01, of_mesh(0.01))


def test_the_next_mesh_has_the_error_that_is_asked_for_by_the_highest_order():
    order = max(one.formal_order for one in ELEMENTS.values())
    size = next_size(0.01, of_mesh(0.0125))
    assert 0.0125 * size**order == pytest.approx(0.01)
    assert next_size(0.01, of_mesh(1.0)) == LARGEST_JUMP
    assert next_size(None, of_mesh(1.0)) == next_size(0.01, None) == 1.0


# --- numerical errors of a score ------------------------------------------------------------------


def test_a_score_has_the_errors_of_both_motions_and_of_the_mesh():
    """By the curve; the phase plane has the larger of its two, and single precision its own.

    That by the vectors is part of the mesh's, and only counts apart where that is unknown.
    """

    def errors(displacement, velocity):
        return dict.fromkeys(PROBES, CurveErrors(displacement=displacement, velocity=velocity))

    mesh = replace(of_mesh(0.0), by_probe=errors(4e-3, 8e-3))
    elements = ElementsRecord(
        element="p2",
        elements=1,
        unknowns=1,
        method="ritz-vectors",
        truncation=CurveErrors(displacement=1e-4, velocity=2e-4),
        mesh_error=mesh,
    )
    single = replace(LATTICE, precision="single", rounding_errors=errors(1e-5, 3e-5))
    reference = replace(
        model_record("fem", list(PROBES)), elements=elements, time_step_errors=errors(0.01, 0.02)
    )
    lattice = replace(
        model_record("msm-mamdani", list(PROBES)),
        lattice=single,
        time_step_errors=errors(0.1, 0.05),
    )
    told = {
        "displacement": [0.01, 0.1, 1e-5, 4e-3],
        "velocity": [0.02, 0.05, 3e-5, 8e-3],
        "phase-plane": [0.02, 0.1, 3e-5, 8e-3],
    }
    for curve, parts in told.items():
        assert numerical_errors(reference, [lattice], "far", curve) == parts
        assert whole_error(parts) == pytest.approx(sum(parts))
    unknown = numerical_errors(
        reference, [replace(lattice, time_step_errors={})], "far", "velocity"
    )
    assert unknown[1] is None
    assert whole_error(unknown) is None
    bare = replace(reference, elements=replace(elements, mesh_error=None))
    apart = numerical_errors(bare, [lattice], "far", "displacement")
    assert apart == [0.01, 0.1, 1e-5, None, 1e-4]


def test_the_vectors_are_counted_once_in_a_score_as_in_the_error_of_the_mesh():
    """Where they are all the error that a motion has, the sum is just that."""
    still = [replace(one, found=SimpleNamespace(**vars(one.found))) for one in meshes()]
    for one in still:
        one.found.trajectory = motion(0.0, 1.0)
    elements = ElementsRecord(
        element="p2",
        elements=1,
        unknowns=1,
        method="ritz-vectors",
        truncation=CurveErrors(displacement=3e-5, velocity=4e-4),
        mesh_error=mesh_error(POSED, still),
    )
    nothing = dict.fromkeys(PROBES, CurveErrors(displacement=0.0, velocity=0.0))
    record = replace(model_record("fem", list(PROBES)), elements=elements, time_step_errors=nothing)
    assert whole_error(numerical_errors(record, [], "far", "displacement")) == pytest.approx(3e-5)
    assert whole_error(numerical_errors(record, [], "far", "velocity")) == pytest.approx(4e-4)


# --- limits and budget of a lattice ---------------------------------------------------------------

TRUTH = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
ASIDE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])  # orthogonal to TRUTH at each point
VOLUMES = np.array([2.0, 0.5])  # norms: of TRUTH 2, of ASIDE the root of 2.5


def test_limits_of_a_lattice_are_those_of_fields_put_together():
    """Half the truth and a part aside: a factor of stiffness mends the first, nothing the other."""
    aside = 0.1 * np.sqrt(2.5) / 2.0
    lattice = LatticeAtRest(0.01, 0.5 * TRUTH + 0.1 * ASIDE, 0.9 * TRUTH)
    found = lattice_limits(lattice, ReferenceAtRest(TRUTH, 0.5 * TRUTH), 0.45, VOLUMES)
    factor = 0.5 / (0.25 + aside**2)
    assert found.relative_l2 == pytest.approx(np.hypot(0.5, aside))
    assert found.relative_l2_at_quarter == pytest.approx(aside / 0.5)
    assert found.best_factor == pytest.approx(factor)
    assert found.relative_l2_at_best_factor == pytest.approx(
        np.hypot(1.0 - 0.5 * factor, factor * aside)
    )
    assert found.relative_l2_with_volume_term == pytest.approx(0.1)
    bare = lattice_limits(
        replace(lattice, with_volume_term=None), ReferenceAtRest(TRUTH, TRUTH), 0.25, VOLUMES
    )
    assert bare.relative_l2_with_volume_term is None
    assert (bare.spacing_m, bare.poisson_ratio) == (0.01, 0.25)


def test_shares_of_a_budget_are_projections_on_the_whole_difference():
    """Parts along it, across it, and both; norms are relative to the truth."""
    whole, size = 0.4 * TRUTH, 0.4
    across = 0.1 * ASIDE
    fields = 0.3 * TRUTH, across, 0.1 * TRUTH - across
    parts = [
        Difference(name, f, e) for name, f, e in zip("abc", fields, (None, 0.1, 0.2), strict=True)
    ]
    found = list(_shares(parts, whole, TRUTH, VOLUMES))
    aside = norm(across, VOLUMES) / 2.0
    assert [one.size for one in found] == pytest.approx([0.3, aside, np.hypot(0.1, aside)])
    assert [one.contribution for one in found] == pytest.approx([0.3, 0.0, 0.1])
    assert [one.left for one in found] == pytest.approx([0.1, np.hypot(0.1, aside), 0.0], abs=1e-15)
    assert sum(one.contribution for one in found) == pytest.approx(size)
    assert [(one.cause, one.error) for one in found] == [("a", None), ("b", 0.1), ("c", 0.2)]


@pytest.mark.parametrize(("integrator", "order"), [("symplectic-euler", 1), ("runge-kutta-4", 4)])
def test_the_part_of_the_time_step_is_that_of_the_whole_step(integrator, order):
    lattice = replace(LATTICE, integrator=integrator)
    record = replace(model_record("msm-mamdani", list(PROBES)), lattice=lattice)
    run = ModelRun(motion(1.0, order), record, halved=motion(0.5, order))
    (part,) = _time_step_part(run)
    assert part.field == pytest.approx(BY_STEP[0, 0] * EXACT[:1, 0], abs=1e-12)
    assert not list(_time_step_part(replace(run, halved=None)))


# --- the error of the finest mesh -----------------------------------------------------------------

SIZES = 0.4, 0.2, 0.1
POSED = SimpleNamespace(
    probes=PROBES,
    tissue=SimpleNamespace(poisson_ratio=0.45),
    volume_rule=SimpleNamespace(weights=np.ones(1)),
)


def meshes(element="p2", status="finished"):
    """Solutions whose errors fall with the element's order of the size; the last in a subspace."""
    order = ELEMENTS[element].formal_order
    return [
        MeshSolution(
            SimpleNamespace(size=size),
            None,
            SimpleNamespace(
                element=element,
                trajectory=motion(size, order, status),
                truncation=CurveChange(3e-5, 4e-4) if size == SIZES[-1] else None,
            ),
        )
        for size in SIZES
    ]


@pytest.mark.parametrize(("graded", "safety"), [(False, SAFETY), (True, SAFETY_GRADED)])
def test_the_error_of_a_mesh_is_that_of_the_finest_and_of_its_vectors(graded, safety):
    found, order = mesh_error(POSED, meshes(), graded=graded), ELEMENTS["p2"].formal_order
    errors = BY_STEP[:, 0] * SIZES[-1] ** order
    assert found.field_peak == pytest.approx(safety * errors[0] / (1.0 + errors[0]))
    for name, u in zip(PROBES, errors, strict=True):
        v, told = OF_VELOCITY * u, found.by_probe[name]
        assert told.displacement == pytest.approx(np.hypot(safety * u / (1.0 + u), 3e-5))
        assert told.velocity == pytest.approx(np.hypot(safety * v / (1.0 + v), 4e-4))
    seen = None if graded else pytest.approx(order)
    assert (found.field_order, found.order_by_probe["far"].velocity) == (seen, seen)
    assert found.formal_order == order


def test_two_meshes_tell_an_error_by_the_assumed_order():
    found, order = mesh_error(POSED, meshes()[1:]), ELEMENTS["p2"].formal_order
    change = BY_STEP[0, 0] * (SIZES[1] ** order - SIZES[2] ** order)
    whole = 1.0 + BY_STEP[0, 0] * SIZES[2] ** order
    error = SAFETY_ASSUMED * change / whole / ((SIZES[1] / SIZES[2]) ** ASSUMED_ORDER - 1.0)
    assert found.field_peak == pytest.approx(error)
    assert found.field_order is None


def test_a_mesh_alone_one_that_locks_and_a_motion_that_ended_early_tell_no_error():
    assert mesh_error(POSED, meshes()[2:]) is None
    assert mesh_error(POSED, meshes("p1")) is None
    assert mesh_error(POSED, meshes(status="diverged")) is None
    soft = SimpleNamespace(**vars(POSED) | {"tissue": SimpleNamespace(poisson_ratio=0.4)})
    assert mesh_error(soft, meshes("p1")) is not None
