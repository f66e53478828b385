"""Static equilibrium of a lattice under its dead load, from the unloaded or the loaded shape."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.kernel import kernel
from msm.kinematics import cross, deformation, dot
from msm.laws import Law
from msm.network import Network
from msm.relaxation import relax
from study.numerics.continuation import Increments, follow
from study.problem.unfinished import UnfinishedError

Floats = NDArray[np.float64]

RESIDUAL = 1e-9
"""Unbalanced force at the start of a motion, relative to the dead load."""
SHAPE_ERROR = 1e-7
"""Distance of the reloaded shape from the given one, relative to the longest spring."""
MOST_ITERATIONS = 60
HISTORY = 6
"""Earlier shapes in Anderson's mixing (1965, J. ACM 12:547)."""
INCREMENTS = Increments(easy=-1, smallest=1 / 4)


class NoEquilibriumError(UnfinishedError):
    """No static equilibrium of a body under its dead load was found."""


class _Unloaded(NamedTuple):
    """Displacement `shape` [m] (n, 3) to the unloaded shape for a factor of the load."""

    factor: float
    shape: Floats
    failure: str = ""
    residuals: tuple[float, ...] = (0.0,)  # increments do not grow by how easily they are solved


def rest_under_dead_load(law: Law, net: Network, dead_load: Floats) -> Floats:
    """Displacement [m] (n, 3) in equilibrium under a dead load [N] (n, 3) alone.

    NoEquilibriumError if dynamic relaxation does not converge.
    """
    if not dead_load.any():
        return np.zeros_like(dead_load)
    u, relaxation = relax(law, net._replace(load=dead_load, external=None), tolerance=RESIDUAL)
    if relaxation.status != "at rest":
        raise NoEquilibriumError(
            f"gravity: the lattice does not come to rest under it ({relaxation.status} after "
            f"{relaxation.steps} steps, {relaxation.residual:.1g} of the load unbalanced)",
            "reduce gravity.acceleration or weight.mass, or enlarge lattice.spacing",
        )
    return u


def unloaded_network(law: Law, net: Network, dead_load: Floats) -> tuple[Network, Floats]:
    """The network whose equilibrium under dead load is the given shape, and its load [N] (n, 3).

    The network has the rest lengths and volumes of the unloaded shape, which Anderson's mixing
    finds as a fixed point, in increments of the load where necessary. The returned load includes
    the foundation's force in the given shape. A linear network is returned unchanged with no load:
    its forces are those of the given shape.
    NoEquilibriumError if the iteration does not converge.
    """
    if net.linear or not dead_load.any():
        return net, np.zeros_like(dead_load)

    def rest(start: _Unloaded, factor: float) -> _Unloaded:
        return _unloaded(law, net, dead_load, start, factor)

    def shape(found: _Unloaded, _: int) -> Floats:
        return found.shape

    found = follow(_Unloaded(0.0, np.zeros_like(dead_load)), (1.0,), rest, shape, INCREMENTS)
    if found.failure:
        part = f", but for {100.0 * found.reached:.2g} % of the load" if found.reached else ""
        raise NoEquilibriumError(
            f"gravity.given: no unloaded shape was found that sags to the given one{part}",
            "reduce gravity.acceleration, or set gravity.given to unloaded",
        )
    unloaded = found.states[-1]
    return from_shape(net, unloaded), dead_load + _foundation(net) @ unloaded


def _unloaded(
    law: Law, net: Network, dead_load: Floats, start: _Unloaded, factor: float
) -> _Unloaded:
    """The unloaded shape for a factor of the load, from that for a smaller one."""
    from scipy.linalg import LinAlgWarning  # here, as few runs need them
    from scipy.optimize import NoConvergence, anderson

    foundation = _foundation(net)

    def shape_error(unloaded: Floats) -> Floats:
        """Displacement from the given shape to the equilibrium of an unloaded one."""
        load = np.asarray(factor * dead_load + foundation @ unloaded)
        return rest_under_dead_load(law, from_shape(net, unloaded), load)

    extrapolated = start.shape * (factor / start.factor if start.factor else 1.0)
    tolerance = SHAPE_ERROR * float(net.length.max())
    how = {"M": HISTORY, "maxiter": MOST_ITERATIONS, "f_tol": tolerance}
    try:
        with warnings.catch_warnings():
            # Earlier shapes may be nearly parallel; the error of the shape decides, not their mix.
            warnings.simplefilter("ignore", LinAlgWarning)
            # alpha = -1 is the plain fixed-point step, which alone need not converge.
            shape = anderson(shape_error, extrapolated, alpha=-1.0, **how)
    except (NoConvergence, NoEquilibriumError):  # also of a trial shape that cannot rest
        return _Unloaded(factor, start.shape, "no shape")
    return _Unloaded(factor, np.asarray(shape))


def _foundation(net: Network) -> csr_array:
    """The foundation's force [N] per displacement [m] (n, n), of either sign as in the network."""
    entries = net.value, net.column.astype(np.int64), net.row.astype(np.int64)
    return csr_array(entries, shape=(len(net.load), len(net.load)))


def from_shape(net: Network, u: Floats) -> Network:
    """The network whose stress-free state is the shape displaced by u [m] (n, 3)."""
    ends = net.ends.astype(np.int64)
    length = np.linalg.norm(net.rest + u[ends[:, 1]] - u[ends[:, 0]], axis=1)
    ratio = np.empty(len(net.bulk))
    volume_ratios(net, u, ratio)
    # With the stress-free volume J_0 V:
    # kappa J_0 V / 2 (J / J_0 - 1)^2 = kappa V / (2 J_0) (J - J_0)^2
    return net._replace(
        length=length,
        scale=net.scale / net.length * length,
        bulk=net.bulk / ratio,
        swollen=ratio - 1.0,
    )


@kernel()
def volume_ratios(net: Network, u: Floats, ratio: Floats) -> None:
    """Set the volume ratio J (c,) of each cell at the displacement u [m] (n, 3)."""
    for c in range(net.cells.shape[0]):
        f, g, h = deformation(net.cells[c], net.edges[c], u)
        ratio[c] = dot(f, cross(g, h))
