"""A lattice at rest under its dead load: displaced by it, or given as it is then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.kernel import kernel
from msm.kinematics import cross, deformation, dot
from msm.laws import Law
from msm.network import Network
from msm.relaxation import relax
from study.problem.unfinished import UnfinishedError

Floats = NDArray[np.float64]

AT_REST = 1e-9
"""Of the dead load, what may be left unbalanced at the start of a motion."""
FOUND = 1e-7
"""Of the longest spring, how far the unloaded shape, loaded again, may miss the given one."""
ROUNDS = 60
MIXED = 6
"""Earlier shapes that Anderson's mixing looks back at (1965, J. ACM 12:547)."""


class NoRestError(UnfinishedError):
    """A body that finds no rest under its weight."""


def sagged(law: Law, net: Network, dead: Floats) -> Floats:
    """Displacement [m] (n, 3) at rest under a dead load [N] (n, 3) alone.

    NoRestError if there is none to be found.
    """
    if not dead.any():
        return np.zeros_like(dead)
    found, how = relax(law, net._replace(load=dead, outer=None), tolerance=AT_REST)
    if how.status != "at rest":
        raise NoRestError(
            f"gravity: the lattice does not come to rest under it ({how.status} after {how.steps} "
            f"steps, {how.residual:.1g} of the load unbalanced)",
            "reduce gravity.acceleration or weight.mass, or enlarge lattice.spacing",
        )
    return found


def unloaded(law: Law, net: Network, dead: Floats) -> tuple[Network, Floats]:
    """The network with the rest lengths and volumes with which it is at rest as it is given.

    And the dead load [N] (n, 3) with what the foundation bears of it. The unloaded shape is sought
    that sags to the given one. Forces of small displacements are
    those of the given shape as it is, and nothing is left of the load. NoRestError if no shape is
    found.
    """
    if net.linear or not dead.any():
        return net, np.zeros_like(dead)
    from scipy.optimize import NoConvergence, anderson  # here, as few runs need it

    entries = net.value, net.column.astype(np.int64), net.row.astype(np.int64)
    support = csr_array(entries, shape=(len(dead), len(dead)))

    def borne(raised: Floats) -> Floats:
        """The load less what a foundation bears that is at rest under the unloaded shape."""
        return np.asarray(dead + support @ raised)

    def missed(raised: Floats) -> Floats:
        """Where an unloaded shape sags to, off the given one."""
        return sagged(law, from_shape(net, raised), borne(raised))

    enough = FOUND * float(net.length.max())
    try:
        # Its own first step goes back by what was missed; alone these steps need not converge.
        raised = anderson(
            missed, np.zeros_like(dead), alpha=-1.0, M=MIXED, maxiter=ROUNDS, f_tol=enough
        )
    except NoConvergence:
        raise NoRestError(
            "gravity.given: no unloaded shape was found that sags to the given one",
            "reduce gravity.acceleration, or set gravity.given to unloaded",
        ) from None
    return from_shape(net, raised), borne(raised)


def from_shape(net: Network, u: Floats) -> Network:
    """The network unstressed where its nodes are displaced by u [m] (n, 3)."""
    ends = net.ends.astype(np.int64)
    length = np.linalg.norm(net.rest + u[ends[:, 1]] - u[ends[:, 0]], axis=1)
    ratio = np.empty(len(net.bulk))
    volume_ratios(net, u, ratio)
    # kappa V / 2 (J / J_0 - 1)^2 of the unstressed volume J_0 V is kappa V / (2 J_0) (J - J_0)^2.
    return net._replace(
        length=length,
        scale=net.scale / net.length * length,
        bulk=net.bulk / ratio,
        swollen=ratio - 1.0,
    )


@kernel()
def volume_ratios(net: Network, u: Floats, ratio: Floats) -> None:
    """Set J (c,) of each cell displaced by u [m] (n, 3)."""
    for c in range(net.cells.shape[0]):
        f, g, h = deformation(net.cells[c], net.spacing, u)
        ratio[c] = dot(f, cross(g, h))
