"""Fuzzy systems as JSON, with every property by name; reading restores an equal system.

    {
      "format": "fuzzy-system",
      "version": 1,
      "name": "comfort",                                 # optional
      "operators": {"conjunction": "min"},               # optional, and so is each of the three
      "inputs": [
        {
          "name": "warmth", "low": 0, "high": 40,
          "sets": [
            {"name": "cold", "kind": "zmf", "parameters": [10, 20]},
            {"name": "warm", "kind": "gaussmf", "parameters": [4, 25], "footprint": {"mean": 1}}
          ]
        }
      ],
      "output": {"name": "heating", "low": 0, "high": 1, "sets": [...]},
      "rules": [
        {"if": [{"input": "warmth", "is": "cold"}], "then": "high"},
        {"if": [{"input": "warmth", "is_not": "cold"}, {"input": "sun", "is": "out"}],
         "then": "low", "connective": "or", "weight": 0.5}
      ]
    }

Kinds and parameters are those of `fuzzy.systems.sets`, which are MATLAB's; a Sugeno system has sets
of kind `constant` or `linear` on its output. A footprint has `mean`, `spread`, `scale` and `lag`, a
rule a `connective` and a `weight`; defaults are those of `Footprint` and `Rule` and are not
written. Operators: `conjunction` min or prod, `disjunction` max or probor,
`implication` min or prod, `aggregation` max, sum or probor, `defuzzification` centroid, bisector,
mom, som or lom, for Sugeno wtsum. JSON knows no comments. Unknown keys are refused.
"""

import difflib
import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NoReturn, cast

from fuzzy.systems.sets import Footprint, FuzzySet, Kind
from fuzzy.systems.system import Connective, FuzzySystem, Operators, Rule, Term, Variable
from study.system.folders import NO_PLACE, write_text

FORMAT = "fuzzy-system"
VERSION = 1
WIDTH = 160
"""Columns within which a set or a rule is kept on one line."""


class JsonError(ValueError):
    """A JSON file without a valid system; the message names file, path and remedy."""


@dataclass(frozen=True)
class Node:
    """A value of the document and its path, such as `rules[3].then`."""

    value: Any
    file: str
    place: str = ""

    def fault(self, what: str) -> JsonError:
        """A JsonError that names this path of the document."""
        return JsonError(": ".join(part for part in (self.file, self.place, what) if part))

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Prefix errors of a set, rule or system with file and path."""
        try:
            yield
        except JsonError:
            raise
        except ValueError as error:
            raise self.fault(str(error)) from error

    def keys(self, *required: str, optional: Collection[str] = ()) -> dict[str, "Node"]:
        """The values of an object by key; JsonError for an unknown or missing key."""
        known = (*required, *optional)
        if not isinstance(self.value, dict):
            raise self.fault(f"give an object with the keys {_quoted(known)}")
        for key in self.value:
            if key not in known:
                raise self.fault(f"unknown key {key!r}; {_hint(key, known)}")
        for key in required:
            if key not in self.value:
                raise self.fault(f"has no {key!r}; add it")
        dot = "." if self.place else ""
        return {k: Node(v, self.file, f"{self.place}{dot}{k}") for k, v in self.value.items()}

    def items(self) -> list["Node"]:
        """The values of a JSON array; JsonError for anything else."""
        if not isinstance(self.value, list):
            raise self.fault("give an array, [...]")
        return [Node(v, self.file, f"{self.place}[{i}]") for i, v in enumerate(self.value)]

    def text(self) -> str:
        """The value as a string; JsonError for anything else."""
        if not isinstance(self.value, str):
            raise self.fault(f"{json.dumps(self.value)} is no text; put it in quotes")
        return self.value

    def number(self) -> float:
        """The value as a number; JsonError for anything else."""
        if not isinstance(self.value, float):
            raise self.fault(f"{json.dumps(self.value)} is no number; give one without quotes")
        return self.value

    def index(self, names: list[str], of: str) -> int:
        """The position of a name among those of the sets or inputs."""
        name = self.text()
        if name not in names:
            raise self.fault(f"{name!r} is {of}; it has {_quoted(names)}{_closest(name, names)}")
        return names.index(name)


def read_json(path: Path) -> FuzzySystem:
    """The system of a JSON file. JsonError naming file, place and remedy."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise JsonError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise JsonError(f"{path}: is not UTF-8 text; save it in that encoding") from None
    return _system(Node(_document(text, path), str(path)))


