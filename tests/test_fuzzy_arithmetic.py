"""Expressions in place of numbers, as MATLAB's files hold them."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzzy.systems.arithmetic import number, parts

VALUES = {
    "pi/4": math.pi / 4,
    "1/3": 1 / 3,
    "1e-3": 1e-3,
    "-2*pi": -2 * math.pi,
    "+.0E0": 0.0,
    "007": 7.0,
    "2^3^2": 64.0,  # from left to right
    "-2^2": -4.0,
    "2^-1": 0.5,
    "8/4/2": 1.0,
    "1-2-3": -4.0,
    "--3": 3.0,
    "2*(1+2)^2-1": 17.0,
    "sqrt(2)*exp(1)": math.sqrt(2) * math.e,
    "eps": 2.0**-52,
}


@pytest.mark.parametrize("text", VALUES)
def test_expressions_have_matlabs_values(text):
    assert number(text) == pytest.approx(VALUES[text], rel=1e-15)


VECTORS = {
    "1 -2": ["1", "-2"],
    "1 - 2": ["1-2"],
    "1-2": ["1-2"],
    "1 , -2,+3": ["1", "-2", "+3"],
    "- 1 2": ["-1", "2"],
    "pi / 4 (1 + 2) * 3": ["pi/4", "(1+2)*3"],
    "(1 -2) 3": ["(1-2)", "3"],
    "-pi\t-pi/2 0 ": ["-pi", "-pi/2", "0"],
    "1e-3 -1e+3": ["1e-3", "-1e+3"],
    "": [],
}


@pytest.mark.parametrize("text", VECTORS)
def test_blanks_part_numbers_as_in_matlab(text):
    assert parts(text) == VECTORS[text]


WRONG = [
    "1e999",
    "NaN",
    "Inf",
    "-inf",
    "1_5",
    "pi()",
    "0/0",
    "1/0",
    "(-1)^.5",
    "__import__",
    "1e5e",
    "1+",
    "e",
    "2pi",
    "1..2",
    "sqrt",
    "sqrt2",
    "9^9^9^9",
    "x",
    "0x10",
    "1j",
    "١",
    "sqrt(-1)",
    "(1",
    "1)",
    "[1]",
    "a.b",
    "1;2",
    "1**2",
]


@pytest.mark.parametrize(
    "text",
    [*WRONG, "", "1 2", "(" * 300 + "1" + ")" * 300],
)
def test_what_is_no_number_is_refused(text):
    with pytest.raises(ValueError, match="is no finite number; correct it"):
        number(text)


@pytest.mark.parametrize("text", ["(1", "1)", "2 (3))", ")("])
def test_parentheses_come_in_pairs(text):
    with pytest.raises(ValueError, match=r"a [()] without its [()]; correct it"):
        parts(text)


LEAVES = st.tuples(st.integers(0, 99).map(str), st.just(3)).map(lambda p: (p[0], float(p[0]), p[1]))


def joined(operands, operator):
    """Text, value and rank of two operands joined, in parentheses where rank asks for them."""
    (left, a, rank_left), (right, b, rank_right) = operands
    rank = {"+": 1, "-": 1, "*": 2}[operator]
    left = left if rank_left >= rank else f"({left})"
    right = right if rank_right > rank else f"({right})"
    value = {"+": a + b, "-": a - b, "*": a * b}[operator]
    return f"{left}{operator}{right}", value, rank


EXPRESSIONS = st.recursive(
    LEAVES,
    lambda inner: st.builds(joined, st.tuples(inner, inner), st.sampled_from("+-*")),
    max_leaves=12,
)


@given(EXPRESSIONS)
@settings(deadline=None)
def test_rank_and_direction_are_those_of_arithmetic(expression):
    text, value, _ = expression
    if len(text) <= 200 and abs(value) < 2**53:
        assert number(text) == value
    assert parts(f"{text} 1") == [text, "1"]
