"""Quantities with units, read from text such as "9.5 kPa"."""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pint import UnitRegistry
    from pydantic_core import CoreSchema

# pint evaluates arithmetic and guesses at commas, so it never sees raw text: one plain number and
# at most four unit names joined by * or /.
_NUMBER = r"(?P<number>[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?)"
_UNIT = r"[A-Za-z]{1,12}(\^-?[1-4])?"
_TEXT = re.compile(rf"{_NUMBER}\s*(?P<unit>%|({_UNIT}(\s*[*/]\s*{_UNIT}){{0,3}})?)")
_COMMA = re.compile(r"[+-]?\d+,\d")
_POWER = re.compile(r"(?<=[A-Za-z])(?:\*\*)?(⁻?[¹²³⁴]|(?<=\*\*)-?[1-4]|[2-4])(?![A-Za-z0-9])")
_IN_ASCII = str.maketrans("µμ·⋅⁻¹²³⁴", "uu**-1234")
_LONGEST_TEXT = 80
USUAL = {
    "m": {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "um": 1e-6},
    "m^3": {"ml": 1e-6, "l": 1e-3, "L": 1e-3, "m^3": 1.0, "mm^3": 1e-9, "cm^3": 1e-6},
    "kg": {"g": 1e-3, "kg": 1.0, "mg": 1e-6},
    "N": {"mN": 1e-3, "N": 1.0, "kN": 1e3, "uN": 1e-6},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6},
    "Pa/m": {"Pa/m": 1.0, "kPa/m": 1e3, "MPa/m": 1e6, "N/m^3": 1.0},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "kg/m^3": {"kg/m^3": 1.0, "g/cm^3": 1e3},
    "byte": {"MB": 1e6, "GB": 1e9, "byte": 1.0},
}
"""Units that are suggested, with their sizes in the SI unit, by the SI unit.

pint knows these too, but takes longer to load than everything else about a scene.
"""
FRAMES = {"Hz": ("fps", "FPS")}
"""Frames per second, which pint takes for feet."""


