"""Inference by any kind of system, with one policy for readings without an output."""

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
    """Output `value` (N,), type-2 `interval` (N, 2) or None, in the output's unit.

    `notes`: changes of the readings; `method`: description of the computation.
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
    """Outputs of a `kind` of inference for the readings X (N, inputs), in the inputs' units.

    `unit` appears in the notes. ValueError, with input and row, for a reading that is not finite,
    by the policy `options.out_of_range`, and where rules fire without a finite output.
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
