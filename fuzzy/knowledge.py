"""The elastography knowledge behind the fuzzy sets, read from `fuzzy/data`; everything in kPa."""

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True)
class SetRecord:
    """Centre and standard deviation [kPa] of one fuzzy set, and where they come from."""

    variable: str
    name: str
    centre: float
    sd: float
    centre_kind: str
    sd_kind: str
    source: str


def rows(file: str) -> list[dict[str, str]]:
    """Rows of one table of `fuzzy/data`, as text."""
    text = (files("fuzzy") / "data" / file).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


@cache
def elastography() -> tuple[SetRecord, ...]:
    """One record per fuzzy set, lowest set of a variable first."""
    return tuple(
        SetRecord(
            variable=row["variable"],
            name=row["set"],
            centre=float(row["centre_kpa"]),
            sd=float(row["sd_kpa"]),
            centre_kind=row["centre_kind"],
            sd_kind=row["sd_kind"],
            source=row["source"],
        )
        for row in rows("elastography.csv")
    )


@cache
def parameters() -> dict[str, float]:
    """Universe limits [kPa], normal liver [kPa], relative footprint and plausible range [kPa]."""
    return {row["name"]: float(row["value"]) for row in rows("parameters.csv")}
