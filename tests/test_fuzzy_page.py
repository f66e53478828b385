"""The page's table of what a `.fis` file may hold: every row is tried as it is written."""

import re
from pathlib import Path

import pytest

from fuzzy.systems.fis_file import FisError, read_fis
from fuzzy.systems.system import OPERATORS

PAGE = Path(__file__).resolve().parent.parent / "docs" / "fuzzy.md"
MAMDANI = """\
[System]
Name='page'
Type='mamdani'
NumInputs=2
NumOutputs=1
NumRules=1
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='centroid'
[Input1]
Name='x'
Range=[0 10]
NumMFs=1
MF1='a':'trimf',[0 5 10]
[Input2]
Name='u'
Range=[0 10]
NumMFs=1
MF1='a':'trimf',[0 5 10]
[Output1]
Name='y'
Range=[0 20]
NumMFs=1
MF1='b':'trimf',[0 5 9]
[Rules]
1 0, 1 (1) : 1
"""
SUGENO = (
    MAMDANI.replace("'mamdani'", "'sugeno'")
    .replace("'centroid'", "'wtaver'")
    .replace("'trimf',[0 5 9]", "'linear',[1 2 3]")
)
ANOTHER = "NumOutputs=2", "[Output2]\nName='z'\nRange=[0 1]\nNumMFs=1\nMF1='c':'trimf',[0 1 2]\n"


def rows():
    lines = PAGE.read_text().split("| in the file | here |\n|---|---|\n")[1].splitlines()
    table = lines[: next(i for i, line in enumerate(lines) if not line.startswith("|"))]
    return dict(re.fullmatch(r"\| (.*?) \| (.*) \|", line).groups() for line in table)


def changed(*pairs, text=MAMDANI):
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def with_set(definition):
    return changed(("'trimf',[0 5 10]", definition))


def with_rule(rule):
    return changed(("1 0, 1 (1) : 1", rule))


def two_outputs(rule):
    count, section = ANOTHER
    rest = changed(("NumOutputs=1", count), ("[Rules]", section + "[Rules]"))
    return rest.replace("1 0, 1 (1) : 1", rule)


WIDE = {"trimf": "0 1 2", "trapmf": "0 1 2 3", "pimf": "0 1 2 3", "gbellmf": "1 2 3"}
WIDE |= dict.fromkeys(("gauss2mf", "dsigmf", "psigmf"), "1 2 3 4")


def with_method(name):
    """Files with a method wherever it may stand."""
    texts = []
    for key, field in (
        ("AndMethod", "conjunction"),
        ("OrMethod", "disjunction"),
        ("ImpMethod", "implication"),
        ("AggMethod", "aggregation"),
        ("DefuzzMethod", "defuzzification"),
    ):
        for text in (MAMDANI, SUGENO):
            fits = (name in ("wtaver", "wtsum")) == (text is SUGENO) or field != "defuzzification"
            known = name in OPERATORS[field] or (name, field) == ("wtaver", "defuzzification")
            if fits and known:
                texts.append(re.sub(rf"{key}='\w+'", f"{key}='{name}'", text))
    assert texts
    return texts


def tried(cell):
    """The files that a row of the table speaks of."""
    codes = re.findall(r"`([^`]*)`", cell)
    if cell.startswith("`'linear'`"):
        return [changed(("[1 2 3]", "[1 3]"), text=SUGENO)]
    if cell.startswith("`'"):
        return [with_set(code) for code in codes]
    if cell.startswith("`gaussmf`"):
        return [with_set(f"'{code}',[{WIDE.get(code, '1 2')}]") for code in codes]
    if cell.startswith(("`min`", "`centroid`")):
        return [text for code in codes for text in with_method(code)]
    return OTHERS[cell](*codes)


