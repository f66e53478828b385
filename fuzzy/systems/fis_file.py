"""`.fis` files of type-1 systems with one output, as in MATLAB and Octave's fuzzy toolkit.

Numbers are written with all significant digits, so that a system is the same after writing and
reading, except that the terms of a rule are in the order of the inputs. A system that the format
cannot represent is refused with a remedy: footprints, a rule with two terms of one input, quotes in
names. Files that MATLAB or Octave can evaluate are supported, with a few exceptions that are
refused with the reason: user-defined functions, which are not part of the file, hedges, negated
consequents, and several outputs. Outputs without rules are dropped.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

from fuzzy.systems.fis_sections import (
    TYPE_2,
    FisError,
    Line,
    Section,
    Values,
    read_sections,
    unquoted,
    words,
)
from fuzzy.systems.sets import FORMS, FUNCTION_KINDS, TYPE_1, FuzzySet, Kind
from fuzzy.systems.system import OPERATORS, Connective, FuzzySystem, Operators, Rule, Term, Variable
from study.system.folders import NO_PLACE, write_text

SYSTEM_KEYS = (
    "Name",
    "Type",
    "Version",
    "NumInputs",
    "NumOutputs",
    "NumRules",
    "AndMethod",
    "OrMethod",
    "ImpMethod",
    "AggMethod",
    "DefuzzMethod",
)
VARIABLE_KEYS = ("Name", "Range", "NumMFs")
METHODS = {
    "AndMethod": "conjunction",
    "OrMethod": "disjunction",
    "ImpMethod": "implication",
    "AggMethod": "aggregation",
    "DefuzzMethod": "defuzzification",
}
# By type. A weighted average has nothing to aggregate: `sum` is MATLAB's word for that.
DEFUZZIFICATIONS = {
    "mamdani": {one: one for one in OPERATORS["defuzzification"] if one != "wtsum"},
    "sugeno": {"wtaver": "centroid", "wtsum": "wtsum"},
}
# Octave's names for what MATLAB calls otherwise.
SYNONYMS = {"algebraic_product": "prod", "algebraic_sum": "probor"}

_SET = re.compile(
    r"""(?P<name>(['"]).*\2)\s*:\s*(['"])(?P<kind>[^'"]*)\3\s*,\s*(?P<numbers>\[.*\])"""
)
_RULE = re.compile(r"([^()]*)\(\s*([^()\s]*)\s*\)\s*:\s*([12])")


def read_fis(path: Path) -> FuzzySystem:
    """The system of a `.fis` file. FisError naming file, line and remedy."""
    sections = read_sections(path)
    values = sections["system"].values(SYSTEM_KEYS)
    kind = _kind(values)
    inputs = tuple(_variable(section) for section in sections.numbered("input"))
    outputs = sections.numbered("output")
    lines = sections["rules"].body
    values.check_count("NumInputs", len(inputs), "inputs")
    values.check_count("NumOutputs", len(outputs), "outputs")
    values.check_count("NumRules", len(lines), "rules")
    rows = [_row(line, len(inputs), len(outputs)) for line in lines]
    column = _only_column(rows, outputs)
    output = _output(outputs[column], kind, len(inputs))
    # A rule that names no set of the output says nothing about it, in MATLAB and in Octave.
    speaking = (row for row in rows if row.consequents[column])
    rules = tuple(_rule(row, column, inputs, output) for row in speaking)
    name = values["Name"].unquoted()
    with values.head.blamed():
        return FuzzySystem(inputs, output, rules, _operators(values, kind), name)


def _kind(values: Values) -> str:
    kind = values["Type"].unquoted().lower()
    if "type2" in kind:
        raise values["Type"].fault(f"Type {kind!r} {TYPE_2}")
    if kind not in DEFUZZIFICATIONS:
        raise values["Type"].fault(f"Type {kind!r}: use mamdani or sugeno")
    return kind


def _operators(values: Values, kind: str) -> Operators:
    operators = Operators()
    for key, field in METHODS.items():
        name = values[key].unquoted().lower()
        with values[key].blamed():
            operators = replace(operators, **_method(field, SYNONYMS.get(name, name), kind))
    return operators


def _method(field: str, name: str, kind: str) -> Any:
    """The operator of a field, by name; an aggregation without effect is checked and dropped."""
    if field == "defuzzification":
        known = DEFUZZIFICATIONS[kind]
        if name not in known:
            raise ValueError(
                f"{field} {name!r}: functions of one's own are no part of the file; in a {kind} "
                f"system use one of {', '.join(known)}"
            )
        return {field: known[name]}
    if field == "aggregation" and kind == "sugeno":
        Operators(aggregation=cast(Any, name))
        return {}
    return {field: name}


def _output(section: Section, kind: str, input_count: int) -> Variable:
    output = _variable(section, input_count)
    for one, line in zip(output.sets, section.values(VARIABLE_KEYS).sets(), strict=True):
        if (one.kind in FUNCTION_KINDS) != (kind == "sugeno"):
            wanted = "constant or linear" if kind == "sugeno" else "a membership function"
            raise line.fault(f"set {one.name!r} is {one.kind}; in a {kind} system give {wanted}")
    return output


def _variable(section: Section, input_count: int = 0) -> Variable:
    values = section.values(VARIABLE_KEYS)
    sets = tuple(_fuzzy_set(line, input_count) for line in values.sets())
    values.check_count("NumMFs", len(sets), "sets")
    ends = values["Range"].numbers()
    if len(ends) != 2:
        raise values["Range"].fault(f"Range {values['Range'].text}: give two numbers, [low high]")
    with section.head.blamed():
        return Variable(values["Name"].unquoted(), *ends, sets)


def _fuzzy_set(line: Line, input_count: int) -> FuzzySet:
    parts = _SET.fullmatch(line.text)
    if not parts:
        raise line.fault(f"{line.text}: write a set as 'name':'kind',[parameters]")
    kind = parts["kind"].strip().lower()
    if kind.endswith("type2"):
        raise line.fault(f"{kind} {TYPE_2}")
    given = line._replace(text=parts["numbers"]).numbers()
    with line.blamed():
        parameters = _unpadded(kind, given, input_count)
        return FuzzySet(unquoted(parts["name"]), cast(Kind, kind), parameters)


def _unpadded(kind: str, parameters: tuple[float, ...], input_count: int) -> tuple[float, ...]:
    """The parameters without the zero padding of older MATLAB files."""
    counts = {"constant": 1, "linear": input_count + 1}
    counts |= {one: len(form.parameters.split()) for one, form in FORMS.items()}
    count = counts.get(kind, len(parameters))
    return parameters if any(parameters[count:]) else parameters[:count]


class _Row(NamedTuple):
    """The numbers of a rule: set of each input and output, weight and connective."""

    line: Line
    antecedents: list[int]
    consequents: list[int]
    weight: float
    connective: Connective


def _row(line: Line, input_count: int, output_count: int) -> _Row:
    parts = _RULE.fullmatch(line.text)
    if not parts:
        raise line.fault(
            f"{line.text!r} is no rule; write a set of each input, the output's set, the weight, "
            "and 1 for AND or 2 for OR, as in `1 0 -2, 3 (1) : 1`"
        )
    numbers = [_index(line, word) for word in words(parts[1])]
    due = input_count + output_count
    if len(numbers) != due:
        outputs = "one output" if output_count == 1 else f"{output_count} outputs"
        raise line.fault(
            f"{len(numbers)} sets for {input_count} inputs and {outputs}; give {due}, with 0 for "
            "an input that the rule does not use"
        )
    antecedents, consequents = numbers[:input_count], numbers[input_count:]
    connective: Connective = "and" if parts[3] == "1" else "or"
    return _Row(line, antecedents, consequents, line.parsed(parts[2]), connective)


def _only_column(rows: list[_Row], outputs: list[Section]) -> int:
    """The index of the only output with rules; the first without any rules."""
    named = [k for k in range(len(outputs)) if any(row.consequents[k] for row in rows)]
    if len(named) > 1:
        raise outputs[named[1]].head.fault(
            "a second output that rules name; write one file for each output"
        )
    return named[0] if named else 0


def _rule(row: _Row, column: int, inputs: tuple[Variable, ...], output: Variable) -> Rule:
    line, consequent = row.line, row.consequents[column]
    if consequent < 0:
        raise line.fault(
            f"consequent {consequent}: NOT on the output is not computed; give the number of a set "
            "of the output, one of its own for what is meant"
        )
    _check_index(line, consequent, output)
    terms = tuple(_terms(line, row.antecedents, inputs))
    if not terms:
        raise line.fault(
            "the rule uses no input, so that nothing says how far it fires (Octave fails there); "
            "give at least one a set other than 0"
        )
    with line.blamed():
        return Rule(terms, consequent - 1, row.connective, row.weight)


def _terms(line: Line, chosen: list[int], inputs: tuple[Variable, ...]) -> Iterator[Term]:
    for i, number in enumerate(chosen):
        _check_index(line, abs(number), inputs[i])
        if number:
            yield Term(i, abs(number) - 1, number < 0)


def _index(line: Line, word: str) -> int:
    number = line.parsed(word)
    if not number.is_integer():
        raise line.fault(f"{word}: hedges, Octave's decimals, are not computed; drop them")
    return int(number)


def _check_index(line: Line, number: int, variable: Variable) -> None:
    if number > len(variable.sets):
        raise line.fault(
            f"set {number} of {variable.name!r}, which has {len(variable.sets)}; correct the rule"
        )


def write_fis(system: FuzzySystem, path: Path) -> None:
    """Write a type-1 system; ValueError, and no file, if a `.fis` file cannot hold it."""
    text = fis_text(system)
    try:
        write_text(path, text)
    except NO_PLACE as error:
        raise FisError(f"{path}: cannot be written ({error.strerror})") from None


def fis_text(system: FuzzySystem) -> str:
    """Text of the `.fis` file of a type-1 system; ValueError if it cannot hold the system."""
    _check_writable(system)
    sections = [
        _system_lines(system),
        *(_variable_lines(f"Input{i}", one) for i, one in enumerate(system.inputs, start=1)),
        _variable_lines("Output1", system.output),
        ["[Rules]", *(_rule_text(rule, len(system.inputs)) for rule in system.rules)],
    ]
    return "\n\n".join("\n".join(lines) for lines in sections) + "\n"


def _check_writable(system: FuzzySystem) -> None:
    for variable in (*system.inputs, system.output):
        for one in variable.sets:
            if one.footprint != TYPE_1:
                raise ValueError(
                    f"{variable.name}: set {one.name!r} has a footprint, which a .fis file cannot "
                    "hold; write JSON, or the system without footprints (type_1_of)"
                )
        _check_names(variable.name, *(one.name for one in variable.sets))
    _check_names(system.name)
    for number, rule in enumerate(system.rules, start=1):
        if len({term.input for term in rule.antecedents}) < len(rule.antecedents):
            raise ValueError(
                f"rule {number}: two terms of one input, and a .fis file holds one; write JSON"
            )


def _check_names(*names: str) -> None:
    for name in names:
        if re.search(r"['\r\n]", name):
            raise ValueError(
                f"name {name!r}: a .fis file holds no quotes or line breaks in names; rename it"
            )


def _system_lines(system: FuzzySystem) -> list[str]:
    kind = "sugeno" if system.is_sugeno else "mamdani"
    values = (
        f"'{system.name}'",
        f"'{kind}'",
        "2.0",
        f"{len(system.inputs)}",
        "1",
        f"{len(system.rules)}",
        *(f"'{method}'" for method in _methods(system)),
    )
    return ["[System]", *(f"{k}={v}" for k, v in zip(SYSTEM_KEYS, values, strict=True))]


def _methods(system: FuzzySystem) -> list[str]:
    methods: list[str] = [getattr(system.operators, field) for field in METHODS.values()]
    if not system.is_sugeno:
        return methods
    names = {one: name for name, one in DEFUZZIFICATIONS["sugeno"].items()}
    return [*methods[:-2], "sum", names[methods[-1]]]


def _variable_lines(header: str, variable: Variable) -> list[str]:
    return [
        f"[{header}]",
        f"Name='{variable.name}'",
        f"Range={_bracketed((variable.low, variable.high))}",
        f"NumMFs={len(variable.sets)}",
        *(
            f"MF{number}='{one.name}':'{one.kind}',{_bracketed(one.parameters)}"
            for number, one in enumerate(variable.sets, start=1)
        ),
    ]


def _bracketed(numbers: Iterable[float]) -> str:
    return f"[{' '.join(_digits(x) for x in numbers)}]"


def _digits(x: float) -> str:
    """The shortest text that reads back as the same number."""
    return repr(float(x)).removesuffix(".0")


def _rule_text(rule: Rule, input_count: int) -> str:
    numbers = [0] * input_count
    for term in rule.antecedents:
        numbers[term.input] = -(term.set + 1) if term.negated else term.set + 1
    terms = " ".join(str(number) for number in numbers)
    connective = 1 if rule.connective == "and" else 2
    return f"{terms}, {rule.consequent + 1} ({_digits(rule.weight)}) : {connective}"
