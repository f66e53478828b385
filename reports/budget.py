"""Error budgets: the causes of each lattice's difference from a reference, as text and tables."""

from __future__ import annotations

from collections.abc import Iterator

from reports.appearance import labels, reference_name
from reports.differences import resolved
from reports.digits import DASH, Table, percent, percent_known
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
    is_hidden = budget.total < (budget.total_error or 0.0)
    total = resolved(budget.total, budget.total_error) if is_hidden else percent(budget.total)
    return total, error, ""


def cause_name(cause: str, reference: str) -> str:
    """Printed name of a cause of the difference."""
    return CAUSES.get(cause, cause) if reference == "fem" else cause


def _cells(part: BudgetPart) -> tuple[str, str, str]:
    error = "" if not part.error else f"± {percent(part.error)}"
    return signed(part.contribution), error, remaining(part.left)


def signed(share: float, error: float | None = None) -> str:
    """A contribution in per cent with its sign, to the digits of an error."""
    printed = remaining(abs(share), error)
    return "0" if printed == "0" else f"{'+' if share > 0 else '−'}{printed}"


def remaining(share: float, error: float | None = None) -> str:
    """A difference in per cent to a tenth or the digits of an error, "0" if none is left."""
    printed = percent_known(round(share, 3), error)
    return "0" if share < SMALL or printed == "0 %" else printed


def sentences(results: Results) -> Iterator[str]:
    """The error budget of the nearest model: what remains after each correction; the main cause."""
    found = by_reference(results).get("fem")
    if not found:
        return
    named = labels(results)
    nearest = min(found, key=lambda one: one.total)
    parts = [part for part in nearest.parts if part.cause != "remainder" and part.size >= SMALL]
    error = nearest.total_error
    steps = ", ".join(
        f"{cause_name(one.cause, 'fem')} {remaining(one.left, error)}" for one in parts
    )
    if not parts:
        return
    largest = max(parts, key=lambda part: part.contribution)
    yield (
        f"Error budget: the field of {named[nearest.model]} differs from the finite elements by "
        f"{percent_known(nearest.total, error)}. Remaining difference as the causes are corrected "
        f"one after another: {steps}. The largest cause is the {cause_name(largest.cause, 'fem')}, "
        f"{signed(largest.contribution, error)}."
    )
