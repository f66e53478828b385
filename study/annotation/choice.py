"""Choices by name, from the table that implements them."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic_core import CoreSchema


@dataclass(frozen=True)
class Choice:
    """Annotation of a text field: its value is a key of a table, given as "module:NAME".

    As an annotation `Annotated[str, Choice("msm.integrators:INTEGRATORS")]` it makes pydantic
    accept the keys of that table and nothing else. The table is imported when a value is read, so
    that a scene can be declared without importing the models, and a new entry of the table is a
    choice. Names that are `usual` are accepted without importing it, for tables that take long to
    load.
    """

    table: str
    usual: tuple[str, ...] = ()

    def names(self) -> tuple[str, ...]:
        """The keys of the table, in its order."""
        found: Mapping[str, object] = resolve_name(self.table)
        return tuple(found)

    def read(self, value: object) -> str:
        """The value if it is a key of the table; ValueError with the existing keys."""
        if isinstance(value, str) and value in self.usual:
            return value
        names = self.names()
        if not isinstance(value, str) or value not in names:
            quoted = [repr(name) for name in names]
            listed = " or ".join(filter(None, [", ".join(quoted[:-1]), quoted[-1]]))
            near = difflib.get_close_matches(str(value).lower(), names, n=1)
            hint = f", did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"should be {listed}{hint}")
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Let pydantic call `read`."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(self.read)