OTHERS = {
    "an input with `Range=[5 5]`": lambda code: [
        changed(("Range=[0 10]", code)),
        changed(("Range=[0 10]", code), text=SUGENO),
    ],
    "a Sugeno output with `Range=[0 0]`": lambda code: [
        changed(("Range=[0 20]", code), text=SUGENO)
    ],
    "a Mamdani output with `Range=[0 0]`": lambda code: [changed(("Range=[0 20]", code))],
    "any `Range=[10 0]`": lambda code: [
        changed((old, code), text=text)
        for old in ("Range=[0 10]", "Range=[0 20]")
        for text in (MAMDANI, SUGENO)
    ],
    "an input with `NumMFs=0`": lambda code: [
        re.sub(r"(Name='u'\n.*\n)NumMFs=1\nMF1.*\n", rf"\1{code}\n", text)
        for text in (MAMDANI, SUGENO)
    ],
    "an output that no rule names": lambda: [two_outputs("1 0, 1 0 (1) : 1")],
    "two outputs that rules name": lambda: [two_outputs("1 0, 1 1 (1) : 1")],
    "rules with `-1` of an input, `0`, weights from 0 to 1, `1` AND, `2` OR": lambda *_: [
        with_rule(rule) for rule in ("-1 0, 1 (0) : 1", "1 -1, 1 (1) : 2", "1 -1 1 (0.5) : 1")
    ],
    "a rule with `-1` of the output": lambda code: [with_rule(f"1 0, {code} (1) : 1")],
    "a rule without inputs, a weight above 1": lambda: [
        with_rule("0 0, 1 (1) : 1"),
        with_rule("1 0, 1 (1.1) : 1"),
    ],
    "a hedge, such as `1.3`": lambda code: [with_rule(f"{code} 0, 1 (1) : 1")],
    "a membership function or a method of one's own": lambda: [
        with_set("'mymf',[0 5 10]"),
        *(re.sub(rf"{key}='\w+'", f"{key}='mine'", MAMDANI) for key in METHODS),
    ],
    "type-2 keys and sets": lambda: [
        changed(("Type='mamdani'", "Type='mamdanitype2'")),
        changed(("NumRules=1", "NumRules=1\nTypeReductionMethod='karnikmendel'")),
        changed(("MF1=", "MF1U=")),
    ],
    "comments by `%` or `#`, quotes of either kind, Latin-1, any order of sections, no counts": (
        lambda *codes: [
            *(changed(("Name='page'", f"Name='page' {code} ours")) for code in codes),
            MAMDANI.replace("'", '"'),
            changed(("'page'", "'m\xe4\xdfig'")).encode("latin-1"),
            MAMDANI[MAMDANI.index("[Input1]") :] + MAMDANI[: MAMDANI.index("[Input1]")],
            re.sub(r"Num\w+=1\n", "", MAMDANI),
        ]
    ),
    "counts that disagree with the file": lambda: [
        changed((f"{key}={n}", f"{key}=7"))
        for key, n in (("NumInputs", 2), ("NumOutputs", 1), ("NumRules", 1), ("NumMFs", 1))
    ],
}
METHODS = ("AndMethod", "OrMethod", "ImpMethod", "AggMethod", "DefuzzMethod")


@pytest.mark.parametrize("cell", rows())
def test_a_row_of_the_table_is_as_it_says(tmp_path, cell):
    path = tmp_path / "page.fis"
    verdict = re.match(r"read|refused", rows()[cell])[0]
    for text in tried(cell):
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        if verdict == "read":
            assert read_fis(path).name
        else:
            with pytest.raises(FisError, match=r"page\.fis:\d+: .*\w"):
                read_fis(path)


def test_a_wrong_verdict_is_seen(tmp_path):
    path = tmp_path / "page.fis"
    path.write_text(MAMDANI)
    assert read_fis(path).name == "page"
    path.write_text(with_rule("1.3 0, 1 (1) : 1"))
    with pytest.raises(FisError):
        read_fis(path)


def test_no_row_is_left_over():
    assert {cell for cell in rows() if not cell.startswith("`")} == set(OTHERS)
