"""Each cause of error shows in its own part of the budget and nowhere else."""

from __future__ import annotations

from functools import cache

import pytest
from matplotlib.figure import Figure

from fuzzy.liver.stiffness import StiffnessEstimate
from reports import budget as printed
from reports.budget_figure import waterfall
from study.models.estimates import FuzzyResults
from study.results.records import BudgetPart, ErrorBudget
from study.run import budget as causes
from study.run import study
from study.scene.file import read_scene

SMALL = (
    "reference.element_size='30 mm'",
    "lattice.spacing='10 mm'",
    "lattice.volume_term=true",
    "lattice.time_step='0.5 ms'",
    "damping.ratio=0.9",
    "fuzzy.systems=['mamdani']",
    "time.duration='2 s'",
    "tool.history={kind='ramp-hold-release',ramp='0.5 s',hold='1.2 s',release='0.2 s'}",
    "models=['fem','msm']",
)
KEYS = ("cause", "size", "contribution", "left")


@cache
def budget(*changes, factor=1.0):
    """The budget of a lattice on the small block whose estimate is a multiple of the modulus."""
    scene = read_scene("block", (*SMALL, *changes))
    modulus = factor * scene.tissue.youngs_modulus
    made = StiffnessEstimate("mamdani", modulus, None, 0.0, (), "")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "run_fuzzy", lambda _: FuzzyResults({"mamdani": made}))
        patch.setattr(study, "estimates", lambda _: {"mamdani": made})
        return study.run_study(scene)


def parts(*changes, **chosen):
    (found,) = budget(*changes, **chosen).record.budgets
    return {part.cause: part for part in found.parts}


def test_parts_add_up_to_the_difference_of_the_fields():
    results = budget(factor=1.2)
    (found,) = results.record.budgets
    rows = {row.quantity: row.value for row in results.field_differences}
    assert found.total == pytest.approx(rows["field-relative-l2-peak"], rel=1e-12)
    assert sum(part.contribution for part in found.parts) == pytest.approx(found.total, rel=1e-9)
    assert found.parts[-1].left == pytest.approx(0.0, abs=1e-12)
    assert found.total_error == results.model("fem").mesh_error.field_peak


def test_what_is_named_explains_the_difference():
    """The remainder is what dynamics and steps differ by: less than the reference's own error."""
    for one in (parts(factor=1.2), parts("lattice.volume_term=false")):
        assert one[causes.REMAINDER].size < 0.01


MOVING = "tool.history={kind='ramp-hold-release',ramp='0.1 s',hold='0 s',release='0.4 s'}"
"""A peak at which nothing has come to rest, or the steps would hardly matter."""
PLANTED = {
    causes.ESTIMATE: (parts, lambda: parts(factor=1.2), 0.12),
    causes.POISSON: (parts, lambda: parts("lattice.volume_term=false"), 0.1),
    causes.SPACING: (parts, lambda: parts("lattice.spacing='20 mm'"), 0.05),
    causes.TIME_STEP: (
        lambda: parts(MOVING, "time.samples=101"),
        lambda: parts(MOVING, "time.samples=101", "lattice.time_step='1 ms'"),
        5e-4,
    ),
}


@pytest.mark.parametrize("cause", PLANTED)
def test_a_planted_error_shows_in_its_part_and_nowhere_else(cause):
    make, plant, least = PLANTED[cause]
    right, wrong = make(), plant()
    before = right[cause].size if cause in right else 0.0
    grown = wrong[cause].size - before
    assert grown > least
    for other in right.keys() - {cause}:
        assert abs(wrong[other].size - right[other].size) < 0.1 * grown + 2e-3 * (grown > 0.01), (
            other
        )


def test_a_benchmark_has_a_budget_of_modulus_damping_and_law():
    results = budget("models=['basafa','msm']", "lattice.volume_term=false", factor=1.2)
    (found,) = results.record.budgets
    assert found.reference == "basafa"
    assert [part.cause for part in found.parts] == [
        causes.ESTIMATE,
        causes.DAMPING,
        causes.LAW,
        causes.REMAINDER,
    ]
    assert sum(part.contribution for part in found.parts) == pytest.approx(found.total, rel=1e-9)


def test_contributions_that_exceed_the_total_are_within_the_axes():
    """A stiffness that doubles the difference and a damping that removes all of it."""
    parts = tuple(
        BudgetPart(cause=cause, size=3.0, contribution=share, left=left, error=None)
        for cause, share, left in (("stiffness", -2.0, 3.0), ("damping", 3.5, 0.5))
    )
    found = ErrorBudget(model="m", reference="basafa", total=1.0, total_error=None, parts=parts)
    axes = Figure().add_subplot()
    waterfall(axes, found)
    low, high = axes.get_xlim()
    ends = [x for bar in axes.patches for x in (bar.get_x(), bar.get_x() + bar.get_width())]
    assert (min(ends), max(ends)) == pytest.approx((-50.0, 300.0))
    assert low < -50.0
    assert high > 300.0


def test_a_budget_is_printed_as_it_was_found():
    results = budget("lattice.volume_term=false", factor=1.5)
    (table,) = printed.budgets(results)
    (found,) = results.record.budgets
    assert table["models"] == ["MSM Mamdani"]
    for row, part in zip(table["rows"][1:], found.parts, strict=True):
        assert row[0] == printed.cause_name(part.cause, "fem")
        assert row[1] == printed.signed(part.contribution)
    (told,) = printed.sentences(results)
    assert "estimate of stiffness" in told
    biggest = max(found.parts, key=lambda part: part.contribution)
    assert printed.cause_name(biggest.cause, "fem") in told.split("The largest cause is the ")[1]
