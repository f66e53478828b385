"""Everything that the template prints, as text; it types no number itself."""

from __future__ import annotations

from typing import Any

from reports import fuzzy_tables, summary, tables
from reports.beforehand import beforehand
from reports.differences import own_error, resolved
from reports.digits import fixed, short, words
from reports.extremes import extremes
from reports.motion_figures import shown_probes
from reports.paper import TABLE_III_SPREAD
from reports.ranking import columns, tool_probe
from reports.reference import is_built_in_liver, reference
from reports.rule_view import view_names
from reports.verification import verification
from study.results.folder import Results

SCENE_COLUMNS = 4


def document(results: Results) -> dict[str, Any]:
    """The document's text by place; a list is empty where a scene lacks the matter."""
    numbers = results.numbers
    return {
        "title": words(numbers.get("title") or "Untitled scene"),
        "running_title": short(numbers.get("title") or "Untitled scene", 80),
        "warnings": [words(text) for text in numbers["warnings"]],
        "glance": summary.glance(results),
        "summary": summary.sentences(results),
        "has_reference": any(record["name"] == "fem" for record in numbers["models"]),
        "has_own_error": own_error(results) is not None,
        "is_built_in_liver": is_built_in_liver(numbers["scene"]),
        "scene": tables.balanced(_scene(results), SCENE_COLUMNS),
        "estimates": tables.estimate_rows(results),
        "stiffness_sets": fuzzy_tables.set_rows(results),
        "unsourced_sets": [str(count) for count in fuzzy_tables.unsourced_count(results)],
        "rule_views": view_names(results),
        "sensitivity": fuzzy_tables.sensitivity_table(results),
        "estimate_notes": tables.estimate_notes(results),
        "rule_count": str(numbers.get("rule_count") or ""),
        "probes_left_out": len(numbers["probes"]) - len(shown_probes(results)),
        "has_band": bool(results.tables["bands"]),
        "similarity": tables.similarity_tables(results),
        "measure_count": len(columns(results)),
        "tool_probe": words(tool_probe(results) or ""),
        "verdicts": tables.verdict_rows(results),
        "paper": tables.paper_rows(results),
        "paper_spread": fixed(TABLE_III_SPREAD, 4),
        "formulas": tables.formula_rows(),
        "errors": tables.error_rows(results),
        "limits": _limits(results),
        "models": tables.model_rows(results),
        "numerics": tables.numerics_rows(results),
        "reference": reference(results),
        "checks": tables.check_rows(results),
        "assumptions": [words(text) for text in numbers["assumptions"]],
        "notes": [words(text) for text in numbers["notes"]],
        "provenance": tables.provenance_rows(results),
        "beforehand": beforehand(results),
        "verification": verification(results),
        "extremes": extremes(results),
    }


def _scene(results: Results) -> list[dict[str, Any]]:
    """Groups of the scene's values, and the numbers that follow from them."""
    rows = tables.dimensionless_rows(results)
    derived = [{"name": "size and dimensionless numbers", "rows": rows}] if rows else []
    return tables.scene_groups(results) + derived


def _limits(results: Results) -> dict[str, str] | None:
    """What the spring lattice cannot do, printed."""
    found = results.numbers.get("lattice_limits")
    if not found:
        return None
    error = own_error(results)
    return {
        "spacing": f"{fixed(1e3 * found['spacing_m'], 1)} mm",
        "poisson_ratio": f"{found['poisson_ratio']:g}",
        "at_quarter": resolved(found["relative_l2_at_quarter"], error),
        "whole": resolved(found["relative_l2"], error),
        "factor": fixed(found["best_factor"], 3),
        "left": resolved(found["relative_l2_at_best_factor"], error),
    }
