"""Results as the rows that the document prints."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from itertools import groupby
from operator import itemgetter

from reports.appearance import labels, reference_name, system_name
from reports.differences import field_errors, own_error, resolved
from reports.digits import (
    DASH,
    PA_PER_KPA,
    Group,
    Table,
    control_point,
    count,
    fixed,
    percent,
    quantity,
    significant,
    spread,
    words,
)
from reports.paper import TABLE_III
from reports.ranking import (
    Column,
    Lead,
    columns,
    leads,
    references,
    score_table,
    tool_probe,
)
from reports.score_digits import printed_score, score_decimals
from reports.summary import printed_margin, real_time_factor, status
from study.results import Results
from study.results.records import CorrectionRecord, CurveErrors, ModelRecord, SystemEstimate
from study.scene.file import resolved as resolved_scene
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
LEFT_OUT = ("title", "renders", "remarks")
"""Keys of the scene that its table leaves out: remarks are among the notes."""
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
    """Estimates of the fuzzy systems with interval and quadrature error, beside the reference."""
    return [_estimate_row(name, one) for name, one in results.record.fuzzy.systems.items()]


def _estimate_row(name: str, one: SystemEstimate) -> list[str]:
    bounds = [fixed(bound / PA_PER_KPA, 2) for bound in one.interval_pa or ()]
    return [
        system_name(name),
        fixed(one.estimate_pa / PA_PER_KPA, 2),
        " to ".join(bounds) or DASH,
        significant(one.quadrature_error_pa / PA_PER_KPA, 1),
        fixed(one.relative_to_reference, 3),
    ]


def estimate_notes(results: Results) -> list[str]:
    """What the fuzzy systems say of the readings, each once."""
    notes = [note for one in results.record.fuzzy.systems.values() for note in one.notes]
    return [words(note) for note in dict.fromkeys(notes)]


def scene_groups(results: Results) -> list[Group]:
    """Tables of the resolved scene: name, and rows of key and value."""
    scene = dict(_numbered(resolved_scene(results.scene)))
    whole = {key: v for key, v in scene.items() if not isinstance(v, dict) and key not in LEFT_OUT}
    tables = {"scene": whole} | {key: v for key, v in scene.items() if isinstance(v, dict) and v}
    return [
        {
            "name": words(name.replace("_", " ")),
            "rows": [[words(key), words(value)] for key, value in _flat(table)],
        }
        for name, table in tables.items()
    ]


def _numbered(table: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """Each of several tables on its own, with its number behind the name."""
    for key, value in table.items():
        if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
            yield from ((f"{key} {number}", one) for number, one in enumerate(value, 1))
        else:
            yield key, value


def balanced(groups: list[Group], count: int) -> list[list[Group]]:
    """Groups of rows in order in so many columns, the tallest of which is as low as can be."""
    whole = sum(_height(group) for group in groups)
    limits = range(max(map(_height, groups), default=0), whole + 1)
    columns = next(c for limit in limits if len(c := _filled(groups, limit)) <= count)
    return columns + [[]] * (count - len(columns))


def _filled(groups: list[Group], limit: int) -> list[list[Group]]:
    """Columns of groups up to a height, one after the other."""
    columns: list[list[Group]] = []
    left = 0
    for group in groups:
        if _height(group) > left:
            columns.append([])
            left = limit
        columns[-1].append(group)
        left -= _height(group)
    return columns


def _height(group: Group) -> int:
    """Lines that a group takes, about."""
    rows = (max(-(-len(key) // KEY), -(-len(value) // VALUE)) for key, value in group["rows"])
    return HEADING_ROWS + sum(rows)


def _flat(table: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in _numbered(table):
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", _value(value)


def _value(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(_value(entry) for entry in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return quantity(value) if isinstance(value, str) else f"{value:.6g}"


def dimensionless_rows(results: Results) -> Table:
    """Labels and values of the numbers that show a mistaken unit."""
    found = results.record.dimensionless
    if found is None:
        return []
    return [[label, show(getattr(found, key))] for key, (label, show) in DIMENSIONLESS.items()]


def similarity_tables(results: Results) -> list[dict[str, object]]:
    """Similarity tables, one per reference: curves and measures over rows by control point."""
    heads = columns(results)
    curves = [(CURVE_NAMES.get(c, c), len(list(g))) for c, g in groupby(heads, itemgetter(0))]
    return [
        {
            "reference": reference_name(results, reference),
            "curves": [{"name": name, "count": count} for name, count in curves],
            "measures": [MEASURE_NAMES.get(measure, measure) for _, measure in heads],
            "groups": list(_score_groups(results, reference, heads)),
        }
        for reference in references(results)
    ]


def _score_groups(
    results: Results, reference: str, heads: list[Column]
) -> Iterator[dict[str, object]]:
    """Scores by control point; a highest one bears a mark where its lead is resolved."""
    named, places = labels(results), score_decimals(results)
    for probe in results.record.probes:
        scores = score_table(results, reference, probe)
        found = leads(results, reference, probe)
        winners = {(lead.best, lead.column) for lead in found if lead.is_resolved}
        rows = [
            [
                named[model],
                *(
                    DASH
                    if (value := row.get(head)) is None
                    else printed_score(value, places, (model, reference, probe, *head))
                    + (BEST if (model, head) in winners else "")
                    for head in heads
                ),
            ]
            for model, row in scores.items()
        ]
        if rows:
            yield {"name": words(probe), "title": control_point(probe), "rows": rows}


def lead_rows(results: Results) -> Table:
    """Leads at the tool: reference, measure, best, next, margin, its errors, whether resolved."""
    probe, named = tool_probe(results), labels(results)
    return [
        _lead_row(lead, named)
        for reference in references(results)
        for lead in leads(results, reference, probe)
    ]


def _lead_row(lead: Lead, named: dict[str, str]) -> list[str]:
    curve, measure = lead.column
    error = DASH if lead.error is None else tiny_too(lead.error)
    return [
        named[lead.reference],
        CURVE_NAMES.get(curve, curve),
        MEASURE_NAMES.get(measure, measure),
        named[lead.best],
        named[lead.runner_up],
        printed_margin(lead),
        f"± {tiny_too(max(lead.high - lead.margin, lead.margin - lead.low))}",
        tiny_too(lead.resampled),
        error if lead.is_whole or lead.error is None else f"≥ {error}",
        RESOLVED[lead.is_resolved],
    ]


def tiny_too(value: float) -> str:
    """A number to four decimals, or to one digit where those are nought."""
    return fixed(value, 4) if value >= 0.5e-4 else significant(value, 1)


def paper_rows(results: Results) -> Table:
    """The paper's Table III beside this run's lowest and highest score against the benchmark."""
    probe, places = tool_probe(results), score_decimals(results)
    scores = score_table(results, "basafa", probe)
    names = {model.system: model.name for model in results.record.models if model.system}
    rows = []
    for system, printed in TABLE_III.items():
        name = names.get(system, "")
        ours = sorted((value, head) for head, value in scores.get(name, {}).items())
        ends = (
            [
                printed_score(value, places, (name, "basafa", probe, *head))
                for value, head in (ours[0], ours[-1])
            ]
            if ours
            else []
        )
        rows.append(
            [
                f"Benchmark – {system_name(system)}",
                fixed(printed, 4),
                spread(ends) if ends else DASH,
            ]
        )
    return rows


def formula_rows() -> Table:
    """Measures of similarity, their formulas as typst mathematics, and what the symbols mean."""
    return [_formula_row(name, text) for name, text in FORMULAS.items()]


def _formula_row(name: str, text: str) -> list[str]:
    formula, _, meaning = text.partition(";")
    quoted = re.sub(r"[a-z]{2,}", lambda w: w[0] if w[0] == "max" else f'"{w[0]}"', formula)
    return [MEASURE_NAMES.get(name, name), quoted, meaning.strip().replace("||", "‖")]


def error_rows(results: Results) -> Table:
    """Field differences and best scale factor of each model from each reference."""
    named = labels(results)
    return [
        [
            named[reference],
            named[model],
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
    return [_model_row(model) for model in results.record.models]


def _model_row(model: ModelRecord) -> list[str]:
    step, critical = model.time_step_s, model.critical_time_step_s
    return [
        model.label,
        _integer(model.nodes),
        _integer(model.parts),
        DASH if step is None else significant(1e3 * step),
        DASH if critical is None else significant(1e3 * critical),
        DASH if not step or not critical else fixed(step / critical, 2),
        _integer(model.steps),
        DASH if model.wall_s is None else significant(model.wall_s, 2),
        significant(model.simulated_s),
        real_time_factor(model),
        status(model),
    ]


def _integer(number: int | None) -> str:
    return DASH if number is None else count(number)


def numerics_rows(results: Results) -> Table:
    """Estimated errors of each model by time step and mesh, its strain, its inverted cells."""
    rows = [_numerics_row(model) for model in results.record.models]
    return [row for row in rows if any(cell != DASH for cell in row[1:])]


def _numerics_row(model: ModelRecord) -> list[str]:
    mesh, lattice = model.mesh_error, model.lattice
    whole = [None if mesh is None else mesh.field_peak, model.largest_strain]
    shares = [*_both(model.time_step_error), *_both(None if mesh is None else mesh.worst), *whole]
    cells = [DASH if share is None else _share(share) for share in shares]
    return [model.label, *cells, _integer(None if lattice is None else lattice.inverted_cells)]


def _both(errors: CurveErrors | None) -> list[float | None]:
    return [None, None] if errors is None else [errors.displacement, errors.velocity]


def _share(share: float) -> str:
    return percent(share) if share == 0.0 or share >= ROUNDING else f"< {percent(ROUNDING)}"


def correction_rows(results: Results) -> Table:
    """What the lattices of corrected ones add, and each estimated error apart, by control point."""
    return [
        row
        for model in results.record.models
        if model.correction is not None
        for row in _corrections(model, model.correction, results.record.probes)
    ]


def _corrections(
    model: ModelRecord, found: CorrectionRecord, probes: tuple[str, ...]
) -> Iterator[list[str]]:
    mesh = {} if model.mesh_error is None else model.mesh_error.by_probe
    vectors = None if model.elements is None else model.elements.truncation_error
    by_probe = (found.remainder, found.remainder_errors, mesh, model.time_step_errors)
    for probe in probes:
        added, spacing, by_mesh, steps = (
            None if (one := errors.get(probe)) is None else one.displacement for errors in by_probe
        )
        parts = (added, spacing, by_mesh, vectors, found.truncation_error, steps)
        yield [model.label, words(probe), *(DASH if one is None else _share(one) for one in parts)]


def check_rows(results: Results) -> Table:
    """Checks of the study on itself: name, value, limit, meaning and outcome."""
    named = labels(results)
    return [
        [
            _check_name(check.name, named),
            significant(check.value, 2),
            significant(check.limit, 2),
            check.meaning,
            "passed" if check.passed else "FAILED",
        ]
        for check in results.record.checks
    ]


def _check_name(name: str, named: Mapping[str, str]) -> str:
    """Name of a check with the label of its model, which is its first part."""
    model, colon, what = name.partition(": ")
    return f"{named.get(model, model)}{colon}{what}"


def provenance_rows(results: Results) -> Table:
    """Provenance of the results: versions, commit, platform, hashes and time taken."""
    found, wall = results.record.provenance, results.record.study_wall_s
    versions = ", ".join(f"{name} {v}" for name, v in found.versions.items() if v)
    rows = [["versions", versions]]
    keys = ["commit", "platform", "processor", "seed", "scene_sha256", "mesh_sha256"]
    keys += ["rule_base_sha256"] if found.rule_base_sha256 else []
    keys += ["tissue_sha256"] if found.tissue_sha256 else []
    for key in keys:
        value = getattr(found, key)
        rows.append([key.replace("_", " "), DASH if value is None else words(str(value))])
    rows.append(["whole study", DASH if wall is None else f"{significant(wall)} s"])
    return [*rows, *_stage_rows(results)]


def _stage_rows(results: Results) -> Table:
    """How the stages ran, and which were kept from an earlier run, with when they were timed."""
    record = results.record
    kept = [
        f"{one.name} ({significant(one.wall_s, 2)} s, {one.measured_at})"
        for one in record.stages
        if one.kept
    ]
    rows = [["processes side by side", str(record.workers)]] if record.stages else []
    return [*rows, *([["stages kept", ", ".join(kept)]] if kept else [])]
