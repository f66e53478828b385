"""The stability study passes, its committed list is whole, and errors planted in it are caught."""

import csv
import dataclasses
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from fem_reference.elasticity import discretise
from study.commands import EXIT_FAILED_CHECK, app
from study.known import request as asked
from study.known import table
from study.known.case import Case, CaseVerdict, Family
from study.known.finding import Finding, at_most, beside, error_of, value
from study.known.request import tried
from study.known.stability.cases import collapse, critical_step, drift, fixed_step, lattice_shapes
from study.known.suite import PROBLEMS, stability_cases
from study.known.trial import attempted, trial
from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue
from study.scene.file import read_scene
from study.sweep.runner import Outcome
from study.system.progress import Silent

COMMITTED = Path(__file__).resolve().parent.parent / "reports/data/stability.csv"
HERE = "tests.test_stability_study"


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    request = asked.StabilityRequest(quick=True, out=tmp_path_factory.mktemp("stability") / "table")
    return request, asked.study(request)


def verdict(case):
    """Of a case run here and now, with whatever is planted."""
    return tried(case, Silent())


def named(family, name):
    (found,) = [case for case in family.cases() if case.name == name]
    return found


# The study ------------------------------------------------------------------------------------


def test_the_quick_cases_are_all_as_expected(quick):
    _, verdicts = quick
    assert len(verdicts) > 150
    assert [v.case.name for v in verdicts if not v.passed] == []


def test_every_family_has_a_quick_case(quick):
    families = {case.family for case in stability_cases(read_scene("block"))}
    assert {verdict.case.family for verdict in quick[1]} == families


def test_the_table_has_a_row_for_each_case(quick):
    request, verdicts = quick
    with (request.folder / table.NAME).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["case"] for row in rows] == [verdict.case.name for verdict in verdicts]
    assert tuple(rows[0]) == table.STABILITY


def test_what_is_stored_is_not_run_again(quick):
    request, _ = quick
    assert "0 left" in asked.planned(request)
    start = time.perf_counter()
    asked.study(request)
    assert time.perf_counter() - start < 5.0  # reading files; the cases take three times as long


def test_no_two_cases_share_a_name():
    every = [(case.family, case.name) for case in stability_cases(read_scene("block"))]
    assert len(set(every)) == len(every)


def test_the_committed_list_is_that_of_this_study_and_all_of_it_passed():
    with COMMITTED.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) >= 150
    now = [(c.family, c.name, c.expectation) for c in stability_cases(read_scene("block"))]
    assert [(row["family"], row["case"], row["expected"]) for row in rows] == now
    assert {row["passed"] for row in rows} == {"True"}
    assert all(row["message"] for row in rows if row["outcome"] == "refused")
    assert all(row["difference"] for row in rows if row["outcome"] != "refused")


# Planted errors -------------------------------------------------------------------------------


@pytest.mark.parametrize("wrong", [0.9, 1.1])
@pytest.mark.parametrize("integrator", critical_step.PLAIN)
def test_a_critical_step_that_is_a_tenth_off_is_caught(monkeypatch, integrator, wrong):
    case = named(critical_step, f"nu 0.4999 by volume term: {integrator}")
    assert verdict(case).passed
    right = critical_step.critical_time_step
    monkeypatch.setattr(critical_step, "critical_time_step", lambda *a: wrong * right(*a))
    found = verdict(case)
    assert not found.passed
    assert found.finding.difference == pytest.approx(0.1, abs=0.015)


def test_a_followed_limit_beyond_the_damped_one_is_caught(monkeypatch):
    case = named(critical_step, "damping ratio 3: runge-kutta-4")
    assert verdict(case).passed
    right = critical_step.critical_time_step
    monkeypatch.setattr(critical_step, "critical_time_step", lambda *a: 1.02 * right(*a))
    assert not verdict(case).passed


def test_another_integrator_diverges_at_another_step(monkeypatch):
    case = named(fixed_step, "1.02 of the limit: symplectic-euler")
    assert verdict(case).passed
    right = fixed_step._dense
    monkeypatch.setattr(fixed_step, "_dense", lambda _, *rest: right("velocity-verlet", *rest))
    assert not verdict(case).passed


def test_a_fixed_step_that_does_not_diverge_is_caught(monkeypatch):
    case = named(fixed_step, "1.02 of the limit: velocity-verlet")
    right = fixed_step.critical_time_step
    monkeypatch.setattr(fixed_step, "critical_time_step", lambda *a: 0.5 * right(*a))
    found = verdict(case)
    assert found.finding.ending == "bounded"
    assert not found.passed


