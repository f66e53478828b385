"""Rule bases as .fis and JSON files, and tables of readings: round trips, quirks and refusals."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzy.systems.conversion import sugeno_of, type_1_of
from fuzzy.systems.files import read_rule_base, write_rule_base
from fuzzy.systems.fis_file import FisError, fis_text, read_fis, write_fis
from fuzzy.systems.inference import infer
from fuzzy.systems.json_file import JsonError, json_text, read_json, write_json
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.sets import FORMS, Footprint, FuzzySet
from fuzzy.systems.system import FuzzySystem, Operators, Rule, Term, Variable
from fuzzy.systems.table import TableError, evaluate_table

TIPPER = """\
[System]
Name='tipper'
Type='mamdani'
Version=2.0
NumInputs=2
NumOutputs=1
NumRules=3
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='centroid'

[Input1]
Name='service'
Range=[0 10]
NumMFs=3
MF1='poor':'gaussmf',[1.5 0]
MF2='good':'gaussmf',[1.5 5]
MF3='excellent':'gaussmf',[1.5 10]

[Input2]
Name='food'
Range=[0 10]
NumMFs=2
MF1='rancid':'trapmf',[-2 0 1 3]
MF2='delicious':'trapmf',[7 9 10 12]

[Output1]
Name='tip'
Range=[0 30]
NumMFs=3
MF1='cheap':'trimf',[0 5 10]
MF2='average':'trimf',[10 15 20]
MF3='generous':'trimf',[20 25 30]

[Rules]
1 1, 1 (1) : 2
2 0, 2 (1) : 1
3 2, 3 (1) : 2
"""
READINGS = np.array([[2.0, 1.0], [4.0, 5.0], [7.0, 8.0]])
MATLABS_TIPS = ["7.0169", "14.4585", "20.3414"]  # printed in MATLAB's documentation


@pytest.fixture
def read(tmp_path):
    """Reads the text of a .fis file."""

    def reader(text):
        path = tmp_path / "rules.fis"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_fis(path)

    return reader


@pytest.fixture
def tipper(read):
    return read(TIPPER)


# --- Random systems ---------------------------------------------------------------------------

NUMBERS = st.floats(-1e6, 1e6, allow_subnormal=False)
WIDTHS = st.floats(1e-6, 1e6)
NAMES = st.text(st.characters(codec="utf-8", exclude_characters="'\r\n"))


@st.composite
def fuzzy_sets(draw, kind, name, footprint):
    names = FORMS[kind].parameters.split()
    corners = sorted(draw(NUMBERS) for _ in names)
    if corners[0] == corners[-1]:
        corners[-1] += 1.0
    parameters = {
        "gaussmf": lambda: (draw(WIDTHS), draw(NUMBERS)),
        "gauss2mf": lambda: (draw(WIDTHS), corners[0], draw(WIDTHS), corners[1]),
        "gbellmf": lambda: (draw(WIDTHS), draw(WIDTHS), draw(NUMBERS)),
        "sigmf": lambda: (draw(WIDTHS), draw(NUMBERS)),
        "dsigmf": lambda: (draw(WIDTHS), draw(NUMBERS), -draw(WIDTHS), draw(NUMBERS)),
        "psigmf": lambda: (draw(WIDTHS), draw(NUMBERS), -draw(WIDTHS), draw(NUMBERS)),
    }.get(kind, lambda: tuple(corners))()
    scale = draw(st.floats(0.1, 1)) if footprint else 1.0
    lag = draw(st.floats(0, 0.9)) if footprint else 0.0
    return FuzzySet(name, kind, parameters, Footprint(scale=scale, lag=lag))


@st.composite
def variables(draw, name, footprint):
    kinds = draw(st.lists(st.sampled_from(sorted(FORMS)), min_size=1, max_size=4))
    low = draw(NUMBERS)
    stem = draw(NAMES)
    sets = (draw(fuzzy_sets(kind, f"{stem}{i}", footprint)) for i, kind in enumerate(kinds))
    return Variable(name, low, low + draw(WIDTHS), tuple(sets))


@st.composite
def systems(draw, footprint=False, repeated_inputs=False):
    count = draw(st.integers(1, 4))
    inputs = tuple(draw(variables(f"input {i}", footprint)) for i in range(count))
    output = draw(variables("output", footprint))
    terms = [
        Term(i, k, n)
        for i in range(count)
        for k in range(len(inputs[i].sets))
        for n in (False, True)
    ]
    unique = None if repeated_inputs else lambda term: term.input
    rule = st.builds(
        Rule,
        st.lists(st.sampled_from(terms), min_size=1, max_size=4, unique_by=unique).map(
            tuple if repeated_inputs else lambda chosen: tuple(sorted(chosen))
        ),
        st.integers(0, len(output.sets) - 1),
        st.sampled_from(("and", "or")),
        st.floats(0, 1),
    )
    operators = st.builds(
        Operators,
        st.sampled_from(("min", "prod")),
        st.sampled_from(("max", "probor")),
        st.sampled_from(("min", "prod")),
    )
    rules = tuple(draw(st.lists(rule, min_size=1, max_size=6)))
    return FuzzySystem(inputs, output, rules, draw(operators), draw(NAMES))


@given(systems())
@settings(deadline=None, max_examples=60)
def test_a_type_1_system_comes_back_from_a_fis_file_as_it_was(tmp_path_factory, system):
    path = tmp_path_factory.getbasetemp() / "random.fis"
    write_fis(system, path)
    assert read_fis(path) == system


@given(systems(footprint=True, repeated_inputs=True))
@settings(deadline=None, max_examples=60)
def test_any_system_comes_back_from_a_json_file_as_it_was(tmp_path_factory, system):
    path = tmp_path_factory.getbasetemp() / "random.json"
    write_json(system, path)
    assert read_json(path) == system


@pytest.mark.parametrize("suffix", [".fis", ".json", ".FIS", ".JSON"])
def test_a_rule_base_is_read_and_written_by_its_suffix(tmp_path, tipper, suffix):
    path = tmp_path / f"tipper{suffix}"
    write_rule_base(tipper, path)
    assert path.read_text(encoding="utf-8").startswith("[" if "f" in suffix.lower() else "{")
    assert read_rule_base(path) == tipper


@pytest.mark.parametrize("act", [read_rule_base, lambda path: write_rule_base(None, path)])
def test_another_suffix_is_refused(tmp_path, act):
    with pytest.raises(ValueError, match=r"rules\.toml: a rule base is a \.fis or a \.json file"):
        act(tmp_path / "rules.toml")


# --- .fis: what is read -----------------------------------------------------------------------


def test_the_file_of_matlabs_tipper_gives_matlabs_tips(tipper):
    answers = infer(tipper, READINGS, "mamdani").value
    assert [f"{tip:.4f}" for tip in answers] == MATLABS_TIPS


def test_the_file_written_is_the_file_read(tipper):
    assert fis_text(tipper) == TIPPER


def _beside(text, sets):
    """The tipper's file with a second output, which no rule names."""
    another = "[Output2]\nName='service charge'\nRange=[0 1]\n" + sets + "\n[Rules]"
    text = text.replace("NumOutputs=1", "NumOutputs=2").replace("[Rules]", another)
    return re.sub(r"(\d, \d) \(", r"\1 0 (", text)


