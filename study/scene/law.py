"""A spring law of a scene: the name of a law in `msm.laws.LAWS`, and its parameters."""

from __future__ import annotations

import difflib
import inspect
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from study.annotation.choice import Choice

if TYPE_CHECKING:
    from pydantic_core import CoreSchema

    from msm.laws import Law

Numbers = float | tuple[float, ...]

KINDS = Choice("msm.laws:LAWS")
DEFAULT = "piecewise"
FREE_OF_TENSION = 1e-9
"""Largest tension of a law at rest that counts as rounding, over its stiffness."""


class _Wrong(NamedTuple):
    """A key of the table, or none for the whole, and what is wrong with its value."""

    key: tuple[str, ...]
    message: str
    value: object


@dataclass(frozen=True)
class SpringLaw:
    """A kind of spring law and its dimensionless parameters.

    In a scene it is one table, `{ kind = "piecewise", strain = [...], relative_tension = [...] }`;
    the parameters are the arguments of the kind's `make` in `msm.laws.LAWS`.
    """

    kind: str
    parameters: Mapping[str, Numbers]

    def make(self, k: float) -> Law:
        """The law scaled to a linear spring of k [N/m]; ValueError if there is none."""
        from msm.laws import LAWS

        return LAWS[self.kind].make(k, **self.parameters)

    @property
    def is_linear(self) -> bool:
        """Whether a spring's tension is proportional to its strain."""
        from msm.laws import LAWS

        return LAWS[self.kind].linear

    def table(self) -> dict[str, str | float | list[float]]:
        """The scene's table that reads as this law."""
        numbers = {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in self.parameters.items()
        }
        return {"kind": self.kind, **numbers}

    @classmethod
    def read(cls, table: object) -> SpringLaw:
        """The law of a scene's table; a pydantic ValidationError names each key that is wrong."""
        if not isinstance(table, dict):
            raise ValueError("should be a table")  # noqa: TRY004 - pydantic takes ValueErrors only
        kind = table.get("kind", DEFAULT)
        try:
            KINDS.read(kind)
        except ValueError as error:
            raise _errors([_Wrong(("kind",), str(error), kind)]) from None
        given = {key: value for key, value in table.items() if key != "kind"}
        wrong = list(_wrong_keys(kind, given))
        if wrong:
            raise _errors(wrong)
        law = cls(kind, {key: _numbers(value) for key, value in given.items()})
        _refuse_unsound(kind, law.make(1.0))
        return law

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> CoreSchema:
        """Let pydantic call `read`."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(cls.read)


def _refuse_unsound(kind: str, law: Law) -> None:
    """Raise ValueError for a law that no spring at rest can have."""
    from msm.laws import stiffness_at_rest, tension

    pull, slopes = tension(law, 0.0), stiffness_at_rest(law)
    if not abs(pull) <= FREE_OF_TENSION or not all(0.0 < k < math.inf for k in slopes):
        raise ValueError(
            f"the law {kind} has tension {pull:g} and slopes {slopes[0]:g} and {slopes[1]:g} at "
            "rest, relative to a linear spring; they must be 0, and finite and above 0"
        )


def _wrong_keys(kind: str, given: Mapping[str, object]) -> Iterator[_Wrong]:
    from msm.laws import LAWS

    _, *arguments = inspect.signature(LAWS[kind].make).parameters.values()
    names = [argument.name for argument in arguments]
    takes = f"the law {kind} takes {' and '.join(names) or 'none'}"
    for key in given.keys() - set(names):
        near = difflib.get_close_matches(key, names, n=1)
        hint = f", did you mean {near[0]!r}?" if near else "; remove it"
        yield _Wrong((key,), f"unknown key, {takes}{hint}", given[key])
    for argument in arguments:
        if argument.name in given:
            value = given[argument.name]
            message = _wrong_value(value, alone=argument.annotation in {float, "float"})
            if message:
                yield _Wrong((argument.name,), message, value)
        elif argument.default is argument.empty:
            yield _Wrong((argument.name,), f"missing, {takes}; give it", given)


def _wrong_value(value: object, *, alone: bool) -> str | None:
    """What is wrong with a value that should be a number (`alone`) or a list of numbers."""
    if alone and isinstance(value, list | tuple):
        return "should be one number"
    entries = value if isinstance(value, list | tuple) else [value]
    for entry in entries:
        if isinstance(entry, bool) or not isinstance(entry, int | float):
            return "should be one number" if alone else "should be a list of numbers"
        if not abs(entry) <= sys.float_info.max:
            return "must be finite"
    return None


def _numbers(value: Any) -> Numbers:
    return tuple(map(float, value)) if isinstance(value, list | tuple) else float(value)


def _errors(wrong: list[_Wrong]) -> ValueError:
    from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError

    return ValidationError.from_exception_data(
        "SpringLaw",
        [
            InitErrorDetails(
                type=PydanticCustomError("spring_law", "{why}", {"why": found.message}),
                loc=found.key,
                input=found.value,
            )
            for found in wrong
        ],
    )
