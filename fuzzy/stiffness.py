"""Liver stiffness [Pa] from elastography readings [Pa] by three fuzzy systems.

The face of the package. Elastography is published in kPa and the fuzzy systems work in kPa; this
module alone converts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from fuzzy import interval_type2, mamdani, sugeno
from fuzzy.assumptions import assumptions
from fuzzy.knowledge import parameters
from fuzzy.liver import liver_system
from fuzzy.rules import AETIOLOGIES
from fuzzy.sets import Array, lower_membership, membership, upper_membership
from fuzzy.settings import Settings
from fuzzy.system import System, grid, memberships

__all__ = [
    "AETIOLOGIES",
    "NORMAL_LIVER",
    "SYSTEMS",
    "Curves",
    "Estimate",
    "Settings",
    "assumptions",
    "estimate",
    "evaluate",
    "membership_curves",
    "rule_count",
    "surface",
]

SystemName = Literal["mamdani", "sugeno", "interval-type-2"]
SYSTEMS: tuple[SystemName, ...] = get_args(SystemName)

PA_PER_KPA = 1e3
NORMAL_LIVER = parameters()["normal_liver"] * PA_PER_KPA  # [Pa]

# The quadrature error is measured against a grid this many times finer.
REFINEMENT = 20


@dataclass(frozen=True)
class Estimate:
    """Small-strain Young's modulus of the liver on the transient-elastography scale [Pa].

    `interval` is the range of centroids of interval type-2, None for the others.
    `quadrature_error` is the distance to the same system on a 20 times finer output grid; it says
    nothing about the data or the rules. `notes` tell what was done to the readings.
    """

    system: str
    estimate: float
    interval: tuple[float, float] | None
    quadrature_error: float
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Curves:
    """Membership of x [Pa], shape (P,), in each named set of a variable, each shape (sets, P)."""

    sets: tuple[str, ...]
    x: Array
    principal: Array
    lower: Array
    upper: Array


def estimate(
    readings: Mapping[str, float], system: str, settings: Settings | None = None
) -> Estimate:
    """Stiffness [Pa] for elastography readings [Pa] by aetiology.

    An aetiology without a reading takes NORMAL_LIVER; a reading outside the instrument's scale is
    clamped to it; both leave a note. Raises ValueError for an unknown aetiology or system, and for
    a reading that is not finite, not positive or so far off that its unit must be wrong.
    """
    settings = settings or Settings()
    X = _row(readings)
    value, interval = evaluate(X, system, settings)
    fine, _ = evaluate(X, system, _refined(settings))
    return Estimate(
        system=system,
        estimate=float(value[0]),
        interval=None if interval is None else (float(interval[0, 0]), float(interval[0, 1])),
        quadrature_error=abs(float(value[0] - fine[0])),
        notes=(*_missing_notes(readings), *_clamp_notes(readings)),
    )


def evaluate(X: Array, system: str, settings: Settings | None = None) -> tuple[Array, Array | None]:
    """Stiffness [Pa] (N,), and the interval (N, 2) of interval type-2, for readings X (N, 5) [Pa].

    Columns follow AETIOLOGIES. Readings are checked and clamped as in `estimate`.
    """
    settings = settings or Settings()
    kpa = _checked(X) / PA_PER_KPA
    value, interval = _infer(_system(settings), kpa, system, settings)
    return value * PA_PER_KPA, None if interval is None else interval * PA_PER_KPA


def rule_count(settings: Settings | None = None) -> int:
    """Number of rules; 247 with the default reading of Table I."""
    return len(_system(settings or Settings()).rules)


def surface(
    system: str,
    x_name: str,
    y_name: str,
    *,
    points: int = 41,
    settings: Settings | None = None,
    base: Mapping[str, float] | None = None,
) -> tuple[Array, Array, Array]:
    """Stiffness over two readings on the instrument's scale: x (P,), y (P,), z (P, P), all [Pa].

    z[i, j] belongs to y[i] and x[j]. The other aetiologies keep their `base` readings.
    """
    i, j = _column(x_name), _column(y_name)
    if i == j:
        raise ValueError(f"surface over {x_name!r} twice: name two different aetiologies")
    low, high = _scale()
    x, y = np.linspace([low, low], [high, high], points, axis=1)
    X = np.tile(_row(base or {}), (points * points, 1))
    X[:, i], X[:, j] = (axis.ravel() for axis in np.meshgrid(x, y))
    z, _ = evaluate(X, system, settings)
    return x, y, z.reshape(points, points)


def membership_curves(settings: Settings | None = None, points: int = 401) -> dict[str, Curves]:
    """Curves of every input and of the output, by variable name."""
    liver = _system(settings or Settings())
    curves = {}
    for variable in (*liver.inputs, liver.output):
        x = grid(variable, points)
        curves[variable.name] = Curves(
            sets=tuple(fuzzy_set.name for fuzzy_set in variable.sets),
            x=x * PA_PER_KPA,
            principal=memberships(variable, x, membership),
            lower=memberships(variable, x, lower_membership),
            upper=memberships(variable, x, upper_membership),
        )
    return curves


def _system(settings: Settings) -> System:
    return liver_system(
        footprint=settings.footprint,
        odd_cell=settings.odd_cell,
        duplicates=settings.duplicates,
        consequent=settings.consequent,
    )


def _infer(liver: System, X: Array, system: str, settings: Settings) -> tuple[Array, Array | None]:
    match system:
        case "mamdani":
            return mamdani.evaluate(liver, X, settings.samples), None
        case "sugeno":
            merge = settings.sugeno_aggregation
            return sugeno.evaluate(liver, X, settings.samples, merge), None
        case "interval-type-2":
            return interval_type2.evaluate(liver, X, settings.samples)
    raise ValueError(f"system {system!r}: use one of {', '.join(SYSTEMS)}")


def _refined(settings: Settings) -> Settings:
    """Each interval of the output grid cut in REFINEMENT, so that the coarse points remain."""
    return replace(settings, samples=REFINEMENT * (settings.samples - 1) + 1)


def _row(readings: Mapping[str, float]) -> Array:
    """The readings as one row (1, 5) [Pa], a normal liver where there is none."""
    row = np.full((1, len(AETIOLOGIES)), NORMAL_LIVER)
    for name, reading in readings.items():
        row[0, _column(name)] = reading
    return row


def _column(name: str) -> int:
    if name not in AETIOLOGIES:
        raise ValueError(f"aetiology {name!r}: use one of {', '.join(AETIOLOGIES)}")
    return AETIOLOGIES.index(name)


def _scale() -> tuple[float, float]:
    """The instrument's scale [Pa]."""
    return parameters()["input_low"] * PA_PER_KPA, parameters()["input_high"] * PA_PER_KPA


