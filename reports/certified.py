"""What is certified of a superposition, in columns of its own beside what is estimated."""

from __future__ import annotations

import math
from collections.abc import Iterator

from reports.digits import DASH, Table, percent, significant, words
from study.results import Results
from study.results.records import CertifiedReduction, ModelRecord

DIGITS = 2


def certified_rows(results: Results) -> Table:
    """Bounds by model and control point: curve, length [mm], energy norm, rest; an estimate.

    The estimate is that of the error by the steps of the load, which no bound covers.
    """
    return [row for model in results.record.models for row in _rows(model)]


def _rows(model: ModelRecord) -> Iterator[list[str]]:
    found = None if model.elements is None else model.elements.certified
    if found is None:
        return
    for probe in found.displacement:
        yield [model.label, words(probe), *_bounds(found, probe), _by_step(model, probe)]


def _bounds(found: CertifiedReduction, probe: str) -> list[str]:
    shares = (found.displacement[probe], found.energy, found.rest)
    curve, energy, rest = (
        DASH if share is None else f"{_above(100.0 * share)} %" for share in shares
    )
    return [curve, _above(1e3 * found.largest_m[probe]), energy, rest]


def _by_step(model: ModelRecord, probe: str) -> str:
    error = model.time_step_errors.get(probe)
    return DASH if error is None else percent(error.displacement)


def _above(bound: float) -> str:
    """A bound with two digits, rounded up: it stays one."""
    if bound <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(bound)) - DIGITS + 1)
    return significant(math.ceil(bound / unit) * unit, DIGITS)
