"""Free vibration of small amplitude about a rest, at large strain or none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, eye_array, kron
from scipy.sparse.linalg import LinearOperator, eigsh

from fem_reference.direct import factorised
from fem_reference.driven import Drive, DrivenState
from fem_reference.mixed_strain import MixedSolid

Floats = NDArray[np.float64]


def lowest_frequency(
    body: MixedSolid, drive: Drive, density: float, about: DrivenState | None = None
) -> float:
    """Of undamped free motion [Hz], what is prescribed held still; about a rest, or none.

    `density` [kg/m^3]. ValueError if nothing holds the body.
    """
    w = np.zeros(body.size + body.pressures)
    if about is not None:
        w = np.concatenate([about.displacement.ravel(), about.pressure])
    free = np.flatnonzero(drive.free)
    every = np.concatenate([free, np.arange(body.size, len(w))])
    solve = factorised(body.tangent(w)[every][:, every])
    volume = csc_array(kron(body.nodal_volume, eye_array(3), format="csc"))
    mass = density * volume[free][:, free]

    def compliance(force: Floats) -> Floats:
        whole = np.zeros(len(every))
        whole[: len(free)] = force.ravel()
        return solve(whole)[: len(free)]

    inverse = LinearOperator(mass.shape, compliance, dtype=np.float64)
    # Between zero and the lowest there is none: its inverse is what the iteration finds first.
    start = np.ones(len(free))
    (found,) = eigsh(mass, 1, mass, 0.0, OPinv=inverse, return_eigenvectors=False, v0=start)
    return float(np.sqrt(found) / (2.0 * np.pi))
