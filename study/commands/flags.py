"""Flags that several commands share, and the exit codes of all."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from cyclopts import Parameter, Token

EXIT_FAILED_CHECK = 1
EXIT_BAD_INPUT = 2

Overrides = Annotated[list[str] | None, Parameter(name="--set")]
"""Flag --set: overrides of a scene, table.key=value."""
Switch = Annotated[bool, Parameter(negative=())]
"""A flag that is off unless it is given."""
AsJson = Annotated[bool, Parameter(name="--json", negative=())]


def _whole(_: object, tokens: Sequence[Token]) -> int:
    """The whole number of a flag; cyclopts would round 1.5 to 2."""
    text = tokens[0].value
    if not re.fullmatch(r"[+-]?[0-9]{1,12}", text):
        raise ValueError(f"{text!r} is no whole number of at most 12 digits")
    return int(text)


def _number(_: object, tokens: Sequence[Token]) -> float:
    """The number of a flag, which cyclopts would take from 1_0 too."""
    text = tokens[0].value
    try:
        value = float(text)
    except ValueError:
        value = None
    if value is None or "_" in text:
        raise ValueError(f"{text!r} is no plain number; write for example 9.5, without a unit")
    return value


NumberOrNone = Annotated[float | None, Parameter(converter=_number)]
Whole = Annotated[int, Parameter(converter=_whole)]
WholeOrNone = Annotated[int | None, Parameter(converter=_whole)]


@dataclass(frozen=True, kw_only=True)
class WorkerFlags:
    """Where runs go that do not depend on each other.

    Parameters
    ----------
    workers
        Processes that runs are spread over; none by default.
    scheduler
        Address of a running Dask scheduler to use instead, tcp://HOST:PORT.
    """

    workers: Whole = 0
    scheduler: str | None = None


Workers = Annotated[WorkerFlags, Parameter(name="*")]
HERE = WorkerFlags()


@dataclass(frozen=True, kw_only=True)
class LiverFlags:
    """How the liver's rule base is read.

    Parameters
    ----------
    knowledge
        Knowledge base: severity, paper-count or freed.
    reading
        Reading of Table I, of the base severity, for example R1 or R4-pair.
    consequent
        Severity of a combination: max (the severest governs) or mean.
    placement
        Centres of the sets: stage-mean or cut-off.
    footprint
        What is uncertain of a type-2 set: uncertain-mean, uncertain-spread or scaled.
    footprint_factor
        Times the published spread; 0 makes type-2 type-1.
    absent
        Aetiology without a reading: normal (a normal liver's reading), silent (no rules) or auto
        (as the knowledge base has it).
    """

    knowledge: str | None = None
    reading: str | None = None
    consequent: str | None = None
    placement: str | None = None
    footprint: str | None = None
    footprint_factor: float | None = None
    absent: str | None = None


LiverReading = Annotated[LiverFlags, Parameter(name="*")]
AS_DEFAULT = LiverFlags()


@dataclass(frozen=True, kw_only=True)
class InferenceFlags:
    """How a fuzzy system is evaluated.

    Parameters
    ----------
    sampling
        Output curve: matlab (sums of samples), octave (trapezoidal rule) or exact.
    samples
        Number of samples, 101 by default.
    sugeno_aggregation
        Sugeno weighs every rule (sum, as MATLAB) or every output set (max).
    reducer
        Type-2: karnik-mendel, eiasc or nie-tan.
    out_of_range
        Reading outside its universe: clamp (and say so), raise, or matlab (take it as it is).
    """

    sampling: str | None = None
    samples: WholeOrNone = None
    sugeno_aggregation: str | None = None
    reducer: str | None = None
    out_of_range: str | None = None


Inference = Annotated[InferenceFlags, Parameter(name="*")]
AS_MATLAB = InferenceFlags()


def given(*flags: LiverFlags | InferenceFlags) -> dict[str, Any]:
    """The flags that were given, by name."""
    every = {key: value for group in flags for key, value in asdict(group).items()}
    return {key: value for key, value in every.items() if value is not None}
