"""An explanation as lines of text."""

from collections.abc import Sequence

from fuzzy.systems.explain import Explanation, Firing, OutputSet, shown_rules
from fuzzy.systems.rule_text import rule_text
from fuzzy.systems.system import FuzzySystem


def explanation_lines(explanation: Explanation, unit: str = "", rules: int = 10) -> list[str]:
    """The explanation as aligned lines of text, with about so many rules."""
    shown = shown_rules(explanation, rules)
    total = len(explanation.system.rules)
    return [
        f"{explanation.kind}: {_answer(explanation, unit)}",
        f"  {explanation.method}",
        *(f"  note: {note}" for note in explanation.notes),
        "readings and degrees of membership",
        *_indented(_degree_rows(explanation, unit)),
        f"rules: {len(explanation.rules)} of {total} fire; shown: {len(shown)}",
        *_indented(_rule_rows(explanation, shown)),
        "output sets",
        *_indented(_output_rows(explanation, unit)),
    ]


def _answer(explanation: Explanation, unit: str) -> str:
    text = f"{explanation.answer:.2f} {unit}"
    if explanation.interval is None:
        return text
    low, high = explanation.interval
    text += f", interval {low:.2f} to {high:.2f} {unit}"
    if explanation.switches is None:
        return text
    places = " and ".join(
        f"{s.before:g}" if s.before == s.after else f"{s.before:g} to {s.after:g}"
        for s in explanation.switches
    )
    return f"{text}, bounds switch at {places} {unit}"


def _span(lower: float, upper: float) -> str:
    return _degree(upper) if lower == upper else f"{_degree(lower)} to {_degree(upper)}"


def _degree(value: float) -> str:
    """To three decimals; one too small for them as a power of ten, as it is not 0."""
    return f"{value:.0e}" if 0.0 < value < 5e-4 else f"{value:.3f}"


def _share(value: float) -> str:
    return "below 0.1 %" if 0.0 < value < 5e-4 else f"{100 * value:.1f} %"


def _degree_rows(explanation: Explanation, unit: str) -> list[list[str]]:
    """Readings and their degrees, but of one that has no part in the answer."""
    rows = []
    for i, (variable, x) in enumerate(
        zip(explanation.system.inputs, explanation.readings, strict=True)
    ):
        if not _has_part(explanation.system, i):
            rows.append([variable.name, "in no rule"])
            continue
        mine = [degree for degree in explanation.degrees if degree.input == variable.name]
        cells = [f"{degree.set} {_span(degree.lower, degree.upper)}" for degree in mine]
        rows.append([variable.name, f"{x:.2f} {unit}", *cells])
    return rows


def _has_part(system: FuzzySystem, i: int) -> bool:
    """Whether a rule names the i-th input, or a linear consequent may ask for it."""
    named = (term.input for rule in system.rules for term in rule.antecedents)
    return i in named or any(one.kind == "linear" for one in system.output.sets)


def _rule_rows(explanation: Explanation, shown: Sequence[Firing]) -> list[list[str]]:
    return [
        [
            f"{firing.number}",
            _span(firing.lower, firing.upper),
            *([] if firing.share is None else [_share(firing.share)]),
            rule_text(firing.rule, explanation.system),
            _effect(firing),
        ]
        for firing in shown
    ]


def _effect(firing: Firing) -> str:
    """Which height of its output set a rule sets."""
    match firing.sets_lower, firing.sets_upper:
        case True, True:
            return "sets the height"
        case True, False:
            return "sets the lower height"
        case False, True:
            return "sets the upper height"
    return ""


def _output_rows(explanation: Explanation, unit: str) -> list[list[str]]:
    word = "weight" if explanation.kind == "sugeno" else "height"
    return [
        [one.name, f"{word} {_span(one.lower, one.upper)}", *_constant(one, unit), _by(one)]
        for one in explanation.outputs
    ]


def _constant(one: OutputSet, unit: str) -> list[str]:
    if one.constant is None or one.share is None:
        return []
    return [f"constant {one.constant:.2f} {unit}", f"share {_share(one.share)}"]


def _by(one: OutputSet) -> str:
    """Which rules set the heights."""
    if not one.upper_rules:
        return ""
    if one.upper_rules == one.lower_rules or not one.lower_rules:
        return f"set by {_numbered(one.upper_rules)}"
    return f"set by {_numbered(one.lower_rules)} (lower), {_numbered(one.upper_rules)} (upper)"


def _numbered(rules: tuple[int, ...]) -> str:
    others = f" and {len(rules) - 1} as strong" if len(rules) > 1 else ""
    return f"rule {rules[0]}{others}"


def _indented(rows: list[list[str]]) -> list[str]:
    """Rows of text with their columns aligned."""
    columns = max((len(row) for row in rows), default=0)
    widths = [max(len(row[i]) for row in rows if i < len(row)) for i in range(columns)]
    return [
        "  " + "  ".join(cell.ljust(widths[i]) for i, cell in enumerate(row)).rstrip()
        for row in rows
    ]