def steady():
    """Energies that scatter as those of a run."""
    rng = np.random.default_rng(5)
    return 1.0 + 1e-4 * rng.standard_normal((drift.STRETCHES, drift.LOOKS))


def drift_verdict(energies):
    case = next(iter(drift.cases()))
    return case.judge(drift.verdict(energies))


def test_a_drift_of_half_a_percent_is_caught():
    ramp = np.linspace(0.0, 1.0, drift.STRETCHES)[:, None]
    assert drift_verdict(steady())
    assert not drift_verdict(steady() * (1.0 + 5e-3 * ramp))
    assert not drift_verdict(steady() * (1.0 - 5e-3 * ramp))


def test_a_scatter_that_would_hide_a_drift_is_no_proof():
    loud = 1.0 + 300.0 * (steady() - 1.0)
    assert not drift_verdict(loud)


def test_an_energy_that_leaves_its_band_is_caught():
    burst = steady()
    burst[50, 3] += 0.1
    assert not drift_verdict(burst)


def test_energy_that_damping_did_not_take_is_missed(monkeypatch):
    case = named(collapse, "10 times its weight, nu 0.45: symplectic-euler")
    assert verdict(case).passed
    right = collapse.Ledger.balance

    def half(self, interval):
        self.kinetic = {sample: 0.5 * size for sample, size in self.kinetic.items()}
        return right(self, interval)

    monkeypatch.setattr(collapse.Ledger, "balance", half)
    assert not verdict(case).passed


def test_springs_without_their_shares_store_too_much(monkeypatch):
    """A lattice whose surface springs count in full is stiffer than the material."""
    case = named(lattice_shapes, "energy of an affine motion, nu 0.45: a single cell")
    right = lattice_shapes.arrays

    def unshared(*args, **settings):
        net = right(*args, **settings)
        return net._replace(scale=np.ones_like(net.scale) * net.length)

    monkeypatch.setattr(lattice_shapes, "arrays", unshared)
    assert not verdict(case).passed


# The verdict ----------------------------------------------------------------------------------


def refusing(says="naming it"):
    return Case(family="f", name="n", function="m:f", expected="refused", says=says)


def valuing(tolerance=0.01):
    return Case(family="f", name="n", function="m:f", tolerance=tolerance)


def test_a_refusal_that_returns_a_number_is_caught():
    assert not refusing().judge(value(0.0, 0.0))


def test_a_refusal_has_to_name_what_is_wrong():
    assert refusing().judge(Finding("refused", message="naming it, and the remedy"))
    assert not refusing().judge(Finding("refused", message="shapes not aligned"))


@pytest.mark.parametrize("number", [1.02, 0.98, np.nan, np.inf, -1.0])
def test_a_number_beyond_its_tolerance_is_caught(number):
    assert valuing().judge(value(1.0, 1.009))
    assert not valuing().judge(value(1.0, number))


def test_a_number_without_anything_beside_it_is_caught():
    assert not valuing().judge(Finding("value", measured=1.0))


def test_an_ending_that_was_not_expected_is_caught():
    assert not valuing().judge(value(1.0, 1.0, ending="diverged"))


def test_a_field_that_is_not_finite_is_caught():
    assert not valuing().judge(beside(np.ones(3), np.array([1.0, np.nan, 1.0])))
    assert not valuing().judge(at_most(1.0, np.nan, ending="value"))
    assert valuing().judge(at_most(1.0, -5.0, ending="value"))


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"expected": "refused"},
        {"says": "x"},
        {"expected": "refused", "says": "x", "tolerance": 1.0},
        {"source": "a book", "tolerance": 1.0},
        {"expected": "refused", "source": "a book"},
    ],
)
def test_a_case_without_a_criterion_is_refused(settings):
    with pytest.raises(ValueError, match="give a refusal what it says"):
        Case(family="f", name="n", function="m:f", **settings)


def test_a_case_cannot_set_its_own_tolerance():
    assert not valuing().judge(error_of("x", 0.02, limit=0.05))
    assert valuing().judge(error_of("x", 0.02)) is False


def test_a_case_that_finds_nothing_has_failed():
    assert not CaseVerdict(PROBLEMS[0], ()).passed


