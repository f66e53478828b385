"""The shape without stress from which a body sags into a given one under known forces.

The balance is written where it holds, in the given shape, for the way m [m] of each of its points
to where it is without stress (Govindjee and Mihalic 1996, Comput. Methods Appl. Mech. Eng.
136:47). With f = 1 + dm/dx, F = f^-1 and J = det F

    int det f tau : grad v dx - support m = load,   tau = mu F F^T + (p - mu + kappa ln J) 1
    int (ln J - p / lambda) q det f dx = 0

are the equations of `fem_reference.mixed_strain` at the state in which the given shape is at rest:
no rest has to be found on the way, as by iteration on shapes (Sellier 2011), which where a body
sags much diverges. The load grows in steps, each by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.direct import symmetric_factors
from fem_reference.laws import IDENTITY
from fem_reference.mixed_strain import MixedSolid, kinematics
from study.continuation import Increments, follow

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

TOLERANCE = 1e-9
"""Of the unbalanced forces relative to the load."""
MOST_ITERATIONS = 12
SHORTEST_STEP = 1 / 64
BY = Increments(easy=5, smallest=1 / 16)
DECREASE = 1e-4
"""Of the unbalanced forces that a step promises, what it must hold."""


class Unloading(NamedTuple):
    """Way `back` [m] of the nodes (n,) to the shape without stress, then pressures [Pa].

    `reached`: share of the load for which one was found; 1 if all is well.
    """

    back: Floats
    reached: float


class _Rest(NamedTuple):
    """Unknowns z for a share of the load, and what was unbalanced before each iteration."""

    z: Floats
    residuals: tuple[float, ...] = (0.0,)
    failure: str = ""
    factor: float = 0.0


@dataclass(frozen=True, eq=False)
class _Point:
    """What stands at the integration points: tau [Pa] (t, q, 3, 3), f's inverse and determinant."""

    inverse: Floats
    volume: Floats
    left: Floats
    stress: Floats
    log_volume: Floats


def unload(given: MixedSolid, load: Floats, free: Bools) -> Unloading:
    """The shape without stress of a body that is at rest as `given` under a load [N] (n,).

    `free` (n + pressures,): unknowns that are not fixed. `back` is that of the whole load, or 0
    where it is not found.
    """

    def rest(start: _Rest, share: float) -> _Rest:
        return _newton(given, share * load, free, start.z)._replace(factor=share)

    found = follow(_Rest(np.zeros(len(free))), (1.0,), rest, BY)
    back = found.rests[-1].z if found.rests else np.zeros(len(free))
    return Unloading(back, found.reached)


def _newton(given: MixedSolid, load: Floats, free: Bools, start: Floats) -> _Rest:
    """Unknowns that balance a load, or why there are none."""
    n = given.size
    scale = np.where(np.arange(len(free)) < n, 1.0, given.typical_shear / given.length)
    size = max(float(np.linalg.norm(load)), float(np.finfo(np.float64).tiny))
    z, at, sizes = start, _point(given, start), list[float]()
    left = _off(given, load, free, z, at)
    for _ in range(MOST_ITERATIONS):
        sizes.append(float(np.linalg.norm(scale * left)) / size)
        if sizes[-1] <= TOLERANCE:
            return _Rest(z, tuple(sizes))
        factors = symmetric_factors(_tangent(given, z, at, free))
        if factors is None:
            return _Rest(z, tuple(sizes), "the tangent is singular")
        step = np.zeros_like(z)
        step[free] = factors.solve(left[free])
        length = 1.0
        while length >= SHORTEST_STEP:
            there = z + length * step
            if np.isfinite(there).all() and given.volume_ratio(there).min() > 0.0:
                point = _point(given, there)
                off = _off(given, load, free, there, point)
                missed = float(np.linalg.norm(scale * off)) / size
                if missed <= (1.0 - DECREASE * length) * sizes[-1]:
                    break
            length *= 0.5
        else:
            return _Rest(z, tuple(sizes), "no way towards balance")
        z, at, left = there, point, off
    return _Rest(z, tuple(sizes), "no balance of forces")


def _point(given: MixedSolid, z: Floats) -> _Point:
    change = kinematics(given.deformation(z))
    inverse = np.swapaxes(change.inverse_transpose, -2, -1)
    left = inverse @ change.inverse_transpose
    log_volume = -np.log(change.volume)
    push = z[given.corners] @ given.shares.T - given.shear + given.pointwise * log_volume
    stress = np.asarray(given.shear)[..., None, None] * left + push[..., None, None] * IDENTITY
    return _Point(inverse, change.volume, left, stress, log_volume)


def _off(given: MixedSolid, load: Floats, free: Bools, z: Floats, at: _Point) -> Floats:
    """What does not balance: forces [N], then volumes [m^3]."""
    n, weights = given.size, given.weights * at.volume
    nodal = np.einsum("tqij,tqja->tai", at.stress * weights[..., None, None], given.slopes)
    pressure = z[given.corners] @ given.shares.T
    missed = ((at.log_volume - pressure / given.carried) * weights) @ given.shares
    count = len(z)
    own = np.asarray(
        np.bincount(given.unknowns.ravel(), nodal.ravel(), minlength=count)
        + np.bincount(given.corners.ravel(), missed.ravel(), minlength=count),
        dtype=np.float64,
    )
    own[:n] -= given.support @ z[:n]
    left = -own
    left[:n] += load
    left[~free] = 0.0
    return np.asarray(left)


def _tangent(given: MixedSolid, z: Floats, at: _Point, free: Bools) -> csc_array:
    """Derivative of forces and volumes by the unknowns; not symmetric.

    With h = d(dm)/dx: d det f = det f tr(F h), d ln J = -tr(F h) and
    d tau = -mu (F h b + (F h b)^T) - kappa tr(F h) 1, b = F F^T.
    """
    weights = given.weights * at.volume
    F, b = at.inverse, at.left
    kept = at.stress - np.asarray(given.pointwise)[..., None, None] * IDENTITY
    stretched = np.einsum("tqik,tqlj->tqijkl", F, b) + np.einsum("tqjk,tqli->tqijkl", F, b)
    sheared = np.asarray(given.shear)[..., None, None, None, None] * stretched
    moduli = np.einsum("tqij,tqlk->tqijkl", kept, F) - sheared
    moduli = moduli * weights[..., None, None, None, None]
    cells, points, _, nodes = given.slopes.shape
    count = 3 * nodes
    half = np.einsum("tqijkl,tqlb->tqjikb", moduli, given.slopes, optimize=True)
    own = given.slopes.reshape(cells, points * 3, nodes).mT @ half.reshape(cells, points * 3, -1)
    own = own.reshape(cells, nodes, 3, 3, nodes).swapaxes(-2, -1)  # (a, i, b, k)
    trace = np.einsum("tqlk,tqlb->tqbk", F, given.slopes).reshape(cells, points, count)
    spread = given.slopes.swapaxes(-2, -1).reshape(cells, points, count)
    shares = given.shares * weights[..., None]
    pressure = z[given.corners] @ given.shares.T
    missed = at.log_volume - pressure / given.carried - 1.0
    whole = np.empty((cells, count + 4, count + 4))
    whole[:, :count, :count] = own.reshape(cells, count, count)
    whole[:, :count, count:] = spread.mT @ shares
    whole[:, count:, :count] = (shares * missed[..., None]).mT @ trace
    whole[:, count:, count:] = -np.einsum(
        "tq,qa,qb->tab", weights / given.carried, given.shares, given.shares
    )
    found = given.assembled(whole) - given.padded_support
    return csc_array(found[free][:, free])
