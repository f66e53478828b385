"""Systems packed into plain arrays, evaluated by the compiled `fuzzy.systems.kernel`.

Results equal those of the numpy modules up to rounding, some hundred times faster. Every call runs
on one thread and releases the interpreter's lock.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fuzzy.systems import kernel
from fuzzy.systems.kinds import SYSTEMS, check_kind, is_compiled
from fuzzy.systems.options import OUT_OF_RANGE, InferenceOptions
from fuzzy.systems.policy import LEAST_STRENGTH, answered, require_readings
from fuzzy.systems.quadrature import Output, is_exact, sampled
from fuzzy.systems.redundancy import dominated
from fuzzy.systems.sets import (
    TYPE_1,
    Array,
    FuzzySet,
    Parameters,
    core,
    has_core,
    lower_membership,
    membership,
    upper_membership,
)
from fuzzy.systems.sugeno import consequents
from fuzzy.systems.system import MERGES, FuzzySystem, Membership, Operators, Rule, memberships
from fuzzy.systems.type_reduction import LEAST_AREA, REDUCERS

KERNEL_FORMS: dict[str, tuple[int, Callable[[Parameters], tuple[float, ...]]]] = {
    "gaussmf": (kernel.GAUSSIAN, lambda p: (*p, *p)),
    "gauss2mf": (kernel.GAUSSIAN, lambda p: p),
    "trimf": (kernel.TRAPEZOID, lambda p: (p[0], p[1], p[1], p[2])),
    "trapmf": (kernel.TRAPEZOID, lambda p: p),
    "pimf": (kernel.SPLINE, lambda p: p),
    "zmf": (kernel.SPLINE, lambda p: (-np.inf, -np.inf, *p)),
    "smf": (kernel.SPLINE, lambda p: (*p, np.inf, np.inf)),
    "linzmf": (kernel.TRAPEZOID, lambda p: (-np.inf, -np.inf, *p)),
    "linsmf": (kernel.TRAPEZOID, lambda p: (*p, np.inf, np.inf)),
    "gbellmf": (kernel.BELL, lambda p: (*p, 0.0)),
    "sigmf": (kernel.SIGMOID_PRODUCT, lambda p: (*p, 1.0, -np.inf)),
    "dsigmf": (kernel.SIGMOID_DIFFERENCE, lambda p: p),
    "psigmf": (kernel.SIGMOID_PRODUCT, lambda p: p),
}
"""Every kind of set as one of the kernel's, with its four parameters there."""


ONE_ROW: dict[str, Callable[..., kernel.Single]] = {
    "mamdani": kernel.one_mamdani,
    "sugeno": kernel.one_sugeno,
    "interval-type-2": kernel.one_interval_type2,
}


class CompiledAnswer(NamedTuple):
    """Output of a compiled system for one row of readings, in the output's unit.

    `lower` and `upper` are the ends of the type-2 interval; for the other systems both are `value`.
    `clamped`: a reading was outside its universe and was clamped. `silent`: no rule fires with
    LEAST_STRENGTH or more; the answer is the middle of the universe or, where rules fire weakly,
    the result of those.
    """

    value: float
    lower: float
    upper: float
    clamped: bool
    silent: bool


@dataclass(frozen=True, eq=False)
class Compiled:
    """A system as the arrays of the kernel, made by `compiled`."""

    system: FuzzySystem
    kind: str
    options: InferenceOptions
    universes: Array
    arguments: tuple[Any, ...]

    def evaluate(self, X: Array) -> Output:
        """Outputs for the readings X (N, inputs), without clamping to their universes.

        NaN where no rule fires, or the fired sets have no mass on the samples; `infer` refuses
        both. ValueError for a wrong width and for a reading that is not finite.
        """
        X = np.ascontiguousarray(require_readings(self.system, X))
        if self.kind == "interval-type-2":
            value, left, right, strength = kernel.interval_type2(X, *self.arguments)
            return Output(value, np.stack([left, right], axis=-1), strength)
        run = kernel.mamdani if self.kind == "mamdani" else kernel.sugeno
        value, strength = run(X, *self.arguments)
        return Output(value, None, strength)

    @cached_property
    def _one(self) -> tuple[Callable[..., kernel.Single], kernel.Integers, Array]:
        """The kernel of one row, and its arguments."""
        clamps = OUT_OF_RANGE[self.options.out_of_range].clamps
        return ONE_ROW[self.kind], *kernel.pack(self.universes, clamps, *self.arguments)

    def one(self, x: Sequence[float] | Array) -> CompiledAnswer:
        """Output for one reading per input, with the policy `options.out_of_range`.

        ValueError as in `infer`: a wrong number of readings, one that is not finite or is refused,
        no rule that fires, no finite output.
        """
        readings = np.array(x, dtype=np.float64)
        if readings.shape != (len(self.universes),):
            raise ValueError(
                f"readings have shape {readings.shape}; give {len(self.universes)}, one per input"
            )
        run, integers, floats = self._one
        value, lower, upper, strength, outside = run(readings, integers, floats)
        policy = OUT_OF_RANGE[self.options.out_of_range]
        allowed = outside == 0 or (outside > 0 and not policy.refuses)
        if allowed and strength >= LEAST_STRENGTH and math.isfinite(upper - lower):
            return CompiledAnswer(value, lower, upper, outside > 0 and policy.clamps, False)
        return self._exceptional(x)

    def _exceptional(self, x: Sequence[float] | Array) -> CompiledAnswer:
        """Result of `infer` for refused readings or no output: an error, or the middle."""
        found, _ = answered(self.system, np.array([x]), self._by_definition, self.options)
        ends = found.value if found.interval is None else found.interval[0]
        return CompiledAnswer(found.value.item(), ends[0].item(), ends[-1].item(), False, True)

    def _by_definition(self, X: Array) -> Output:
        return SYSTEMS[self.kind].evaluate(self.system, X, self.options)


