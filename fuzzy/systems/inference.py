"""Inference by any of the three systems, with one policy for readings no system can answer.

Readings outside an input's universe, and readings for which no rule fires, are treated alike by all
three systems, and whatever was done to them is said in the result: no system answers silently with
the middle of its universe.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from fuzzy.systems import interval_type2, mamdani, sugeno
from fuzzy.systems.interval_type2 import Reducer
from fuzzy.systems.quadrature import SAMPLINGS, Output, Sampling
from fuzzy.systems.sets import Array
from fuzzy.systems.system import FuzzySystem, Merge, Variable

SystemName = Literal["mamdani", "sugeno", "interval-type-2"]
SYSTEMS: tuple[SystemName, ...] = get_args(SystemName)
OutOfRange = Literal["clamp", "raise", "matlab"]

# Below this strength the clipped sets are flat and their centroid is that of the universe.
LEAST_STRENGTH = 1e-12
# Fewer rows do not repay loading the compiled kernels, let alone compiling them the first time.
COMPILED_FROM_ROWS = 20_000
# The numpy modules hold sets x rows x samples numbers at a time.
ROWS_AT_ONCE = 2_000

CHOICES: dict[str, tuple[str, ...]] = {
    "sampling": SAMPLINGS,
    "sugeno_aggregation": get_args(Merge),
    "reducer": get_args(Reducer),
    "out_of_range": get_args(OutOfRange),
}


@dataclass(frozen=True)
class InferenceOptions:
    """How a system is evaluated.

    `samples` points carry the output's universe (101 is MATLAB's default); `exact` sampling takes
    none and finds the ends of type-2 intervals by itself, so that `eiasc` changes nothing there.
    `out_of_range`: `clamp` takes the nearest end of the universe and says so, `raise` refuses,
    `matlab` evaluates as it is, and where nothing fires answers with the middle of the universe,
    and says so; the first two refuse readings for which no rule fires.
    """

    sampling: Sampling = "matlab"
    samples: int = 101
    sugeno_aggregation: Merge = "sum"
    reducer: Reducer = "karnik-mendel"
    out_of_range: OutOfRange = "clamp"

    def __post_init__(self) -> None:
        if not isinstance(self.samples, int) or self.samples < 11:
            raise ValueError(f"samples = {self.samples!r}: give a whole number of at least 11")
        for key, allowed in CHOICES.items():
            if getattr(self, key) not in allowed:
                raise ValueError(f"{key} = {getattr(self, key)!r}: use one of {', '.join(allowed)}")


@dataclass(frozen=True)
class Inferred:
    """Answer `value` (N,), type-2 `interval` (N, 2) or None, in the output's unit.

    `notes` say what was done to the readings, `method` how the answer was computed.
    """

    value: Array
    interval: Array | None
    notes: tuple[str, ...]
    method: str


def infer(
    system: FuzzySystem,
    X: Array,
    kind: str,
    options: InferenceOptions | None = None,
    unit: str = "",
) -> Inferred:
    """Answers of the `kind` of system to the readings X (N, inputs), in the inputs' units.

    `unit` is named in notes. Raises ValueError, naming input and row, for a reading that is not
    finite, as `options.out_of_range` says, and where rules fire without giving a finite answer.
    """
    options = options or InferenceOptions()
    check_kind(system, kind)
    X = require_readings(system, X)
    X, notes = in_range(system, X, options.out_of_range, unit)
    with np.errstate(over="ignore", invalid="ignore"):  # an answer that is not finite is refused
        output = _evaluate(system, X, kind, options)
    output, silent = _answered(system, X, output, options)
    return Inferred(output.value, output.interval, (*notes, *silent), method(system, kind, options))


def check_kind(system: FuzzySystem, kind: str) -> None:
    """ValueError if the kind is unknown or cannot be had from the system."""
    if kind not in SYSTEMS:
        raise ValueError(f"system {kind!r}: use one of {', '.join(SYSTEMS)}")
    if system.is_sugeno and kind != "sugeno":
        raise ValueError(
            f"{system.name}: its consequents are constants, so it can only be evaluated as sugeno; "
            f"give its output membership functions for {kind}"
        )


def require_readings(system: FuzzySystem, X: Array) -> Array:
    """X as floats (N, inputs). ValueError for a wrong width or a number that is not finite."""
    X = np.asarray(X, dtype=np.float64)
    if X.ndim != 2 or X.shape[1] != len(system.inputs):
        raise ValueError(f"readings have shape {X.shape}; give (N, {len(system.inputs)})")
    bad = np.argwhere(~np.isfinite(X))
    if bad.size:
        row, column = bad[0]
        raise ValueError(
            f"{system.inputs[column].name} = {X[row, column]} (row {row + 1}): "
            "give a finite reading"
        )
    return X


def in_range(
    system: FuzzySystem, X: Array, policy: OutOfRange, unit: str
) -> tuple[Array, tuple[str, ...]]:
    """The readings as evaluated under a policy, and what was done to them.

    ValueError if the policy is `raise` and one is outside its universe.
    """
    low = np.array([variable.low for variable in system.inputs])
    high = np.array([variable.high for variable in system.inputs])
    outside = (low > X) | (high < X)
    notes = tuple(
        _outside(system.inputs[i], X[:, i], outside[:, i], policy, unit)
        for i in np.flatnonzero(outside.any(axis=0))
    )
    if notes and policy == "raise":
        raise ValueError(notes[0])
    return (np.clip(X, low, high) if policy == "clamp" else X), notes


def _outside(
    variable: Variable, x: Array, outside: NDArray[np.bool_], policy: OutOfRange, unit: str
) -> str:
    first = int(np.flatnonzero(outside)[0])
    others = int(outside.sum()) - 1
    where = f" (row {first + 1}" + (f" and {others} more)" if others else ")") if x.size > 1 else ""
    done = {
        "clamp": "clamped to it",
        "matlab": "taken as it is",
        "raise": "correct it, or let out_of_range clamp it",
    }[policy]
    unit = f" {unit}" if unit else ""
    return (
        f"{variable.name}: reading {x[first]:g}{unit}{where} is outside "
        f"{variable.low:g}-{variable.high:g}{unit}; {done}"
    )


def _evaluate(system: FuzzySystem, X: Array, kind: str, options: InferenceOptions) -> Output:
    if options.sampling != "exact" and len(X) >= COMPILED_FROM_ROWS:
        from fuzzy.systems.compiled import compiled  # numba, which few rows do not repay

        return compiled(system, kind, options).evaluate(X)
    starts = range(0, max(len(X), 1), ROWS_AT_ONCE)
    blocks = [_block(system, X[i : i + ROWS_AT_ONCE], kind, options) for i in starts]
    if len(blocks) == 1:
        return blocks[0]
    values, intervals, strengths = zip(*blocks, strict=True)
    interval = None if intervals[0] is None else np.concatenate(intervals)
    return Output(np.concatenate(values), interval, np.concatenate(strengths))


def _block(system: FuzzySystem, X: Array, kind: str, options: InferenceOptions) -> Output:
    sampling, samples = options.sampling, options.samples
    if kind == "mamdani":
        return mamdani.evaluate(system, X, sampling, samples)
    if kind == "sugeno":
        return sugeno.evaluate(system, X, sampling, samples, options.sugeno_aggregation)
    return interval_type2.evaluate(system, X, sampling, samples, options.reducer)


def _answered(
    system: FuzzySystem, X: Array, output: Output, options: InferenceOptions
) -> tuple[Output, tuple[str, ...]]:
    """The output with an answer in every row: the middle of the universe where MATLAB has it."""
    fires = output.strength >= LEAST_STRENGTH
    known = np.isfinite(output.value)
    if output.interval is not None:
        known &= np.isfinite(output.interval).all(axis=-1)
    if (fires & known).all():
        return output, ()
    if (fires & ~known).any():
        raise ValueError(_no_number(system, X, fires & ~known, options))
    if options.out_of_range != "matlab":
        raise ValueError(
            f"no rule fires for {_readings(system, X, ~fires)}: add a rule or widen a set that "
            "covers these readings"
        )
    return _with_middle(system, output, known), _on_silence(system, X, known, fires)


def _no_number(
    system: FuzzySystem, X: Array, rows: NDArray[np.bool_], options: InferenceOptions
) -> str:
    """Why rows have no finite answer although rules fire, and what to do."""
    output, readings = system.output, _readings(system, X, rows)
    universe = f"{output.low:g}-{output.high:g}"
    if system.is_sugeno:
        why = "its consequents overflow: correct the reading or the coefficients"
    elif options.sampling == "exact":
        why = f"a set that fires has no mass on {universe}: move or widen the set"
    else:
        why = (
            f"a set that fires has no mass on the {options.samples} samples of {universe}: "
            "raise samples, or choose exact sampling, or move the set"
        )
    return f"{output.name}: no finite answer for {readings}; {why}"


def _readings(system: FuzzySystem, X: Array, rows: NDArray[np.bool_]) -> str:
    """The readings of the first of these rows, its number, and how many more there are."""
    first, others = int(rows.argmax()), int(rows.sum()) - 1
    pairs = zip(system.inputs, X[first], strict=True)
    readings = ", ".join(f"{variable.name} = {value:g}" for variable, value in pairs)
    more = f" and {others} more" if others else ""
    return f"{readings} (row {first + 1} of {len(X)}{more})"


def _with_middle(system: FuzzySystem, output: Output, known: NDArray[np.bool_]) -> Output:
    """The output with the middle of the universe in all rows but the known ones."""
    low, high = system.output.low, system.output.high
    value = np.where(known, output.value, 0.5 * (low + high))
    interval = output.interval
    if interval is not None:
        interval = np.where(known[:, None], interval, np.array([low, high]))
    return Output(value, interval, output.strength)


def _on_silence(
    system: FuzzySystem, X: Array, known: NDArray[np.bool_], fires: NDArray[np.bool_]
) -> tuple[str, ...]:
    """What was done in rows without a rule that fires by LEAST_STRENGTH."""
    cases = (
        (~known, "no rule fires", "the answer is no more than the middle of the universe"),
        (
            known & ~fires,
            f"no rule fires by {LEAST_STRENGTH:g} or more",
            "the answer is computed from what is left",
        ),
    )
    return tuple(
        f"{found} for {_readings(system, X, rows)}: {done}, as in MATLAB"
        for rows, found, done in cases
        if rows.any()
    )


def method(system: FuzzySystem, kind: str, options: InferenceOptions) -> str:
    """One sentence on how answers are computed."""
    operators = system.operators
    joins = (
        f"AND {operators.conjunction}, OR {operators.disjunction}, "
        f"implication {operators.implication}, aggregation max"
    )
    points = {
        "matlab": f"sums over {options.samples} points",
        "octave": f"the trapezoidal rule over {options.samples} points",
        "exact": "integration between the kinks of the curve",
    }[options.sampling]
    match kind:
        case "mamdani":
            return f"Mamdani: {joins}, centroid by {points}"
        case "sugeno" if system.is_sugeno:
            return f"Sugeno: {joins}, {_averaged(options)}"
        case "sugeno":
            return f"Sugeno: constants by {points} over each output set, {_averaged(options)}"
    exact_ends = "middle of the exact Karnik-Mendel interval"
    reduced = {
        "karnik-mendel": exact_ends,
        "eiasc": exact_ends if options.sampling == "exact" else "middle of the interval by EIASC",
        "nie-tan": "Nie-Tan centroid, interval by Karnik-Mendel",
    }[options.reducer]
    return f"Interval type-2: {joins}, {reduced}, {points}"


def _averaged(options: InferenceOptions) -> str:
    each = "rule" if options.sugeno_aggregation == "sum" else "output set, by its strongest rule"
    return f"weighted average over every {each}"
