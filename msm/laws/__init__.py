"""Spring laws: tension over strain, relative to the spring's weight and rest length.

A spring of rest length L_0, weight w (its stiffness relative to k_ref) and strain
X = (L - L_0) / L_0 has the force w L_0 `tension(law, X)`; `stiffness(law, X)` is the slope. A law
is a named tuple of constants. The record of its type in LAWS has the functions, which are compiled
into the loops of the kernels without a branch on the law. A new law is a file with its named tuple
and its `ForceLaw`, and an entry in LAWS, by whose name a scene selects it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload

from msm.laws.basafa import BASAFA, Basafa
from msm.laws.force_law import ForceLaw, Law
from msm.laws.hooke import HOOKE, Hooke
from msm.laws.piecewise import PIECEWISE, Piecewise, piecewise
from msm.simd import lanewise

__all__ = [
    "LAWS",
    "Basafa",
    "ForceLaw",
    "Hooke",
    "Law",
    "Piecewise",
    "force_law_of",
    "initial_stiffness",
    "largest_stiffness",
    "piecewise",
    "stiffness",
    "stiffness_at_rest",
    "tension",
]

LAWS: dict[str, ForceLaw] = {"hooke": HOOKE, "basafa": BASAFA, "piecewise": PIECEWISE}


def force_law_of(law: Law) -> ForceLaw:
    """The record in LAWS of a law's type. ValueError if there is none."""
    found = _record(type(law))
    if found is None:
        raise ValueError(
            f"a {type(law).__name__} is the type of no spring law; add its record to msm.laws.LAWS"
        )
    return found


def law_of_kind(law: Any) -> ForceLaw | None:
    """The record in LAWS of a law's numba type; None for another type."""
    return _record(getattr(law, "instance_class", None))


def _record(kind: object) -> ForceLaw | None:
    return next((found for found in LAWS.values() if found.type is kind), None)


def tension(law: Law, strain: float) -> float:
    """Tension [N/m] of a law at a strain; times weight and rest length it is a force [N]."""
    return float(force_law_of(law).tension(law, strain))


def stiffness(law: Law, strain: float) -> float:
    """Slope [N/m] of the tension at a strain; times weight it is a spring's own stiffness."""
    return float(force_law_of(law).stiffness(law, strain))


@overload(tension, strict=False)  # whatever a law calls its arguments
def _compiled_tension(law: Any, strain: Any) -> Callable[..., Any] | None:
    """Select the tension by the type of the law, at compilation."""
    found = law_of_kind(law)
    if found is None:
        return None
    return found.tension if found.branchless else lanewise(found.tension, strain)


@overload(stiffness, strict=False)
def _compiled_stiffness(law: Any, strain: Any) -> Callable[..., Any] | None:
    """Select the stiffness by the type of the law, at compilation."""
    found = law_of_kind(law)
    if found is None:
        return None
    return found.stiffness if found.branchless else lanewise(found.stiffness, strain)


def initial_stiffness(law: Law) -> float:
    """Slope [N/m] of the tension at zero strain, in extension if the law has a kink there."""
    return stiffness(law, 0.0)


def stiffness_at_rest(law: Law) -> tuple[float, float]:
    """Slopes [N/m] of the tension just below and just above zero strain."""
    return stiffness(law, float(np.nextafter(0.0, -1.0))), initial_stiffness(law)


def largest_stiffness(law: Law) -> float:
    """Largest slope [N/m] of the tension at any strain."""
    return float(force_law_of(law).largest_stiffness(law))
