"""The table of unknowns: their ranges and sources."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

from study.robustness.unknowns import Unknown


def write_ranges(path: Path, unknowns: Iterable[Unknown]) -> None:
    """Write a row per unknown: its name, range and meaning."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(("unknown", "range", "meaning"))
        table.writerows((one.name, one.extent, one.why) for one in unknowns)
