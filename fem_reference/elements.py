"""Tetrahedral elements that a body may be made of, and what each asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import skfem

ElementName = str
"""A key of `ELEMENTS`."""


@dataclass(frozen=True)
class Element:
    """Shape functions of a displacement component, and what goes with them.

    `shapes`: scikit-fem's class. `gradient_order`: degree that the quadrature of the stiffness
    integrates, which squares of gradients have in straight cells. `formal_order`: of convergence of
    the displacement in L2. `bytes_per_unknown`: at the peak of assembly and iterative solution,
    measured at 20 000 to 100 000 unknowns, of `p2` to 220 000. `quadratic`: it has nodes on edges
    too, and may be curved. `mixed`: it has a linear, continuous pressure of its own.
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
"""Poisson ratio above which a pressure pays: at 0.49 it leaves a seventh of the error."""


def chosen_element(element: str, poisson_ratio: float) -> ElementName:
    """The element that is meant: `auto` is quadratic, with a pressure of its own above nu 0.48.

    ValueError for a name that is not one of `CHOICES`.
    """
    if element == AUTO:
        return "p2" if poisson_ratio <= LOCKING else "taylor-hood"
    if element not in ELEMENTS:
        raise ValueError(f"reference.element: {element} is not one of {', '.join(CHOICES)}")
    return element
