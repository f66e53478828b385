"""Torsion of a free ball: its five lowest modes have one frequency.

The surface of a ball of radius R carries no shear where (l - 1) j_l(k) = k j_(l+1)(k), k = omega R
/ c_s; the least root for l = 2 is 2.50113. Lamb (1881), Proc. London Math. Soc. 13:189.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.sparse import csc_array
from scipy.sparse.linalg import LinearOperator, eigsh
from scipy.special import spherical_jn

from fem_reference.dynamics import Oscillator
from fem_reference.elements import ElementName
from fem_reference.grid import curved
from fem_reference.stiffness import Stiffness
from study.known.finding import Finding, error_of, number_of, observed_order
from study.known.verification.moduli import shear_modulus
from study.known.verification.round_shapes import ball, ball_octant
from study.known.verification.solid import Solid, mass_matrix, restricted, solid
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

CASES: tuple[tuple[ElementName, float], ...] = (("p2", 0.45), ("taylor-hood", 0.4999))
RIGID, FOLD = 6, 5


def whole() -> Iterator[Finding]:
    """The five lowest frequencies of torsion of a whole ball of 512 tetrahedra."""
    for name, nu in CASES:
        tissue = Tissue(poisson_ratio=nu)
        body = solid(curved(*ball(2)), name, tissue)
        everything = np.ones(body.points.size, dtype=bool)
        found = _frequencies(body, tissue, everything, RIGID + FOLD)[RIGID:]
        label = f"{name}, nu {nu:g}"
        yield number_of(f"mean of five omega R / c_s, {label}", exact(), float(found.mean()), 2e-3)
        yield error_of(f"spread of the five, {label}", float(np.ptp(found)) / exact(), 2e-3)


def octant() -> Iterator[Finding]:
    """Two of the five frequencies, in an eighth of the ball that cannot slide along its planes.

    The order is between that of quadratic surfaces, 3, and of energy, 4.
    """
    for name, nu in CASES:
        means = []
        for refinements in (2, 3):
            tissue = Tissue(poisson_ratio=nu)
            body = solid(curved(*ball_octant(refinements)), name, tissue)
            plane = body.points < 1e-9
            # What lies along a plane is held: a component is, on the planes of both others.
            held = np.roll(plane, 1, axis=1) | np.roll(plane, 2, axis=1)
            means.append(float(_frequencies(body, tissue, ~held.ravel(), 2).mean()))
        order = observed_order([abs(mean - exact()) for mean in means])
        label = f"mean of two omega R / c_s, {name}, nu {nu:g}"
        yield number_of(label, exact(), means[-1], 2e-4, order)


def exact() -> float:
    """Exact frequency of torsion, omega R / c_s."""
    return float(brentq(lambda k: spherical_jn(2, k) - k * spherical_jn(3, k), 2.0, 3.0))


def _frequencies(body: Solid, tissue: Tissue, free: NDArray[np.bool_], count: int) -> Floats:
    """The lowest omega R / c_s of motions of the free displacements (n,)."""
    mass = csc_array(mass_matrix(body, tissue.density)[free][:, free])
    shear_speed_squared = shear_modulus(tissue) / tissue.density
    squared = _lowest(restricted(body.stiffness, free), mass, shear_speed_squared, count)
    return np.asarray(np.sqrt(np.abs(squared) / shear_speed_squared))


def _lowest(stiffness: Stiffness, mass: csc_array, shift: float, count: int) -> Floats:
    """Squared frequencies [1/s^2], shifted by a positive one as those of rigid motion are zero."""
    size = stiffness.size
    operator = partial(LinearOperator, (size, size), dtype=np.float64)
    solve = Oscillator(mass, stiffness, np.zeros(size), RayleighDamping(0.0)).shifted(
        0.0, 1.0 / shift
    )
    squared = eigsh(
        operator(lambda u: stiffness @ u),
        count,
        M=mass,
        sigma=-shift,
        OPinv=operator(lambda f: solve(f) / shift),
        v0=np.random.default_rng(1).standard_normal(size),
        return_eigenvectors=False,
    )
    return np.sort(squared)
