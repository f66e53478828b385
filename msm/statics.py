"""Linear static solution of a lattice under its full load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array, eye_array, kron
from scipy.sparse.linalg import cg

from msm import volume as volumes
from msm.assembly import Assembly, Material
from msm.laws import initial_stiffness
from msm.springs import stiffness_matrix
from msm.ties import hanging_nodes

Floats = NDArray[np.float64]

TOLERANCE = 1e-10


def static_displacement(assembly: Assembly, material: Material) -> Floats:
    """Static displacement [m] (n, 3) under the full load, linearised about the unloaded state.

    ValueError if the support does not hold the lattice.
    """
    stiffness = stiffness_at_rest(assembly, material)
    return extended(assembly, solved(stiffness, assembly.load.ravel())).reshape(-1, 3)


def sag(assembly: Assembly, material: Material) -> Floats:
    """Displacement [m] (n, 3) in equilibrium under gravity alone, linearised at rest.

    It is zero if the given nodes are those under gravity. ValueError if the support does not hold
    the lattice.
    """
    loads = assembly.external_loads
    if loads is None or loads.given_loaded or not loads.dead.any():
        return np.zeros_like(assembly.load)
    stiffness = stiffness_at_rest(assembly, material)
    return extended(assembly, solved(stiffness, loads.dead.ravel())).reshape(-1, 3)


def solved(stiffness: csr_array, load: Floats, tolerance: float = TOLERANCE) -> Floats:
    """Displacement [m] (3 n,) under nodal forces [N] (3 n,), to a relative residual of `tolerance`.

    ValueError if the support does not hold the lattice.
    """
    # Factors of a 3-D lattice have large fill-in: gigabytes at 20 000 nodes. The matrix is well
    # conditioned except for a stiff support, for which Jacobi preconditioning suffices.
    preconditioner, most = diags_array(1.0 / stiffness.diagonal()), 7 * len(load)
    found, failed = cg(stiffness, load, rtol=tolerance, maxiter=most, M=preconditioner)
    if failed:
        raise ValueError("the lattice has no static equilibrium: the support does not hold it")
    return np.asarray(found)


def stiffness_at_rest(assembly: Assembly, material: Material) -> csr_array:
    """Stiffness [N/m] (3 n, 3 n) of springs, volume term and support at rest.

    Constrained unknowns are decoupled and keep their diagonal stiffness. Hanging nodes are
    decoupled with zero displacement; `extended` interpolates them.
    """
    count = len(assembly.mass)
    springs = stiffness_matrix(assembly.springs, count, initial_stiffness(material.law))
    whole = csr_array(springs + kron(assembly.foundation, eye_array(3)))
    if material.volume is not None:
        whole = csr_array(whole + volumes.stiffness_matrix(material.volume, count))
    if assembly.masters is not None:
        spread = kron(assembly.masters, eye_array(3))
        alone = np.repeat(hanging_nodes(assembly.masters), 3)
        own = diags_array(alone * whole.diagonal().mean())
        whole = csr_array(spread.T @ whole @ spread + own)
    return whole if assembly.fixed is None else _decoupled(whole, assembly.fixed.ravel())


def extended(assembly: Assembly, motion: Floats) -> Floats:
    """A displacement (3 n, ...) with its values at hanging nodes interpolated from the masters."""
    if assembly.masters is None:
        return motion
    return np.asarray(kron(assembly.masters, eye_array(3), format="csr") @ motion)


def _decoupled(matrix: csr_array, fixed: NDArray[np.bool_]) -> csr_array:
    """The matrix without entries that couple constrained unknowns (3 n,) to others."""
    found = matrix.tocoo()
    kept = ~(fixed[found.row] | fixed[found.col]) | (found.row == found.col)
    entries = (found.data[kept], (found.row[kept], found.col[kept]))
    return csr_array(coo_array(entries, shape=found.shape))
