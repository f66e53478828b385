"""Results as the rows that the document prints."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import groupby
from typing import Any

from reports.appearance import look, reference_name, system_name
from reports.differences import field_errors, own_error, resolved
from reports.digits import (
    DASH,
    PA_PER_KPA,
    Table,
    count,
    fixed,
    percent,
    quantity,
    significant,
    words,
)
from reports.paper import TABLE_III
from reports.ranking import (
    Column,
    Verdict,
    columns,
    references,
    score_table,
    tool_probe,
    verdicts,
)
from reports.summary import status
from study.results.folder import Results
from study.similarity.score import FORMULAS

BEST = "*"
"""Marks the highest score of the fuzzy systems in a column if its lead is resolved.

The template prints it bold.
"""
MEASURE_NAMES = {
    "relative-l2": "relative L2",
    "iso-18571": "ISO 18571",
    "frechet": "Fréchet",
    "area": "area",
    "pcm": "PCM",
}
CURVE_NAMES = {"phase-plane": "phase plane"}
RESOLVED = {True: "yes", False: "not resolved", None: "not known"}
DIMENSIONLESS: dict[str, tuple[str, Callable[[float], str]]] = {
    "extent_m": ("largest extent", lambda v: f"{fixed(1e3 * v, 1)} mm"),
    "volume_m3": ("volume of the mesh", lambda v: f"{significant(1e3 * v)} L"),
    "sag_rho_g_l_over_e": ("sag under own weight, ρ g L / E", significant),
    "tool_pressure_over_e": ("mean tool pressure / E", significant),
    "tool_radius_over_spacing": ("tool radius / lattice spacing", significant),
    "tool_radius_over_element_size": ("tool radius / element size asked", significant),
}
HEADING_ROWS = 2
"""Height of a group's name in rows."""
KEY, VALUE = 20, 14
"""Characters that fit on a line of a column of the scene."""
LEFT_OUT = ("title", "renders")
FIELD_QUANTITIES = (
    "field-relative-l2-peak",
    "field-relative-l2-final",
    "field-l2-final-over-peak",
    "field-relative-l2-peak-at-best-factor",
)
ROUNDING = 1e-8
"""Share below which an error is that of floating point."""
AT_PEAK = ("field-relative-l2-peak", "field-relative-l2-peak-at-best-factor")
"""What the error of the reference's field at the peak may hide."""


def estimate_rows(results: Results) -> Table:
    """System, estimate, interval, quadrature error, relative to the reference."""
    return [_estimate_row(name, one) for name, one in results.numbers["stiffness"].items()]


def _estimate_row(name: str, one: dict[str, Any]) -> list[str]:
    interval = one.get("interval_pa")
    bounds = [fixed(bound / PA_PER_KPA, 2) for bound in interval or ()]
    return [
        system_name(name),
        fixed(one["estimate_pa"] / PA_PER_KPA, 2),
        " to ".join(bounds) or DASH,
        significant(one["quadrature_error_pa"] / PA_PER_KPA, 1),
        fixed(one["relative_to_reference"], 3),
    ]


def estimate_notes(results: Results) -> list[str]:
    """What the fuzzy systems say of the readings, each once."""
    notes = [note for one in results.numbers["stiffness"].values() for note in one["notes"]]
    return [words(note) for note in dict.fromkeys(notes)]


def scene_groups(results: Results) -> list[dict[str, Any]]:
    """Tables of the resolved scene: name, and rows of key and value."""
    scene = results.numbers["scene"]
    whole = [[key, words(_value(v))] for key, v in scene.items() if _is_value(v)]
    groups = [{"name": "scene", "rows": [row for row in whole if row[0] not in LEFT_OUT]}]
    for name, table in scene.items():
        if isinstance(table, dict) and table:
            rows = [[words(key), words(value)] for key, value in _flat(table)]
            groups.append({"name": name, "rows": rows})
    return [{**group, "name": words(str(group["name"]).replace("_", " "))} for group in groups]


