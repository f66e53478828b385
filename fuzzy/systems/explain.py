"""Explanation of an output: degrees, fired rules, heights of the output sets, output curve.

All values are in the units of the system. A type-1 quantity has equal lower and upper values.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fuzzy.systems import sugeno
from fuzzy.systems.inference import infer
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.policy import LEAST_STRENGTH, in_range
from fuzzy.systems.quadrature import is_exact, sampled
from fuzzy.systems.sets import Array
from fuzzy.systems.system import (
    MERGES,
    FuzzySystem,
    Rule,
    aggregated,
    firing_strengths,
    memberships,
    merged,
)


class Degree(NamedTuple):
    """Membership of the reading of an input in one of its sets."""

    input: str
    set: str
    lower: float
    upper: float


class Firing(NamedTuple):
    """A fired rule and its effect; `number` counts from 1.

    `share` is its fraction of the total weight of a Sugeno system, None for other systems, where a
    rule matters only if it determines the lower or upper height of its output set. Equally strong
    rules determine a height together and share its weight.
    """

    number: int
    rule: Rule
    lower: float
    upper: float
    share: float | None
    sets_lower: bool
    sets_upper: bool


class OutputSet(NamedTuple):
    """An output set and the height at which it is implied.

    `lower_rules` and `upper_rules`: numbers of the rules that determine it; empty where strengths
    or curves are added. In a Sugeno system each set has a `constant` and its `share` of the total
    weight.
    """

    name: str
    lower: float
    upper: float
    lower_rules: tuple[int, ...]
    upper_rules: tuple[int, ...]
    constant: float | None
    share: float | None


class OutputCurve(NamedTuple):
    """Bounds (M,) of the union of the implied output sets at the points y (M,)."""

    y: Array
    lower: Array
    upper: Array


class SwitchPoint(NamedTuple):
    """Switch point of an end of the type-2 interval between the bounds.

    The first `samples` points, up to `before`, lie on one side; the next is `after`. Without
    sampling both are the end itself, and `samples` is None.
    """

    samples: int | None
    before: float
    after: float


@dataclass(frozen=True)
class Explanation:
    """One output of a system with all intermediate results.

    `readings` (inputs,): as evaluated, after clamping; `rules`: strongest first, ties by fewer
    terms; `curve`: None for Sugeno; `interval` and `switches`: for type-2 only. With exact sampling
    the curve is given at `options.samples` points, for plotting.
    """

    system: FuzzySystem
    kind: str
    readings: Array
    degrees: tuple[Degree, ...]
    rules: tuple[Firing, ...]
    outputs: tuple[OutputSet, ...]
    curve: OutputCurve | None
    answer: float
    interval: tuple[float, float] | None
    switches: tuple[SwitchPoint, SwitchPoint] | None
    notes: tuple[str, ...]
    method: str


class _Fired(NamedTuple):
    """Strength of each rule (R,), whether it determines its set's height, and the heights (K,)."""

    consequents: NDArray[np.intp]
    lower: Array
    upper: Array
    sets_lower: NDArray[np.bool_]
    sets_upper: NDArray[np.bool_]
    lower_heights: Array
    upper_heights: Array


def explain(
    system: FuzzySystem,
    x: Array,
    kind: str,
    options: InferenceOptions | None = None,
    unit: str = "",
) -> Explanation:
    """Explain the output of `infer` for the readings x (inputs,).

    `unit` appears in the notes. ValueError as in `infer`.
    """
    options = options or InferenceOptions()
    X = np.asarray(x, dtype=np.float64)[np.newaxis]
    found = infer(system, X, kind, options, unit)
    X, _ = in_range(system, X, options.out_of_range, unit)
    fired = _fire(system, X, kind, options)
    constants = _constants(system, X, options) if kind == "sugeno" else None
    shares = _shares(fired, options) if kind == "sugeno" else None
    order = _order(system, fired)
    curve = None if kind == "sugeno" else _curve(system, fired, kind, options.samples)
    interval = None if found.interval is None else _pair(found.interval[0])
    return Explanation(
        system=system,
        kind=kind,
        readings=X[0],
        degrees=_degrees(system, X[0], kind),
        rules=_firings(system, fired, shares, order),
        outputs=_outputs(system, fired, constants, shares, order),
        curve=curve,
        answer=float(found.value[0]),
        interval=interval,
        switches=_switches(curve, interval, options),
        notes=found.notes,
        method=found.method,
    )


def _degrees(system: FuzzySystem, x: Array, kind: str) -> tuple[Degree, ...]:
    lower, upper = SYSTEMS[kind].bounds
    return tuple(
        Degree(variable.name, one.name, float(lower(one, reading)), float(upper(one, reading)))
        for variable, reading in zip(system.inputs, x, strict=True)
        for one in variable.sets
    )


def _fire(system: FuzzySystem, X: Array, kind: str, options: InferenceOptions) -> _Fired:
    low, high = SYSTEMS[kind].bounds
    lower, upper = firing_strengths(system, X, low, high), firing_strengths(system, X, high, low)
    adds = kind == "sugeno" and MERGES[options.sugeno_aggregation].adds
    every_counts = adds or (kind != "sugeno" and system.operators.aggregation != "max")
    consequents = np.array([rule.consequent for rule in system.rules])
    heights = [merged(system, strengths, "sum" if adds else "max") for strengths in (lower, upper)]
    sets = [
        (strengths > 0) & (strengths == height[consequents]) & (not every_counts)
        for strengths, height in zip((lower, upper), heights, strict=True)
    ]
    columns = (part[:, 0] for part in (lower, upper, *sets, *heights))
    return _Fired(consequents, *columns)