QUIRKS = {
    "byte order mark": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "Windows line ends": lambda text: text.replace("\n", "\r\n"),
    "old Macintosh line ends": lambda text: text.replace("\n", "\r"),
    "no line end": lambda text: text.rstrip("\n"),
    "MATLAB comments": lambda text: "% $Revision: 1.1 $\n" + text.replace("\n\n", "\n%\n"),
    "Octave comments": lambda text: "## made by hand\n" + text,
    "comments after values": lambda text: text.replace("'mamdani'", "'mamdani' % type"),
    "blanks around": lambda text: "".join(f" \t{line}  \n" for line in text.split("\n")),
    "spaced signs": lambda text: text.replace("=", " = ").replace(":'", " : '"),
    "commas between parameters": lambda text: text.replace("[1.5 0]", "[ 1.5, 0.0 ]"),
    "exponents": lambda text: text.replace("[1.5 0]", "[15e-1 +.0E0]"),
    "commas between sets of a rule": lambda text: text.replace("1 1, 1", "1,1,1"),
    "no comma in a rule": lambda text: text.replace("1 1, 1", "1  1 1"),
    "fuzzylite's decimals": lambda text: text.replace("1 1, 1 (1)", "1.000 1.000 , 1.000 (1.000)"),
    "no counts": lambda text: re.sub(r"Num\w+=\d+\n", "", text),
    "no version": lambda text: text.replace("Version=2.0\n", ""),
    "sections in lower case": lambda text: text.replace("[Input1]", "[input 1]"),
    "sections in another order": lambda text: (
        text[text.index("[Input1]") : text.index("[Rules]")]
        + text[: text.index("[Input1]")]
        + text[text.index("[Rules]") :]
    ),
    "zeros filling parameters up": lambda text: text.replace("[1.5 0]", "[1.5 0 0 0]"),
    "double quotes": lambda text: text.replace("'", '"'),
    "statements of MATLAB": lambda text: text.replace("[0 10]\n", "[0 10];\n"),
    "kinds in capitals": lambda text: text.replace("'gaussmf'", "'GaussMF'"),
    "keys in capitals": lambda text: text.replace("Range=", "RANGE=").replace("MF1=", "mf1="),
    "expressions": lambda text: text.replace("[1.5 0]", "[3/2 sqrt(4) - 2]").replace(
        "[5 ", "[(1 + 2) * 2 - 1 "
    ),
    "a count with decimals": lambda text: text.replace("NumMFs=2", "NumMFs=2.0"),
    "an output without sets": lambda text: _beside(text, "NumMFs=0\n"),
    "an output that no rule names": lambda text: _beside(
        text, "NumMFs=1\nMF1='all':'trimf',[0 1 2]\n"
    ),
    "a rule that names no output": lambda text: (
        text.replace("Rules=3", "Rules=4") + "1 1, 0 (1) : 1\n"
    ),
}


