"""Everything that the template prints, as text; it types no number itself."""

from __future__ import annotations

from reports import budget, first_figure, fuzzy_tables, score_tables, summary, tables
from reports.alternatives import alternatives
from reports.certified import certified_rows
from reports.cut_figure import section
from reports.differences import finite_elements, own_error, resolved
from reports.digits import Group, control_point, fixed, short, symbols, words
from reports.motion_figures import shown_probes
from reports.page.answer import answer, question
from reports.paper import TABLE_I, TABLE_III_SPREAD, sources
from reports.ranking import columns, tool_probe
from reports.reference import is_built_in_liver, reference
from reports.reference_spacing import reference_spacing
from reports.rule_view import view_names
from reports.tool_force import force_rows, overlap
from study.results import Results

SCENE_COLUMNS = 4
WIDE = "msm-mamdani"
"""The model that is drawn as a wide line."""


def document(results: Results) -> dict[str, object]:
    """The document's text by place; a list is empty where a scene lacks the matter."""
    record = results.record
    title = record.title or "Untitled scene"
    return {
        "title": words(title),
        "running_title": short(title, 80),
        "warnings": [words(text) for text in record.warnings],
        "question": words(question(results)),
        "answer": _answer(results),
        "cut_reference": next(iter(cut.lengths)) if (cut := section(results)) else "",
        "first_caption": words(first_figure.caption(results)),
        "alternatives": alternatives(results),
        "glance": summary.glance(results),
        "summary": summary.sentences(results),
        "reference_spacing": reference_spacing(results),
        "has_reference": finite_elements(results) is not None,
        "has_own_error": own_error(results) is not None,
        "is_built_in_liver": is_built_in_liver(results.scene),
        "scene": tables.balanced(_scene(results), SCENE_COLUMNS),
        "estimates": tables.estimate_rows(results),
        "stiffness_sets": fuzzy_tables.set_rows(results),
        "unsourced_sets": [str(count) for count in fuzzy_tables.unsourced_count(results)],
        "rule_views": view_names(results),
        "surface_inputs": [name.upper() for name in results.scene.fuzzy.surface],
        "system_changes": fuzzy_tables.system_changes(results),
        "estimate_notes": tables.estimate_notes(results),
        "rule_count": str(record.fuzzy.rule_count or ""),
        "probes_left_out": len(record.probes) - len(shown_probes(results)),
        "has_band": bool(results.bands),
        "has_wide_line": any(one.name == WIDE for one in record.models) and len(record.models) > 1,
        "has_diverged": any(one.status == "diverged" for one in record.models),
        "tool_forces": force_rows(results),
        "tool_overlap": overlap(results),
        "similarity": tables.similarity_tables(results),
        "measure_count": len(columns(results)),
        "tool_probe": words(tool_probe(results)),
        "at_tool": control_point(tool_probe(results)),
        "leads": tables.lead_rows(results),
        "ranks": score_tables.rank_rows(results),
        "ratings": score_tables.rating_rows(results),
        "score_errors": score_tables.score_error_rows(results),
        "paper": tables.paper_rows(results),
        "paper_spread": fixed(TABLE_III_SPREAD, 4),
        "formulas": tables.formula_rows(),
        "errors": tables.error_rows(results),
        "limits": _limits(results),
        "budgets": budget.budgets(results),
        "models": tables.model_rows(results),
        "numerics": tables.numerics_rows(results),
        "corrections": tables.correction_rows(results),
        "certified": certified_rows(results),
        "reference": reference(results),
        "checks": tables.check_rows(results),
        "assumptions": [words(symbols(text)) for text in record.assumptions],
        "notes": [words(text) for text in record.notes],
        "provenance": tables.provenance_rows(results),
        "table_i": {"header": TABLE_I[0], "rows": TABLE_I[1:]},
        "sources": [words(text) for text in sources(results)],
    }


def _scene(results: Results) -> list[Group]:
    """Groups of the scene's values, and the numbers that follow from them."""
    groups, rows = tables.scene_groups(results), tables.dimensionless_rows(results)
    return [*groups, {"name": "size and dimensionless numbers", "rows": rows}] if rows else groups


def _answer(results: Results) -> dict[str, object]:
    """Which model, how wrong, how fast, what limits it; three numbers with their errors."""
    found = answer(results)
    return {
        "sentences": [words(line) for line in found.sentences],
        "numbers": [[words(one.name), one.value, one.error] for one in found.numbers],
    }


def _limits(results: Results) -> dict[str, str] | None:
    """What the spring lattice cannot do, printed."""
    found, error = results.record.lattice_limits, own_error(results)
    if found is None:
        return None
    return {
        "spacing": f"{fixed(1e3 * found.spacing_m, 1)} mm",
        "poisson_ratio": f"{found.poisson_ratio:g}",
        "at_quarter": resolved(found.relative_l2_at_quarter, error),
        "whole": resolved(found.relative_l2, error),
        "factor": fixed(found.best_factor, 3),
        "left": resolved(found.relative_l2_at_best_factor, error),
    }
