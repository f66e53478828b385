"""One patient by a rule base of the user's: its outputs for one reading of each input."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.inference import Inferred, infer
from fuzzy.systems.kinds import SYSTEMS, check_kind
from fuzzy.systems.system import FuzzySystem
from study.estimation.patient import explained, interval_text
from study.estimation.request import Answer, EstimationRequest, settings_of
from study.estimation.rule_base import rule_base


def by_file(request: EstimationRequest, path: Path) -> Answer:
    """Outputs of a rule base, in its own units. ValueError for readings that do not fit it."""
    if request.figures is not None:
        raise ValueError("--figures: only of the liver's rules; leave it out with --rule-base")
    system, _ = rule_base(path, request.settings)
    x = _row(request.readings, system, path)
    kinds = tuple(request.systems) or tuple(kind for kind in SYSTEMS if _serves(system, kind))
    options = settings_of(request.settings).options
    found = {kind: infer(system, x[None], kind, options) for kind in kinds}
    if request.as_json:
        lines = [json.dumps({kind: _numbers(one) for kind, one in found.items()}, indent=1)]
    else:
        lines = [_line(kind, one) for kind, one in found.items()]
    if request.explain:
        lines += explained(request, system, x, kinds)
    notes = dict.fromkeys(note for one in found.values() for note in one.notes)
    return Answer(tuple(lines), tuple(notes))


def _row(readings: Mapping[str, float], system: FuzzySystem, path: Path) -> NDArray[np.float64]:
    """Readings (inputs,) in the order of the inputs. ValueError for one too many or too few."""
    names = [variable.name for variable in system.inputs]
    listed = f"the inputs of {path} are {', '.join(names)}"
    if not readings:
        raise ValueError(f"--rule-base: give its readings as a table, --inputs FILE.csv; {listed}")
    for name in readings:
        if name not in names:
            raise ValueError(f"--{name}: {listed}; leave it out")
    for name in names:
        if name not in readings:
            how = f"give --{name}" if name in AETIOLOGIES else "give a table, --inputs FILE.csv"
            raise ValueError(f"--rule-base: no reading of {name}; {how}; {listed}")
    return np.array([readings[name] for name in names])


def _serves(system: FuzzySystem, kind: str) -> bool:
    """Whether a rule base can be evaluated as this kind."""
    try:
        check_kind(system, kind)
    except ValueError:
        return False
    return True


def _line(kind: str, found: Inferred) -> str:
    bounds = [] if found.interval is None else [f"{bound:.6g}" for bound in found.interval[0]]
    return f"{kind:16s} {found.value[0]:9.6g}{interval_text(bounds)}"


def _numbers(found: Inferred) -> dict[str, object]:
    numbers: dict[str, object] = {
        "estimate": float(found.value[0]),
        "method": found.method,
        "notes": list(found.notes),
    }
    interval = {} if found.interval is None else {"interval": found.interval[0].tolist()}
    return numbers | interval
