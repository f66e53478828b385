"""Rules that repeat, contradict or dominate one another, by their terms alone.

A rule is dominated if another one with the same consequent is at least as strong at every reading,
as by `if food is good` in the case of `if food is good and service is poor`. Where rules are merged
by max, a dominated rule does not change the output.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term


class Pair(NamedTuple):
    """A rule and the one that it repeats, contradicts or is dominated by, by index."""

    rule: int
    other: int


class AntecedentForm(NamedTuple):
    """Canonical form of an antecedent, without order and without repetition under min and max.

    A term that counts n times is stored as (term, 1) to (term, n), so that an antecedent is part of
    another if and only if its set is a subset.
    """

    any_of: bool
    terms: frozenset[tuple[Term, int]]


def form(rule: Rule, operators: Operators) -> AntecedentForm:
    """Form of the rule's antecedent; a single term is an AND."""
    repeats = operators.conjunction == "prod"
    if rule.connective == "or":
        repeats = operators.disjunction == "probor"
    times = Counter(rule.antecedents if repeats else set(rule.antecedents))
    terms = frozenset((term, k) for term, n in times.items() for k in range(1, n + 1))
    return AntecedentForm(rule.connective == "or" and len(terms) > 1, terms)


def repeated(system: FuzzySystem) -> tuple[Pair, ...]:
    """Rules with the antecedent and the consequent of an earlier one."""
    return tuple(_met_before(system, same_consequent=True))


def contradictory(system: FuzzySystem) -> tuple[Pair, ...]:
    """Rules with the antecedent of an earlier one and another consequent."""
    return tuple(_met_before(system, same_consequent=False))


def _met_before(system: FuzzySystem, *, same_consequent: bool) -> Iterator[Pair]:
    met: dict[AntecedentForm, dict[int, int]] = {}
    for i, rule in enumerate(system.rules):
        first = met.setdefault(form(rule, system.operators), {})
        earlier = [j for k, j in first.items() if (k == rule.consequent) == same_consequent]
        if earlier:
            yield Pair(i, earlier[0])
        first.setdefault(rule.consequent, i)


def dominated(system: FuzzySystem) -> tuple[Pair, ...]:
    """Every dominated rule, with the shortest rule that dominates it.

    Rules of weight 0 are ignored. Of equal rules, the first one is kept. With additive aggregation
    every rule counts, and none is dominated.
    """
    if system.operators.aggregation != "max":
        return ()
    forms = [form(rule, system.operators) for rule in system.rules]

    def gives_way(i: int, j: int) -> bool:
        one, other = system.rules[i], system.rules[j]
        if i == j or one.consequent != other.consequent or one.weight > other.weight:
            return False
        if forms[i] == forms[j] and one.weight == other.weight:
            return j < i
        return _never_stronger(forms[i], forms[j])

    index = _Index(forms)
    stronger = {
        i: [j for j in sorted(index.never_weaker(forms[i])) if gives_way(i, j)]
        for i, rule in enumerate(system.rules)
        if rule.weight
    }
    return tuple(
        Pair(i, min(others, key=lambda j: (len(forms[j].terms), j)))
        for i, others in stronger.items()
        if others
    )


class _Index:
    """Index of antecedents by their terms, for fast search of dominating ones."""

    def __init__(self, forms: Sequence[AntecedentForm]) -> None:
        self.conjunctions: dict[frozenset[tuple[Term, int]], list[int]] = {}
        self.alternatives: dict[tuple[Term, int], set[int]] = {}
        for i, found in enumerate(forms):
            if found.any_of:
                for term in found.terms:
                    self.alternatives.setdefault(term, set()).add(i)
            else:
                self.conjunctions.setdefault(found.terms, []).append(i)

    def never_weaker(self, one: AntecedentForm) -> set[int]:
        """Antecedents that `one` exceeds at no reading; see `_never_stronger`."""
        by_term = [self.alternatives.get(term, set()) for term in one.terms]
        if one.any_of:
            return set.intersection(*by_term)
        return set().union(*by_term, *(self.conjunctions[part] for part in self._parts(one.terms)))

    def _parts(self, terms: frozenset[tuple[Term, int]]) -> Iterable[frozenset[tuple[Term, int]]]:
        """Subsets that are antecedents, by enumeration or by search, whichever is less work."""
        if 2 ** len(terms) > len(self.conjunctions):
            return [part for part in self.conjunctions if part <= terms]
        sizes = range(len(terms) + 1)
        parts = (frozenset(part) for size in sizes for part in combinations(terms, size))
        return [part for part in parts if part in self.conjunctions]


def _never_stronger(one: AntecedentForm, other: AntecedentForm) -> bool:
    """Whether `one` exceeds `other` at no reading: AND shrinks and OR grows with every term."""
    if one.any_of:
        return other.any_of and one.terms <= other.terms
    if other.any_of:
        return not one.terms.isdisjoint(other.terms)
    return other.terms <= one.terms
