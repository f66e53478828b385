"""The lattice at rest with nodes that are moved, and the forces that hold them there.

Newton's method along a path of growing prescribed displacement and load. The volume term's
pressures are unknowns of their own until balance: nearly incompressible cells then converge as
springs do. They are eliminated cell by cell, so that the matrix stays that of the nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, eye_array, kron
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from msm.forces import internal_forces
from msm.laws import Law, initial_stiffness
from msm.network import Network
from msm.tangent import SIGNS, Tangent, empty_tangent, linearise
from study.continuation import Increments, follow

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Booleans = NDArray[np.bool_]

TOLERANCE = 1e-9
"""Of the unbalanced forces relative to the load and the forces that hold."""
MOST_ITERATIONS = 20
INCREMENTS = Increments(easy=6, smallest=1 / 64)
SHORTEST_STEP = 1 / 64
GROWTH = 2.0
"""By how much unbalanced forces may grow in a step that moves no node that is held."""

# Signs of the permutations of three axes.
_PERMUTED = np.zeros((3, 3, 3))
_PERMUTED[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_PERMUTED[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0


@dataclass(frozen=True)
class DrivenRest:
    """A stable rest at `factor` times what is asked for.

    `displacement` [m] and `reaction` [N] (n, 3), the latter of nodes that are held, else zero;
    `residuals`: unbalanced force relative to load and reaction, before each iteration of the last
    increment and after the last.
    """

    factor: float
    displacement: Floats
    reaction: Floats
    residuals: tuple[float, ...]


@dataclass(frozen=True)
class DrivenLattice:
    """Rests at the factors asked for, as far as they were reached.

    `reached`: factor of the last rest found; `failure` says why it ends there, empty if not.
    """

    rests: tuple[DrivenRest, ...]
    reached: float
    failure: str


class _Rest(NamedTuple):
    """Where Newton's method ended: u [m] (n, 3), pressures [J] of the cells; stable if no failure.

    A pressure times the derivative of J by a displacement is a force.
    """

    factor: float
    u: Floats
    pressure: Floats
    residuals: tuple[float, ...]
    failure: str = ""


def move_driven(
    law: Law, net: Network, prescribed: Floats, factors: Sequence[float] = (1.0,)
) -> DrivenLattice:
    """Rests under growing multiples of the load and of `prescribed` [m] (n, 3), nan where free.

    ValueError for a factor of zero, or prescribed values that do not fit the nodes.
    """
    if not (np.isfinite(factors).all() and np.all(factors)):
        raise ValueError(f"factors: {tuple(factors)} must be finite and not zero")
    if prescribed.shape != net.load.shape:
        raise ValueError(f"prescribed: {prescribed.shape} does not fit {net.load.shape} nodes")
    lattice = _Lattice(law, net, prescribed)
    start = _Rest(0.0, np.zeros_like(net.load), np.zeros(len(net.cells)), ())
    found = follow(start, factors, partial(_rest, lattice), INCREMENTS)
    return DrivenLattice(tuple(map(lattice.told, found.rests)), found.reached, found.failure)


def lowest_frequency(
    law: Law, net: Network, prescribed: Floats, displacement: Floats | None = None
) -> float:
    """Of undamped free motion of small amplitude [Hz] about a displacement [m] (n, 3), or none.

    What is prescribed is held still. ValueError if nothing holds the lattice.
    """
    lattice = _Lattice(law, net, prescribed)
    u = np.zeros_like(net.load) if displacement is None else displacement
    at = lattice.linearised(u)
    stiffness = lattice.matrix(at, net.bulk * at.swelling)[lattice.free][:, lattice.free]
    factors = _factorised(stiffness)
    if factors is None:
        raise ValueError("the stiffness is singular: nothing holds the lattice")
    mass = diags_array(np.repeat(net.mass, 3)[lattice.free]).tocsc()
    inverse = LinearOperator(mass.shape, factors.solve, dtype=np.float64)
    start = np.ones(mass.shape[0])
    (found,) = eigsh(stiffness, 1, mass, 0.0, OPinv=inverse, return_eigenvectors=False, v0=start)
    return float(np.sqrt(found) / (2.0 * np.pi))


def _rest(lattice: _Lattice, start: _Rest, factor: float) -> _Rest:
    """Newton's method at one factor. The first step brings the nodes that are held along."""
    u, pressure, free = start.u.copy(), start.pressure.copy(), lattice.free
    held, residuals = np.flatnonzero(~free), list[float]()
    goal, failure = factor * lattice.prescribed.ravel()[held], "no balance of forces"
    while len(residuals) <= MOST_ITERATIONS:
        at = lattice.linearised(u)
        lacking, missed = lattice.unbalanced(at, u, pressure, factor)
        residuals.append(lattice.size(lacking, missed) / lattice.scale(lacking, factor))
        behind = np.zeros(u.size)
        behind[held] = goal - u.ravel()[held]
        matrix = lattice.matrix(at, pressure)
        factors = _factorised(matrix[free][:, free])
        if residuals[-1] <= TOLERANCE and not behind.any():
            failure = "" if _is_definite(factors) else "the lattice gives way"
            break
        if factors is None:
            failure = "no way towards balance"
            break
        # What the pressures miss acts as a force until they are eliminated.
        forces = lacking - lattice.on_nodes(at, lattice.net.bulk * missed)
        behind[free] = factors.solve((forces - matrix @ behind)[free])
        step = behind.reshape(u.shape)
        turned = lattice.net.bulk * (missed + lattice.swelling(at, step))
        size, moving = lattice.size(lacking, missed), bool(behind[held].any())
        length = _length(lattice, (u, pressure), (step, turned), factor, size, moving=moving)
        if length == 0.0:
            failure = "no way towards balance"
            break
        u, pressure = u + length * step, pressure + length * turned
        if length == 1.0:  # rounding must not leave a node short of its place
            u.ravel()[held] = goal
    return _Rest(factor, u, pressure, tuple(residuals), failure)