@pytest.mark.parametrize("quirk", QUIRKS)
def test_quirks_of_real_files_are_read(read, tipper, quirk):
    assert read(QUIRKS[quirk](TIPPER)) == tipper


def test_names_may_hold_blanks_percent_and_number_signs(read):
    system = read(TIPPER.replace("'poor'", "'poor # 100 % '"))
    assert system.inputs[0].sets[0].name == "poor # 100 % "


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("'chef''s choice'", "chef's choice"),
        ("'chef's choice'", "chef's choice"),
        ('"chef\'s choice"', "chef's choice"),
        ("'say \"hi\"'", 'say "hi"'),
        ("'a [b], (c) : d'", "a [b], (c) : d"),
    ],
)
def test_names_may_hold_quotes_brackets_and_commas(read, written, name):
    system = read(TIPPER.replace("'poor'", written).replace("'tipper'", written))
    assert (system.name, system.inputs[0].sets[0].name) == (name, name)


def test_names_in_latin_1_are_read(read):
    for encoding in ("utf-8", "latin-1"):
        system = read(TIPPER.replace("poor", "mäßig").encode(encoding))
        assert system.inputs[0].sets[0].name == "mäßig"


def test_two_outputs_that_rules_name_are_refused(read):
    text = _beside(TIPPER, "NumMFs=1\nMF1='all':'trimf',[0 1 2]\n")
    with pytest.raises(FisError, match=r"fis:37: a second output that rules name; write one file"):
        read(text.replace("1 1, 1 0", "1 1, 1 1"))


def test_one_output_of_two_may_be_the_second(read, tipper):
    first = "[Output1]\nName='x'\nRange=[0 1]\nNumMFs=0\n\n[Output2]"
    text = TIPPER.replace("NumOutputs=1", "NumOutputs=2").replace("[Output1]", first)
    assert read(re.sub(r", (\d) \(", r", 0 \1 (", text)) == tipper


def test_negation_weight_and_connective_are_read(read):
    system = read(TIPPER.replace("3 2, 3 (1) : 2", "-3 2, 3 (0.25) : 1"))
    assert system.rules[2] == Rule((Term(0, 2, negated=True), Term(1, 1)), 2, "and", 0.25)


def test_octaves_names_of_product_and_probabilistic_or_are_read(read):
    text = TIPPER.replace("AndMethod='min'", "AndMethod='algebraic_product'")
    system = read(text.replace("OrMethod='max'", "OrMethod='algebraic_sum'"))
    assert system.operators == Operators("prod", "probor")


SUGENO = (
    re.sub(r"'(cheap|average|generous)':'trimf',\[\d+ (\d+) \d+\]", r"'\1':'constant',[\2]", TIPPER)
    .replace("'mamdani'", "'sugeno'")
    .replace("AggMethod='max'", "AggMethod='sum'")
    .replace("'centroid'", "'wtaver'")
)


@pytest.mark.parametrize("aggregation", ["sum", "max"])
def test_sugeno_files_are_read_with_either_aggregation(read, aggregation):
    system = read(SUGENO.replace("AggMethod='sum'", f"AggMethod='{aggregation}'"))
    assert [one.parameters for one in system.output.sets] == [(5.0,), (15.0,), (25.0,)]
    assert fis_text(system) == SUGENO


def test_linear_consequents_are_read(read):
    system = read(SUGENO.replace("'constant',[25]", "'linear',[2 -0.5 20]"))
    assert system.output.sets[2] == FuzzySet("generous", "linear", (2.0, -0.5, 20.0))
    # By hand: only the third rule fires at service 10, food 10.
    X = np.array([[10.0, 10.0]])
    alone = replace(system, rules=system.rules[2:])
    assert infer(alone, X, "sugeno").value == pytest.approx([35.0], abs=1e-12)


def test_zeros_filling_consequents_up_are_dropped(read):
    padded = read(
        SUGENO.replace("'constant',[25]", "'linear',[2 -0.5 20 0]").replace("[5]", "[5 0 0 0]")
    )
    plain = read(SUGENO.replace("'constant',[25]", "'linear',[2 -0.5 20]"))
    assert padded == plain
    with pytest.raises(FisError, match="a constant takes 1 parameter"):
        read(SUGENO.replace("'constant',[5]", "'constant',[5 1]"))


# --- .fis: what is refused --------------------------------------------------------------------

