"""Accuracy against cost, and where models break: studies that come with the program."""

from __future__ import annotations

from reports import stability, tradeoff, tradeoff_answers
from reports.digits import count, percent, words
from reports.stability_map import critical_step_figure, stability_map
from reports.tradeoff_figure import tradeoff_figure


def robustness() -> dict[str, object] | None:
    """Trade-off and stability study as text; one whose table is missing is left out.

    None where neither table was delivered.
    """
    found: dict[str, object] = {}
    if configurations := tradeoff.configurations():
        found["tradeoff"] = {
            "sentences": tradeoff_answers.sentences(configurations),
            "answers": tradeoff_answers.answers(configurations),
            "measured": _measured(tradeoff.conditions()),
        }
    if cases := stability.cases():
        found["stability"] = {"sentences": stability.sentences(cases)}
    return found or None


def robustness_figures() -> dict[str, bytes | None]:
    """Figures of both studies as SVG by place in the document; None where a table is missing."""
    cases = stability.cases()
    return {
        "tradeoff": tradeoff_figure(tradeoff.configurations()),
        "stability": stability_map(cases),
        "critical_step": critical_step_figure(cases),
    }


def _measured(conditions: tradeoff.Conditions | None) -> str:
    """Machine and reference in a sentence, as far as they are known."""
    if conditions is None:
        return ""
    machine = f"on {words(conditions.processor)}, " if conditions.processor else ""
    return (
        f"Measured {machine}with {conditions.repeats} repeats, against finite elements with "
        f"{count(conditions.unknowns)} unknowns, whose estimated error is "
        f"{percent(conditions.field_error)}."
    )