def _length(
    lattice: _Lattice,
    place: tuple[Floats, Floats],
    step: tuple[Floats, Floats],
    factor: float,
    size: float,
    *,
    moving: bool,
) -> float:
    """Largest of 1, 1/2, 1/4, ... of a step in u and pressure that can be taken; 0 if none."""
    length = 1.0
    while length >= SHORTEST_STEP:
        u, pressure = (x + length * dx for x, dx in zip(place, step, strict=True))
        at = lattice.linearised(u)
        if len(at.swelling) == 0 or at.swelling.min() > -1.0:
            left = lattice.size(*lattice.unbalanced(at, u, pressure, factor))
            if np.isfinite(left) and (moving or left <= GROWTH * size):
                return length
        length *= 0.5
    return 0.0


class _Lattice:
    """Forces and stiffness of a network whose cells have pressures of their own."""

    def __init__(self, law: Law, net: Network, prescribed: Floats) -> None:
        self.law, self.net, self.prescribed = law, net, prescribed
        self.free = np.isnan(prescribed.ravel())
        self.alone = net._replace(cells=net.cells[:0], bulk=net.bulk[:0])
        self.slopes = SIGNS / (4.0 * net.spacing)  # B_a, (8, 3)
        self.unit = initial_stiffness(law) * net.spacing
        count = len(net.load)
        foundation = csr_array((net.value, net.column, net.row), shape=(count, count))
        self.foundation = csc_array(kron(foundation, eye_array(3)))
        corners = np.asarray(net.cells, dtype=np.int64)
        self.places = (3 * corners[:, :, None] + np.arange(3)).reshape(len(corners), 24)

    def linearised(self, u: Floats) -> Tangent:
        """Springs and cells at a displacement."""
        at = empty_tangent(self.net)
        linearise(self.law, self.net, u, at)
        return at

    def by_corner(self, at: Tangent) -> Floats:
        """Derivatives [1/m] of J by the displacements of a cell's corners, (c, 24)."""
        return np.asarray(np.einsum("cij,aj->cai", at.cofactor, self.slopes).reshape(-1, 24))

    def swelling(self, at: Tangent, step: Floats) -> Floats:
        """What a step [m] (n, 3) adds to J, to first order, (c,)."""
        return np.asarray((self.by_corner(at) * step.ravel()[self.places]).sum(axis=1))

    def on_nodes(self, at: Tangent, pressure: Floats) -> Floats:
        """Gradient [N] (3 n,) of the work of pressures [J] (c,)."""
        shares = self.by_corner(at) * pressure[:, None]
        size = self.net.load.size
        found = np.bincount(self.places.ravel(), shares.ravel(), minlength=size)
        return np.asarray(found, dtype=np.float64)

    def unbalanced(
        self, at: Tangent, u: Floats, pressure: Floats, factor: float
    ) -> tuple[Floats, Floats]:
        """Forces [N] (3 n,) that nothing balances, and J - 1 (c,) without its pressure."""
        force = np.empty_like(u)
        internal_forces(self.law, self.alone, u, force)
        force += factor * self.net.load
        missed = at.swelling - pressure / self.net.bulk
        return force.ravel() - self.on_nodes(at, pressure), missed

    def size(self, lacking: Floats, missed: Floats) -> float:
        """Size [N] of what is unbalanced among the free."""
        return float(np.hypot(np.linalg.norm(lacking[self.free]), self.unit * _norm(missed)))

    def scale(self, lacking: Floats, factor: float) -> float:
        """Size [N] of the load and of the forces that hold."""
        return max(abs(factor) * _norm(self.net.load), _norm(lacking[~self.free]), 1e-300)

    def matrix(self, at: Tangent, pressure: Floats) -> csc_array:
        """Stiffness [N/m] (3 n, 3 n) at a state whose pressures are eliminated."""
        size = self.net.load.size
        along = (at.along - at.across)[:, None, None]
        block = along * at.direction[:, :, None] * at.direction[:, None, :]
        block += at.across[:, None, None] * np.eye(3)
        pair = np.concatenate([np.concatenate([block, -block], 2)] * 2, 1)
        pair[:, 3:] *= -1.0
        ends = np.asarray(self.net.ends, dtype=np.int64)
        places = (3 * ends[:, :, None] + np.arange(3)).reshape(-1, 6)
        return _summed(pair, places, size) + self._of_cells(at, pressure) + self.foundation

    def _of_cells(self, at: Tangent, pressure: Floats) -> csc_array:
        """Kappa V dJ dJ, and the second derivative of J times the pressure."""
        slope = self.by_corner(at)
        block = self.net.bulk[:, None, None] * slope[:, :, None] * slope[:, None, :]
        across = np.cross(self.slopes[:, None], self.slopes[None])  # B_a x B_b, (8, 8, 3)
        rows = np.einsum("abj,cmj->cabm", across, at.deformation) * pressure[:, None, None, None]
        turned = np.einsum("ikm,cabm->caibk", _PERMUTED, rows)
        return _summed(block + turned.reshape(block.shape), self.places, self.net.load.size)

    def told(self, at: _Rest) -> DrivenRest:
        """What a rest is handed out as."""
        lacking, _ = self.unbalanced(self.linearised(at.u), at.u, at.pressure, at.factor)
        reaction = np.where(self.free, 0.0, -lacking).reshape(at.u.shape)
        return DrivenRest(at.factor, at.u, reaction, at.residuals)


def _summed(blocks: Floats, places: Ints, size: int) -> csc_array:
    """Matrix of blocks (k, m, m) at places (k, m)."""
    count = places.shape[1]
    entries = (np.repeat(places, count, axis=1).ravel(), np.tile(places, count).ravel())
    return csc_array(coo_array((blocks.ravel(), entries), shape=(size, size)))


def _norm(x: Floats) -> float:
    return float(np.linalg.norm(x))


def _factorised(matrix: csc_array) -> Any:
    """Sparse factors by symmetric elimination; None if the matrix is singular."""
    try:
        return splu(
            csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None


def _is_definite(factors: Any) -> bool:
    """Whether all pivots lie on the diagonal and are positive."""
    if factors is None or not (factors.perm_r == factors.perm_c).all():
        return False
    return bool((factors.U.diagonal() > 0.0).all())
