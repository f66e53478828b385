"""The unloaded shape of a lattice by Newton's method, posed in the given shape.

In the given shape the direction of every spring and the gradient of every cell are known. Only the
rest lengths and the stress-free volumes depend on the unknown displacement m to the unloaded shape,
so that equilibrium with the load is a system for m in which no forward problem has to be solved:
for elements, Govindjee and Mihalic (1996), Comput. Methods Appl. Mech. Eng. 136:47.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, eye_array, kron

from msm.forces import internal_forces
from msm.kernel import kernel
from msm.kinematics import cross, deformation, dot
from msm.laws import Law
from msm.network import Network
from msm.relaxation import relax
from msm.tangent import SIGNS, Tangent, empty_tangent, linearise
from study.numerics.continuation import (
    NO_EQUILIBRIUM,
    NO_STEP,
    Increments,
    follow,
    slow_iterations,
)
from study.numerics.factors import symmetric_factors

Floats = NDArray[np.float64]

UNSTABLE_AS_GIVEN = "the given shape would be an unstable equilibrium"
TOLERANCE = 1e-9
"""Norm of the unbalanced force relative to that of the load."""
MOST_ITERATIONS = 40
"""Limit on iterations that leave more than a tenth of the residual."""
SHORTEST_STEP = 1 / 64
DECREASE = 1e-4
"""Required decrease of the residual, relative to that of the linear model (Armijo)."""
INCREMENTS = Increments(easy=5, smallest=1 / 64, unit="the load")
MOST_UNKNOWNS = 60_000
"""Largest number of unknowns: the sparse factors of more would exceed a gigabyte or two."""
PERTURBATION, RETURNED, MOST_STEPS = 1e-3, 0.1, 20_000
"""Displacement from the given shape in the test of its stability, relative to the shortest spring,
the share of it that may be left after relaxation, and the steps of that."""


class Unloaded(NamedTuple):
    """Displacement `shape` [m] (n, 3) to the unloaded shape for a `factor` of the load."""

    factor: float
    shape: Floats
    failure: str = ""
    residuals: tuple[float, ...] = (0.0,)


@dataclass(frozen=True, eq=False)
class _InverseProblem:
    """Equilibrium in the given shape under `dead_load` [N] (n, 3).

    `foundation` [N/m] (n, n): its force per displacement. `spread` (3 n, k): displacements by the
    k independent ones.
    """

    law: Law
    net: Network
    dead_load: Floats
    foundation: csr_array
    spread: csr_array

    def residual(self, shape: Floats, factor: float) -> Floats:
        """Unbalanced force [N] (k,) on the independent components in the given shape."""
        force = np.empty_like(shape)
        internal_forces(self.law, from_shape(self.net, shape), np.zeros_like(shape), force)
        force += factor * self.dead_load + self.foundation @ shape
        return np.asarray(self.spread.T @ force.ravel())

    def tangent(self, shape: Floats) -> csc_array:
        """Derivative [N/m] (k, k) of the residual by the independent components of the shape."""
        size = shape.size
        blocks = [self._of_springs(shape), self._of_cells(shape)]
        whole = kron(self.foundation, eye_array(3), format="csr")
        for block, dofs in blocks:
            count = dofs.shape[1]
            places = np.repeat(dofs, count, axis=1).ravel(), np.tile(dofs, count).ravel()
            whole = whole + csr_array(coo_array((block.ravel(), places), shape=(size, size)))
        return csc_array(self.spread.T @ whole @ self.spread)

    def _of_springs(self, shape: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Blocks (s, 6, 6) and their components (s, 6) of the springs.

        With rest length l and direction N in the unloaded shape, length L and direction n in the
        given one, and the tension t of the strain (L - l) / l, the force of a spring of weight w
        changes by dF = w (t - t' L / l) n N . d(m_j - m_i).
        """
        net = from_shape(self.net, shape)
        at = _linearised(self.law, net, np.zeros_like(shape))
        ends = net.ends.astype(np.int64)
        unloaded = net.rest + shape[ends[:, 1]] - shape[ends[:, 0]]
        stretch = np.linalg.norm(net.rest, axis=1) / net.length
        slope = (at.across - at.along) * stretch / net.length
        block = slope[:, None, None] * at.direction[:, :, None] * unloaded[:, None, :]
        pair = np.concatenate([np.concatenate([-block, block], 2)] * 2, 1)
        pair[:, 3:] *= -1.0
        return pair, _components(ends)

    def _of_cells(self, shape: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Blocks (c, 24, 24) and their components (c, 24) of the cells.

        With the volume ratio J of the unloaded shape, dF_a = kappa V / J^2 B_a dJ.
        """
        net = self.net
        at = _linearised(self.law, net, shape)
        ratio = np.empty(len(net.bulk))
        volume_ratios(net, shape, ratio)
        gradients = SIGNS / (4.0 * net.edges[:, None, None])  # (c, 8, 3)
        slope = np.einsum("cij,caj->cai", at.cofactor, gradients).reshape(len(ratio), 24)
        scaled = (net.bulk / ratio**2)[:, None] * gradients.reshape(len(ratio), 24)
        return scaled[:, :, None] * slope[:, None, :], _components(net.cells.astype(np.int64))

    def is_stable(self, shape: Floats, factor: float) -> bool:
        """Whether the given shape, slightly perturbed, comes back to rest as it was."""
        net = from_shape(self.net, shape)
        size = PERTURBATION * float(np.linalg.norm(net.rest, axis=1).min())
        noise = np.random.default_rng(0).uniform(-size, size, self.spread.shape[1])
        start = np.asarray(self.spread @ noise).reshape(shape.shape)
        load = factor * self.dead_load + self.foundation @ shape
        loaded = net._replace(load=np.asarray(load), external=None)
        u, _ = relax(self.law, loaded, start=start, most_steps=MOST_STEPS)
        return float(np.abs(u).max()) <= RETURNED * size  # False for NaN


def unload(law: Law, net: Network, dead_load: Floats, foundation: csr_array) -> Unloaded:
    """The unloaded shape that sags to the given one under a dead load [N] (n, 3).

    `foundation` [N/m] (n, n): force per displacement. The load grows in increments; if it is not
    reached, the result is that of the largest part of it and has a `failure`.
    """
    spread = _independent(net)
    start = Unloaded(0.0, np.zeros_like(dead_load))
    if spread.shape[1] > MOST_UNKNOWNS:
        return start._replace(failure=f"more than {MOST_UNKNOWNS} unknowns")
    problem = _InverseProblem(law, net, dead_load, foundation, spread)
    reached = [start]

    def state(found: Unloaded, _: int) -> Unloaded:
        return found

    def search(before: Unloaded, factor: float) -> Unloaded:
        found = _newton(problem, before, factor)
        if not found.failure:
            reached.append(found)
        return found

    path = follow(start, (1.0,), search, state, INCREMENTS)
    return reached[-1]._replace(failure=path.failure)


def _newton(problem: _InverseProblem, start: Unloaded, factor: float) -> Unloaded:
    """Newton's method with line search at a factor of the load."""
    size = float(np.linalg.norm(problem.spread.T @ problem.dead_load.ravel())) * factor
    shape, residuals = start.shape, list[float]()
    residual = problem.residual(shape, factor)
    failure = NO_EQUILIBRIUM
    while slow_iterations(residuals) < MOST_ITERATIONS:
        residuals.append(float(np.linalg.norm(residual)) / size)
        if residuals[-1] <= TOLERANCE:
            failure = "" if problem.is_stable(shape, factor) else UNSTABLE_AS_GIVEN
            break
        factors = symmetric_factors(problem.tangent(shape))
        step = None if factors is None else -factors.solve(residual)
        found = None if step is None else _decreased(problem, shape, step, factor, residual)
        if found is None:
            failure = NO_STEP
            break
        shape, residual = found
    return Unloaded(factor, shape, failure, tuple(residuals))


def _decreased(
    problem: _InverseProblem, shape: Floats, step: Floats, factor: float, residual: Floats
) -> tuple[Floats, Floats] | None:
    """Shape and residual after the largest fraction 1, 1/2, ... of a step that reduces the latter.

    No cell may invert. None without such a fraction.
    """
    size, whole = float(np.linalg.norm(residual)), np.asarray(problem.spread @ step)
    ratio, length = np.empty(len(problem.net.bulk)), 1.0
    while length >= SHORTEST_STEP:
        trial = shape + length * whole.reshape(shape.shape)
        volume_ratios(problem.net, trial, ratio)
        if ratio.min(initial=1.0) > 0.0:
            left = problem.residual(trial, factor)
            if float(np.linalg.norm(left)) <= (1.0 - DECREASE * length) * size:
                return trial, left
        length *= 0.5
    return None


def _linearised(law: Law, net: Network, u: Floats) -> Tangent:
    found = empty_tangent(net)
    linearise(law, net, u, found)
    return found


def _components(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Components (k, 3 m) of nodes (k, m)."""
    return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 3 * nodes.shape[1])


def _independent(net: Network) -> csr_array:
    """Displacements (3 n, k) by the components that are neither constrained nor hanging."""
    count = len(net.load)
    kept = np.ones((count, 3), dtype=np.bool_)
    kept[net.hanging] = False
    kept[net.fixed[:, 0], net.fixed[:, 1]] = False
    tied = np.repeat(net.hanging, np.diff(net.first_master)).astype(np.int64)
    free = np.setdiff1d(np.arange(count), net.hanging)
    rows, columns = np.append(free, tied), np.append(free, net.master.astype(np.int64))
    values = np.append(np.ones(len(free)), net.part)
    tie = coo_array((values, (rows, columns)), shape=(count, count))
    spread = csc_array(kron(tie, eye_array(3)))
    return csr_array(spread[:, np.flatnonzero(kept.ravel())])


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
