"""Liver stiffness [Pa] from elastography readings [Pa] by three fuzzy systems.

Elastography is published in kPa and the fuzzy systems work in kPa; this module alone converts.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fuzzy.liver.knowledge import parameters
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.system import liver_system
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems import exact
from fuzzy.systems.inference import Inferred, infer
from fuzzy.systems.quadrature import is_exact
from fuzzy.systems.sets import Array, lower_membership, membership, upper_membership
from fuzzy.systems.system import FuzzySystem, memberships

UNIT = "kPa"
PA_PER_KPA = 1e3
NORMAL_LIVER = parameters()["normal_liver"] * PA_PER_KPA  # [Pa]


@dataclass(frozen=True)
class StiffnessEstimate:
    """Small-strain Young's modulus of the liver on the transient-elastography scale [Pa].

    `interval` is the range of centroids of interval type-2, None for the others.
    `quadrature_error` is the distance to the same system without sampling, or the tolerance of
    exact sampling; it says nothing about the data or the rules. `notes` state what was done to the
    readings, `method` how the answer was computed.
    """

    system: str
    estimate: float
    interval: tuple[float, float] | None
    quadrature_error: float
    notes: tuple[str, ...]
    method: str


@dataclass(frozen=True)
class MembershipCurves:
    """Membership of x [Pa], shape (P,), in each named set of a variable, each shape (sets, P)."""

    sets: tuple[str, ...]
    x: Array
    principal: Array
    lower: Array
    upper: Array


def estimate(
    readings: Mapping[str, float], system: str, settings: LiverSettings | None = None
) -> StiffnessEstimate:
    """Stiffness [Pa] for elastography readings [Pa] by aetiology.

    An aetiology without a reading takes NORMAL_LIVER, or its rules are left out, as `absent` says;
    either leaves a note, as does a reading outside the instrument's scale. Raises ValueError for an
    unknown aetiology or system, and for a reading that is not finite, not positive, so far off that
    its unit must be wrong, or refused by `out_of_range`.
    """
    settings = settings or LiverSettings()
    row = liver_row(readings)  # first, as it refuses unknown names
    liver = patient_system(readings, settings)
    found = infer(liver, row, system, settings.options, UNIT)
    return StiffnessEstimate(
        system=system,
        estimate=float(found.value[0]) * PA_PER_KPA,
        interval=_interval(found),
        quadrature_error=_quadrature_error(liver, row, system, settings, found),
        notes=(*_missing_notes(readings, settings), *found.notes),
        method=found.method,
    )


def evaluate(
    X: Array,
    system: str,
    settings: LiverSettings | None = None,
    present: Collection[str] = AETIOLOGIES,
) -> tuple[Array, Array | None]:
    """Stiffness [Pa] (N,), and the interval (N, 2) of interval type-2, for readings X (N, 5) [Pa].

    Columns follow AETIOLOGIES; where the absent are silent only those `present` take part.
    Readings are checked as in `estimate`.
    """
    settings = settings or LiverSettings()
    found = infer(
        liver_system(settings, _present(present, settings)),
        _plausible(np.asarray(X, dtype=np.float64)) / PA_PER_KPA,
        system,
        settings.options,
        UNIT,
    )
    interval = None if found.interval is None else found.interval * PA_PER_KPA
    return found.value * PA_PER_KPA, interval


def rule_count(settings: LiverSettings | None = None) -> int:
    """Number of rules with all aetiologies present; 247 with the default reading of Table I."""
    return len(liver_system(settings or LiverSettings()).rules)


def patient_system(readings: Mapping[str, float], settings: LiverSettings) -> FuzzySystem:
    """The fuzzy system, in kPa, that answers for these aetiologies."""
    return liver_system(settings, _present(readings, settings))


def _present(names: Collection[str], settings: LiverSettings) -> tuple[str, ...]:
    if not settings.missing.silences:
        return AETIOLOGIES
    return tuple(name for name in AETIOLOGIES if name in names)


def liver_row(readings: Mapping[str, float]) -> Array:
    """The readings [Pa] as one row (1, 5) in kPa, a normal liver where there is none."""
    row = np.full((1, len(AETIOLOGIES)), NORMAL_LIVER)
    for name, reading in readings.items():
        row[0, _column(name)] = reading
    return _plausible(row) / PA_PER_KPA


def surface(
    system: str,
    x_name: str,
    y_name: str,
    *,
    points: int = 41,
    settings: LiverSettings | None = None,
    base: Mapping[str, float] | None = None,
) -> tuple[Array, Array, Array]:
    """Stiffness over two readings on the instrument's scale: x (P,), y (P,), z (P, P), all [Pa].

    z[i, j] belongs to y[i] and x[j]. The other aetiologies keep their `base` readings.
    """
    i, j = _column(x_name), _column(y_name)
    if i == j:
        raise ValueError(f"surface over {x_name!r} twice: name two different aetiologies")
    base = base or {}
    low, high = _scale()
    x = y = np.geomspace(low, high, points)  # where the sets are, near the lower end
    X = np.tile(liver_row(base) * PA_PER_KPA, (points * points, 1))
    X[:, i], X[:, j] = (axis.ravel() for axis in np.meshgrid(x, y))
    z, _ = evaluate(X, system, settings, {*base, x_name, y_name})
    return x, y, z.reshape(points, points)


def membership_curves(
    settings: LiverSettings | None = None, points: int = 401
) -> dict[str, MembershipCurves]:
    """Curves of every input and of the output, by variable name."""
    liver = liver_system(settings or LiverSettings())
    curves = {}
    for variable in (*liver.inputs, liver.output):
        x = np.linspace(variable.low, variable.high, points)
        curves[variable.name] = MembershipCurves(
            sets=tuple(fuzzy_set.name for fuzzy_set in variable.sets),
            x=x * PA_PER_KPA,
            principal=memberships(variable, x, membership),
            lower=memberships(variable, x, lower_membership),
            upper=memberships(variable, x, upper_membership),
        )
    return curves


def _interval(found: Inferred) -> tuple[float, float] | None:
    if found.interval is None:
        return None
    low, high = found.interval[0] * PA_PER_KPA
    return float(low), float(high)


def _quadrature_error(
    liver: FuzzySystem, row: Array, system: str, settings: LiverSettings, found: Inferred
) -> float:
    if is_exact(settings.options.sampling):
        return exact.TOLERANCE * (liver.output.high - liver.output.low) * PA_PER_KPA
    continuous = infer(liver, row, system, replace(settings.options, sampling="exact"), UNIT)
    return abs(float(found.value[0] - continuous.value[0])) * PA_PER_KPA


def _column(name: str) -> int:
    if name not in AETIOLOGIES:
        raise ValueError(f"aetiology {name!r}: use one of {', '.join(AETIOLOGIES)}")
    return AETIOLOGIES.index(name)


def _scale() -> tuple[float, float]:
    """The instrument's scale [Pa]."""
    return parameters()["input_low"] * PA_PER_KPA, parameters()["input_high"] * PA_PER_KPA


def _plausible(X: Array) -> Array:
    """X [Pa] once no reading is beyond any liver."""
    low, high = (parameters()[key] * PA_PER_KPA for key in ("plausible_low", "plausible_high"))
    # Written so that NaN, for which no comparison holds, counts as implausible.
    bad = np.argwhere(~((low <= X) & (high >= X)))
    if bad.size:
        row, column = bad[0]
        raise ValueError(_refusal(AETIOLOGIES[column], X[row, column]))
    return X


def _refusal(name: str, reading: float) -> str:
    if not np.isfinite(reading) or reading <= 0:
        return f"{name} = {reading} Pa: give a finite positive reading, or leave it out"
    low, high = parameters()["plausible_low"], parameters()["plausible_high"]
    return (
        f"{name} = {reading:g} Pa is outside {low:g}-{high:g} kPa, beyond any liver: give Pa "
        "(9.5 kPa is 9500) on the transient-elastography scale"
    )


def _missing_notes(readings: Mapping[str, float], settings: LiverSettings) -> list[str]:
    names = [name for name in AETIOLOGIES if name not in readings]
    done = settings.missing.note.format(normal=NORMAL_LIVER / PA_PER_KPA)
    return [f"{', '.join(names)}: no reading; {done}"] if names else []
