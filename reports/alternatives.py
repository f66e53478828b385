"""Alternative texts of the figures of a report, for readers who cannot see them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from reports import budget
from reports.appearance import labels
from reports.differences import elements, field_errors
from reports.digits import percent, short, significant, words
from reports.motion_figures import peak, probe_groups
from reports.ranking import tool_probe
from reports.rule_view import view_names
from study.results import Results

MILLI = 1e3
PEAK = "field-relative-l2-peak"
FIXED = {
    "sets": "Fuzzy sets of every reading and of the stiffness, membership over kPa; their numbers "
    "are in the table of sets",
    "surfaces": "Estimated stiffness over two readings, a surface for each fuzzy system; the "
    "estimates at the scene's readings are in the table of estimates",
    "sensitivity": "Change of the estimate of each system by each open choice; the largest are "
    "named in the findings, all are in sensitivity.csv",
    "tool_force": "Force of each tool over time and over its travel; the largest are in the table "
    "that follows",
}


def alternatives(results: Results) -> dict[str, list[str]]:
    """A text for each figure by its place in the document, whether it is drawn or not."""
    at_tool, found = _peaks(results, [tool_probe(results)]), _differences(results)
    return {
        **{place: [text] for place, text in FIXED.items()},
        "scene": ["The deformed organ with its supports, tools and control points"],
        "first": [f"Displacement over time at the tool. {at_tool} {_budgets(results)}".strip()],
        "motion": [
            f"Displacement, velocity and phase plane. {_peaks(results, group)}"
            for group in probe_groups(results)
        ],
        "budget": [_budgets(results) or "Error budgets of the displacement field"],
        "cut": [f"Displacement in a cut through the tool axis, a panel per model. {found}".strip()],
        "fields": [f"Difference from the finite elements on the surface. {found}".strip()],
        "rules": [f"Rules of {name} that fire, and its output" for name in view_names(results)],
    }


def _peaks(results: Results, probes: Sequence[str]) -> str:
    finished = [model for model in results.record.models if model.status == "finished"]
    parts = []
    for probe in probes:
        found = [(one.label, peak(results, one.name, probe)) for one in finished]
        told = [f"{name} {significant(MILLI * u)} mm" for name, u in found if u is not None]
        parts.append(f"at {words(short(probe))} {', '.join(told)}")
    return f"Largest displacements: {'; '.join(parts)}." if finished else ""


def _differences(results: Results) -> str:
    named, found, reference = labels(results), field_errors(results), elements(results)
    shares: Mapping[str, float] = {
        named[model]: values[PEAK] for (model, of), values in found.items() if of == reference
    }
    told = ", ".join(f"{name} {percent(share)}" for name, share in shares.items())
    return f"Relative L2 differences of the whole field: {told}." if told else ""


def _budgets(results: Results) -> str:
    named = labels(results)
    told = [
        f"{named[one.model]} {percent(one.total)}: "
        + ", ".join(
            f"{budget.cause_name(part.cause, one.reference)} {budget.signed(part.contribution)}"
            for part in one.parts
        )
        for one in budget.by_reference(results).get("fem", [])
    ]
    return f"Error budgets: {'; '.join(told)}." if told else ""
