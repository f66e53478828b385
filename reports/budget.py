"""Error budgets: the causes of each lattice's difference from a reference, as text and tables."""

from __future__ import annotations

from collections.abc import Iterator

from reports.appearance import labels, reference_name
from reports.differences import resolved
from reports.digits import DASH, Table, fixed, percent
from study.results import Results
from study.results.records import BudgetPart, ErrorBudget

CAUSES = {"stiffness": "estimate of stiffness"}
"""Names of causes in print, against finite elements."""
SMALL = 5e-4
"""Share below which a contribution is printed as zero."""


def budgets(results: Results) -> list[dict[str, object]]:
    """A table per reference: a row per cause; per model contribution, its error and remainder."""
    return [_table(results, reference, of) for reference, of in by_reference(results).items()]


def by_reference(results: Results) -> dict[str, list[ErrorBudget]]:
    """Budgets of a run by what they are taken against."""
    found: dict[str, list[ErrorBudget]] = {}
    for budget in results.record.budgets:
        found.setdefault(budget.reference, []).append(budget)
    return found


def _table(results: Results, reference: str, found: list[ErrorBudget]) -> dict[str, object]:
    causes = [part.cause for part in found[0].parts]
    rows: Table = [["total", *(text for one in found for text in _total(one))]]
    for i, cause in enumerate(causes):
        cells = [text for one in found for text in _cells(one.parts[i])]
        rows.append([cause_name(cause, reference), *cells])
    named = labels(results)
    return {
        "reference": reference_name(results, reference),
        "models": [named[one.model] for one in found],
        "rows": rows,
    }


def _total(budget: ErrorBudget) -> tuple[str, str, str]:
    error = DASH if budget.total_error is None else f"± {percent(budget.total_error)}"
    return resolved(budget.total, budget.total_error), error, ""


def cause_name(cause: str, reference: str) -> str:
    """Printed name of a cause of the difference."""
    return CAUSES.get(cause, cause) if reference == "fem" else cause


def _cells(part: BudgetPart) -> tuple[str, str, str]:
    error = "" if not part.error else f"± {percent(part.error)}"
    return signed(part.contribution), error, "0" if part.left < SMALL else percent(part.left)


def signed(share: float) -> str:
    """A contribution in per cent with its sign."""
    if abs(share) < SMALL:
        return "0"
    return f"{'+' if share > 0 else '−'}{fixed(100.0 * abs(share), 1)} %"


def sentences(results: Results) -> Iterator[str]:
    """The error budget of the nearest model: what remains after each correction; the main cause."""
    found = by_reference(results).get("fem")
    if not found:
        return
    named = labels(results)
    nearest = min(found, key=lambda one: one.total)
    parts = [part for part in nearest.parts if part.cause != "remainder" and part.size >= SMALL]
    steps = ", ".join(
        f"{cause_name(part.cause, 'fem')} {fixed(100.0 * part.left, 1)} %" for part in parts
    )
    if steps:
        yield (
            f"Error budget: the field of {named[nearest.model]} differs from the finite elements "
            f"by {percent(nearest.total)}. Remaining difference as the causes are corrected one "
            f"after another: {steps}."
        )
    largest = max(parts, key=lambda part: part.contribution, default=None)
    if largest is not None:
        name = cause_name(largest.cause, "fem")
        yield f"The largest cause is the {name}, {signed(largest.contribution)}."