REFUSALS = {
    "a type-2 type": ("Type='mamdani'", "Type='type2'", 3, "is not read from .fis.* JSON"),
    "a type-2 key": (
        "Version=2.0",
        "TypeReductionMethod='karnikmendel'",
        4,
        "TypeReductionMethod belongs to a type-2 system",
    ),
    "a type-2 set": ("MF1='poor'", "MF1U='poor'", 18, "MF1U belongs to a type-2 system"),
    "a type-2 kind": ("'gaussmf',[1.5 0]", "'gaussmftype2',[1 0 2 0]", 18, "type-2 system"),
    "another type": ("'mamdani'", "'tsukamoto'", 3, "'tsukamoto': use mamdani or sugeno"),
    "an aggregation of one's own": (
        "AggMethod='max'",
        "AggMethod='joined'",
        11,
        "aggregation 'joined': functions of one's own .* use one of max, sum, probor",
    ),
    "Octave's own": (
        "AggMethod='max'",
        "AggMethod='einstein_sum'",
        11,
        "'einstein_sum': .* Octave",
    ),
    "a defuzzification": ("'centroid'", "'peak'", 12, "'peak': functions .* use one of centroid"),
    "Sugeno's average": ("'centroid'", "'wtaver'", 12, "'wtaver': .* use one of centroid"),
    "an operator": ("OrMethod='max'", "OrMethod='sum'", 9, "'sum': .* use one of max, probor"),
    "the number of outputs": ("NumOutputs=1", "NumOutputs=2", 6, "NumOutputs is 2, .* are 1"),
    "the number of inputs": ("NumInputs=2", "NumInputs=3", 5, "NumInputs is 3, .* are 2 inputs"),
    "the number of rules": ("NumRules=3", "NumRules=4", 7, "NumRules is 4, .* are 3 rules"),
    "the number of sets": ("NumMFs=2", "NumMFs=3", 25, "NumMFs is 3, .* are 2 sets"),
    "an unknown key": ("Version=2.0", "Enabled=1", 4, "'Enabled' is no key .* remove the line"),
    "a key without value": ("Version=2.0", "Version", 4, "'Version' is no key=value"),
    "a key twice": ("Version=2.0", "Name='again'", 4, "a second Name"),
    "a missing key": ("AndMethod='min'\n", "", 1, "no AndMethod; add it"),
    "a missing range": ("Range=[0 30]\n", "", 29, "no Range; add it"),
    "a section twice": ("[Input2]", "[Input1]", 22, r"a second \[Input1\]"),
    "an unknown section": ("[Input2]", "[Inputs]", 22, r"\[Inputs\] is no section"),
    "text before all sections": (
        "[System]",
        "x\n[System]",
        1,
        r"start the file with \[System\]",
    ),
    "a quote too few": ("'tipper'", "'tipper", 2, "between one pair of single quotes"),
    "a range of one number": ("Range=[0 30]", "Range=[0]", 31, r"give two numbers, \[low high\]"),
    "a range without brackets": ("Range=[0 30]", "Range=0 30", 31, r"one pair of \[ \]"),
    "a range upside down": ("Range=[0 30]", "Range=[30 0]", 29, "low 30.0 must be below 0.0"),
    "an unknown word": ("Range=[0 30]", "Range=[0 tip]", 31, "'tip' is no finite number"),
    "an expression of a variable": ("Range=[0 30]", "Range=[0 3*x]", 31, r"'3\*x' is no finite"),
    "a division by 0": ("Range=[0 30]", "Range=[0 1/0]", 31, "'1/0' is no finite number"),
    "an open parenthesis": ("Range=[0 30]", "Range=[0 (3]", 31, r"a \( without its \)"),
    "a closed parenthesis": ("Range=[0 30]", "Range=[0 3)]", 31, r"a \) without its \("),
    "no width": ("Range=[0 30]", "Range=[9 9]", 1, "universe 9 to 9 has no width"),
    "an unwritten number": ("[1.5 0]", "[NaN 0]", 18, "'NaN' is no finite number"),
    "a number beyond doubles": ("[1.5 0]", "[1.5 1e999]", 18, "'1e999' is no finite number"),
    "an underscore": ("[1.5 0]", "[1_5 0]", 18, "'1_5' is no finite number"),
    "an unknown kind": ("'gaussmf',[1.5 0]", "'rampmf',[1 0]", 18, "'rampmf' is none of MATLAB's"),
    "a parameter too few": ("[1.5 0]", "[1.5]", 18, r"takes 2 parameters \(sd, centre\), got 1"),
    "a parameter too many": ("[1.5 0]", "[1.5 0 7]", 18, "takes 2 parameters .* got 3"),
    "a shapeless set": ("[0 5 10]", "[5 0 10]", 33, "do not form a trimf"),
    "a set unlike a set": ("'poor':'gaussmf',", "'poor',", 18, r"'name':'kind',\[parameters\]"),
    "a set out of turn": ("MF3='excellent'", "MF4='excellent'", 20, "MF4 where MF3 is due"),
    "a set twice": ("MF2='good'", "MF1='good'", 19, "a second MF1"),
    "two sets of a name": ("'good'", "'poor'", 14, "two sets share a name"),
    "two inputs of a name": ("Name='food'", "Name='service'", 1, "each with a name of its own"),
    "a constant in Mamdani": ("'trimf',[0 5 10]", "'constant',[5]", 33, "'cheap' is constant"),
    "no rule": ("1 1, 1 (1) : 2", "if poor then cheap", 38, "is no rule; write a set of each"),
    "a rule too short": ("1 1, 1 (1) : 2", "1, 1 (1) : 2", 38, "2 sets for 2 inputs .* give 3"),
    "a set that is not there": ("1 1, 1", "1 3, 1", 38, "set 3 of 'food', which has 2"),
    "a consequent not there": ("1 1, 1", "1 1, 4", 38, "set 4 of 'tip', which has 3"),
    "a negated consequent": ("1 1, 1", "1 1, -1", 38, "consequent -1: NOT on the output"),
    "no antecedent": ("1 1, 1", "0 0, 1", 38, "the rule uses no input"),
    "a hedge": ("1 1, 1", "1.3 1, 1", 38, "1.3: hedges, Octave's decimals, are not computed"),
    "a weight above 1": ("1 1, 1 (1)", "1 1, 1 (1.5)", 38, "rule weight 1.5"),
    "a third connective": ("1 1, 1 (1) : 2", "1 1, 1 (1) : 3", 38, "is no rule"),
}


