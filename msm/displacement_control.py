"""Static equilibrium of a lattice under displacement control, with the reactions.

Newton's method along a path of growing prescribed displacement and load. During the iterations the
pressures of the volume term are independent unknowns, so that nearly incompressible cells converge
as springs do. They are condensed cell by cell, which leaves a matrix of the nodes alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, eye_array, kron
from scipy.sparse.linalg import LinearOperator, eigsh

from msm.forces import internal_forces
from msm.laws import Law, initial_stiffness
from msm.network import Network
from msm.tangent import SIGNS, Tangent, empty_tangent, linearise
from study.numerics.continuation import (
    NO_EQUILIBRIUM,
    NO_STEP,
    UNSTABLE,
    EquilibriumPath,
    Increments,
    follow,
    slow_iterations,
)
from study.numerics.factors import has_inertia, symmetric_factors

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Booleans = NDArray[np.bool_]

TOLERANCE = 1e-9
"""Norm of the residual relative to that of the load and the reactions."""
MOST_ITERATIONS = 20
"""Limit on iterations that leave more than a tenth of the residual."""
INCREMENTS = Increments(easy=6, smallest=1 / 64)
SHORTEST_STEP = 1 / 64
GROWTH = 2.0
"""Largest growth of the residual in a step in which no prescribed displacement changes."""

# Levi-Civita symbol.
_PERMUTATION = np.zeros((3, 3, 3))
_PERMUTATION[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_PERMUTATION[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0


@dataclass(frozen=True)
class EquilibriumState:
    """A stable equilibrium at `factor` times the prescribed displacement and load.

    `displacement` [m] and `reaction` [N] (n, 3), the latter zero at free components; `residuals`:
    norm of the residual relative to load and reaction, before each iteration of the last increment
    and after the last.
    """

    factor: float
    displacement: Floats
    reaction: Floats
    residuals: tuple[float, ...]


class _Iterate(NamedTuple):
    """Last iterate of Newton's method: u [m] (n, 3), pressures [J] (c,); stable if no failure.

    A pressure [J] times the derivative [1/m] of J by a displacement is a force.
    """

    factor: float
    u: Floats
    pressure: Floats
    residuals: tuple[float, ...]
    failure: str = ""


class _Residual(NamedTuple):
    """Nodal forces [N] (3 n,) out of balance, and the volume equations J - 1 - p / kappa V (c,)."""

    force: Floats
    volume: Floats


def equilibrium_path(
    law: Law, net: Network, prescribed: Floats, load_factors: Sequence[float] = (1.0,)
) -> EquilibriumPath[EquilibriumState]:
    """Equilibria at `load_factors` times the load and `prescribed` [m] (n, 3), NaN where free.

    ValueError for a factor of zero, or prescribed values that do not fit the nodes.
    """
    if prescribed.shape != net.load.shape:
        raise ValueError(f"prescribed: {prescribed.shape} does not fit {net.load.shape} nodes")
    lattice = _MixedLattice(law, net, prescribed)
    start = _Iterate(0.0, np.zeros_like(net.load), np.zeros(len(net.cells)), ())
    search = partial(_newton, lattice)
    return follow(start, load_factors, search, lambda at, _: lattice.state(at), INCREMENTS)


def lowest_frequency(
    law: Law, net: Network, prescribed: Floats, displacement: Floats | None = None
) -> float:
    """Lowest natural frequency [Hz], undamped, about a displacement [m] (n, 3), or about rest.

    Components with a prescribed displacement are fixed. ValueError if the stiffness is singular.
    """
    lattice = _MixedLattice(law, net, prescribed)
    u = np.zeros_like(net.load) if displacement is None else displacement
    tangent = lattice.linearised(u)
    free = lattice.free
    stiffness = lattice.matrix(tangent, net.bulk * tangent.swelling)[free][:, free]
    factors = symmetric_factors(stiffness)
    if factors is None:
        raise ValueError("the stiffness is singular: nothing holds the lattice")
    mass = diags_array(np.repeat(net.mass, 3)[free]).tocsc()
    inverse = LinearOperator(mass.shape, factors.solve, dtype=np.float64)
    start = np.ones(mass.shape[0])
    (found,) = eigsh(stiffness, 1, mass, 0.0, OPinv=inverse, return_eigenvectors=False, v0=start)
    return float(np.sqrt(found) / (2.0 * np.pi))


def _newton(lattice: _MixedLattice, start: _Iterate, factor: float) -> _Iterate:
    """Newton's method at one factor; its first step takes up the prescribed displacements."""
    u, pressure, free = start.u.copy(), start.pressure.copy(), lattice.free
    constrained, residuals = np.flatnonzero(~free), list[float]()
    target, failure = factor * lattice.prescribed.ravel()[constrained], NO_EQUILIBRIUM
    while slow_iterations(residuals) < MOST_ITERATIONS:
        tangent = lattice.linearised(u)
        residual = lattice.residual(tangent, u, pressure, factor)
        residuals.append(lattice.norm(residual) / lattice.scale(residual, factor))
        increment = np.zeros(u.size)
        increment[constrained] = target - u.ravel()[constrained]
        matrix = lattice.matrix(tangent, pressure)
        factors = symmetric_factors(matrix[free][:, free])
        if residuals[-1] <= TOLERANCE and not increment.any():
            # An indefinite tangent during the iterations does no harm; at equilibrium it is a
            # loss of stability.
            failure = "" if has_inertia(factors) else UNSTABLE
            break
        if factors is None:
            failure = NO_STEP
            break
        prescribing = bool(increment[constrained].any())
        step = lattice.newton_step(tangent, residual, matrix, factors, increment)
        length = _step_length(lattice, (u, pressure), step, factor, residual, prescribing)
        if length == 0.0:
            failure = NO_STEP
            break
        u, pressure = u + length * step[0], pressure + length * step[1]
        if length == 1.0:  # removes the rounding of the sum
            u.ravel()[constrained] = target
    return _Iterate(factor, u, pressure, tuple(residuals), failure)


