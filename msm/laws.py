"""Spring laws: tension over strain, relative to the spring's weight and rest length.

A spring of rest length L_0, weight w (its stiffness relative to k_ref) and strain
X = (L - L_0) / L_0 pulls with w L_0 `tension(law, X)`; `stiffness(law, X)` is the slope. A law is a
named tuple with one function for each, joined in TENSIONS and STIFFNESSES; the kernel compiles them
into a loop of their own with nothing left to decide inside. A new law is one more pair.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ZERO = 1e-12
"""How far from zero, relative to its largest entry, a table's tension at rest may round."""


class Hooke(NamedTuple):
    """Linear spring: `k` [N/m] is k_ref."""

    k: float


class Basafa(NamedTuple):
    """Eq. (6), (7): K_1 X + K_2 X^3 up to the strain x_c, then straight on.

    `k1`, `k2` [N/m] are K_1 / h and K_2 / h of an edge: a face diagonal thus has sqrt(2) times the
    force constants of an edge, which keeps the lattice isotropic.
    """

    k1: float
    k2: float
    x_c: float


class Piecewise(NamedTuple):
    """Straight pieces between measured points, the first and last carried on; see `piecewise`.

    `strains` and `tensions` [N/m], each (p,), both rising. Where two pieces meet, the slope is that
    of the piece of larger strain.
    """

    strains: Floats
    tensions: Floats


Law = Hooke | Basafa | Piecewise


def piecewise(strains: Sequence[float] | Floats, tensions: Sequence[float] | Floats) -> Piecewise:
    """Law through points of strain and tension [N/m], relative as for every law.

    ValueError unless there are two points or more, finite and rising, on a line through (0, 0).
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
        falls = np.flatnonzero(np.diff(values) <= 0.0)
        if len(falls):
            p = int(falls[0])
            raise ValueError(
                f"the {name} of a spring law must rise from point to point, but goes from "
                f"{values[p]:g} at point {p} to {values[p + 1]:g} at point {p + 1}: {why}"
            )
    law = Piecewise(x, t)
    at_rest = tension(law, 0.0)
    if abs(at_rest) > ZERO * np.abs(t).max():
        raise ValueError(
            f"a spring law must be free of tension at rest, but has {at_rest:g} N/m at strain 0: "
            "add the point (0, 0) or shift the tensions"
        )
    return law


# The kernel compiles these and wants the annotations of its own overload, hence Any.
def _hooke(law: Any, strain: Any) -> Any:
    return law.k * strain


def _hooke_slope(law: Any, strain: Any) -> Any:  # noqa: ARG001 - the same at any strain
    return law.k


def _basafa(law: Any, strain: Any) -> Any:
    size = abs(strain)
    if size <= law.x_c:
        return law.k1 * strain + law.k2 * strain**3  # Eq. (6), inner branch
    a = law.k1 * law.x_c + law.k2 * law.x_c**3  # Eq. (7), taken at x_c: force and slope continuous
    b = law.k1 + 3.0 * law.k2 * law.x_c**2
    return (a + b * (size - law.x_c)) * (1.0 if strain > 0.0 else -1.0)


def _basafa_slope(law: Any, strain: Any) -> Any:
    x = min(abs(strain), law.x_c)
    return law.k1 + 3.0 * law.k2 * x**2


@register_jitable
def _piece(law: Any, strain: Any) -> Any:
    """Which piece a strain lies on, counted without a branch, which strains about 0 would mislead.

    For NaN it is the first.
    """
    p = 0
    for n in range(1, len(law.strains) - 1):
        p += strain >= law.strains[n]
    return p


@register_jitable
def _slope_of(law: Any, p: Any) -> Any:
    return (law.tensions[p + 1] - law.tensions[p]) / (law.strains[p + 1] - law.strains[p])


def _piecewise(law: Any, strain: Any) -> Any:
    p = _piece(law, strain)
    return law.tensions[p] + _slope_of(law, p) * (strain - law.strains[p])


def _piecewise_slope(law: Any, strain: Any) -> Any:
    return _slope_of(law, _piece(law, strain))


TENSIONS = {Hooke: _hooke, Basafa: _basafa, Piecewise: _piecewise}
STIFFNESSES = {Hooke: _hooke_slope, Basafa: _basafa_slope, Piecewise: _piecewise_slope}


def tension(law: Law, strain: float) -> float:
    """Tension [N/m] of a law at a strain; times weight and rest length it is a force [N]."""
    return float(TENSIONS[type(law)](law, strain))


def stiffness(law: Law, strain: float) -> float:
    """Slope [N/m] of the tension at a strain; times weight it is a spring's own stiffness."""
    return float(STIFFNESSES[type(law)](law, strain))


@overload(tension)
def _compiled_tension(law: Any, strain: Any) -> Callable[..., Any] | None:  # noqa: ARG001 - typed by law alone
    """Choose the tension by the type of the law, when a kernel is compiled."""
    return TENSIONS.get(getattr(law, "instance_class", type(None)))


@overload(stiffness)
def _compiled_stiffness(law: Any, strain: Any) -> Callable[..., Any] | None:  # noqa: ARG001 - typed by law alone
    """Choose the slope by the type of the law, when a kernel is compiled."""
    return STIFFNESSES.get(getattr(law, "instance_class", type(None)))


def initial_stiffness(law: Law) -> float:
    """Slope [N/m] of the tension at rest, towards stretching if the law has a corner there."""
    return stiffness(law, 0.0)


def largest_stiffness(law: Law) -> float:
    """Largest slope [N/m] of the tension at any strain."""
    if isinstance(law, Piecewise):
        return float((np.diff(law.tensions) / np.diff(law.strains)).max())
    return stiffness(law, law.x_c if isinstance(law, Basafa) else 0.0)