def _checked(X: Array) -> Array:
    """X [Pa] clamped to the instrument's scale, once every reading is found plausible."""
    low, high = (parameters()[key] * PA_PER_KPA for key in ("plausible_low", "plausible_high"))
    # Written so that NaN, for which no comparison holds, counts as implausible.
    bad = np.argwhere(~((low <= X) & (high >= X)))
    if bad.size:
        row, column = bad[0]
        raise ValueError(_refusal(AETIOLOGIES[column], X[row, column]))
    return np.clip(X, *_scale())


def _refusal(name: str, reading: float) -> str:
    if not np.isfinite(reading) or reading <= 0:
        return f"{name} = {reading} Pa: give a finite positive reading, or leave it out"
    low, high = parameters()["plausible_low"], parameters()["plausible_high"]
    return (
        f"{name} = {reading:g} Pa is outside {low:g}-{high:g} kPa, beyond any liver: give Pa "
        "(9.5 kPa is 9500) on the transient-elastography scale"
    )


def _missing_notes(readings: Mapping[str, float]) -> list[str]:
    return [
        f"{name}: no reading; the normal liver's {NORMAL_LIVER / PA_PER_KPA:g} kPa taken"
        for name in AETIOLOGIES
        if name not in readings
    ]


def _clamp_notes(readings: Mapping[str, float]) -> list[str]:
    low, high = _scale()
    return [
        f"{name}: reading {reading / PA_PER_KPA:g} kPa is outside the instrument's scale "
        f"{low / PA_PER_KPA:g}-{high / PA_PER_KPA:g} kPa; clamped to it"
        for name, reading in readings.items()
        if not low <= reading <= high
    ]
