"""How numbers and names are printed."""

from __future__ import annotations

import math
import re
from typing import TypedDict

Table = list[list[str]]
"""Cells of a table, row by row."""


class Group(TypedDict):
    """Rows of a table that belong together, under a name."""

    name: str
    rows: Table


PA_PER_KPA = 1e3
DASH = "–"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
LONGEST_WORD = 20
ONLY_POINT = "control-point"
"""Name of the control point of a scene without an organ."""
QUANTITY = re.compile(r"(-?\d[\d.]*(?:e[+-]?\d+)?)(?: (.+))?")
RANGE = re.compile(r"(-?[\d.e+-]+) to (-?[\d.e+-]+) (\S+)")
BEFORE_UNIT = re.compile(
    r"(?<=[\d)]) (?=±|(?:%|mm/s|mm|kPa|MPa|Pa|ms|s|Hz|kHz|mN|N|mJ|L)(?!\w))|(?<=[±<]) (?=\d)"
)
"""A space within a number with its error and unit."""
LARGER_UNITS = {"Pa": (1e3, 1e-3, "kPa"), "Pa/m": (1e6, 1e-6, "MPa/m")}
SMALLER_UNITS = {"m": (1e3, "mm"), "m^3": (1e3, "L")}


def fixed(value: float, decimals: int) -> str:
    """A number with so many decimals. ValueError if it is not finite."""
    text = f"{_finite(value):.{decimals}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def significant(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, as a power of ten if it is small or large.

    Raises ValueError if it is not finite.
    """
    if _finite(value) == 0.0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -3 <= power <= 5:
        return fixed(float(f"{value:.{digits - 1}e}"), max(0, digits - 1 - power))
    return f"{fixed(float(mantissa), digits - 1)}·10{str(power).translate(SUPERSCRIPTS)}"


def percent(share: float, digits: int = 3) -> str:
    """A share of one as a percentage, to a tenth at the finest."""
    value = 100.0 * _finite(share)
    return f"{fixed(value, 1) if abs(value) >= 0.1 ** (digits - 2) else significant(value, 2)} %"


def percent_known(share: float, error: float | None) -> str:
    """A share of one as a percentage to the first digit of its error, to a tenth at the finest."""
    if not error or _decimals(100.0 * error) > 0:
        return percent(share)
    return f"{fixed(100.0 * share, 0)} %"


def with_error(value: float, error: float) -> str:
    """A number and its estimated error, to the first digit of the error: "12.3 ± 0.1"."""
    if error == 0.0:
        return significant(value)
    decimals = _decimals(error)
    return f"{fixed(value, decimals)} ± {fixed(error, decimals)}"


def _decimals(error: float) -> int:
    """Decimals down to the first digit of an error, none where that is a ten or more."""
    return max(0, -int(f"{_finite(error):.0e}".split("e")[1]))


def count(value: int) -> str:
    """A count in groups of three digits."""
    return f"{value:,}".replace(",", "\u202f")


def spread(values: list[str]) -> str:
    """The first and the last of some printed numbers: "a to b", or one if they print alike."""
    first, last = values[0], values[-1]
    return first if first == last else f"{first} to {last}"


def quantity(text: str) -> str:
    """A scene's SI quantity as a reader would write it: "9500.0 Pa" becomes "9.5 kPa"."""
    found = QUANTITY.fullmatch(text)
    if found is None:
        return text
    value, unit = float(found[1]), found[2] or ""
    threshold, factor, larger = LARGER_UNITS.get(unit, (math.inf, 1.0, unit))
    if abs(value) >= threshold:
        value, unit = factor * value, larger
    elif unit in SMALLER_UNITS and 0 < abs(value) < 0.5:
        factor, unit = SMALLER_UNITS[unit]
        value *= factor
    unit = unit.replace("*", "·").replace("^2", "²").replace("^3", "³")
    return f"{value:.6g} {unit}".strip()


def interval(text: str) -> str:
    """A range in SI units as a reader would write it: "0.003 to 0.01 m" becomes "3 to 10 mm"."""
    found = RANGE.fullmatch(text)
    if found is None:
        return text
    low, high, unit = float(found[1]), float(found[2]), found[3]
    if unit in SMALLER_UNITS and max(abs(low), abs(high)) < 0.5:
        factor, unit = SMALLER_UNITS[unit]
    elif unit in LARGER_UNITS and min(abs(low), abs(high)) >= LARGER_UNITS[unit][0]:
        _, factor, unit = LARGER_UNITS[unit]
    else:
        return text
    return f"{factor * low:.3g} to {factor * high:.3g} {unit}"


def symbols(text: str) -> str:
    """Text with the paper's symbols as they are printed there: "K_1 / h_0^2" as K₁ / h₀²."""
    text = text.replace("gamma_", "γ_").replace("sqrt(2)", "√2")
    text = re.sub(r"\b(\w)_(\d)", lambda m: m[1] + m[2].translate(SUBSCRIPTS), text)
    return re.sub(r"\^(\d)", lambda m: m[1].translate(SUPERSCRIPTS), text)


def control_point(probe: str) -> str:
    """A control point in a sentence; that of a single point needs no name."""
    return "the control point" if probe == ONLY_POINT else f"the control point {words(probe)}"


def words(text: str) -> str:
    """Text without control characters, whose long words may be broken at the end of a line."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return re.sub(rf"\S{{{LONGEST_WORD}}}(?=\S)", lambda found: found[0] + "\u200b", clean)


def unbroken(text: str) -> str:
    """Text in which no line ends within a number with its error and unit."""
    return BEFORE_UNIT.sub("\u00a0", text)


def short(text: str, length: int = 32) -> str:
    """The beginning of a name, fit for a title of a panel."""
    clean = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return clean if len(clean) <= length else clean[: length - 1] + "…"


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError(f"{value} is not a number that a report can print")
    return value