@dataclass(frozen=True)
class Quantity:
    """Annotation of a float field: its SI unit and the closed range of allowed SI values.

    As an annotation `Annotated[float, Quantity("Pa", 100, 1e6)]` it makes pydantic accept a text
    with any unit of that dimension, or a bare number in the SI unit.
    """

    unit: str
    low: float
    high: float

    def read(self, value: object) -> float:
        """SI value of a text with unit or of a bare SI number; ValueError says what is wrong."""
        given = (self.unit, self._example())
        number = _parsed(value, *given) if isinstance(value, str) else _bare(value, *given)
        if not math.isfinite(number):
            raise ValueError("must be finite")
        if not self.low <= number <= self.high:
            hint = _hint(value, self.unit) if isinstance(value, str) else self._meant(number)
            limits = f"must lie between {self.low:g} and {self.high:g} {self.unit}".strip()
            raise ValueError(limits + hint)
        return number

    def _example(self) -> str:
        """A value in range: 1 in the SI unit, or in the first usual unit in which it is allowed."""
        units = (self.unit, *USUAL.get(self.unit, ()))
        allowed = (one for one in units if self.low <= _factor(one, self.unit, "") <= self.high)
        return f'"1 {next(allowed, self.unit)}"'

    def _meant(self, number: float) -> str:
        """For a bare number out of range: the first usual unit that would bring it into range."""
        for unit in USUAL.get(self.unit, ()):
            if unit != self.unit and self.low <= number * _factor(unit, self.unit, "") <= self.high:
                return f', did you mean "{number:g} {unit}"?'
        percent = not self.unit and self.high <= 1.0 < number and self.low <= number / 100.0
        return f', did you mean "{number:g} %"?' if percent and number / 100.0 <= self.high else ""

    def text(self, value: float) -> str:
        """The value as text that `read` restores exactly."""
        return f"{value!r} {self.unit}".strip()

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Let pydantic call `read`."""
        from pydantic_core import core_schema

        read = self._read_count if source is int else self.read
        return core_schema.no_info_plain_validator_function(read)

    def _read_count(self, value: object) -> int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise ValueError("write a whole number")  # noqa: TRY004 - pydantic takes ValueErrors only
        return int(self.read(value))


def _bare(value: object, unit: str, example: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(  # noqa: TRY004 - pydantic reports ValueErrors only
            f"write a number with its unit, for example {example}" if unit else "write a number"
        )
    try:
        return float(value)
    except OverflowError:
        raise ValueError("must be finite") from None


def _in_ascii(text: str) -> str:
    """A quantity as it would be typed without µ, raised digits and dots: N/mm², N/mm2 as N/mm^2."""
    plain = text.strip().replace("−", "-")
    number = re.match(_NUMBER, plain)
    end = number.end() if number else 0
    return plain[:end] + _POWER.sub(r"^\1", plain[end:]).translate(_IN_ASCII)


def _parsed(text: str, unit: str, example: str) -> float:
    match = _TEXT.fullmatch(_in_ascii(text)) if len(text) <= _LONGEST_TEXT else None
    example = f"write for example {example}" if unit else "write a plain number"
    if match is None:
        comma = "; the decimal sign is a point" if _COMMA.match(text.strip()) else ""
        raise ValueError(f"not one number with a unit{comma}; {example}")
    if match["unit"] == "%" and not unit:
        return float(f"{0.01 * float(match['number']):.15g}")
    if not match["unit"]:
        if unit:
            raise ValueError(f"the unit is missing; {example}")
        return float(match["number"])
    if match["unit"] in FRAMES.get(unit, ()):
        return float(match["number"])
    converted = float(match["number"]) * _factor(match["unit"], unit, example)
    return float(f"{converted:.15g}")  # 1.5 l is 0.0015 m^3, without the rounding of the factor


def _factor(name: str, unit: str, example: str) -> float:
    """Size of a unit in the SI unit. ValueError for an unknown unit or another dimension."""
    if name == unit:  # always so in scenes written by a run
        return 1.0
    known = USUAL.get(unit, {}).get(name)
    return _factor_of_pint(name, unit, example) if known is None else known


def _factor_of_pint(name: str, unit: str, example: str) -> float:
    import pint

    registry = _registry()
    try:
        given = registry.Quantity(1.0, registry.Unit(name.replace(" ", "")))
        return float(given.to(unit or "dimensionless").magnitude)
    except pint.UndefinedUnitError:
        raise ValueError(
            f"{name!r} is not a known unit (upper and lower case matter){_near(name, unit)}; "
            f"{example}"
        ) from None
    except pint.DimensionalityError:
        kind = f"a unit like {unit}" if unit else "a number without unit"
        raise ValueError(f"{name!r} is not {kind}{_near(name, unit)}; {example}") from None
    except pint.PintError as error:
        raise ValueError(f"{name!r}: {error}; {example}") from None


def _near(name: str, unit: str) -> str:
    """The most similar usual unit, ignoring case first, or an empty text."""
    usual = tuple(USUAL.get(unit, ()))
    same = [one for one in usual if one.lower() == name.lower()]
    near = same or difflib.get_close_matches(name, usual, n=1)
    return f", did you mean {near[0]!r}?" if near else ""


def _hint(text: str, unit: str) -> str:
    """For a value out of range: the usual unit that differs from its own by the case of letters."""
    match = _TEXT.fullmatch(_in_ascii(text))
    name = match["unit"] if match else ""
    usual = tuple(USUAL.get(unit, ()))
    return _near(name, unit) if name not in usual and _differs_by_case(name, usual) else ""


def _differs_by_case(name: str, usual: tuple[str, ...]) -> bool:
    return name.lower() in {one.lower() for one in usual}


@cache
def _registry() -> UnitRegistry[float]:
    import pint

    return pint.UnitRegistry()
