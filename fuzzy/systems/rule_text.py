"""A rule as a sentence."""

from fuzzy.systems.system import FuzzySystem, Rule, Term


def rule_text(rule: Rule, system: FuzzySystem) -> str:
    """The rule in words: `if food is good and service is not poor then high (weight 0.5)`."""
    terms = f" {rule.connective} ".join(_term(term, system) for term in rule.antecedents)
    weight = "" if rule.weight == 1 else f" (weight {rule.weight:g})"
    return f"if {terms} then {system.output.sets[rule.consequent].name}{weight}"


def _term(term: Term, system: FuzzySystem) -> str:
    variable = system.inputs[term.input]
    return f"{variable.name} is {'not ' if term.negated else ''}{variable.sets[term.set].name}"
