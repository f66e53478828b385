"""Policy for readings without an output, common to all kinds of inference.

Readings outside an input's universe and readings for which no rule fires are treated the same by
all systems. Every change is stated in a note: no system returns the middle of its universe
silently.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fuzzy.systems.options import OUT_OF_RANGE, InferenceOptions
from fuzzy.systems.quadrature import Output, is_exact
from fuzzy.systems.sets import Array
from fuzzy.systems.system import FuzzySystem, Variable

# Below this strength the clipped sets are flat and their centroid is that of the universe.
LEAST_STRENGTH = 1e-12


def answered(
    system: FuzzySystem,
    X: Array,
    evaluate: Callable[[Array], Output],
    options: InferenceOptions,
    unit: str = "",
) -> tuple[Output, tuple[str, ...]]:
    """Output of `evaluate` for the readings X (N, inputs) under the policy, with notes.

    `unit` appears in the notes. ValueError, with input and row, for a reading that is not finite,
    by the policy `options.out_of_range`, and where rules fire without a finite output.
    """
    X, notes = in_range(system, require_readings(system, X), options.out_of_range, unit)
    with np.errstate(over="ignore", invalid="ignore"):  # an answer that is not finite is refused
        output = evaluate(X)
    output, silent = _answered(system, X, output, options)
    return output, (*notes, *silent)


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
    system: FuzzySystem, X: Array, policy: str, unit: str
) -> tuple[Array, tuple[str, ...]]:
    """The readings as evaluated under a policy, and notes on their changes.

    ValueError if the policy is `raise` and one is outside its universe.
    """
    low, high = np.array([variable.reach for variable in system.inputs]).T
    outside = (low > X) | (high < X)
    notes = tuple(
        _outside(system.inputs[i], X[:, i], outside[:, i], policy, unit)
        for i in np.flatnonzero(outside.any(axis=0))
    )
    if notes and OUT_OF_RANGE[policy].refuses:
        raise ValueError(notes[0])
    return (np.clip(X, low, high) if OUT_OF_RANGE[policy].clamps else X), notes


def _outside(
    variable: Variable, x: Array, outside: NDArray[np.bool_], policy: str, unit: str
) -> str:
    first = int(np.flatnonzero(outside)[0])
    others = int(outside.sum()) - 1
    where = f" (row {first + 1}" + (f" and {others} more)" if others else ")") if x.size > 1 else ""
    unit = f" {unit}" if unit else ""
    return (
        f"{variable.name}: reading {x[first]:g}{unit}{where} is outside "
        f"{variable.low:g}-{variable.high:g}{unit}; {OUT_OF_RANGE[policy].done}"
    )


def _answered(
    system: FuzzySystem, X: Array, output: Output, options: InferenceOptions
) -> tuple[Output, tuple[str, ...]]:
    """The output with a value in every row: the middle of the universe where MATLAB returns it."""
    fires = output.strength >= LEAST_STRENGTH
    known = np.isfinite(output.value)
    if output.interval is not None:
        known &= np.isfinite(output.interval).all(axis=-1)
    if (fires & known).all():
        return output, ()
    if (fires & ~known).any():
        raise ValueError(_no_number(system, X, fires & ~known, options))
    if not OUT_OF_RANGE[options.out_of_range].middle:
        raise ValueError(
            f"no rule fires for {_readings(system, X, ~fires)}: add a rule or widen a set that "
            "covers these readings"
        )
    return _with_middle(system, output, known), _on_silence(system, X, known, fires)


def _no_number(
    system: FuzzySystem, X: Array, rows: NDArray[np.bool_], options: InferenceOptions
) -> str:
    """Message on rows without a finite output although rules fire, with the remedy."""
    output, readings = system.output, _readings(system, X, rows)
    universe = f"{output.low:g}-{output.high:g}"
    if system.is_sugeno:
        why = "its consequents overflow: correct the reading or the coefficients"
    elif is_exact(options.sampling):
        why = f"a set that fires has no mass on {universe}: move or widen the set"
    else:
        why = (
            f"a set that fires has no mass on the {options.samples} samples of {universe}: "
            "raise samples, or choose exact sampling, or move the set"
        )
    return f"{output.name}: no finite answer for {readings}; {why}"


def _readings(system: FuzzySystem, X: Array, rows: NDArray[np.bool_]) -> str:
    """The readings and number of the first of these rows, and the number of further rows."""
    first, others = int(rows.argmax()), int(rows.sum()) - 1
    pairs = zip(system.inputs, X[first], strict=True)
    readings = ", ".join(f"{variable.name} = {value:g}" for variable, value in pairs)
    more = f" and {others} more" if others else ""
    return f"{readings} (row {first + 1} of {len(X)}{more})"


def _with_middle(system: FuzzySystem, output: Output, known: NDArray[np.bool_]) -> Output:
    """The output with the middle of the universe in all rows without a value."""
    low, high = system.output.low, system.output.high
    value = np.where(known, output.value, 0.5 * (low + high))
    interval = output.interval
    if interval is not None:
        interval = np.where(known[:, None], interval, np.array([low, high]))
    return Output(value, interval, output.strength)


def _on_silence(
    system: FuzzySystem, X: Array, known: NDArray[np.bool_], fires: NDArray[np.bool_]
) -> tuple[str, ...]:
    """Notes on rows in which no rule fires with LEAST_STRENGTH or more."""
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
