"""Inverse elastostatics: the stress-free shape of a body with a given shape under a known load.

Equilibrium is posed in the given shape for the displacement m [m] of its points to the stress-free
shape (Govindjee and Mihalic 1996, Comput. Methods Appl. Mech. Eng. 136:47). With f = 1 + dm/dx,
F = f^-1 and J = det F

    int det f tau : grad v dx - support m = load,   tau = mu F F^T + (p - mu + kappa ln J) 1
    int (ln J - p / lambda) q det f dx = 0

are the equations of `fem_reference.mixed_strain` at the equilibrium in the given shape. No forward
problem has to be solved, unlike in fixed-point iteration on shapes (Sellier 2011), which diverges
where a body sags much. The load grows in increments, each solved by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.laws import IDENTITY
from fem_reference.mixed_strain import MixedSolid, kinematics
from study.numerics.continuation import NO_EQUILIBRIUM, NO_STEP, Increments, follow
from study.numerics.factors import symmetric_factors

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

TOLERANCE = 1e-9
"""Norm of the residual relative to that of the load."""
MOST_ITERATIONS = 12
"""Iterations that leave more than FAST of the residual; faster ones are not counted."""
FAST = 0.1
SHORTEST_STEP = 1 / 64
INCREMENTS = Increments(easy=5, smallest=1 / 64)
DECREASE = 1e-4
"""Required decrease of the residual, relative to that of the linear model (Armijo)."""


class Unloading(NamedTuple):
    """Displacement `back` [m] (n,) of the nodes to the stress-free shape, then pressures [Pa].

    `reached`: factor of the load up to which a shape was found; 1 for the whole load.
    """

    back: Floats
    reached: float


class _Iterate(NamedTuple):
    """Unknowns z at a factor of the load, and the relative residual before each iteration."""

    z: Floats
    residuals: tuple[float, ...] = (0.0,)
    failure: str = ""
    factor: float = 0.0


@dataclass(frozen=True, eq=False)
class _PointValues:
    """Values at the integration points (t, q, ...).

    `inverse`: F = f^-1; `volume`: det f; `left`: F F^T; `stress`: tau [Pa]; `log_volume`: ln J.
    """

    inverse: Floats
    volume: Floats
    left: Floats
    stress: Floats
    log_volume: Floats


def unload(given: MixedSolid, load: Floats, free: Bools) -> Unloading:
    """The stress-free shape of a body whose `given` shape is in equilibrium under a load [N] (n,).

    `free` (n + pressures,): unknowns that are not constrained. The result is that of the whole
    load; where none is found, its `back` is 0.
    """

    def solve(start: _Iterate, factor: float) -> _Iterate:
        return _newton(given, factor * load, free, start.z)._replace(factor=factor)

    undeformed = np.zeros(len(free))
    found = follow(_Iterate(undeformed), (1.0,), solve, lambda at, _: at.z, INCREMENTS)
    return Unloading(found.states[-1] if found.converged else undeformed, found.reached)


def _newton(given: MixedSolid, load: Floats, free: Bools, start: Floats) -> _Iterate:
    """Newton's method with line search for the unknowns in equilibrium with a load."""
    n = given.size
    scale = np.where(np.arange(len(free)) < n, 1.0, given.typical_shear / given.length)
    load_norm = max(float(np.linalg.norm(load)), float(np.finfo(np.float64).tiny))
    z, at, residuals = start, _point_values(given, start), list[float]()
    residual = _residual(given, load, free, z, at)
    slow = 0
    while slow < MOST_ITERATIONS:
        residuals.append(float(np.linalg.norm(scale * residual)) / load_norm)
        if residuals[-1] <= TOLERANCE:
            return _Iterate(z, tuple(residuals))
        factors = symmetric_factors(_tangent(given, z, at, free))
        if factors is None:
            return _Iterate(z, tuple(residuals), "the tangent is singular")
        step = np.zeros_like(z)
        step[free] = factors.solve(residual[free])
        length = 1.0
        while length >= SHORTEST_STEP:
            trial = z + length * step
            if np.isfinite(trial).all() and given.volume_ratio(trial).min() > 0.0:
                trial_values = _point_values(given, trial)
                trial_residual = _residual(given, load, free, trial, trial_values)
                norm = float(np.linalg.norm(scale * trial_residual)) / load_norm
                if norm <= (1.0 - DECREASE * length) * residuals[-1]:
                    break
            length *= 0.5
        else:
            return _Iterate(z, tuple(residuals), NO_STEP)
        slow += norm > FAST * residuals[-1]
        z, at, residual = trial, trial_values, trial_residual
    return _Iterate(z, tuple(residuals), NO_EQUILIBRIUM)