@pytest.mark.parametrize("flaw", REFUSALS)
def test_a_flawed_file_is_refused_with_file_and_line(read, flaw):
    good, bad, line, message = REFUSALS[flaw]
    assert good in TIPPER
    with pytest.raises(FisError, match=rf"rules\.fis:{line}: .*{message}") as refusal:
        read(TIPPER.replace(good, bad, 1))
    assert str(refusal.value).count("rules.fis:") == 1


def test_a_membership_function_in_a_sugeno_file_is_refused(read):
    with pytest.raises(FisError, match=r"fis:33: set 'cheap' is trimf; in a sugeno system give"):
        read(SUGENO.replace("'constant',[5]", "'trimf',[0 5 10]"))


def test_a_linear_consequent_of_the_wrong_length_is_refused(read):
    with pytest.raises(FisError, match="'generous': linear takes 3 parameters"):
        read(SUGENO.replace("'constant',[25]", "'linear',[2 20]"))


@pytest.mark.parametrize("section", ["System", "Input1", "Output1", "Rules"])
def test_a_missing_section_is_named(read, section):
    start = TIPPER.index(f"[{section}]")
    after = TIPPER.find("\n[", start)
    with pytest.raises(FisError, match=rf"has no \[{section}\] section; add it"):
        read(TIPPER[:start] + (TIPPER[after + 1 :] if after > 0 else ""))


def test_a_file_that_cannot_be_read_is_named(tmp_path, read):
    with pytest.raises(FisError, match=r"none\.fis: cannot be read \(No such file"):
        read_fis(tmp_path / "none.fis")
    with pytest.raises(FisError, match=r"rules\.fis: is UTF-16 text; save it as UTF-8"):
        read(TIPPER.encode("utf-16"))


def test_what_a_fis_file_cannot_hold_is_not_written(tmp_path, tipper):
    path = tmp_path / "lost.fis"
    first, *others = tipper.inputs[0].sets
    sets = (replace(first, footprint=Footprint(mean=0.5)), *others)
    uncertain = replace(tipper, inputs=(replace(tipper.inputs[0], sets=sets), tipper.inputs[1]))
    with pytest.raises(ValueError, match=r"service: set 'poor' has a footprint.*write JSON"):
        write_fis(uncertain, path)
    twice = replace(tipper, rules=(Rule((Term(0, 0), Term(0, 1)), 0),))
    with pytest.raises(ValueError, match=r"rule 1: two terms of one input.*write JSON"):
        write_fis(twice, path)
    with pytest.raises(ValueError, match="no quotes or line breaks in names; rename it"):
        write_fis(replace(tipper, name="chef's"), path)
    assert not path.exists()
    assert type_1_of(uncertain) == tipper
    write_fis(type_1_of(uncertain), path)
    with pytest.raises(FisError, match="cannot be written"):
        write_fis(tipper, tmp_path)


def test_the_sugeno_system_of_a_mamdani_one_answers_as_it_does(tmp_path, tipper):
    converted = sugeno_of(tipper)
    write_fis(converted, tmp_path / "tipper.fis")
    read_back = read_fis(tmp_path / "tipper.fis")
    expected = infer(tipper, READINGS, "sugeno")
    assert (infer(read_back, READINGS, "sugeno").value == expected.value).all()
    assert sugeno_of(converted) == converted
    # The peaks of the symmetric triangles, as far as samples 0.3 apart see them.
    places = [one.parameters[0] for one in converted.output.sets]
    assert places == pytest.approx([5, 15, 25], abs=0.003)


# --- JSON -------------------------------------------------------------------------------------


@pytest.fixture
def document(tipper):
    """The tipper's JSON, to be damaged."""
    return json.loads(json_text(tipper))


@pytest.fixture
def read_document(tmp_path):
    def reader(document):
        path = tmp_path / "rules.json"
        text = document if isinstance(document, str) else json.dumps(document)
        path.write_text(text, encoding="utf-8")
        return read_json(path)

    return reader


def test_rules_read_as_sentences_and_defaults_are_left_out(tipper):
    text = json_text(tipper)
    assert '{"if": [{"input": "service", "is": "good"}], "then": "average"}' in text
    assert '"footprint"' not in text
    assert '"weight"' not in text
    sets = '{"name": "poor", "kind": "gaussmf", "parameters": [1.5, 0.0]}'
    assert sets in text