def compiled(
    system: FuzzySystem, kind: str, options: InferenceOptions, *, pruned: bool = True
) -> Compiled:
    """The compiled system for inference of one `kind`; the last few are cached.

    `pruned` drops dominated rules where rules merge by max, which does not change the output.
    ValueError for a kind that the system does not support, and for exact sampling.
    """
    check_kind(system, kind)
    if is_exact(options.sampling):
        raise ValueError(
            "sampling = 'exact' is not compiled: evaluate it with infer, or choose matlab or "
            "octave sampling with more samples"
        )
    if not is_compiled(system, kind):
        raise ValueError(
            f"{system.name}: aggregation {system.operators.aggregation} and defuzzification "
            f"{system.operators.defuzzification} are not compiled: evaluate it with infer"
        )
    return _compiled(system, kind, options, pruned)


@lru_cache(maxsize=32)
def _compiled(system: FuzzySystem, kind: str, options: InferenceOptions, pruned: bool) -> Compiled:
    summed = kind == "sugeno" and MERGES[options.sugeno_aggregation].adds
    idle = {pair.rule for pair in dominated(system)} if pruned and not summed else set()
    rules = [rule for number, rule in enumerate(system.rules) if number not in idle]
    used = sorted({(term.input, term.set) for rule in rules for term in rule.antecedents})
    packed = (
        _packed_sets(system, rules, used, type_1=kind != "interval-type-2"),
        _packed_rules(system, rules, used, summed),
    )
    universes = np.array([variable.reach for variable in system.inputs])
    return Compiled(system, kind, options, universes, (*packed, *_output(system, kind, options)))


def _output(system: FuzzySystem, kind: str, options: InferenceOptions) -> tuple[Any, ...]:
    """The last arguments of the kernel."""
    if kind == "sugeno":
        return (consequents(system, options.sampling, options.samples),)
    if kind == "mamdani":
        return (_packed_grid(system, options, (membership, membership)),)
    grid = _packed_grid(system, options, (lower_membership, upper_membership))
    return grid, REDUCERS[options.reducer].nie_tan, LEAST_AREA


def _packed_sets(
    system: FuzzySystem, rules: Sequence[Rule], used: Sequence[tuple[int, int]], *, type_1: bool
) -> kernel.Sets:
    sets = [system.inputs[i].sets[s] for i, s in used]
    forms = [KERNEL_FORMS[one.kind] for one in sets]
    negated = {(t.input, t.set) for rule in rules for t in rule.antecedents if t.negated}
    footprints = [TYPE_1 if type_1 else one.footprint for one in sets]
    return kernel.Sets(
        np.array([kind for kind, _ in forms]),
        np.array([i for i, _ in used]),
        np.array([place in negated for place in used], dtype=np.int64),
        np.array(
            [(*four(one.shape), *_core(one)) for one, (_, four) in zip(sets, forms, strict=True)]
        ),
        np.array([(f.mean, f.spread, f.scale, f.lag) for f in footprints]),
    )


def _core(one: FuzzySet) -> tuple[float, float]:
    # Sets without a core have no footprint that would ask for it.
    return core(one) if has_core(one) else (-np.inf, np.inf)


def _packed_rules(
    system: FuzzySystem, rules: Sequence[Rule], used: Sequence[tuple[int, int]], summed: bool
) -> kernel.Rules:
    place = {one: 2 * number for number, one in enumerate(used)}
    members = [_members(rule, place) for rule in rules]
    operators = [_operator(rule, system.operators) for rule in rules]
    starts = [(operator, one[:-1]) for operator, one in zip(operators, members, strict=True)]
    return kernel.Rules(
        np.cumsum([0, *(len(one) for one in members)]),
        np.array([m for one in members for m in one]),
        np.array(operators),
        np.array([False, *(one == other for one, other in pairwise(starts))], dtype=np.int64),
        np.array([rule.weight for rule in rules], dtype=np.float64),
        np.array([rule.consequent for rule in rules]),
        summed,
    )


def _members(rule: Rule, place: Mapping[tuple[int, int], int]) -> list[int]:
    members = [place[term.input, term.set] + term.negated for term in rule.antecedents]
    return members if len(members) > 1 else 2 * members


def _operator(rule: Rule, operators: Operators) -> int:
    if len(rule.antecedents) == 1:
        return kernel.MINIMUM  # of the term and itself
    if rule.connective == "and":
        return kernel.MINIMUM if operators.conjunction == "min" else kernel.PRODUCT
    return kernel.MAXIMUM if operators.disjunction == "max" else kernel.PROBOR


def _packed_grid(
    system: FuzzySystem, options: InferenceOptions, bounds: tuple[Membership, Membership]
) -> kernel.Grid:
    y, weights = sampled(system.output, options.samples, options.sampling)
    lower, upper = (memberships(system.output, y, bound) for bound in bounds)
    return kernel.Grid(y, weights, lower, upper, system.operators.implication == "prod")
