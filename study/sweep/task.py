"""One run of a sweep: which function, with which arguments."""

from __future__ import annotations

from dataclasses import dataclass

from study.sweep.canonical import Plain, canonical, digest
from study.sweep.program import program


@dataclass(frozen=True)
class Task:
    """A function by name, and its keyword arguments.

    `function`: "package.module:name" of a top-level function that returns a dictionary. `arguments`
    and that dictionary are plain JSON values without NaN; tuples arrive as lists. For a file that a
    run reads, the arguments should include its SHA-256, since a path does not show that the file
    changed. ValueError if the arguments are not plain.
    """

    function: str
    arguments: Plain

    def __post_init__(self) -> None:
        """Refuse arguments that could not be sent to another process."""
        module, _, name = self.function.partition(":")
        if not module or not name.isidentifier():
            raise ValueError(f"{self.function!r}: name a function as package.module:function")
        try:
            canonical(self.arguments)
        except ValueError as error:
            raise ValueError(f"arguments of {self.function}: {error}") from None

    @property
    def module(self) -> str:
        """Name of the function's module."""
        return self.function.partition(":")[0]

    @property
    def key(self) -> str:
        """SHA-256 of function, arguments and program: equal keys, equal results."""
        return key(self.function, self.arguments, program(self.module))


def key(function: str, arguments: Plain, identity: str) -> str:
    """Key of a run by the program of this identity (`study.sweep.program`)."""
    return digest({"function": function, "arguments": arguments, "program": identity})
