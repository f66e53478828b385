"""Stiffness of a body, with or without a pressure of its own."""

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
    """The pressure p = lambda div u of mixed elements, by its own shape functions.

    `divergence` [m^2] (pressures, n) and `mass` [m^3] (pressures, pressures) integrate them with
    div u and with each other; `lame` is lambda [Pa], `shear` the shear modulus [Pa]. Of tissue that
    differs from place to place these are those of the tissue around; `mass` integrates with
    `lame` over lambda, and `varied_schur`
    [m^3/Pa] with 1 / lambda + 1 / mu.
    """

    divergence: csc_array
    mass: csc_array
    lame: float
    shear: float
    varied_schur: csc_array | None = None

    @property
    def schur(self) -> csc_array:
        """Integrals of products of pressures over lambda and over the shear modulus, summed.

        The complement of the displacements is equivalent to it at any Poisson ratio.
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
    """K = matrix + lambda B^T M^-1 B, the second term by the divergence and mass of a pressure.

    `matrix` [N/m] (n, n), symmetric; where there is a pressure, only what the shear modulus and the
    support do. It is kept by blocks of 3 x 3, with a quarter of the indices.
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
        """The matrix by blocks of nodes, whose products are the quickest."""
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
