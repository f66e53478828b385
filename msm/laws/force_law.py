"""What a spring law is told by: one record for each kind."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

Law: TypeAlias = tuple[Any, ...]
"""The constants of one spring law: a named tuple of the type of some record, such as `Hooke`."""


class ForceLaw(NamedTuple):
    """One kind of spring law.

    `type`: the named tuple of its constants, numbers and arrays. `tension(law, strain)` and its
    slope `stiffness(law, strain)` [N/m]: plain functions that numba can compile, for the
    kernels take them in. `largest_stiffness(law)` [N/m]: largest slope at any
    strain. `make(k, ...)`: the law in proportion to a linear spring of k [N/m]; its other arguments
    are what a scene gives by their names, each a dimensionless number or a sequence of them, and a
    ValueError says why they make no law. `linear`: whether the tension is proportional to the
    strain, whatever the constants. `branchless`: whether tension and stiffness do the same at every
    strain and use no more than +, -, *, /, abs, min and max, so that the kernels may give them
    several strains at once; another law is asked strain by strain.
    """

    type: type[Law]
    tension: Callable[[Any, Any], Any]
    stiffness: Callable[[Any, Any], Any]
    largest_stiffness: Callable[[Any], float]
    make: Callable[..., Law]
    linear: bool = False
    branchless: bool = False