def test_a_family_names_functions_of_its_module_and_runs_its_refusals_always():
    family = Family("f", HERE)
    held, refused = family.case("n", "broken", {}, 0.1), family.case("n", "broken", {}, "why")
    assert held.function == refused.function == f"{HERE}:broken"
    assert (held.expectation, refused.expectation) == ("value, within 0.1", "refused, naming why")
    assert (held.quick, refused.quick) == (False, True)


# How a case is run ----------------------------------------------------------------------------


def forever():
    while True:
        pass


def warned():
    warnings.warn("beware", RuntimeWarning, stacklevel=1)
    return value(1.0, 1.0)


def broken():
    return 1 / 0


def not_finite():
    return value(1.0, float("nan"))


@pytest.mark.parametrize(
    ("function", "message"),
    [
        ("forever", "did not end within 0.2 s"),
        ("warned", "RuntimeWarning: beware"),
        ("broken", "ZeroDivisionError"),
        ("missing", "AttributeError"),
    ],
)
def test_a_hang_a_warning_and_a_traceback_are_errors(function, message):
    (found,) = attempted(f"{HERE}:{function}", {}, 0.2)
    assert found.ending == "error"
    assert message in found.message


def test_numbers_that_are_not_finite_are_missing():
    (found,) = trial(f"{HERE}:not_finite", {}, 5.0)["findings"]
    assert found["measured"] is found["difference"] is None


def test_a_case_whose_worker_died_has_failed():
    case = valuing()
    (found,) = asked.judged([case], [Outcome(case.task, "crashed", None, "killed", 1.0)])
    assert not found.passed
    assert found.finding.message == "crashed: killed"


# The reference at its ends --------------------------------------------------------------------


def discretised(mesh=None, nu=0.3, element="p2"):
    size, down = (0.02, 0.02, 0.02), np.array([0.0, 0.0, -1.0])
    tool = ToolPatch(np.array(size), down, 0.02, 0.1)
    support = Foundation(down, 0.0, 1e-3, 1e5)
    tissue = Tissue(poisson_ratio=nu)
    return discretise(mesh or block_mesh(size, 0.01), tissue, support, tool, element)


@pytest.mark.parametrize("nu", [0.5, 0.7, -1.0, np.nan, np.inf])
def test_a_poisson_ratio_that_no_solid_has_is_refused(nu):
    with pytest.raises(ValueError, match=r"tissue\.poisson_ratio: .* not between -1 and 0\.5"):
        discretised(nu=nu)


def test_a_pressure_is_left_out_where_it_says_nothing():
    with_pressure, without = discretised(nu=0.0, element="taylor-hood"), discretised(nu=0.0)
    assert with_pressure.stiffness.pressure is None
    assert abs(with_pressure.stiffness.matrix - without.stiffness.matrix).max() == 0.0


def test_a_flat_tetrahedron_is_named():
    mesh = block_mesh((0.02, 0.02, 0.02), 0.01)
    points = mesh.points.copy()
    a, b, *_ = mesh.tetrahedra[5]
    points[a] = points[b]
    with pytest.raises(ValueError, match=r"organ\.mesh: \d+ flat tetrahedra, the first number \d+"):
        discretised(TetrahedralMesh(points, mesh.tetrahedra))


# The command ----------------------------------------------------------------------------------


def ask(*arguments):
    """Exit code of the command."""
    with pytest.raises(SystemExit) as left:
        app(["stability", *arguments])
    return left.value.code


def test_a_dry_run_says_what_would_be_run_and_writes_nothing(tmp_path, capsys):
    assert not ask("--dry-run", "--out", str(tmp_path / "table"))
    assert "0 stored" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_a_scene_without_a_lattice_is_bad_input(tmp_path):
    with pytest.raises(ValueError, match=r"organ\.shape"):
        app(["stability", "paper", "--out", str(tmp_path / "table")])


def test_a_case_that_is_not_as_expected_is_a_failed_check(monkeypatch, tmp_path, capsys):
    wrong = named(lattice_shapes, "share left out: apart")
    wrong = dataclasses.replace(wrong, expected="bounded")
    monkeypatch.setattr(asked, "stability_cases", lambda *_, **__: [wrong])
    assert ask("--out", str(tmp_path / "table")) == EXIT_FAILED_CHECK
    assert "NOT AS EXPECTED: lattice shapes: share left out: apart" in capsys.readouterr().out
