"""Elastography data of the fuzzy sets, from `fuzzy/liver/data`; all in kPa."""

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal, cast

Severity = Literal["mild", "moderate", "severe"]

OUTPUT = "stiffness"
SEVERITIES: tuple[Severity, ...] = ("mild", "moderate", "severe")
"""Names of the output sets, in ascending order."""

PLACEMENTS: dict[str, str] = {
    "stage-mean": " for want of means; the others are means of patients at the stage (sporea2010)",
    "cut-off": "",
}
"""Placements of the centres, with a note on cut-offs where one is chosen."""

STAGES = {2: ("F2", "F4"), 3: ("F2", "F3", "F4"), 4: ("F1", "F2", "F3", "F4")}
"""METAVIR stages of the sets of an input, by number of sets."""


@dataclass(frozen=True)
class SetRecord:
    """Data of one fuzzy set, in kPa or relative to the centre, each with its source.

    `centre`: mean stiffness of patients at the stage, or the cut-off that diagnoses it, as
    `placement` says. `within_stage_sd`: spread between patients of one stage; its kind is
    `published`, `pooled` from published groups, or `ratio`: SD/mean of the stage in HBV and HCV
    times the centre. `between_study`, `between_operator`: relative SD of the centre between
    studies and relative half-difference between two operators, `published` for this disease or
    `transferred` from the one that has it.

    `sourced` rates centre and within-stage spread. `yes`: both published for this disease and
    stage, or pooled from such; `partly`: the centre is, the spread is a ratio; `weak`: the centre
    is published for another purpose than this stage; `no`: nothing was found, the centre lies
    between its neighbours.
    """

    aetiology: str
    stage: str
    severity: Severity
    placement: str
    centre: float
    centre_source: str
    within_stage_sd: float
    sd_kind: str
    sd_source: str
    between_study: float
    between_study_kind: str
    between_study_source: str
    between_operator: float
    between_operator_kind: str
    between_operator_source: str
    n: int | None
    sourced: str
    note: str


def rows(file: str) -> list[dict[str, str]]:
    """Rows of one table of `fuzzy/liver/data`, as text."""
    text = (files("fuzzy.liver") / "data" / file).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


@cache
def elastography() -> tuple[SetRecord, ...]:
    """One record per variable, stage and placement, lowest stage of a variable first."""
    return tuple(_record(row) for row in rows("elastography.csv"))


def _record(row: dict[str, str]) -> SetRecord:
    return SetRecord(
        aetiology=row["aetiology"],
        stage=row["stage"],
        severity=cast("Severity", row["severity"]),
        placement=row["placement"],
        centre=float(row["centre_kpa"]),
        centre_source=row["centre_source"],
        within_stage_sd=float(row["within_stage_sd_kpa"]),
        sd_kind=row["sd_kind"],
        sd_source=row["sd_source"],
        between_study=float(row["between_study"]),
        between_study_kind=row["between_study_kind"],
        between_study_source=row["between_study_source"],
        between_operator=float(row["between_operator"]),
        between_operator_kind=row["between_operator_kind"],
        between_operator_source=row["between_operator_source"],
        n=int(row["n"]) if row["n"] else None,
        sourced=row["sourced"],
        note=row["note"],
    )


def input_records(aetiology: str, count: int, placement: str) -> tuple[SetRecord, ...]:
    """Records of an aetiology with `count` sets, mildest first.

    An aetiology without any stage mean (ALD, CLD, NAFLD) takes its cut-offs for both placements.
    ValueError if the data have no such sets.
    """
    known = [record for record in elastography() if record.aetiology == aetiology]
    placed = {r.stage: r for r in known if r.placement == placement} or {r.stage: r for r in known}
    wanted = STAGES.get(count, ())
    missing = [stage for stage in wanted if stage not in placed]
    if not wanted or missing:
        lacking = f"no {placement} is known for {', '.join(missing)}; " if missing else ""
        raise ValueError(
            f"{aetiology} with {count} sets: {lacking}the data have {', '.join(placed)} of "
            f"{aetiology} for placement {placement}; choose another reading or placement"
        )
    return tuple(placed[stage] for stage in wanted)


def output_records() -> tuple[SetRecord, ...]:
    """Records of the output sets, mild to severe; the same for both placements."""
    return tuple(record for record in elastography() if record.aetiology == OUTPUT)


@cache
def parameters() -> dict[str, float]:
    """Universe limits [kPa], normal liver [kPa] and plausible range [kPa]."""
    return {row["name"]: float(row["value"]) for row in rows("parameters.csv")}
