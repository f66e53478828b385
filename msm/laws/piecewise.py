"""Springs of a measured law: linear interpolation between points of strain and tension."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from msm.laws.force_law import ForceLaw

Floats = NDArray[np.float64]

ZERO = 1e-12
"""Rounding of the tension at zero strain, relative to the largest entry of the table."""


class Piecewise(NamedTuple):
    """Linear interpolation between measured points, extrapolated at both ends; see `piecewise`.

    `strains` and `tensions` [N/m], each (p,), both ascending. At a point the slope is that of the
    interval of larger strain.
    """

    strains: Floats
    tensions: Floats


def piecewise(strains: Sequence[float] | Floats, tensions: Sequence[float] | Floats) -> Piecewise:
    """Law through points of strain and tension [N/m], relative as for every law.

    ValueError unless there are two or more finite and ascending points, with no strain below -1 and
    no tension at zero strain.
    """
    x, t = np.array(strains, dtype=np.float64), np.array(tensions, dtype=np.float64)
    if x.ndim != 1 or x.shape != t.shape or len(x) < 2:
        raise ValueError(
            f"a spring law needs as many strains as tensions, two or more: got shapes {x.shape} "
            f"and {t.shape}"
        )
    if not (np.isfinite(x).all() and np.isfinite(t).all()):
        raise ValueError("a spring law's strains and tensions must be finite numbers")
    for name, values, why in (
        ("strain", x, "sort the points and give each strain once"),
        ("tension", t, "a spring that weakens as it is stretched makes the lattice unstable"),
    ):
        _refuse_fall(name, values, why)
    if x[0] < -1.0:
        raise ValueError(f"no spring has a strain below -1, so none of {x[0]:g}: leave it out")
    law = Piecewise(x, t)
    at_rest = _tension(law, 0.0)
    if abs(at_rest) > ZERO * np.abs(t).max():
        raise ValueError(
            f"a spring law must be free of tension at rest, but has {at_rest:g} N/m at strain 0: "
            "add the point (0, 0) or shift the tensions"
        )
    return law


def _refuse_fall(name: str, values: Floats, why: str) -> None:
    falls = np.flatnonzero(np.diff(values) <= 0.0)
    if len(falls):
        p = int(falls[0])
        raise ValueError(
            f"the {name} of a spring law must rise from point to point, but goes from "
            f"{values[p]:g} at point {p} to {values[p + 1]:g} at point {p + 1}: {why}"
        )


def in_proportion(
    k: float, strain: Sequence[float], relative_tension: Sequence[float]
) -> Piecewise:
    """Law through points of strain and of tension relative to k [N/m], see `piecewise`.

    `relative_tension` is that of a linear spring at this strain: where it equals `strain`, the
    spring has the stiffness k.
    """
    return piecewise(strain, k * np.array(relative_tension, dtype=np.float64))


@register_jitable
def _piece(law: Piecewise, strain: float) -> int:
    """Interval of a strain, found without a branch, which strains about 0 would mispredict.

    For NaN it is the first.
    """
    p = 0
    for n in range(1, len(law.strains) - 1):
        p += strain >= law.strains[n]
    return p


@register_jitable
def _slope_of(law: Piecewise, p: int) -> Any:  # a numpy scalar
    return (law.tensions[p + 1] - law.tensions[p]) / (law.strains[p + 1] - law.strains[p])


def _tension(law: Piecewise, strain: float) -> Any:
    p = _piece(law, strain)
    return law.tensions[p] + _slope_of(law, p) * (strain - law.strains[p])


def _stiffness(law: Piecewise, strain: float) -> Any:
    return _slope_of(law, _piece(law, strain))


def _largest_stiffness(law: Piecewise) -> float:
    return float((np.diff(law.tensions) / np.diff(law.strains)).max())


PIECEWISE = ForceLaw(Piecewise, _tension, _stiffness, _largest_stiffness, in_proportion)
