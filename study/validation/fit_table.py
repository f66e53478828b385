"""A fit as lines, JSON, and a CSV file of the curve: time_s, measured, uncertainty, found, unit."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from study.system.folders import naming, write_text
from study.validation.fitting import Fit

NAME = "fit.csv"
COLUMNS = ("time_s", "measured", "uncertainty", "found", "unit")


def write(fit: Fit, path: Path) -> None:
    """Write the measured and the fitted curve; uncertainty is empty where it was not given."""
    curve = fit.curve
    spread = curve.uncertainty if curve.uncertainty is not None else np.full(len(fit.found), np.nan)
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for values in zip(curve.times, curve.values, spread, fit.found, strict=True):
        cells = ["" if math.isnan(value) else f"{value:.9g}" for value in values]
        rows.writerow([*cells, curve.unit])
    with naming(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text.getvalue())


def lines(fit: Fit) -> Iterator[str]:
    """A line per quantity, and the goodness of fit."""
    for one in fit.quantities:
        unit = f" {one.unit}" if one.unit else ""
        own = "" if math.isnan(one.numerical) else f"; the model's own error {one.numerical:.2g}"
        yield f"{one.key} = {one.value:.4g}{unit} (95 %: {one.low:.4g} to {one.high:.4g}{own})"
    size = float(np.sqrt((fit.curve.values**2).mean()))
    left = f"rms {fit.rms:.3g} {fit.curve.unit}, {100 * fit.rms / size:.2g} % of it"
    yield f"left of the curve: {left}, after {fit.runs} runs"
    yield _about_scatter(fit)


def _about_scatter(fit: Fit) -> str:
    if not fit.scatter_known:
        return "the intervals are by what is left: no uncertainty was given with the curve"
    text = f"what is left is {fit.chi:.2g} times the uncertainty given"
    return f"{text}; above 1 the intervals are widened by it" if fit.chi > 1.0 else text


def as_json(fit: Fit) -> str:
    """Quantities with their intervals, and the residual."""
    quantities = [
        {
            "key": one.key,
            "unit": one.unit,
            "value": one.value,
            "low": one.low,
            "high": one.high,
            "numerical": None if math.isnan(one.numerical) else one.numerical,
        }
        for one in fit.quantities
    ]
    record = {
        "quantities": quantities,
        "rms": fit.rms,
        "unit": fit.curve.unit,
        "scatter_known": fit.scatter_known,
        "chi": fit.chi if fit.scatter_known else None,
        "runs": fit.runs,
    }
    return json.dumps(record, indent=2, allow_nan=False)
