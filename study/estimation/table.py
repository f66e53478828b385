"""A table of readings evaluated by the rules of the liver or of a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.stiffness import NORMAL_LIVER, PA_PER_KPA, patient_system
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.system import FuzzySystem
from study.estimation.patient import explained
from study.estimation.request import PLAUSIBLE, Answer, EstimationRequest, settings_of
from study.estimation.rule_base import rule_base
from study.system.folders import check_file

if TYPE_CHECKING:
    from fuzzy.systems.table import Blanks


def table(request: EstimationRequest, inputs: Path) -> Answer:
    """Write or explain the outputs of a table. ValueError for flags that do not fit together."""
    from fuzzy.systems.table import evaluate_table

    _check_table(request)
    system, unit = rule_base(request.rule_base, request.settings)
    options = settings_of(request.settings).options
    lines: list[str] = []
    notes: tuple[str, ...] = ()
    if request.out is not None:
        (kind,) = request.systems
        check_file(request.out)
        range_ = PLAUSIBLE if request.rule_base is None else (-np.inf, np.inf)
        blanks = _blanks(request)
        notes = evaluate_table(system, inputs, request.out, kind, options, unit, range_, blanks)
        lines.append(str(request.out))
    if request.explain:
        lines += explained(request, *_table_row(request, inputs, system), request.systems)
    return Answer(tuple(lines), notes)


def _check_table(request: EstimationRequest) -> None:
    if request.readings:
        raise ValueError(f"--{next(iter(request.readings))}: the table gives the readings")
    for flag, given in (("--json", request.as_json), ("--figures", request.figures)):
        if given:
            raise ValueError(f"{flag}: only for one patient; leave it out with --inputs")
    if request.out is None and not request.explain:
        raise ValueError("--inputs: name the table to write, --out FILE.csv")
    if len(request.systems) != 1:
        raise ValueError(f"--inputs: name one --system, of {', '.join(SYSTEMS)}")
    if request.row is not None and not request.explain:
        raise ValueError("--row: only with --explain; leave it out")


def _blanks(request: EstimationRequest) -> Blanks | None:
    """What a blank cell of the table means; None for a rule base that does not say."""
    if request.rule_base is not None:
        return None
    from fuzzy.systems.table import Blanks

    settings, normal = settings_of(request.settings), NORMAL_LIVER / PA_PER_KPA
    return Blanks(
        value=normal,
        system=lambda names: patient_system(dict.fromkeys(names, normal), settings),
        note=settings.missing.note.format(normal=normal),
    )


def _table_row(
    request: EstimationRequest, inputs: Path, system: FuzzySystem
) -> tuple[FuzzySystem, NDArray[np.float64]]:
    """The system that answers for the row to explain, and its readings."""
    from fuzzy.systems.table import read_readings

    blanks = _blanks(request)
    X = read_readings(inputs, system, blanks=blanks is not None)
    number = 1 if request.row is None else request.row
    if not 1 <= number <= len(X):
        raise ValueError(f"--row {number}: the table has rows 1 to {len(X)}")
    x = np.asarray(X[number - 1])
    if blanks is None or not np.isnan(x).any():
        return system, x
    named = (one.name for one, value in zip(system.inputs, x, strict=True) if np.isfinite(value))
    return blanks.system(tuple(named)), np.where(np.isnan(x), blanks.value, x)