def _constants(system: FuzzySystem, X: Array, options: InferenceOptions) -> Array:
    """Value of each consequent of a Sugeno system, shape (output sets,)."""
    table = sugeno.consequents(system, options.sampling, options.samples)
    return np.asarray(table[:, :-1] @ X[0] + table[:, -1])


def _shares(fired: _Fired, options: InferenceOptions) -> Array:
    """Fraction of each rule in the total weight of a Sugeno system, shape (rules,)."""
    weights = fired.upper
    if not MERGES[options.sugeno_aggregation].adds:
        level = np.bincount(fired.consequents, fired.sets_upper)[fired.consequents]
        weights = np.where(fired.sets_upper, fired.upper / np.maximum(level, 1), 0.0)
    total = weights.sum()
    return weights / total if total > 0 else weights


def _order(system: FuzzySystem, fired: _Fired) -> NDArray[np.intp]:
    """Fired rules, strongest first, ties by fewer terms."""
    lengths = np.array([len(rule.antecedents) for rule in system.rules])
    order = np.lexsort((lengths, -fired.lower, -fired.upper))
    return order[fired.upper[order] >= LEAST_STRENGTH]


def _firings(
    system: FuzzySystem, fired: _Fired, shares: Array | None, order: NDArray[np.intp]
) -> tuple[Firing, ...]:
    return tuple(
        Firing(
            number=int(r) + 1,
            rule=system.rules[r],
            lower=float(fired.lower[r]),
            upper=float(fired.upper[r]),
            share=None if shares is None else float(shares[r]),
            sets_lower=bool(fired.sets_lower[r]),
            sets_upper=bool(fired.sets_upper[r]),
        )
        for r in order
    )


def _outputs(
    system: FuzzySystem,
    fired: _Fired,
    constants: Array | None,
    shares: Array | None,
    order: NDArray[np.intp],
) -> tuple[OutputSet, ...]:
    def numbers(sets: NDArray[np.bool_], k: int) -> tuple[int, ...]:
        return tuple(int(r) + 1 for r in order if sets[r] and fired.consequents[r] == k)

    return tuple(
        OutputSet(
            name=one.name,
            lower=float(fired.lower_heights[k]),
            upper=float(fired.upper_heights[k]),
            lower_rules=numbers(fired.sets_lower, k),
            upper_rules=numbers(fired.sets_upper, k),
            constant=None if constants is None else float(constants[k]),
            share=None if shares is None else float(shares[fired.consequents == k].sum()),
        )
        for k, one in enumerate(system.output.sets)
    )


def _curve(system: FuzzySystem, fired: _Fired, kind: str, samples: int) -> OutputCurve:
    y = sampled(system.output, samples, "matlab").y
    strengths = (fired.lower, fired.upper)
    lower, upper = (
        aggregated(system, level[:, np.newaxis], memberships(system.output, y, bound))[0]
        for level, bound in zip(strengths, SYSTEMS[kind].bounds, strict=True)
    )
    return OutputCurve(y, lower, upper)


def _pair(ends: Array) -> tuple[float, float]:
    return float(ends[0]), float(ends[1])


def _switches(
    curve: OutputCurve | None, interval: tuple[float, float] | None, options: InferenceOptions
) -> tuple[SwitchPoint, SwitchPoint] | None:
    """Switch points: each end is the centroid of a set that switches between the bounds there."""
    if curve is None or interval is None or not curve.upper.max() > 0:
        return None
    if is_exact(options.sampling):
        left, right = (SwitchPoint(None, end, end) for end in interval)
        return left, right
    # A sample on the end itself belongs to the upper bound, which may be all there is.
    left = _switch(curve.y, int(np.searchsorted(curve.y, interval[0], side="right")))
    right = _switch(curve.y, int(np.searchsorted(curve.y, interval[1], side="left")))
    return left, right


def _switch(y: Array, samples: int) -> SwitchPoint:
    last = len(y) - 1
    return SwitchPoint(samples, float(y[max(samples - 1, 0)]), float(y[min(samples, last)]))


def shown_rules(explanation: Explanation, count: int) -> tuple[Firing, ...]:
    """About `count` most informative rules, strongest first.

    They are the first rule of each output set and of each height, then the strongest rules with a
    set that no earlier one has, then the strongest of the others.
    """
    by_number = {firing.number: firing for firing in explanation.rules}
    consequents = [firing.rule.consequent for firing in explanation.rules]
    first = [explanation.rules[consequents.index(k)].number for k in sorted(set(consequents))]
    first += [one.lower_rules[0] for one in explanation.outputs if one.lower_rules]
    named = {term for number in first for term in by_number[number].rule.antecedents}
    telling = []
    for firing in explanation.rules:
        if not named.issuperset(firing.rule.antecedents):
            telling.append(firing.number)
            named.update(firing.rule.antecedents)
    ranked = list(dict.fromkeys((*first, *telling, *by_number)))
    chosen = {*ranked[: max(count, len(set(first)))]}
    return tuple(firing for firing in explanation.rules if firing.number in chosen)
