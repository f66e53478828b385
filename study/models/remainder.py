"""The nonlinear part of a lattice's motion: the effect of large displacements.

It is the difference of a lattice and its linearisation about rest, both by the same steps of the
same integrator. Errors that both have in common cancel: those of the steps, of cut cells at the
surface, and of the load on few nodes. The remainder is small and smooth, so that a coarse lattice
resolves it. Its error decreases with about the spacing to the power ORDER, and is estimated from a
lattice of half the spacing.

Under gravity both start in equilibrium under it, each by its own forces, so that the difference
includes the effect of large displacements on the sag. A shape that is given loaded is where both
start; the effect of its prestress on a load is that of the nonlinear lattice alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm import model as msm
from msm.model import Step
from msm.reduction import ReducedLattice, ReducedMotion, reduced, ritz_vectors
from msm.statics import sag
from study.models.lattice import PreparedLattice
from study.problem.trajectory import Trajectory
from study.results.records import CurveErrors
from study.similarity.fields import relative_l2_of_curves
from study.system.progress import Advance

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ORDER = 1.5
"""Assumed of the remainder's error in the spacing; cells that are cut keep it from 2."""
FINER = 0.5
"""Spacing of the lattice that the error is estimated from, times that of the other.

A coarser one would be cheaper, but where neither resolves the strain under the tool both have the
same error and seem to agree. With one of two thirds the difference is too small against the scatter
by the position of the cells (`reports/data/corrected_places.csv` has both).
"""
KEPT = 0.75
"""Share of the vectors that is kept to estimate the truncation error from the others."""


@dataclass(frozen=True)
class Remainder:
    """The remainder of a motion, and `truncation`: error of the linear part by its `vectors`.

    `trajectory` is the difference, not a number from where the lattice diverged. `lattice`: run of
    the lattice; `nodal` (samples, 2, n, 3): difference of displacement [m] and velocity [m/s] at
    its nodes, in single precision, of no samples where it was not kept.
    """

    trajectory: Trajectory
    lattice: msm.Run
    nodal: NDArray[np.float32]
    vectors: int
    truncation: float

    @property
    def samples(self) -> range:
        """Numbers of the samples before the lattice diverged, all if it did not."""
        return range(int(np.isfinite(self.trajectory.displacement).all(axis=(1, 2)).sum()))


