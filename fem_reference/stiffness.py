"""Stiffness of a body, in displacements alone or with an independent pressure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, bsr_array, csc_array

from fem_reference.blocks import Blocks, blocks_of
from fem_reference.direct import Solve, factorised

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pressure:
    """The pressure p = lambda div u of mixed elements in its shape functions.

    `divergence` [m^2] (pressures, n): integrals of the shape functions with div u; `mass` [m^3]
    (pressures, pressures): of their products; `lame`, `shear`: lambda and mu [Pa]. In heterogeneous
    tissue, `lame` and `shear` are those of the surrounding tissue, the integrand of `mass` has the
    factor `lame` / lambda, and that of `varied_schur` [m^3/Pa] 1 / lambda + 1 / mu.
    """

    divergence: csc_array
    mass: csc_array
    lame: float
    shear: float
    varied_schur: csc_array | None = None

    @property
    def schur(self) -> csc_array:
        """Approximate Schur complement [m^3/Pa]: (1 / lambda + 1 / mu) times the pressure mass.

        It is spectrally equivalent to the Schur complement at any Poisson ratio.
        """
        if self.varied_schur is not None:
            return self.varied_schur
        return csc_array((1.0 / self.shear + 1.0 / self.lame) * self.mass)

    def of(self, u: Floats) -> Floats:
        """Nodal pressures [Pa]."""
        return self.lame * self._solve_mass(self.divergence @ u)

    @cached_property
    def _solve_mass(self) -> Solve:
        return factorised(self.mass)


@dataclass(frozen=True)
class Stiffness:
    """K = matrix + lambda B^T M^-1 B, with divergence B and mass M of the pressure, if any.

    `matrix` [N/m] (n, n), symmetric, in blocks of 3 x 3; with a pressure, only the contributions of
    the shear modulus and of the support.
    """

    matrix: Any
    pressure: Pressure | None = None

    @property
    def size(self) -> int:
        """Number of displacements."""
        return int(self.matrix.shape[0])

    @property
    def unknowns(self) -> int:
        """Number of displacements and pressures."""
        return self.size + (0 if self.pressure is None else self.pressure.mass.shape[0])

    @cached_property
    def blocks(self) -> Blocks:
        """The matrix in blocks of nodes, with the fastest products."""
        return blocks_of(self.matrix.tobsr(blocksize=(3, 3)))

    def __matmul__(self, u: Floats) -> Floats:
        of_one = u.ndim == 1 and isinstance(self.matrix, bsr_array)
        found: Floats = (self.blocks if of_one else self.matrix) @ u
        if self.pressure is None:
            return found
        return np.asarray(found + self.pressure.divergence.T @ self.pressure.of(u))

    def system(self, mass: csc_array | None = None, share: float = 1.0) -> csc_array:
        """Symmetric matrix whose solution has the u of (mass + share K) u = f in its first rows.

        Beside a pressure its last rows are those of the pressure over -share.
        """
        own = share * csc_array(self.matrix)
        block = own if mass is None else mass + own
        if self.pressure is None:
            return csc_array(block)
        B, C = share * self.pressure.divergence, (share / self.pressure.lame) * self.pressure.mass
        return csc_array(block_array([[block, B.T], [B, -C]], format="csc"))
