"""Numeric expressions in MATLAB's files: pi/4, -2*pi, 1/3, (1 + 2)*1e-3.

The grammar has + - * / ^, signs, parentheses, the constants pi and eps, and the functions sqrt and
exp; nothing else is evaluated. As in MATLAB, a power binds tighter than a preceding sign, and
operators of equal precedence associate to the left. In a vector, a sign with a blank before but not
after it starts a new number: [1 -2] has two, [1 - 2] and [1-2] have one.
"""

import math
import re
from collections.abc import Callable

NAMES = {"pi": math.pi, "eps": math.ulp(1.0)}
FUNCTIONS: dict[str, Callable[[float], float]] = {"sqrt": math.sqrt, "exp": math.exp}
LONGEST = 200
"""Largest number of characters of an expression."""

_TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[a-z]+|[-+*/^()]", re.ASCII)


def parts(text: str) -> list[str]:
    """The expressions of a vector, separated by blanks or commas as in MATLAB.

    ValueError for unbalanced parentheses.
    """
    text = re.sub(r"\s*([*/^])\s*", r"\1", text.strip())
    text = re.sub(r"(?<=[^\s,(+-])\s+([+-])\s+", r"\1", text)
    text = re.sub(r"(^|[,(])\s*([+-])\s+", r"\1\2", text)
    found, depth = [""], 0
    for character in text:
        depth += (character == "(") - (character == ")")
        if depth < 0:
            raise ValueError("a ) without its (; correct it")
        if depth == 0 and (character.isspace() or character == ","):
            found.append("")
        elif not character.isspace():
            found[-1] += character
    if depth:
        raise ValueError("a ( without its ); correct it")
    return [one for one in found if one]


def number(text: str) -> float:
    """The value of an expression. ValueError for a syntax error or a value that is not finite."""
    try:
        value = _Reader(text).whole()
    except (ArithmeticError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is no finite number; correct it")
    return value


class _Reader:
    """Tokens of an expression, and the position of the parser."""

    def __init__(self, text: str) -> None:
        self._tokens = _TOKEN.findall(text)
        self._next = 0
        if len(text) > LONGEST or "".join(self._tokens) != text:
            raise ValueError(text)

    def whole(self) -> float:
        value = self._sum()
        if self._peek():
            raise ValueError(self._peek())
        return value

    def _peek(self) -> str:
        return self._tokens[self._next] if self._next < len(self._tokens) else ""

    def _take(self) -> str:
        token = self._peek()
        self._next += 1
        return token

    def _sum(self) -> float:
        value = self._product()
        while self._peek() in ("+", "-"):
            value += self._product() if self._take() == "+" else -self._product()
        return value

    def _product(self) -> float:
        value = self._signed()
        while self._peek() in ("*", "/"):
            if self._take() == "*":
                value *= self._signed()
            else:
                value /= self._signed()
        return value

    def _signed(self) -> float:
        if self._peek() in ("+", "-"):
            return self._signed() if self._take() == "+" else -self._signed()
        value = self._atom()
        while self._peek() == "^":
            self._take()
            value = math.pow(value, self._exponent())
        return value

    def _exponent(self) -> float:
        """The exponent after ^, to which signs belong but further powers do not."""
        if self._peek() in ("+", "-"):
            return self._exponent() if self._take() == "+" else -self._exponent()
        return self._atom()

    def _atom(self) -> float:
        word = self._take()
        if word in NAMES:
            return NAMES[word]
        if word in FUNCTIONS and self._peek() == "(":
            return FUNCTIONS[word](self._atom())
        if word != "(":
            return float(word) if word[:1].isdecimal() or word[:1] == "." else math.nan
        value = self._sum()
        if self._take() != ")":
            raise ValueError(word)
        return value