def test_defaults_may_be_written_or_left_out(read_document, document, tipper):
    rule = document["rules"][1]
    rule |= {"connective": "and", "weight": 1}
    document["inputs"][0]["sets"][0]["footprint"] = {"mean": 0}
    del document["operators"]["implication"]
    assert read_document(document) == tipper
    del document["operators"], document["name"]
    assert read_document(document) == replace(tipper, name="system")


def test_the_example_of_the_documentation_is_a_system(read_document):
    import fuzzy.systems.json_file

    example = re.search(r"\n    \{\n.*?\n    \}\n", fuzzy.systems.json_file.__doc__, re.DOTALL)[0]
    example = re.sub(r" +#.*", "", example)
    low, high = ({"name": n, "kind": "trimf", "parameters": [0, 0, 1]} for n in ("low", "high"))
    example = example.replace("[...]", json.dumps([low, high]))
    sun = {
        "name": "sun",
        "low": 0,
        "high": 1,
        "sets": [{"name": "out", "kind": "smf", "parameters": [0, 1]}],
    }
    system = json.loads(example)
    system["inputs"].append(sun)
    assert read_document(system).rules[1] == Rule(
        (Term(0, 0, negated=True), Term(1, 0)), 0, "or", 0.5
    )


def at(document, place):
    """The object that holds the place, and the last key."""
    *path, last = place
    for key in path:
        document = document[key]
    return document, last


FLAWS = {
    "a misspelt set": (
        ("rules", 2, "if", 1, "is"),
        "delicius",
        r"rules\[2\]\.if\[1\]\.is: 'delicius' is no set of 'food'; it has 'rancid', 'delicious'; "
        "did you mean 'delicious'",
    ),
    "a misspelt input": (
        ("rules", 0, "if", 0, "input"),
        "servise",
        r"rules\[0\]\.if\[0\]\.input: 'servise' is no input of the system; it has 'service'",
    ),
    "a misspelt consequent": (
        ("rules", 0, "then"),
        "Cheap",
        r"rules\[0\]\.then: 'Cheap' is no set",
    ),
    "a misspelt key": (
        ("rules", 0, "wieght"),
        0.5,
        r"rules\[0\]: unknown key 'wieght'; known are .* did you mean 'weight'\?",
    ),
    "a rule without terms": (("rules", 0, "if"), [], r"rules\[0\]\.if: has no term"),
    "a term both ways": (
        ("rules", 0, "if", 0, "is_not"),
        "good",
        r"rules\[0\]\.if\[0\]: give either 'is' or 'is_not'",
    ),
    "a connective": (("rules", 0, "connective"), "xor", r"rules\[0\]: .*'xor': use and, or"),
    "a weight": (("rules", 0, "weight"), 1.5, r"rules\[0\]: rule weight 1.5"),
    "a weight in quotes": (("rules", 0, "weight"), "1", r"weight: \"1\" is no number"),
    "a weight that is true": (("rules", 0, "weight"), True, "weight: true is no number"),
    "an operator": (("operators", "conjunction"), "product", "operators: conjunction 'product'"),
    "an unknown operator": (("operators", "negation"), "max", "unknown key 'negation'"),
    "a range": (("output", "low"), 40, "output: variable 'tip': low 40.0 must be below 30.0"),
    "a name": (("output", "name"), 7, r"output\.name: 7.0 is no text; put it in quotes"),
    "a kind": (("inputs", 1, "sets", 0, "kind"), "trapez", r"inputs\[1\]\.sets\[0\]: .*'trapez'"),
    "a parameter": (
        ("inputs", 1, "sets", 0, "parameters"),
        [1, 2],
        r"inputs\[1\]\.sets\[0\]: .*takes 4 parameters",
    ),
    "a huge parameter": (
        ("inputs", 1, "sets", 0, "parameters", 3),
        10**400,
        r"inputs\[1\]\.sets\[0\]: .*give finite numbers",
    ),
    "a footprint": (
        ("output", "sets", 0, "footprint"),
        {"spread": 2},
        r"output\.sets\[0\]\.footprint: footprint spread 2.0",
    ),
    "an object for an array": (("rules",), {}, "rules: give an array"),
    "a text for an object": (("output",), "tip", "output: give an object with the keys 'name'"),
    "no rules": (("rules",), [], "the system has no rules"),
    "another format": (("format",), "fis", "is no fuzzy system; such a file begins with"),
    "a later version": (("version",), 2, "is of version 2.0; this program reads version 1"),
}


@pytest.mark.parametrize("flaw", FLAWS)
def test_a_flawed_document_is_refused_with_its_place(read_document, document, flaw):
    place, value, message = FLAWS[flaw]
    holder, key = at(document, place)
    holder[key] = value
    with pytest.raises(JsonError, match=rf"rules\.json: .*{message}") as refusal:
        read_document(document)
    assert str(refusal.value).count("rules.json:") == 1


@pytest.mark.parametrize("key", ["inputs", "output", "rules"])
def test_a_missing_key_is_named(read_document, document, key):
    del document[key]
    with pytest.raises(JsonError, match=f"has no '{key}'; add it"):
        read_document(document)