def _point_values(given: MixedSolid, z: Floats) -> _PointValues:
    change = kinematics(given.deformation(z))
    inverse = np.swapaxes(change.inverse_transpose, -2, -1)
    left = inverse @ change.inverse_transpose
    log_volume = -np.log(change.volume)
    pressure = z[given.corners] @ given.shares.T - given.shear + given.pointwise * log_volume
    stress = np.asarray(given.shear)[..., None, None] * left + pressure[..., None, None] * IDENTITY
    return _PointValues(inverse, change.volume, left, stress, log_volume)


def _residual(given: MixedSolid, load: Floats, free: Bools, z: Floats, at: _PointValues) -> Floats:
    """Residual forces [N], then residual volumes [m^3]."""
    n, weights = given.size, given.weights * at.volume
    nodal = np.einsum("tqij,tqja->tai", at.stress * weights[..., None, None], given.slopes)
    pressure = z[given.corners] @ given.shares.T
    volumes = ((at.log_volume - pressure / given.carried) * weights) @ given.shares
    count = len(z)
    internal = np.asarray(
        np.bincount(given.unknowns.ravel(), nodal.ravel(), minlength=count)
        + np.bincount(given.corners.ravel(), volumes.ravel(), minlength=count),
        dtype=np.float64,
    )
    internal[:n] -= given.support @ z[:n]
    residual = -internal
    residual[:n] += load
    residual[~free] = 0.0
    return np.asarray(residual)


def _tangent(given: MixedSolid, z: Floats, at: _PointValues, free: Bools) -> csc_array:
    """Derivative of internal forces and volumes by the unknowns; not symmetric.

    With h = d(dm)/dx: d det f = det f tr(F h), d ln J = -tr(F h) and
    d tau = -mu (F h b + (F h b)^T) - kappa tr(F h) 1, b = F F^T.
    """
    weights = given.weights * at.volume
    F, b = at.inverse, at.left
    kept = at.stress - np.asarray(given.pointwise)[..., None, None] * IDENTITY
    geometric = np.einsum("tqik,tqlj->tqijkl", F, b) + np.einsum("tqjk,tqli->tqijkl", F, b)
    sheared = np.asarray(given.shear)[..., None, None, None, None] * geometric
    moduli = np.einsum("tqij,tqlk->tqijkl", kept, F) - sheared
    moduli = moduli * weights[..., None, None, None, None]
    cells, points, _, nodes = given.slopes.shape
    count = 3 * nodes
    half = np.einsum("tqijkl,tqlb->tqjikb", moduli, given.slopes, optimize=True)
    block = given.slopes.reshape(cells, points * 3, nodes).mT @ half.reshape(cells, points * 3, -1)
    block = block.reshape(cells, nodes, 3, 3, nodes).swapaxes(-2, -1)  # (a, i, b, k)
    trace = np.einsum("tqlk,tqlb->tqbk", F, given.slopes).reshape(cells, points, count)
    spread = given.slopes.swapaxes(-2, -1).reshape(cells, points, count)
    shares = given.shares * weights[..., None]
    pressure = z[given.corners] @ given.shares.T
    volume_rate = at.log_volume - pressure / given.carried - 1.0
    whole = np.empty((cells, count + 4, count + 4))
    whole[:, :count, :count] = block.reshape(cells, count, count)
    whole[:, :count, count:] = spread.mT @ shares
    whole[:, count:, :count] = (shares * volume_rate[..., None]).mT @ trace
    whole[:, count:, count:] = -np.einsum(
        "tq,qa,qb->tab", weights / given.carried, given.shares, given.shares
    )
    found = given.assembled(whole) - given.padded_support
    return csc_array(found[free][:, free])
