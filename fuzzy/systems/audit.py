"""Audit of a rule base: repeated, contradictory and ineffective rules, and gaps in coverage.

There are three kinds of ineffective rules. Rules of weight 0, and rules whose terms no reading
satisfies together, never fire. A dominated rule fires and counts in Sugeno's sum over rules, but
does not change the output where rules are merged by max: Mamdani, type-2, and Sugeno by output
sets.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fuzzy.systems import coverage, redundancy
from fuzzy.systems.coverage import Coverage, Gap
from fuzzy.systems.redundancy import Pair
from fuzzy.systems.rule_text import rule_text
from fuzzy.systems.system import FuzzySystem

THRESHOLD = 0.05
"""Firing strength up to which a reading counts as uncovered; that of a Gaussian at 2.4 SD."""


@dataclass(frozen=True)
class Audit:
    """Findings on a system: rules by index, sets by (variable, set).

    `coverage` tests `samples` readings of all inputs together against `threshold`; `gaps` are those
    of each input alone.
    """

    duplicates: tuple[Pair, ...]
    contradictions: tuple[Pair, ...]
    dominated: tuple[Pair, ...]
    unreachable: tuple[int, ...]
    weightless: tuple[int, ...]
    unused_sets: tuple[tuple[str, str], ...]
    gaps: tuple[Gap, ...]
    coverage: Coverage
    samples: int
    threshold: float


def audit(system: FuzzySystem, *, samples: int = 4096, threshold: float = THRESHOLD) -> Audit:
    """Audit a system. ValueError for no samples or a threshold outside 0 to 1."""
    if samples < 1:
        raise ValueError(f"samples = {samples}: give at least 1")
    if not 0 < threshold < 1:
        raise ValueError(f"threshold = {threshold}: give a strength between 0 and 1")
    return Audit(
        duplicates=redundancy.repeated(system),
        contradictions=redundancy.contradictory(system),
        dominated=redundancy.dominated(system),
        unreachable=coverage.unreachable(system),
        weightless=tuple(i for i, rule in enumerate(system.rules) if rule.weight == 0),
        unused_sets=tuple(_unused(system)),
        gaps=coverage.gaps(system, threshold),
        coverage=coverage.coverage(system, samples, threshold),
        samples=samples,
        threshold=threshold,
    )


def _unused(system: FuzzySystem) -> Iterator[tuple[str, str]]:
    used = {(term.input, term.set) for rule in system.rules for term in rule.antecedents}
    for i, variable in enumerate(system.inputs):
        for k, one in enumerate(variable.sets):
            if (i, k) not in used:
                yield variable.name, one.name
    concluded = {rule.consequent for rule in system.rules}
    for k, one in enumerate(system.output.sets):
        if k not in concluded:
            yield system.output.name, one.name


def audit_lines(found: Audit, system: FuzzySystem, examples: int = 3) -> tuple[str, ...]:
    """The findings as sentences, each kind followed by its first `examples` rules."""
    return (
        _headline(system),
        *_pairs(
            found.duplicates,
            system,
            examples,
            "repeat an earlier rule: each counts again in Sugeno's sum over rules and changes no "
            "other answer",
        ),
        *_pairs(
            found.contradictions,
            system,
            examples,
            "contradict an earlier rule, with the same antecedent and another consequent",
        ),
        *_dominance(found, system, examples),
        *_rules(found.unreachable, system, examples, "can be fired by no reading of the universe"),
        *_rules(found.weightless, system, examples, "have weight 0 and never fire"),
        *(f"{variable}: no rule uses the set {name}" for variable, name in found.unused_sets),
        *(
            f"{gap.input}: no set exceeds {found.threshold:g} from {gap.low:g} to {gap.high:g}"
            for gap in found.gaps
        ),
        _covered(found, system),
    )


def _headline(system: FuzzySystem) -> str:
    counts = ", ".join(f"{len(variable.sets)} of {variable.name}" for variable in system.inputs)
    return f"{system.name}: {len(system.rules)} rules on sets: {counts}"


def _pairs(found: Sequence[Pair], system: FuzzySystem, examples: int, what: str) -> Iterator[str]:
    if found:
        yield f"{_counted(len(found), system)} {what}"
    for pair in found[:examples]:
        yield f"  rule {pair.rule + 1}, as rule {pair.other + 1}: {_text(pair.rule, system)}"
    yield from _more(found, examples)


def _dominance(found: Audit, system: FuzzySystem, examples: int) -> Iterator[str]:
    if not found.dominated:
        return
    left = len(system.rules) - len(found.dominated) - len(found.weightless)
    yield (
        f"{_counted(len(found.dominated), system)} change no answer where rules are merged by max "
        "(Mamdani, type-2, Sugeno by output sets): a rule with the same consequent and a part of "
        f"the antecedent, or all of it, is always at least as strong. The other {left} alone give "
        "the same answers; Sugeno's sum over rules counts all"
    )
    for pair in found.dominated[:examples]:
        yield (
            f"  rule {pair.rule + 1}, {_text(pair.rule, system)}, gives way to rule "
            f"{pair.other + 1}, {_text(pair.other, system)}"
        )
    yield from _more(found.dominated, examples)


def _rules(found: Sequence[int], system: FuzzySystem, examples: int, what: str) -> Iterator[str]:
    if found:
        yield f"{_counted(len(found), system)} {what}"
    yield from (f"  rule {rule + 1}: {_text(rule, system)}" for rule in found[:examples])
    yield from _more(found, examples)


def _more(found: Sequence[object], examples: int) -> Iterator[str]:
    if len(found) > examples:
        yield f"  and {len(found) - examples} more"


def _covered(found: Audit, system: FuzzySystem) -> str:
    values = zip(system.inputs, found.coverage.least_covered, strict=True)
    reading = ", ".join(f"{variable.name} = {x:.4g}" for variable, x in values)
    share = found.coverage.uncovered
    fire = (
        f"{100 * share:.2g} % of {found.samples} readings spread over the universe fire no rule"
        if share
        else f"each of {found.samples} readings spread over the universe fires a rule"
    )
    return (
        f"{fire} above {found.threshold:g}; the least covered reading, {reading}, fires rules up "
        f"to {found.coverage.least_strength:.2g}"
    )


def _counted(number: int, system: FuzzySystem) -> str:
    return f"{number} of {len(system.rules)} rules"


def _text(rule: int, system: FuzzySystem) -> str:
    return rule_text(system.rules[rule], system)
