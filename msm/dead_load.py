"""Static equilibrium of a lattice under its dead load, from the unloaded or the loaded shape."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.laws import Law
from msm.network import Network
from msm.relaxation import relax
from msm.unloading import Unloaded, from_shape, unload
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
INCREMENTS = Increments(easy=-1, smallest=1 / 4, unit="the load")
SAG_INCREMENTS = INCREMENTS._replace(smallest=1 / 16)


class NoEquilibriumError(UnfinishedError):
    """No static equilibrium of a body under its dead load was found."""


def rest_under_dead_load(law: Law, net: Network, dead_load: Floats) -> Floats:
    """Displacement [m] (n, 3) in equilibrium under a dead load [N] (n, 3) alone.

    Where dynamic relaxation diverges under the whole load at once, the load grows in increments.
    NoEquilibriumError if it diverges under an increment too, or does not come to rest.
    """

    def rest(start: Unloaded, factor: float) -> Unloaded:
        found = _relaxed(law, net, dead_load, start, factor)
        if found.failure.startswith("not at rest"):  # smaller increments take as long
            raise _no_rest(start.factor, found.failure)
        return found

    start = Unloaded(0.0, np.zeros_like(dead_load))
    path = follow(start, (1.0,), rest, lambda found, _: found.shape, SAG_INCREMENTS)
    if path.failure:
        raise _no_rest(path.reached, path.failure)
    return path.states[-1]


def _no_rest(reached: float, failure: str) -> NoEquilibriumError:
    part = f", but under {100.0 * reached:.2g} % of it" if reached else ""
    return NoEquilibriumError(
        f"gravity: the lattice does not come to rest under it{part} ({failure})",
        "reduce gravity.acceleration or weight.mass, or enlarge lattice.spacing",
    )


def _relaxed(
    law: Law, net: Network, dead_load: Floats, start: Unloaded, factor: float = 1.0
) -> Unloaded:
    """The shape at rest under a factor of the load, relaxed from a start."""
    if not dead_load.any():
        return Unloaded(factor, np.zeros_like(dead_load))
    loaded = net._replace(load=dead_load, external=None)
    u, end = relax(law, loaded, factor, start.shape, RESIDUAL)
    if end.status == "at rest":
        return Unloaded(factor, u)
    left = f"{end.status} after {end.steps} steps, {end.residual:.1g} of the load unbalanced"
    return start._replace(failure=left)


def unloaded_network(law: Law, net: Network, dead_load: Floats) -> tuple[Network, Floats]:
    """The network whose equilibrium under dead load is the given shape, and its load [N] (n, 3).

    The network has the rest lengths and volumes of the unloaded shape, which Anderson's mixing
    finds as a fixed point, in increments of the load where necessary, or else Newton's method. The
    returned load includes the foundation's force in the given shape. A linear network is returned
    unchanged with no load: its forces are those of the given shape.
    NoEquilibriumError if neither converges.
    """
    if net.linear or not dead_load.any():
        return net, np.zeros_like(dead_load)
    found = _by_mixing(law, net, dead_load)
    if found.failure:
        by_newton = unload(law, net, dead_load, _foundation(net))
        found = max(found, by_newton, key=lambda one: one.factor)
    if found.factor < 1.0:
        raise _no_shape(found)
    return from_shape(net, found.shape), dead_load + _foundation(net) @ found.shape


def _no_shape(found: Unloaded) -> NoEquilibriumError:
    """The refusal of a load of which a part was reached, and what ended the search."""
    part = f", but for {100.0 * found.factor:.2g} % of the load" if found.factor else ""
    return NoEquilibriumError(
        f"gravity.given: no unloaded shape was found that sags to the given one{part} "
        f"({found.failure})",
        "reduce gravity.acceleration, or set gravity.given to unloaded",
    )


def _by_mixing(law: Law, net: Network, dead_load: Floats) -> Unloaded:
    """The unloaded shape as a fixed point, or that of the last increment with a failure."""
    reached = [Unloaded(0.0, np.zeros_like(dead_load))]

    def rest(start: Unloaded, factor: float) -> Unloaded:
        found = _unloaded(law, net, dead_load, start, factor)
        if not found.failure:
            reached.append(found)
        return found

    path = follow(reached[0], (1.0,), rest, lambda one, _: one, INCREMENTS)
    return reached[-1]._replace(failure=path.failure)


def _unloaded(
    law: Law, net: Network, dead_load: Floats, start: Unloaded, factor: float
) -> Unloaded:
    """The unloaded shape for a factor of the load, from that for a smaller one."""
    from scipy.linalg import LinAlgWarning  # here, as few runs need them
    from scipy.optimize import NoConvergence, anderson

    foundation = _foundation(net)
    given = Unloaded(0.0, np.zeros_like(dead_load))

    def shape_error(unloaded: Floats) -> Floats:
        """Displacement from the given shape to the equilibrium of an unloaded one."""
        load = np.asarray(factor * dead_load + foundation @ unloaded)
        found = _relaxed(law, from_shape(net, unloaded), load, given)
        if found.failure:  # a trial shape that cannot rest
            raise NoEquilibriumError(found.failure, "")
        return found.shape

    extrapolated = start.shape * (factor / start.factor if start.factor else 1.0)
    tolerance = SHAPE_ERROR * float(net.length.max())
    how = {"M": HISTORY, "maxiter": MOST_ITERATIONS, "f_tol": tolerance}
    try:
        with warnings.catch_warnings():
            # Earlier shapes may be nearly parallel; the error of the shape decides, not their mix.
            warnings.simplefilter("ignore", LinAlgWarning)
            # alpha = -1 is the plain fixed-point step, which alone need not converge.
            shape = anderson(shape_error, extrapolated, alpha=-1.0, **how)
    except (NoConvergence, NoEquilibriumError):
        return Unloaded(factor, start.shape, "no fixed point")
    return Unloaded(factor, np.asarray(shape))


def _foundation(net: Network) -> csr_array:
    """The foundation's force [N] per displacement [m] (n, n), of either sign as in the network."""
    entries = net.value, net.column.astype(np.int64), net.row.astype(np.int64)
    return csr_array(entries, shape=(len(net.load), len(net.load)))