def balanced(groups: list[dict[str, Any]], count: int) -> list[list[dict[str, Any]]]:
    """Groups in order in so many columns, the tallest of which is as low as can be."""
    whole = sum(_height(group) for group in groups)
    limits = range(max(map(_height, groups), default=0), whole + 1)
    columns = next(c for limit in limits if len(c := _filled(groups, limit)) <= count)
    return columns + [[]] * (count - len(columns))


def _filled(groups: list[dict[str, Any]], limit: int) -> list[list[dict[str, Any]]]:
    """Columns of groups up to a height, one after the other."""
    columns: list[list[dict[str, Any]]] = []
    left = 0
    for group in groups:
        if _height(group) > left:
            columns.append([])
            left = limit
        columns[-1].append(group)
        left -= _height(group)
    return columns


def _height(group: dict[str, Any]) -> int:
    """Lines that a group takes, about."""
    rows = (max(-(-len(key) // KEY), -(-len(value) // VALUE)) for key, value in group["rows"])
    return HEADING_ROWS + sum(rows)


def _is_value(value: Any) -> bool:
    return value is not None and not isinstance(value, dict)


def _flat(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        elif value is not None:
            yield f"{prefix}{key}", _value(value)


def _value(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_value(entry) for entry in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return quantity(value) if isinstance(value, str) else f"{value:.6g}"


def dimensionless_rows(results: Results) -> Table:
    """Label and value of the numbers that show a mistaken unit."""
    found = results.numbers.get("dimensionless", {})
    return [
        [label, show(found[key])] for key, (label, show) in DIMENSIONLESS.items() if key in found
    ]


def similarity_tables(results: Results) -> list[dict[str, Any]]:
    """One table per reference: curves and measures as header, rows grouped by control point."""
    heads = columns(results)
    curves = [[CURVE_NAMES.get(c, c), len(list(g))] for c, g in groupby(heads, lambda h: h[0])]
    return [
        {
            "reference": reference_name(reference),
            "curves": [{"name": name, "count": count} for name, count in curves],
            "measures": [MEASURE_NAMES.get(measure, measure) for _, measure in heads],
            "groups": list(_score_groups(results, reference, heads)),
        }
        for reference in references(results)
    ]


def _score_groups(
    results: Results, reference: str, heads: list[Column]
) -> Iterator[dict[str, Any]]:
    """Scores by control point; a highest one bears a mark where its lead is resolved."""
    for probe in results.numbers["probes"]:
        scores = score_table(results, reference, probe)
        found = verdicts(results, reference, probe)
        winners = {(v.best, v.column) for v in found if v.is_resolved}
        rows = [
            [look(model).label, *(_score(row.get(h), is_best=(model, h) in winners) for h in heads)]
            for model, row in scores.items()
        ]
        if rows:
            yield {"probe": words(probe), "rows": rows}


def _score(value: float | None, *, is_best: bool) -> str:
    return DASH if value is None else fixed(value, 4) + (BEST if is_best else "")


def verdict_rows(results: Results) -> Table:
    """Reference, curve, measure, best, runner-up, lead, numerical error, whether resolved."""
    probe = tool_probe(results)
    return [
        _verdict_row(verdict)
        for reference in (references(results) if probe else ())
        for verdict in verdicts(results, reference, str(probe))
    ]


def _verdict_row(verdict: Verdict) -> list[str]:
    curve, measure = verdict.column
    error = DASH if verdict.error is None else _tiny_too(verdict.error)
    return [
        look(verdict.reference).label,
        CURVE_NAMES.get(curve, curve),
        MEASURE_NAMES.get(measure, measure),
        look(verdict.best).label,
        look(verdict.runner_up).label,
        fixed(verdict.lead, 4),
        error if verdict.is_whole or verdict.error is None else f"≥ {error}",
        RESOLVED[verdict.is_resolved],
    ]


def _tiny_too(value: float) -> str:
    return fixed(value, 4) if value >= 0.5e-4 else significant(value, 1)


def paper_rows(results: Results) -> Table:
    """The paper's Table III beside this run's lowest and highest score against the benchmark."""
    probe = tool_probe(results)
    scores = score_table(results, "basafa", probe) if probe else {}
    rows = []
    for system, printed in TABLE_III.items():
        ours = list(scores.get(f"msm-{system}", {}).values())
        span = f"{fixed(min(ours), 4)} to {fixed(max(ours), 4)}" if ours else DASH
        rows.append([f"Benchmark – {system_name(system)}", fixed(printed, 4), span])
    return rows


def formula_rows() -> Table:
    """Measure, its formula as typst mathematics, and what its symbols mean."""
    return [_formula_row(name, text) for name, text in FORMULAS.items()]


def _formula_row(name: str, text: str) -> list[str]:
    formula, _, meaning = text.partition(";")
    quoted = re.sub(r"[a-z]{2,}", lambda w: w[0] if w[0] == "max" else f'"{w[0]}"', formula)
    return [MEASURE_NAMES.get(name, name), quoted, meaning.strip().replace("||", "‖")]


def error_rows(results: Results) -> Table:
    """Reference, model, field differences and best factor."""
    return [
        [
            look(reference).label,
            look(model).label,
            *_differences(values, own_error(results, reference)),
            fixed(values["field-best-factor-peak"], 3),
        ]
        for (model, reference), values in field_errors(results).items()
    ]


def _differences(values: dict[str, float], error: float | None) -> Iterator[str]:
    for name in FIELD_QUANTITIES:
        yield resolved(values[name], error if name in AT_PEAK else None)


def model_rows(results: Results) -> Table:
    """Size, steps and cost of each model."""
    return [_model_row(record) for record in results.numbers["models"]]


def _model_row(record: dict[str, Any]) -> list[str]:
    parts = record.get("elements", record.get("springs"))
    step, critical = record.get("time_step_s"), record.get("critical_time_step_s")
    wall, simulated = record.get("wall_s"), record["simulated_s"]
    return [
        look(record["name"]).label,
        _integer(record.get("nodes")),
        _integer(parts),
        DASH if step is None else significant(1e3 * step),
        DASH if critical is None else significant(1e3 * critical),
        DASH if not step or not critical else fixed(step / critical, 2),
        _integer(record.get("steps")),
        DASH if wall is None else significant(wall, 2),
        significant(simulated),
        DASH if not wall else significant(simulated / wall, 2),
        status(record),
    ]


def _integer(number: int | None) -> str:
    return DASH if number is None else count(number)


def numerics_rows(results: Results) -> Table:
    """Estimated errors of each model by time step and mesh, its strain, its inverted cells."""
    rows = [_numerics_row(record) for record in results.numbers["models"]]
    return [row for row in rows if any(cell != DASH for cell in row[1:])]


def _numerics_row(record: dict[str, Any]) -> list[str]:
    mesh = record.get("mesh_error") or {}
    shares = [record.get("time_step_error"), record.get("time_step_error_velocity")]
    shares += [mesh.get(name) for name in ("displacement", "velocity", "field_peak")]
    shares.append(record.get("largest_strain", record.get("largest_spring_strain")))
    cells = [DASH if share is None else _share(share) for share in shares]
    return [look(record["name"]).label, *cells, _integer(record.get("inverted_cells"))]


def _share(share: float) -> str:
    return percent(share) if share == 0.0 or share >= ROUNDING else f"< {percent(ROUNDING)}"


def check_rows(results: Results) -> Table:
    """Name, value, limit, meaning and outcome of each check."""
    return [
        [
            check["name"],
            significant(check["value"], 2),
            significant(check["limit"], 2),
            check["meaning"],
            "passed" if check["passed"] else "FAILED",
        ]
        for check in results.numbers["checks"]
    ]


def provenance_rows(results: Results) -> Table:
    """Versions, commit, platform, hashes and time taken."""
    found = results.numbers["provenance"]
    versions = ", ".join(f"{name} {v}" for name, v in found["versions"].items() if v)
    rows = [["versions", versions]]
    for key in ("commit", "platform", "processor", "seed", "scene_sha256", "mesh_sha256"):
        value = found.get(key)
        rows.append([key.replace("_", " "), DASH if value is None else words(str(value))])
    wall = results.numbers.get("study_wall_s")
    return [*rows, ["whole study", DASH if wall is None else f"{significant(wall)} s"]]
