"""Comparison of several runs: which numbers differ by more than their errors."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from reports.appearance import system_name
from reports.differences import elements, field_errors, own_error
from reports.digits import DASH, PA_PER_KPA, significant, with_error
from reports.motion_figures import peak
from reports.page.answer import curve_error
from reports.ranking import tool_probe
from study.results import Results

PEAK = "field-relative-l2-peak"
HEADER = ("quantity", "model", "unit")
VERDICTS = {True: "differs", False: "within errors", None: "error not known"}


@dataclass(frozen=True)
class Measured:
    """A number of a run and its error in the same unit, None where that is not known."""

    value: float
    error: float | None

    @property
    def printed(self) -> str:
        """The number with its error, as it is printed."""
        if self.error is None:
            return f"{significant(self.value)} (± not known)"
        if self.error < 5e-4 * abs(self.value):
            return significant(self.value)
        return with_error(self.value, self.error)


@dataclass(frozen=True)
class Compared:
    """One quantity of one model in every run, None for a run without it."""

    quantity: str
    model: str
    unit: str
    values: tuple[Measured | None, ...]

    @property
    def differs(self) -> bool | None:
        """Whether the lowest and the highest are apart by more than both errors together.

        None where they are apart and an error is not known.
        """
        found = sorted((one for one in self.values if one is not None), key=lambda one: one.value)
        low, high = found[0], found[-1]
        if high.value == low.value:
            return False
        if low.error is None or high.error is None:
            return None
        return high.value - low.value > low.error + high.error


def compared(runs: Sequence[Results]) -> list[Compared]:
    """Quantities that two runs at least have, in the order of the first that has them."""
    found = [dict(_numbers(run)) for run in runs]
    keys = dict.fromkeys(key for one in found for key in one)
    rows = [Compared(*key, tuple(one.get(key) for one in found)) for key in keys]
    return [row for row in rows if sum(value is not None for value in row.values) > 1]


Key = tuple[str, str, str]


def _numbers(run: Results) -> Iterator[tuple[Key, Measured]]:
    probe, errors, own = tool_probe(run), field_errors(run), own_error(run)
    for model in run.record.models:
        if model.status != "finished":
            continue
        largest = peak(run, model.name, probe)
        if largest is not None:
            share = curve_error(model, probe)
            error = None if share is None else 1e3 * largest * share
            key = (f"largest displacement at {probe}", model.label, "mm")
            yield key, Measured(1e3 * largest, error)
        share_off = errors.get((model.name, elements(run)), {}).get(PEAK)
        if share_off is not None:
            key = ("field difference from the finite elements", model.label, "%")
            yield key, Measured(100.0 * share_off, None if own is None else 100.0 * own)
    for system, one in run.record.fuzzy.systems.items():
        key = ("estimated Young's modulus", system_name(system), "kPa")
        yield key, Measured(one.estimate_pa / PA_PER_KPA, one.quadrature_error_pa / PA_PER_KPA)


def lines(names: Sequence[str], runs: Sequence[Results], rows: Sequence[Compared]) -> list[str]:
    """The table for a terminal, those that differ first."""
    table = [[*HEADER, *names, "verdict"], *cells(rows)]
    widths = [max(len(row[i]) for row in table) for i in range(len(table[0]))]
    told = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) for row in table]
    return [*(line.rstrip() for line in told), said(names, runs, rows)]


def said(names: Sequence[str], runs: Sequence[Results], rows: Sequence[Compared]) -> str:
    """How many numbers differ, and which models have none, in sentences."""
    apart = sum(row.differs is True for row in rows)
    text = (
        f"{apart} of {len(rows)} numbers differ by more than the sum of their errors. ± is the "
        "numerical error (mesh, time steps, quadrature), without the error of the model."
    )
    lost = [
        f"{model.label} in {name} ({model.status})"
        for name, run in zip(names, runs, strict=True)
        for model in run.record.models
        if model.status != "finished"
    ]
    return f"{text} Models without results: {', '.join(lost)}." if lost else text


def cells(rows: Iterable[Compared]) -> list[list[str]]:
    """The rows as printed, those that differ first."""
    return [_cells(row) for row in sorted(rows, key=lambda r: list(VERDICTS).index(r.differs))]


def text(names: Sequence[str], rows: Iterable[Compared]) -> str:
    """The table as CSV: a value and its error by run, empty where there is none."""
    made = io.StringIO()
    writer = csv.writer(made, lineterminator="\n")
    writer.writerow([*HEADER, *(f"{n}{end}" for n in names for end in ("", " ±")), "verdict"])
    for row in rows:
        cells = [cell for one in row.values for cell in _pair(one)]
        writer.writerow([row.quantity, row.model, row.unit, *cells, VERDICTS[row.differs]])
    return made.getvalue()


def _cells(row: Compared) -> list[str]:
    values = [DASH if one is None else one.printed for one in row.values]
    return [row.quantity, row.model, row.unit, *values, VERDICTS[row.differs]]


def _pair(one: Measured | None) -> tuple[str, str]:
    if one is None:
        return "", ""
    return f"{one.value:.9g}", "" if one.error is None else f"{one.error:.3g}"


def short_names(paths: Sequence[str]) -> list[str]:
    """Names of runs by their folders, numbered where two are alike."""
    given = [path.rstrip("/").rpartition("/")[2] or path for path in paths]
    return [f"{n} ({i})" if given.count(n) > 1 else n for i, n in enumerate(given, 1)]
