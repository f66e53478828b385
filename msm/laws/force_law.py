"""Definition of a kind of spring law."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

Law: TypeAlias = tuple[Any, ...]
"""The constants of one spring law: a named tuple of the type of some record, such as `Hooke`."""


class ForceLaw(NamedTuple):
    """One kind of spring law.

    `type`: named tuple of its constants, numbers and arrays. `tension(law, strain)` and its slope
    `stiffness(law, strain)` [N/m]: plain functions that numba can compile into the kernels.
    `largest_stiffness(law)` [N/m]: largest slope at any strain. `make(k, ...)`: the law scaled by a
    linear spring of k [N/m]; a scene gives its other arguments by name, each a dimensionless number
    or a sequence of them. ValueError, with the reason, for invalid ones. `linear`: whether the
    tension is proportional to the strain for any constants. `branchless`: whether tension and
    stiffness use the same operations at every strain, and only +, -, *, /, abs, min and max, so
    that the kernels can evaluate a vector of strains; other laws are evaluated strain by strain.
    """

    type: type[Law]
    tension: Callable[[Any, Any], Any]
    stiffness: Callable[[Any, Any], Any]
    largest_stiffness: Callable[[Any], float]
    make: Callable[..., Law]
    linear: bool = False
    branchless: bool = False