def _document(text: str, path: Path) -> Any:
    try:
        return json.loads(text, parse_int=float, parse_constant=_refused, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise JsonError(f"{path}:{error.lineno}:{error.colno}: {error.msg}") from None
    except RecursionError:
        raise JsonError(f"{path}: is nested far too deeply to be a fuzzy system") from None
    except JsonError as error:
        raise JsonError(f"{path}: {error}") from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise JsonError(f"an object has the key {key!r} twice; remove one of both")
        found[key] = value
    return found


def _refused(constant: str) -> NoReturn:
    raise JsonError(f"{constant} is no finite number; correct it")


def _system(root: Node) -> FuzzySystem:
    _check_format(root)
    keys = root.keys(
        "format", "version", "inputs", "output", "rules", optional=("name", "operators")
    )
    inputs = tuple(_variable(node) for node in keys["inputs"].items())
    output = _variable(keys["output"])
    rules = tuple(_rule(node, inputs, output) for node in keys["rules"].items())
    operators = _operators(keys["operators"]) if "operators" in keys else Operators()
    name = keys["name"].text() if "name" in keys else "system"
    with root.blamed():
        return FuzzySystem(inputs, output, rules, operators, name)


def _check_format(root: Node) -> None:
    if not isinstance(root.value, dict) or root.value.get("format") != FORMAT:
        raise root.fault(f'is no fuzzy system; such a file begins with "format": "{FORMAT}"')
    version = root.value.get("version")
    if version != VERSION:
        raise root.fault(f"is of version {version!r}; this program reads version {VERSION}")


def _operators(node: Node) -> Operators:
    chosen: Any = {k: v.text() for k, v in node.keys(optional=_names(Operators)).items()}
    with node.blamed():
        return Operators(**chosen)


def _variable(node: Node) -> Variable:
    keys = node.keys("name", "low", "high", "sets")
    sets = tuple(_fuzzy_set(one) for one in keys["sets"].items())
    with node.blamed():
        return Variable(keys["name"].text(), keys["low"].number(), keys["high"].number(), sets)


def _fuzzy_set(node: Node) -> FuzzySet:
    keys = node.keys("name", "kind", "parameters", optional=("footprint",))
    parameters = tuple(one.number() for one in keys["parameters"].items())
    footprint = _footprint(keys["footprint"]) if "footprint" in keys else Footprint()
    name, kind = keys["name"].text(), cast(Kind, keys["kind"].text())
    with node.blamed():
        return FuzzySet(name, kind, parameters, footprint)


def _footprint(node: Node) -> Footprint:
    widths = {k: v.number() for k, v in node.keys(optional=_names(Footprint)).items()}
    with node.blamed():
        return Footprint(**widths)


def _rule(node: Node, inputs: tuple[Variable, ...], output: Variable) -> Rule:
    keys = node.keys("if", "then", optional=("connective", "weight"))
    terms = tuple(_term(one, inputs) for one in keys["if"].items())
    if not terms:
        raise keys["if"].fault("has no term; give at least one")
    consequent = keys["then"].index(_set_names(output), f"no set of {output.name!r}")
    connective = keys["connective"].text() if "connective" in keys else "and"
    weight = keys["weight"].number() if "weight" in keys else 1.0
    with node.blamed():
        return Rule(terms, consequent, cast(Connective, connective), weight)


def _term(node: Node, inputs: tuple[Variable, ...]) -> Term:
    keys = node.keys("input", optional=("is", "is_not"))
    if ("is" in keys) == ("is_not" in keys):
        raise node.fault("give either 'is' or 'is_not'")
    i = keys["input"].index([variable.name for variable in inputs], "no input of the system")
    named = keys["is_not" if "is_not" in keys else "is"]
    index = named.index(_set_names(inputs[i]), f"no set of {inputs[i].name!r}")
    return Term(i, index, "is_not" in keys)


def _names(kind: type[Operators | Footprint]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _set_names(variable: Variable) -> list[str]:
    return [one.name for one in variable.sets]


def _quoted(names: Collection[str]) -> str:
    return ", ".join(repr(name) for name in names)


def _hint(name: str, known: Collection[str]) -> str:
    return f"known are {_quoted(known)}{_closest(name, known)}"


def _closest(name: str, known: Collection[str]) -> str:
    closest = difflib.get_close_matches(name, known, 1)
    return f"; did you mean {closest[0]!r}?" if closest else ""


def write_json(system: FuzzySystem, path: Path) -> None:
    """Write any system, of type 1 or 2, as JSON; JsonError if the file cannot be written."""
    try:
        write_text(path, json_text(system))
    except NO_PLACE as error:
        raise JsonError(f"{path}: cannot be written ({error.strerror})") from None


def json_text(system: FuzzySystem) -> str:
    """The document of a system, with one line per set and rule where it fits."""
    document = {
        "format": FORMAT,
        "version": VERSION,
        "name": system.name,
        "operators": _operators_entry(system.operators),
        "inputs": [_variable_entry(variable) for variable in system.inputs],
        "output": _variable_entry(system.output),
        "rules": [_rule_entry(rule, system) for rule in system.rules],
    }
    return _laid_out(document) + "\n"


def _operators_entry(operators: Operators) -> dict[str, str]:
    """All operators, without later additions to version 1 that have their default."""
    late = {"aggregation": "max", "defuzzification": "centroid"}
    return {key: one for key, one in asdict(operators).items() if late.get(key) != one}


def _variable_entry(variable: Variable) -> dict[str, Any]:
    return {
        "name": variable.name,
        "low": float(variable.low),
        "high": float(variable.high),
        "sets": [_set_entry(one) for one in variable.sets],
    }


def _set_entry(one: FuzzySet) -> dict[str, Any]:
    parameters = [float(number) for number in one.parameters]
    entry = {"name": one.name, "kind": one.kind, "parameters": parameters}
    footprint = _changed(asdict(one.footprint), asdict(Footprint()))
    return {**entry, "footprint": footprint} if footprint else entry


def _rule_entry(rule: Rule, system: FuzzySystem) -> dict[str, Any]:
    terms = [
        {
            "input": system.inputs[term.input].name,
            "is_not" if term.negated else "is": system.inputs[term.input].sets[term.set].name,
        }
        for term in rule.antecedents
    ]
    manner = {"connective": rule.connective, "weight": float(rule.weight)}
    entry = {"if": terms, "then": system.output.sets[rule.consequent].name}
    return entry | _changed(manner, {"connective": "and", "weight": 1.0})


def _changed(entries: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in entries.items() if value != defaults[key]}


def _laid_out(value: Any, indent: str = "") -> str:
    """JSON text of a value on one line, or one line per entry if that is too long."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False)
    if len(indent + text) < WIDTH or not isinstance(value, dict | list):
        return text
    deeper = indent + "  "
    if isinstance(value, list):
        opening, closing = "[]"
        entries = [_laid_out(one, deeper) for one in value]
    else:
        opening, closing = "{}"
        entries = [f"{json.dumps(k)}: {_laid_out(v, deeper)}" for k, v in value.items()]
    body = ",\n".join(deeper + entry for entry in entries)
    return f"{opening}\n{body}\n{indent}{closing}"