def _step_length(
    lattice: _MixedLattice,
    start: tuple[Floats, Floats],
    step: tuple[Floats, Floats],
    factor: float,
    residual: _Residual,
    prescribing: bool,
) -> float:
    """Largest admissible fraction 1, 1/2, 1/4, ... of a step in u and pressure; 0 without one.

    No cell may invert, and the residual may grow by GROWTH at most, except in a step that changes
    prescribed displacements (`prescribing`).
    """
    limit = np.inf if prescribing else GROWTH * lattice.norm(residual)
    length = 1.0
    while length >= SHORTEST_STEP:
        u, pressure = (x + length * dx for x, dx in zip(start, step, strict=True))
        tangent = lattice.linearised(u)
        if len(tangent.swelling) == 0 or tangent.swelling.min() > -1.0:
            norm = lattice.norm(lattice.residual(tangent, u, pressure, factor))
            if np.isfinite(norm) and norm <= limit:
                return length
        length *= 0.5
    return 0.0


class _MixedLattice:
    """Residual and tangent of a network whose cells have independent pressures."""

    def __init__(self, law: Law, net: Network, prescribed: Floats) -> None:
        self.law, self.net, self.prescribed = law, net, prescribed
        self.free = np.isnan(prescribed.ravel())
        self.without_cells = net._replace(cells=net.cells[:0], bulk=net.bulk[:0])
        self.gradients = SIGNS / (4.0 * net.spacing)  # B_a, (8, 3)
        self.unit_force = initial_stiffness(law) * net.spacing
        count = len(net.load)
        foundation = csr_array((net.value, net.column, net.row), shape=(count, count))
        self.foundation = csc_array(kron(foundation, eye_array(3)))
        corners = np.asarray(net.cells, dtype=np.int64)
        self.cell_dofs = (3 * corners[:, :, None] + np.arange(3)).reshape(len(corners), 24)

    def linearised(self, u: Floats) -> Tangent:
        """Tangents of springs and cells at a displacement."""
        tangent = empty_tangent(self.net)
        linearise(self.law, self.net, u, tangent)
        return tangent

    def volume_gradient(self, tangent: Tangent) -> Floats:
        """Derivatives [1/m] of J by the displacements of the corners of each cell, (c, 24)."""
        found = np.einsum("cij,aj->cai", tangent.cofactor, self.gradients)
        return np.asarray(found.reshape(-1, 24))

    def pressure_forces(self, tangent: Tangent, pressure: Floats) -> Floats:
        """Gradient [N] (3 n,) of the work of pressures [J] (c,)."""
        by_cell = self.volume_gradient(tangent) * pressure[:, None]
        size = self.net.load.size
        found = np.bincount(self.cell_dofs.ravel(), by_cell.ravel(), minlength=size)
        return np.asarray(found, dtype=np.float64)

    def residual(self, tangent: Tangent, u: Floats, pressure: Floats, factor: float) -> _Residual:
        """Residual of equilibrium and of the volume equations."""
        force = np.empty_like(u)
        internal_forces(self.law, self.without_cells, u, force)
        force += factor * self.net.load
        volume = tangent.swelling - pressure / self.net.bulk
        return _Residual(force.ravel() - self.pressure_forces(tangent, pressure), volume)

    def norm(self, residual: _Residual) -> float:
        """Norm [N] of the residual at free components and of the volume equations."""
        force = np.linalg.norm(residual.force[self.free])
        return float(np.hypot(force, self.unit_force * _norm(residual.volume)))

    def scale(self, residual: _Residual, factor: float) -> float:
        """The larger of the norms [N] of load and reactions."""
        return max(abs(factor) * _norm(self.net.load), _norm(residual.force[~self.free]), 1e-300)

    def newton_step(
        self,
        tangent: Tangent,
        residual: _Residual,
        matrix: csc_array,
        factors: Any,
        increment: Floats,
    ) -> tuple[Floats, Floats]:
        """Newton step in u [m] (n, 3) and pressure [J] (c,).

        `increment` [m] (3 n,): change of the prescribed displacements, zero elsewhere; `factors`:
        those of the `matrix` among the free components.
        """
        step, free = increment.copy(), self.free
        # Condensed, the residual of a volume equation acts as a pressure.
        volume_force = self.pressure_forces(tangent, self.net.bulk * residual.volume)
        forces = residual.force - volume_force
        step[free] = factors.solve((forces - matrix @ increment)[free])
        change = (self.volume_gradient(tangent) * step[self.cell_dofs]).sum(axis=1)
        return step.reshape(-1, 3), self.net.bulk * (residual.volume + change)

    def matrix(self, tangent: Tangent, pressure: Floats) -> csc_array:
        """Tangent stiffness [N/m] (3 n, 3 n) with the pressures condensed."""
        size = self.net.load.size
        axial = (tangent.along - tangent.across)[:, None, None]
        block = axial * tangent.direction[:, :, None] * tangent.direction[:, None, :]
        block += tangent.across[:, None, None] * np.eye(3)
        pair = np.concatenate([np.concatenate([block, -block], 2)] * 2, 1)
        pair[:, 3:] *= -1.0
        ends = np.asarray(self.net.ends, dtype=np.int64)
        dofs = (3 * ends[:, :, None] + np.arange(3)).reshape(-1, 6)
        cells = self._cell_matrix(tangent, pressure)
        return _assembled(pair, dofs, size) + cells + self.foundation

    def _cell_matrix(self, tangent: Tangent, pressure: Floats) -> csc_array:
        """Kappa V dJ dJ^T plus the pressure times the second derivative of J."""
        slope = self.volume_gradient(tangent)
        block = self.net.bulk[:, None, None] * slope[:, :, None] * slope[:, None, :]
        products = np.cross(self.gradients[:, None], self.gradients[None])  # B_a x B_b, (8, 8, 3)
        rows = np.einsum("abj,cmj->cabm", products, tangent.deformation)
        rows *= pressure[:, None, None, None]
        geometric = np.einsum("ikm,cabm->caibk", _PERMUTATION, rows)
        return _assembled(
            block + geometric.reshape(block.shape), self.cell_dofs, self.net.load.size
        )

    def state(self, at: _Iterate) -> EquilibriumState:
        """The equilibrium of a converged iterate, with its reactions."""
        residual = self.residual(self.linearised(at.u), at.u, at.pressure, at.factor)
        reaction = np.where(self.free, 0.0, -residual.force).reshape(at.u.shape)
        return EquilibriumState(at.factor, at.u, reaction, at.residuals)


def _assembled(blocks: Floats, dofs: Ints, size: int) -> csc_array:
    """Sum of blocks (k, m, m) at the degrees of freedom (k, m)."""
    count = dofs.shape[1]
    entries = (np.repeat(dofs, count, axis=1).ravel(), np.tile(dofs, count).ravel())
    return csc_array(coo_array((blocks.ravel(), entries), shape=(size, size)))


def _norm(x: Floats) -> float:
    return float(np.linalg.norm(x))