def test_errors_of_syntax_name_line_and_column(read_document):
    with pytest.raises(JsonError, match=r"rules\.json:2:10: Expecting value"):
        read_document('{\n"format":}')
    with pytest.raises(JsonError, match="the key 'format' twice"):
        read_document('{"format": "fuzzy-system", "format": "fuzzy-system"}')
    with pytest.raises(JsonError, match="NaN is no finite number"):
        read_document('{"format": NaN}')
    with pytest.raises(JsonError, match="nested far too deeply"):
        read_document("[" * 100_000)
    with pytest.raises(JsonError, match="is no fuzzy system"):
        read_document("[]")


# --- Tables -----------------------------------------------------------------------------------


@pytest.fixture
def table(tmp_path):
    """Writes a table of readings and evaluates it; returns the notes and the rows written."""

    def evaluate(system, text, kind="mamdani", options=None):
        source, target = tmp_path / "in.csv", tmp_path / "out.csv"
        source.write_bytes(text if isinstance(text, bytes) else text.encode())
        notes = evaluate_table(system, source, target, kind, options)
        with target.open(newline="", encoding="utf-8") as file:
            parted = next((one for one in ";\t" if one in file.readline()), ",")
            file.seek(0)
            return notes, list(csv.reader(file, delimiter=parted))

    return evaluate


def test_the_table_keeps_its_columns_and_gains_the_estimate(table, tipper):
    text = 'food,guest,service\n1,"Ada, Countess",2\n5,Alan,4\n8,Grace,7\n'
    notes, rows = table(tipper, text)
    assert notes == ()
    assert [row[:3] for row in rows] == list(csv.reader(text.splitlines()))
    assert rows[0][3:] == ["estimate"]
    expected = infer(tipper, READINGS, "mamdani").value
    assert [float(row[3]) for row in rows[1:]] == expected.tolist()


def test_type_2_adds_the_ends_of_its_interval(table, tipper):
    _, rows = table(tipper, "service,food\n2,1\n4,5\n", "interval-type-2")
    expected = infer(tipper, READINGS[:2], "interval-type-2")
    assert rows[0] == ["service", "food", "estimate", "lower", "upper"]
    answers = np.array(rows[1:], dtype=float)[:, 2:]
    assert (answers == np.column_stack([expected.value, expected.interval])).all()


@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbfservice,food\r\n2,1\r\n",
        "service, food\n 2 , 1\n",
        "\nservice,food\n\n2,1\n\n",
        '"service","food"\n"2","1e0"',
        "service;food\r\n2;1\r\n",
        "service;food\n2,0;1\n;\n\n",
        "sep=;\r\nservice;food\r\n2,0;1,0\r\n",
        '"service"\t"food"\n"2,0"\t1\n',
        b"\xef\xbb\xbfservice;food;;\r\n2;1;;\r\n;;;\r\n",
        "service,food,,\n2,1,,\n,,,\n\n",
        "service,food\n2,1,\n",
    ],
)
def test_quirks_of_spreadsheets_are_read(table, tipper, text):
    _, rows = table(tipper, text)
    assert [f"{float(row[-1].replace(',', '.')):.4f}" for row in rows[1:]] == MATLABS_TIPS[:1]


def test_a_table_of_another_locale_is_answered_in_its_own(tmp_path, tipper):
    source, target = tmp_path / "in.csv", tmp_path / "out.csv"
    source.write_text("food;guest;service\n1;Ada, Countess;2,0\n5;Alan;4\n")
    evaluate_table(tipper, source, target, "mamdani")
    header, *lines = target.read_text().splitlines()
    assert header == "food;guest;service;estimate"
    tips = infer(tipper, READINGS, "mamdani").value.tolist()
    expected = [repr(tip).replace(".", ",") for tip in tips]
    assert lines == [f"1;Ada, Countess;2,0;{expected[0]}", f"5;Alan;4;{expected[1]}"]
    # Columns that are no readings say nothing about the readings' decimals.
    source.write_text("food;guest;service\n1;Ada, Countess;2\n")
    evaluate_table(tipper, source, target, "mamdani")
    answer = target.read_text().splitlines()[1].split(";")[-1]
    assert float(answer) == pytest.approx(tips[0], rel=1e-12)


