"""Lowest natural frequency of a body about an equilibrium, at large strain or at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, eye_array, kron
from scipy.sparse.linalg import LinearOperator, eigsh

from fem_reference.direct import factorised
from fem_reference.displacement_control import EquilibriumState, Loading
from fem_reference.mixed_strain import MixedSolid

Floats = NDArray[np.float64]


def lowest_frequency(
    body: MixedSolid, loading: Loading, density: float, about: EquilibriumState | None = None
) -> float:
    """Lowest natural frequency [Hz], undamped, about an equilibrium, by default at rest.

    Components with a prescribed displacement are fixed; `density` in [kg/m^3]. ValueError if the
    stiffness is singular.
    """
    w = np.zeros(body.size + body.pressures)
    if about is not None:
        w = np.concatenate([about.displacement.ravel(), about.pressure])
    free = np.flatnonzero(loading.free)
    unknowns = np.concatenate([free, np.arange(body.size, len(w))])
    solve = factorised(body.tangent(w)[unknowns][:, unknowns])
    volume = csc_array(kron(body.nodal_volume, eye_array(3), format="csc"))
    mass = density * volume[free][:, free]

    def compliance(force: Floats) -> Floats:
        padded = np.zeros(len(unknowns))
        padded[: len(free)] = force.ravel()
        return solve(padded)[: len(free)]

    inverse = LinearOperator(mass.shape, compliance, dtype=np.float64)
    # No eigenvalue lies between 0 and the lowest, so shift-invert at 0 finds the lowest.
    start = np.ones(len(free))
    (found,) = eigsh(mass, 1, mass, 0.0, OPinv=inverse, return_eigenvectors=False, v0=start)
    return float(np.sqrt(found) / (2.0 * np.pi))
