"""Inference by any kind of system, under one policy for readings that no system can answer."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from fuzzy.systems.kinds import SYSTEMS, check_kind, is_compiled
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.policy import answered
from fuzzy.systems.quadrature import Output, is_exact
from fuzzy.systems.sets import Array
from fuzzy.systems.system import FuzzySystem

# Fewer rows do not repay loading the compiled kernels, let alone compiling them the first time.
COMPILED_FROM_ROWS = 20_000
# The numpy modules hold sets x rows x samples numbers at a time.
ROWS_AT_ONCE = 2_000


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
    evaluate = partial(_evaluate, system, kind, options)
    output, notes = answered(system, X, evaluate, options, unit)
    return Inferred(output.value, output.interval, notes, SYSTEMS[kind].method(system, options))


def _evaluate(system: FuzzySystem, kind: str, options: InferenceOptions, X: Array) -> Output:
    fast = is_compiled(system, kind) and not is_exact(options.sampling)
    if fast and len(X) >= COMPILED_FROM_ROWS:
        from fuzzy.systems.compiled import compiled  # numba, which few rows do not repay

        return compiled(system, kind, options).evaluate(X)
    starts = range(0, max(len(X), 1), ROWS_AT_ONCE)
    blocks = [SYSTEMS[kind].evaluate(system, X[i : i + ROWS_AT_ONCE], options) for i in starts]
    if len(blocks) == 1:
        return blocks[0]
    values, intervals, strengths = zip(*blocks, strict=True)
    interval = None if intervals[0] is None else np.concatenate(intervals)
    return Output(np.concatenate(values), interval, np.concatenate(strengths))
