"""Requests of the command line to the fuzzy systems, and the lines that answer them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from fuzzy.liver.knowledge import parameters
from fuzzy.liver.settings import LiverSettings
from fuzzy.systems.options import InferenceOptions

PLAUSIBLE = (parameters()["plausible_low"], parameters()["plausible_high"])
"""Readings [kPa] beyond which a unit must be wrong."""
SHAPES = ("footprint", "footprint_factor")
"""Settings of the type-2 sets, which are drawn and written, too."""


@dataclass(frozen=True, kw_only=True)
class EstimationRequest:
    """What the command line asked of `estimate`.

    `readings` [kPa] by aetiology; `systems` empty for all three; `settings` the given fields of
    LiverSettings and InferenceOptions by name; `row` of the table to explain, from 1.
    """

    readings: Mapping[str, float] = field(default_factory=dict)
    systems: Sequence[str] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    rule_base: Path | None = None
    inputs: Path | None = None
    out: Path | None = None
    explain: bool = False
    row: int | None = None
    figures: Path | None = None
    surface: tuple[str, str] | None = None
    as_json: bool = False


@dataclass(frozen=True)
class Answer:
    """Lines for the terminal, and notes on what was done to the readings."""

    lines: tuple[str, ...]
    notes: tuple[str, ...] = ()


def settings_of(given: Mapping[str, Any]) -> LiverSettings:
    """Settings with the given fields in place of the defaults. ValueError naming a wrong one."""
    names = {one.name for one in fields(InferenceOptions)}
    options = InferenceOptions(**{key: value for key, value in given.items() if key in names})
    liver = {key: value for key, value in given.items() if key not in names}
    return LiverSettings(**liver, options=options)


def flag_of(key: str) -> str:
    """The flag of a setting."""
    return "--" + key.replace("_", "-")
