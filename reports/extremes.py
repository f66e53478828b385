"""What accuracy costs and where models break, measured beforehand; none of it is of the run."""

from __future__ import annotations

from typing import Any

from reports import exchange, exchange_answers, stability
from reports.beforehand import has_lattice
from reports.digits import count, percent, words
from reports.exchange_figure import exchange_figure
from reports.stability_map import critical_step_figure, stability_map
from study.results.folder import Results


def extremes(results: Results) -> dict[str, Any] | None:
    """Both studies as text, None for a scene without a lattice or where no table was delivered.

    A study whose table is missing is left out.
    """
    if not has_lattice(results):
        return None
    found: dict[str, Any] = {}
    if configurations := exchange.configurations():
        found["exchange"] = {
            "sentences": exchange_answers.sentences(configurations),
            "answers": exchange_answers.answers(configurations),
            "measured": _measured(exchange.record()),
        }
    if cases := stability.cases():
        found["stability"] = {"sentences": stability.sentences(cases)}
    return found or None


def extreme_figures(results: Results) -> dict[str, bytes]:
    """Their figures as SVG by place in the document."""
    if not has_lattice(results):
        return {}
    cases = stability.cases()
    drawn = {
        "exchange": exchange_figure(exchange.configurations()),
        "stability": stability_map(cases),
        "critical_step": critical_step_figure(cases),
    }
    return {place: svg for place, svg in drawn.items() if svg is not None}


def _measured(record: dict[str, Any]) -> str:
    """Machine and reference in a sentence, as far as they are known."""
    machine, known = record.get("machine", {}), record.get("reference", {})
    parts = []
    if machine.get("processor"):
        parts.append(f"on {words(machine['processor'])}")
    if record.get("repeats"):
        parts.append(f"in {record['repeats']} turns")
    if known.get("unknowns"):
        error = percent(known["field_error"])
        parts.append(
            f"against finite elements of {count(known['unknowns'])} unknowns, whose own "
            f"error is {error}"
        )
    return f"Measured {', '.join(parts)}." if parts else ""
