"""The stiffness of one patient by the fuzzy systems, in numbers, words and figures."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import (
    PA_PER_KPA,
    UNIT,
    StiffnessEstimate,
    estimate,
    liver_row,
    patient_system,
)
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.system import FuzzySystem
from study.estimation.request import PLAUSIBLE, Answer, EstimationRequest, settings_of
from study.system.folders import making, write_bytes


def patient(request: EstimationRequest) -> Answer:
    """The estimates of a patient. ValueError for readings or flags that cannot be answered."""
    settings = settings_of(request.settings)
    if not request.readings and settings.missing.silences:
        raise ValueError(
            "no reading is given: give one or more in kPa, such as --hcv 9.5, a table of them by "
            "--inputs, or --absent normal for a normal liver"
        )
    for name, value in request.readings.items():
        _check_plausible(value, f"--{name} {value:g}")
    readings = {name: PA_PER_KPA * value for name, value in request.readings.items()}
    found = [estimate(readings, name, settings) for name in request.systems or SYSTEMS]
    lines = [_as_json(found)] if request.as_json else [_line(one) for one in found]
    if request.explain:
        system = patient_system(readings, settings)
        lines += explained(request, system, liver_row(readings)[0], tuple(SYSTEMS))
    if request.figures is not None:
        lines += _draw(request.figures, request, readings, settings)
    notes = dict.fromkeys(note for one in found for note in one.notes)
    return Answer(tuple(lines), tuple(notes))


def _check_plausible(kpa: float, where: str) -> None:
    low, high = PLAUSIBLE
    if not low <= kpa <= high:  # true for NaN too
        raise ValueError(f"{where}: no liver has that; give kPa, {low:g} to {high:g}")


def _line(found: StiffnessEstimate) -> str:
    bounds = [f"{bound / PA_PER_KPA:.2f}" for bound in found.interval or ()]
    return f"{found.system:16s} {found.estimate / PA_PER_KPA:7.2f} {UNIT}{interval_text(bounds)}"


def interval_text(bounds: Sequence[str]) -> str:
    """The bounds of an estimate beside it; empty where there are none."""
    return f"   [{', '.join(bounds)}]" if bounds else ""


def _as_json(found: Sequence[StiffnessEstimate]) -> str:
    return json.dumps({one.system: _numbers(one) for one in found}, indent=1)


def _numbers(found: StiffnessEstimate) -> dict[str, object]:
    numbers: dict[str, object] = {
        "estimate_pa": found.estimate,
        "quadrature_error_pa": found.quadrature_error,
        "method": found.method,
        "notes": list(found.notes),
    }
    return numbers | ({"interval_pa": list(found.interval)} if found.interval else {})


def explained(
    request: EstimationRequest,
    system: FuzzySystem,
    x: NDArray[np.float64],
    kinds: Sequence[str],
) -> Iterator[str]:
    """Lines that explain the answer for a row of readings `x` (inputs,).

    Of the systems that the request names, else of all `kinds`.
    """
    from fuzzy.systems.explain import explain
    from fuzzy.systems.explanation_text import explanation_lines

    unit = UNIT if request.rule_base is None else ""
    options = settings_of(request.settings).options
    for name in request.systems or kinds:
        yield ""
        yield from explanation_lines(explain(system, x, name, options, unit), unit)


def _draw(
    folder: Path, request: EstimationRequest, readings: Mapping[str, float], settings: LiverSettings
) -> Iterator[str]:
    """Write the figures into the folder; their paths."""
    from reports.fuzzy_figures import draw_sets, draw_surfaces
    from reports.rule_view import draw_rules
    from study.models.estimates import drawings

    systems, over = request.systems or tuple(SYSTEMS), request.surface or ("hcv", "hbv")
    arrays = drawings(settings, systems, readings, over)
    found = {name: estimate(readings, name, settings).estimate for name in systems}
    pictures = {"sets": draw_sets(arrays, found), "surfaces": draw_surfaces(arrays, over)}
    pictures |= {f"rules-{name}": draw_rules(arrays, name) for name in systems}
    paths = {folder / f"{name}.svg": picture for name, picture in pictures.items()}
    with making(folder):
        for path, picture in paths.items():
            write_bytes(path, picture)
    yield from map(str, paths)
