"""Sensitivity of the estimate to each open choice, compared with that to the kind of system.

One choice at a time is varied from the base settings. The change is evaluated at given readings and
over a sample of readings, all in Pa.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from fuzzy.liver.bases import KNOWLEDGE, STAGES_ONLY
from fuzzy.liver.knowledge import parameters
from fuzzy.liver.readings import READINGS
from fuzzy.liver.settings import CHOICES, LiverSettings
from fuzzy.liver.stiffness import PA_PER_KPA, evaluate, liver_row
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import CHOICES as OPTIONS
from fuzzy.systems.quadrature import is_exact
from fuzzy.systems.sets import Array
from fuzzy.systems.spread import spread

EXACT_ROWS = 24
"""Rows for exact sampling, which takes some 10 ms per reading."""

STAND_IN: dict[str, Any] = {"sampling": "octave", "samples": 1001}
"""Substitute for exact sampling where another choice is varied: within 0.2 Pa, far faster."""

LARGEST_READING = 40.0 * PA_PER_KPA
"""Two within-stage SDs above the highest centre in use, cirrhosis in ALD at 22.6 +- 8.9 kPa."""

SYSTEM = "system"
TYPE_2: tuple[str, ...] = ("interval-type-2",)
SUGENO: tuple[str, ...] = ("sugeno",)


class Axis(NamedTuple):
    """A field of LiverSettings or of its options, its values, and the systems that it affects."""

    key: str
    values: tuple[Any, ...]
    systems: tuple[str, ...] = tuple(SYSTEMS)


AXES = (
    Axis("knowledge", tuple(KNOWLEDGE)),
    Axis("reading", tuple(READINGS)),
    Axis("consequent", tuple(CHOICES["consequent"])),
    Axis("placement", tuple(CHOICES["placement"])),
    Axis("absent", ("normal", "silent")),
    Axis("footprint", tuple(CHOICES["footprint"]), TYPE_2),
    Axis("footprint_factor", (0.0, 0.5, 1.0, 2.0), TYPE_2),
    Axis("reducer", tuple(OPTIONS["reducer"]), TYPE_2),
    Axis("sugeno_aggregation", tuple(OPTIONS["sugeno_aggregation"]), SUGENO),
    Axis("sampling", tuple(OPTIONS["sampling"])),
    Axis("samples", (51, 101, 1001)),
)


@dataclass(frozen=True)
class Sensitivity:
    """Change [Pa] of one system's estimate when one choice goes from `base` to `alternative`.

    `at_readings`: at the given readings; `rms` and `largest` magnitude: over a number of `rows` of
    readings. `widths`: mean width [Pa] of the type-2 interval before and after, None for the
    others. The choice `system` compares the system `base` with `alternative`.
    """

    choice: str
    base: str
    alternative: str
    system: str
    at_readings: float
    rms: float
    largest: float
    rows: int
    widths: tuple[float, float] | None = None


@dataclass(frozen=True)
class Screening:
    """Rows by choice, the kind of system last; and the alternatives left out, with reasons."""

    rows: tuple[Sensitivity, ...]
    left_out: tuple[str, ...]


class _Case(NamedTuple):
    """Readings X (N, 5) [Pa], a kind of system and its settings."""

    X: Array
    system: str
    settings: LiverSettings
    present: tuple[str, ...] = AETIOLOGIES


_Answers = Callable[[_Case], tuple[Array, Array | None]]
"""Stiffness and interval of a case, see `fuzzy.liver.stiffness.evaluate`."""


def sensitivity(readings: Mapping[str, float], base: LiverSettings, rows: int = 256) -> Screening:
    """Every alternative of every choice against `base`, at the readings [Pa] and over `rows` more.

    Those are spread log-uniformly over each aetiology, for a base that follows the reading over
    those given, see `spread_readings`; exact sampling is
    tried on the first EXACT_ROWS of them, and elsewhere replaced by its STAND_IN. What happens to
    an aetiology without a reading is tried on patients with the given ones alone. Raises
    ValueError as `estimate` does.
    """
    found: list[Sensitivity] = []
    answers = _cached_answers()
    left_out: list[str] = []
    for system in SYSTEMS:  # so that faulty readings are not taken for a fault of an alternative
        evaluate(_patient(readings), system, base, readings)
    for axis in AXES:
        for value in axis.values:
            if value == _value(base, axis.key) or _is_idle(axis.key, base):
                continue
            try:
                found += _changes(readings, base, axis, value, rows, answers)
            except ValueError as error:
                left_out.append(f"{axis.key} {_label(value)}: {error}")
    return Screening((*found, *_between_systems(readings, base, rows, answers)), tuple(left_out))


def _cached_answers() -> _Answers:
    """Cache of evaluated cases, since the base is compared with every alternative."""
    found: dict[tuple[object, ...], tuple[Array, Array | None]] = {}

    def answers(case: _Case) -> tuple[Array, Array | None]:
        key = (case.X.tobytes(), *case[1:])
        if key not in found:
            found[key] = evaluate(*case)
        return found[key]

    return answers


def _value(settings: LiverSettings, key: str) -> Any:
    if key == "absent":
        return settings.absence
    return getattr(settings if hasattr(settings, key) else settings.options, key)


def _is_idle(key: str, base: LiverSettings) -> bool:
    """Whether a choice has no effect on the estimate.

    Exact sampling takes no samples, and a base that follows the reading has cells of its own.
    """
    if key in STAGES_ONLY:
        return base.base.follows
    return key == "samples" and is_exact(base.options.sampling)


def _changed(base: LiverSettings, key: str, value: Any) -> LiverSettings:
    if key == "knowledge":  # what shapes a base of stages alone stays behind
        usual = LiverSettings()
        kept = {name: getattr(usual, name) for name in STAGES_ONLY}
        return replace(base, knowledge=value, **kept)
    if hasattr(base, key):
        return replace(base, **{key: value})
    return replace(base, options=replace(base.options, **{key: value}))


def _changes(
    readings: Mapping[str, float],
    base: LiverSettings,
    axis: Axis,
    value: Any,
    rows: int,
    answers: _Answers,
) -> list[Sensitivity]:
    labels = axis.key, _label(_value(base, axis.key)), _label(value)
    if axis.key != "sampling":
        base = _sampled(base)
    other = _changed(base, axis.key, value)
    present = _spread_over(readings, base)
    if axis.key == "absent":
        present = tuple(readings)
        _require_absent(present)
    X = spread_readings(_rows(base, other, rows), present)
    return [
        _difference(
            labels,
            readings,
            _Case(X, system, base, present),
            _Case(X, system, other, present),
            answers,
        )
        for system in axis.systems
    ]


def _spread_over(readings: Mapping[str, float], base: LiverSettings) -> tuple[str, ...]:
    """Aetiologies whose readings are spread: all, or those given where the others are silent."""
    return tuple(readings) if base.base.follows and readings else AETIOLOGIES


def _label(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _require_absent(present: Collection[str]) -> None:
    if not present or len(present) == len(AETIOLOGIES):
        raise ValueError(
            f"needs some aetiologies with a reading and some without; {len(present)} of "
            f"{len(AETIOLOGIES)} have one"
        )


def _sampled(settings: LiverSettings) -> LiverSettings:
    if not is_exact(settings.options.sampling):
        return settings
    return replace(settings, options=replace(settings.options, **STAND_IN))


def _rows(base: LiverSettings, other: LiverSettings, rows: int) -> int:
    exact = any(is_exact(one.options.sampling) for one in (base, other))
    return min(rows, EXACT_ROWS) if exact else rows


def _between_systems(
    readings: Mapping[str, float], base: LiverSettings, rows: int, answers: _Answers
) -> Iterator[Sensitivity]:
    present = _spread_over(readings, base)
    X, base = spread_readings(rows, present), _sampled(base)
    for one, other in combinations(SYSTEMS, 2):
        labels = (SYSTEM, one, other)
        before, after = (_Case(X, system, base, present) for system in (one, other))
        yield _difference(labels, readings, before, after, answers)


def _difference(
    labels: tuple[str, str, str],
    readings: Mapping[str, float],
    first: _Case,
    second: _Case,
    answers: _Answers,
) -> Sensitivity:
    before, after = (answers(case) for case in (first, second))
    patients = (
        case._replace(X=_patient(readings), present=tuple(readings)) for case in (first, second)
    )
    here = [float(answers(patient)[0][0]) for patient in patients]
    change = after[0] - before[0]
    return Sensitivity(
        *labels,
        system=first.system,
        at_readings=here[1] - here[0],
        rms=float(np.sqrt(np.mean(change**2))),
        largest=float(np.abs(change).max()),
        rows=len(change),
        widths=_widths(before[1], after[1]),
    )


def _widths(before: Array | None, after: Array | None) -> tuple[float, float] | None:
    if before is None or after is None:
        return None
    first, second = (float(np.diff(interval, axis=1).mean()) for interval in (before, after))
    return first, second


def _patient(readings: Mapping[str, float]) -> Array:
    return liver_row(readings) * PA_PER_KPA


def spread_readings(rows: int, present: Collection[str] = AETIOLOGIES) -> Array:
    """Readings (rows, 5) [Pa]: log-uniform and independent where present, else a normal liver's.

    They run from the foot of the instrument's scale to LARGEST_READING; on a logarithmic scale,
    as the spread within a stage grows with its mean.
    """
    X = np.repeat(_patient({}), rows, axis=0)
    columns = [i for i, name in enumerate(AETIOLOGIES) if name in present]
    low = parameters()["input_low"] * PA_PER_KPA
    X[:, columns] = low * (LARGEST_READING / low) ** spread(rows, len(columns))
    return X
