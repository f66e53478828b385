"""Which fuzzy system scored highest, by how much, and whether the numerics resolve it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from study.results.folder import Results
from study.results.records import CurveErrors, ModelRecord

Column = tuple[str, str]


@dataclass(frozen=True)
class Lead:
    """Lead of the best fuzzy-tuned model over the next, for one reference, probe and measure.

    `margin`: difference of their scores. `error` is the sum of the relative numerical errors of
    the three curves compared, at the probe; `is_whole` says whether all of them are known.
    """

    reference: str
    column: Column
    best: str
    runner_up: str
    margin: float
    error: float | None
    is_whole: bool

    @property
    def is_resolved(self) -> bool | None:
        """Whether the margin exceeds the numerical error; None if that is not fully known."""
        if self.error is not None and self.margin <= self.error:
            return False
        return True if self.is_whole and self.error is not None else None


def references(results: Results) -> list[str]:
    """References that something was scored against, in order of appearance."""
    return list(dict.fromkeys(row.reference for row in results.scores))


def columns(results: Results) -> list[Column]:
    """Columns of the scores, curve and measure, in order of appearance."""
    return list(dict.fromkeys((row.curve, row.measure) for row in results.scores))


def score_table(results: Results, reference: str, probe: str) -> dict[str, dict[Column, float]]:
    """Scores against a reference at a probe, by model and column."""
    table: dict[str, dict[Column, float]] = {}
    for row in results.scores:
        if row.reference == reference and row.probe == probe:
            table.setdefault(row.model, {})[row.curve, row.measure] = row.score
    return table


def tool_probe(results: Results) -> str:
    """Control point nearest to where the tool touches, or the first one."""
    probes, fields = results.record.probes, results.fields
    if len(fields.get("probes", ())) != len(probes):
        return probes[0]
    distances = np.linalg.norm(fields["probes"] - fields["tool"][0], axis=1)
    return probes[int(np.argmin(distances))]


def leads(results: Results, reference: str, probe: str) -> Iterator[Lead]:
    """One lead per measure that scored at least two fuzzy-tuned models."""
    table = score_table(results, reference, probe)
    records = {model.name: model for model in results.record.models}
    tuned = {name: row for name, row in table.items() if records[name].system is not None}
    for column in columns(results):
        scored = [(row[column], model) for model, row in tuned.items() if column in row]
        if len(scored) < 2:
            continue
        (score, best), (second, runner_up) = sorted(scored, reverse=True)[:2]
        compared = [records[model] for model in (reference, best, runner_up)]
        parts = _numerical_errors(compared, probe, column[0])
        known = [part for part in parts if part is not None]
        yield Lead(
            reference=reference,
            column=column,
            best=best,
            runner_up=runner_up,
            margin=score - second,
            error=sum(known) if known else None,
            is_whole=len(known) == len(parts),
        )


def _numerical_errors(compared: list[ModelRecord], probe: str, curve: str) -> list[float | None]:
    """Relative L2 errors by the time steps, and by mesh and subspace of the first, the reference.

    A spring lattice is a model at its spacing and has none by its mesh.
    """
    steps = [_of_curve(curve, model.time_step_errors.get(probe)) for model in compared]
    elements = compared[0].elements
    if elements is None:
        return steps
    mesh = elements.mesh_error
    by_mesh = None if mesh is None else _of_curve(curve, mesh.by_probe.get(probe))
    return [*steps, by_mesh, elements.truncation_error or 0.0]


def _of_curve(curve: str, errors: CurveErrors | None) -> float | None:
    """A loop of the phase plane has the larger of its two."""
    if errors is None:
        return None
    found = {"displacement": errors.displacement, "velocity": errors.velocity}
    return found.get(curve, max(found.values()))