@dataclass(frozen=True, eq=False)
class PreparedRemainder:
    """A nonlinear lattice, and itself linear in at most `count` vectors."""

    lattice: PreparedLattice
    count: int

    @cached_property
    def vectors(self) -> Floats:
        """Load-dependent Ritz vectors (3 n, m) of the lattice at rest."""
        one = self.lattice
        return ritz_vectors(one.assembly, one.springs.material, self.count)

    @cached_property
    def start(self) -> Floats:
        """Displacement [m] (n, 3) at which the linear lattice starts, at rest under gravity."""
        return sag(self.lattice.assembly, self.lattice.springs.material)

    def linear(self, count: int | None = None) -> ReducedLattice:
        """The lattice linear about rest, among the first `count` vectors or all."""
        one = self.lattice
        return reduced(one.assembly, one.springs.material, self.vectors[:, :count])

    def linear_motion(self, lattice: ReducedLattice) -> ReducedMotion:
        """The linear lattice at rest, stepped as the nonlinear one is."""
        one = self.lattice
        damping, integrator = one.springs.material.damping, one.model.lattice.integrator
        further = tuple(load.factor for load in one.problem.loads)
        return ReducedMotion(lattice, damping, one.problem.factor, integrator, further)

    def run(
        self, step: Step, advance: Advance = lambda _: None, *, keep_nodes: bool = False
    ) -> Remainder:
        """The motion of the lattice by steps of its own choice, less that of the linear one."""
        one, problem = self.lattice, self.lattice.problem
        samples, size = len(problem.observation.times) * keep_nodes, one.assembly.load.shape
        nodal = np.full((samples, 2, *size), np.nan, np.float32)

        def keep(sample: int, u: Floats, v: Floats) -> None:
            if keep_nodes:
                nodal[sample] = u, v

        found = msm.run(
            one.assembly,
            one.springs.material,
            problem.factor,
            problem.observation,
            step,
            advance,
            integrator=one.model.lattice.integrator,
            single=one.single,
            on_sample=keep,
        )
        return self._beyond_linear(found, nodal)

    def _beyond_linear(self, found: msm.Run, nodal: NDArray[np.float32]) -> Remainder:
        linear = self.linear()
        moved = self._moved(linear, found.substeps)
        for sample, (y, rate) in zip(range(len(nodal)), zip(*moved, strict=True), strict=False):
            nodal[sample] -= [self.start + linear.displacement(y), linear.displacement(rate)]
        trajectory = plus(found.trajectory, self._seen(linear, *moved), -1.0)
        truncation = self._truncation(linear, moved[0], found)
        return Remainder(trajectory, found, nodal, len(linear.squares), truncation)

    def _moved(self, linear: ReducedLattice, substeps: Ints) -> tuple[Floats, Floats]:
        """Modal coordinates and rates (samples, m) by so many steps between the samples."""
        motion = self.linear_motion(linear)
        times = self.lattice.problem.observation.times
        y, rates = np.zeros((2, len(times), len(linear.squares)))
        for n, count in enumerate(map(int, substeps)):
            if count:  # none once the lattice has diverged
                motion.advance(count, float(times[1] - times[0]) / count)
            y[n + 1], rates[n + 1] = motion.coordinates, motion.rates
        return y, rates

    def _seen(self, linear: ReducedLattice, y: Floats, rates: Floats) -> Trajectory:
        """The motion of the linear lattice as it is observed."""
        seen, lattice = self.lattice.problem.observation, self.lattice.assembly.lattice
        at_probes, _ = lattice.interpolation(seen.probes)
        probes = _at(at_probes, linear)
        frames = [self.start + linear.displacement(y[frame]) for frame in seen.frames]
        volume, surface = (
            np.array([weights @ u for u in frames])
            for weights, _ in map(lattice.interpolation, (seen.volume_points, seen.surface_points))
        )
        u, v = (np.einsum("pdm,tm->tpd", probes, one) for one in (y, rates))
        return Trajectory(at_probes @ self.start + u, v, volume, surface)

    def _truncation(self, linear: ReducedLattice, y: Floats, found: msm.Run) -> float:
        """Largest relative L2 change of a point's motion by the last quarter of the vectors."""
        fewer = self.linear(max(1, int(KEPT * len(linear.squares))))
        probes = self.lattice.problem.observation.probes
        weights = self.lattice.assembly.lattice.interpolation(probes)[0]
        coordinates = (y, self._moved(fewer, found.substeps)[0])
        whole, part = (
            np.einsum("pdm,tm->tpd", _at(weights, one), at)
            for one, at in zip((linear, fewer), coordinates, strict=True)
        )
        return float(relative_l2_of_curves(whole - part, whole).max())


def _at(weights: csr_array, linear: ReducedLattice) -> Floats:
    """Shapes (q, 3, m) at points whose weights of the nodes are given."""
    count = len(linear.squares)
    found = weights @ linear.shapes.reshape(len(linear.shapes), -1)
    return np.asarray(found).reshape(-1, 3, count)


def plus(one: Trajectory, other: Trajectory, share: float = 1.0) -> Trajectory:
    """The sum of a motion and a share of another; it ends as the first one does."""
    return replace(
        one,
        displacement=one.displacement + share * other.displacement,
        velocity=one.velocity + share * other.velocity,
        volume_field=one.volume_field + share * other.volume_field,
        surface_field=one.surface_field + share * other.surface_field,
    )


def relative_sizes(
    probes: tuple[str, ...], part: Trajectory, whole: Trajectory, share: float = 1.0
) -> dict[str, CurveErrors]:
    """A share of the L2 norm of a part's curves over that of the whole's, by control point."""
    u = share * relative_l2_of_curves(part.displacement, whole.displacement)
    v = share * relative_l2_of_curves(part.velocity, whole.velocity)
    return {
        probe: CurveErrors(displacement=float(a), velocity=float(b))
        for probe, a, b in zip(probes, u, v, strict=True)
    }


def remainder_errors(
    probes: tuple[str, ...], coarse: Trajectory, fine: Trajectory, whole: Trajectory
) -> dict[str, CurveErrors]:
    """Estimated L2 errors of a remainder by control point, relative to the `whole` motion.

    `coarse` is that remainder and `fine` the one of FINER times the spacing: their difference is
    1 - FINER^ORDER times the error of the coarser, if ORDER is right.
    """
    share = 1.0 / (1.0 - FINER**ORDER)
    return relative_sizes(probes, plus(coarse, fine, -1.0), whole, share)
