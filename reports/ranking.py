"""Which fuzzy system scored highest, by how much, and whether the numerics resolve it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from reports.appearance import system_of
from study.results.folder import Results

Column = tuple[str, str]


@dataclass(frozen=True)
class Verdict:
    """The two best fuzzy systems of one reference, probe and measure.

    `error` is the sum of the relative numerical errors of the three curves compared, at the probe
    where they are known there; `is_whole` says whether the reference's discretisation error is in
    it.
    """

    reference: str
    column: Column
    best: str
    runner_up: str
    score: float
    lead: float
    error: float | None
    is_whole: bool

    @property
    def is_resolved(self) -> bool | None:
        """Whether the lead exceeds the numerical error; None if that is not fully known."""
        if self.error is not None and self.lead <= self.error:
            return False
        return True if self.is_whole and self.error is not None else None


def references(results: Results) -> list[str]:
    """References that something was scored against, in order of appearance."""
    return list(dict.fromkeys(str(row[1]) for row in results.tables["similarity"]))


def columns(results: Results) -> list[Column]:
    """Curve and measure of each score, in order of appearance."""
    return list(dict.fromkeys((str(r[3]), str(r[4])) for r in results.tables["similarity"]))


def score_table(results: Results, reference: str, probe: str) -> dict[str, dict[Column, float]]:
    """Scores against a reference at a probe, by model and column."""
    table: dict[str, dict[Column, float]] = {}
    for model, against, where, curve, measure, value in results.tables["similarity"]:
        if against == reference and str(where) == probe:
            table.setdefault(str(model), {})[str(curve), str(measure)] = float(value)
    return table


def tool_probe(results: Results) -> str | None:
    """Control point nearest to where the tool touches, or the first one."""
    probes: list[str] = results.numbers["probes"]
    fields = results.arrays.get("fields")
    if not probes or fields is None or len(fields["probes"]) != len(probes):
        return probes[0] if probes else None
    distances = np.linalg.norm(fields["probes"] - fields["tool"][0], axis=1)
    return probes[int(np.argmin(distances))]


def verdicts(results: Results, reference: str, probe: str) -> Iterator[Verdict]:
    """One verdict per measure that scored at least two fuzzy systems."""
    table = score_table(results, reference, probe)
    records = {record["name"]: record for record in results.numbers["models"]}
    for column in columns(results):
        scored = [(row[column], model) for model, row in table.items() if column in row]
        ranked = sorted((pair for pair in scored if system_of(pair[1])), reverse=True)
        if len(ranked) < 2:
            continue
        (score, best), (second, runner_up) = ranked[:2]
        compared = [records.get(model, {}) for model in (reference, best, runner_up)]
        parts = [_step_error(record, probe, column[0]) for record in compared]
        parts.append(_mesh_error(compared[0], probe, column[0]))
        parts.append(compared[0].get("truncation_error") or 0.0)  # none without a subspace
        known = [part for part in parts if part is not None]
        yield Verdict(
            reference=reference,
            column=column,
            best=best,
            runner_up=runner_up,
            score=score,
            lead=score - second,
            error=sum(known) if known else None,
            is_whole=len(known) == len(parts),
        )


def _step_error(record: dict[str, Any], probe: str, curve: str) -> float | None:
    """Relative L2 error of a model's curve by the time step, at the probe if it is known there."""
    there = record.get("time_step_error_by_probe", {}).get(probe)
    if there:
        return _of_curve(curve, there)
    displacement = record.get("time_step_error")
    if displacement is None:
        return None
    velocity = record.get("time_step_error_velocity", displacement)
    return _of_curve(curve, {"displacement": displacement, "velocity": velocity})


def _mesh_error(record: dict[str, Any], probe: str, curve: str) -> float | None:
    """That by the mesh; a spring lattice is a model at its spacing and has none."""
    if record and "elements" not in record:
        return 0.0
    found = record.get("mesh_error_by_probe", {}).get(probe) or record.get("mesh_error")
    return _of_curve(curve, found) if found else None


def _of_curve(curve: str, errors: dict[str, float]) -> float:
    """A loop of the phase plane has the larger of its two."""
    if curve == "phase-plane":
        return max(errors["displacement"], errors["velocity"])
    return errors[curve]