TABLE_FLAWS = {
    "no such column": ("service,Food\n1,2", 1, "no column 'food' among .* did you mean 'Food'"),
    "a column with its unit": ("service,food [1]\n1,2", 1, r"did you mean 'food \[1\]'\? Rename"),
    "no column alike": ("service,x\n1,2", 1, "no column 'food' among 'service', 'x'; add it"),
    "a column twice": ("food,service,food\n1,2,3", 1, "column 'food' appears twice"),
    "decimal commas between commas": (
        'service,food\n"1,5",2',
        2,
        "service: '1,5' is no number; write a point, or part columns by semicolons",
    ),
    "points beside decimal commas": (
        "service;food\n1,5;2\n1.234;3",
        3,
        "service: '1.234' stands beside decimal commas",
    ),
    "groups of thousands": ("service;food\n1.234,5;2", 2, "'1.234,5' stands beside"),
    "two decimal commas": ("service;food\n1,234,5;2", 2, "'1,234,5' is no number"),
    "a decimal comma in one column": ("service\n2,5", 2, "2 cells under 1 columns"),
    "an estimate already": ("service,food,estimate\n1,2,3", 1, "a column 'estimate' already"),
    "a word": ("service,food\n1,2\n3,abc", 3, "food: 'abc' is no number"),
    "an empty cell": ("service,food\n1,2\n\n,3", 4, "service: the cell is empty"),
    "NaN": ("service,food\n1,nan", 2, "food: 'nan' is no finite number"),
    "infinity": ("service,food\n1,2\n1,-inf", 3, "food: '-inf' is no finite number"),
    "an underscore": ("service,food\n1,1_0", 2, "food: '1_0' is no finite number"),
    "a short row": ("service,food\n1,2\n3", 3, "1 cells under 2 columns"),
    "a long row": ("service,food\n1,2,3", 2, "3 cells under 2 columns"),
    "a row after a cell of two lines": (
        'service,food,note\n1,2,"two\nlines"\n3,x,',
        4,
        "food: 'x' is no number",
    ),
    "an open quote": ('service,food\n1,"2\n3,4', 3, "unexpected end of data; export"),
}


@pytest.mark.parametrize("flaw", TABLE_FLAWS)
def test_a_flawed_table_is_refused_with_file_and_line(table, tipper, tmp_path, flaw):
    text, line, message = TABLE_FLAWS[flaw]
    with pytest.raises(TableError, match=rf"in\.csv:{line}: .*{message}"):
        table(tipper, text)
    # The fixture's tipper, and the table: nothing was written, nothing left aside.
    assert {path.name for path in tmp_path.iterdir()} == {"rules.fis", "in.csv"}


@pytest.mark.parametrize("text", ["", "\n\n", "service,food\n"])
def test_a_table_without_readings_is_refused(table, tipper, text):
    with pytest.raises(TableError, match=r"in\.csv: holds no numbers"):
        table(tipper, text)


@pytest.mark.parametrize("column", ["estimate", "lower", "upper"])
def test_columns_of_answers_are_not_overwritten(table, tipper, column):
    text = f"service,food,{column}\n1,2,3"
    with pytest.raises(TableError, match=f"a column '{column}' already; rename or remove it"):
        table(tipper, text, "interval-type-2")


def test_notes_and_refusals_of_inference_name_lines(table, tipper):
    text = "service,food\n2,1\n\n4,5\n12,8\n13,8\n"
    notes, _ = table(tipper, text)
    assert notes == ("service: reading 12 (line 5 and 1 more) is outside 0-10; clamped to it",)
    with pytest.raises(TableError, match=r"in\.csv: service: reading 12 \(line 5 and 1 more\)"):
        table(tipper, text, options=InferenceOptions(out_of_range="raise"))
    silent = replace(tipper, rules=tipper.rules[1:2])
    far = replace(
        tipper.inputs[0], sets=(tipper.inputs[0].sets[0], FuzzySet("good", "trimf", (4, 5, 6)))
    )
    silent = replace(silent, inputs=(far, tipper.inputs[1]))
    with pytest.raises(TableError, match=r"no rule fires .* \(line 4\): add a rule"):
        table(silent, "service,food\n5,5\n\n1,5\n")


def test_an_unknown_kind_is_refused_before_the_table_is_read(tmp_path, tipper):
    with pytest.raises(ValueError, match="system 'fuzzy': use one of mamdani"):
        evaluate_table(tipper, tmp_path / "none.csv", tmp_path / "out.csv", "fuzzy")


def test_the_table_itself_and_unwritable_places_are_refused(tmp_path, tipper):
    source = tmp_path / "in.csv"
    source.write_text("service,food\n2,1\n")
    with pytest.raises(TableError, match="is the table itself"):
        evaluate_table(tipper, source, tmp_path / "." / "in.csv", "mamdani")
    with pytest.raises(TableError, match="cannot be written"):
        evaluate_table(tipper, source, tmp_path / "none" / "out.csv", "mamdani")
    with pytest.raises(TableError, match="cannot be read"):
        evaluate_table(tipper, tmp_path / "none.csv", tmp_path / "out.csv", "mamdani")
    source.write_bytes(b"service,food,n\xe4me\n2,1,x\n")
    with pytest.raises(TableError, match="is not UTF-8 text"):
        evaluate_table(tipper, source, tmp_path / "out.csv", "mamdani")
    for workbook in (b"PK\x03\x04" + bytes(60), b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"):
        source.write_bytes(workbook)
        with pytest.raises(TableError, match=r"is a workbook, not a table; save the sheet as CSV"):
            evaluate_table(tipper, source, tmp_path / "out.csv", "mamdani")
    assert source.exists()


def test_an_earlier_answer_survives_a_failure(tmp_path, table, tipper):
    table(tipper, "service,food\n2,1\n")
    before = (tmp_path / "out.csv").read_bytes()
    with pytest.raises(TableError):
        table(tipper, "service,food\n2,x\n")
    assert (tmp_path / "out.csv").read_bytes() == before
