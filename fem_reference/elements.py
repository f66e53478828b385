"""Tetrahedral elements of the reference, with their orders and memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import skfem

ElementName = str
"""A key of `ELEMENTS`."""


@dataclass(frozen=True)
class Element:
    """Properties of an element.

    `shapes`: scikit-fem's class of the shape functions of one displacement component.
    `gradient_order`: degree of the quadrature of the stiffness, that of squared gradients in
    straight cells. `formal_order`: order of convergence of the displacement in L2.
    `bytes_per_unknown`: peak memory of assembly and iterative solution, measured at 20 000 to
    100 000 unknowns, of `p2` up to 220 000. `quadratic`: it has edge nodes and may be curved.
    `mixed`: it has a continuous linear pressure.
    """

    shapes: Any
    gradient_order: int
    formal_order: float
    bytes_per_unknown: int
    quadratic: bool = True
    mixed: bool = False


ELEMENTS: dict[ElementName, Element] = {
    "p1": Element(skfem.ElementTetP1, 1, 2.0, 30_000, quadratic=False),
    "p2": Element(skfem.ElementTetP2, 2, 3.0, 6_000),
    "taylor-hood": Element(skfem.ElementTetP2, 2, 3.0, 13_000, mixed=True),
}
AUTO = "auto"
CHOICES = (AUTO, *ELEMENTS)
"""Names that `chosen_element` takes."""
LOCKING = 0.48
"""Poisson ratio above which mixed elements pay: at 0.49 they have a seventh of the error."""


def chosen_element(element: str, poisson_ratio: float) -> ElementName:
    """The element of a name; `auto` is `p2`, and `taylor-hood` above a Poisson ratio of 0.48.

    ValueError for a name that is not one of `CHOICES`.
    """
    if element == AUTO:
        return "p2" if poisson_ratio <= LOCKING else "taylor-hood"
    if element not in ELEMENTS:
        raise ValueError(f"reference.element: {element} is not one of {', '.join(CHOICES)}")
    return element
