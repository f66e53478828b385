"""A linear lattice in few vectors: mass points on their own, each on a spring to ground.

The vectors are load-dependent Ritz vectors: the rest under the load, and then what inertia adds to
the one before (Wilson, Yuan and Dickens 1982, Earthquake Eng. Struct. Dyn. 10:813). Among the modes
of their span the equations of motion fall apart. Each is that of a mass point of 1 kg on a
foundation of its own, so that an integrator of lattices takes them as it takes the lattice, with
the same error of its steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array, diags_array

from msm import volume as volumes
from msm.assembly import Assembly, Material
from msm.damping import NodalDamping
from msm.integrators import INTEGRATORS
from msm.laws import Hooke
from msm.network import Network, network
from msm.outer import Burden, Outer
from msm.springs import Springs
from msm.stability import longest_step
from msm.statics import TOLERANCE, extended, solved, stiffness_at_rest
from msm.timestep import ALLOWED, whole_steps

Floats = NDArray[np.float64]

LOOSE = 1e-2
"""Residual of all vectors but the first: any vector serves, what is projected is exact."""
SPANNED = 1e-8
"""Share of a vector below which the others span it: there are no more."""
NO_SPRINGS = Springs(np.zeros((0, 2), dtype=np.int64), np.zeros((0, 3)), np.zeros(0))


@dataclass(frozen=True)
class ReducedLattice:
    """A lattice, linear about rest, among the modes of a few vectors.

    `shapes` (n, 3, m): displacement of the nodes by mode, of modal mass 1 kg; `squares` [1/s^2]
    (m,): squared angular frequencies; `load` (m,): the full load along each mode, `others`
    (loads, m) the further ones.
    """

    shapes: Floats
    squares: Floats
    load: Floats
    others: Floats

    def displacement(self, coordinates: Floats) -> Floats:
        """Displacement [m] (n, 3) of the nodes at modal coordinates (m,)."""
        flat = self.shapes.reshape(-1, len(self.squares))  # one product, not one for each node
        return np.asarray(flat @ coordinates).reshape(-1, 3)


def ritz_vectors(assembly: Assembly, material: Material, count: int) -> Floats:
    """At most `count` load-dependent Ritz vectors (3 n, m), orthonormal in the mass.

    Of several loads each has its own sequence, and these take turns. Fewer where these span all
    that the loads move. ValueError if the support does not hold the lattice.
    """
    return np.column_stack(list(islice(_ritz_vectors(assembly, material), max(count, 1))))


def _ritz_vectors(assembly: Assembly, material: Material) -> Iterator[Floats]:
    mass, stiffness = np.repeat(assembly.mass, 3), stiffness_at_rest(assembly, material)
    found = np.zeros((len(mass), 0))
    pushed, tolerance = [assembly.load.ravel(), *_further_loads(assembly)], TOLERANCE
    while pushed and found.shape[1] < len(mass):
        following = []
        for load in pushed:
            vector = _new_direction(solved(stiffness, load, tolerance), found, mass)
            if vector is not None:  # else the others span what this load moves
                yield vector
                found = np.column_stack([found, vector])
                following.append(mass * vector)
        pushed, tolerance = following, LOOSE


def _further_loads(assembly: Assembly) -> Floats:
    """Loads [N] (loads, 3 n) beside the first."""
    if assembly.burden is None:
        return np.zeros((0, assembly.load.size))
    return assembly.burden.loads.reshape(-1, assembly.load.size)


def _new_direction(vector: Floats, found: Floats, mass: Floats) -> Floats | None:
    """What a vector has beside those found, of unit modal mass; None if that is nothing."""
    whole = np.sqrt(vector @ (mass * vector))
    for _ in range(2):  # once is not enough in floating point
        vector = vector - found @ (found.T @ (mass * vector))
    left = np.sqrt(vector @ (mass * vector))
    return vector / left if left > SPANNED * whole else None


def reduced(assembly: Assembly, material: Material, vectors: Floats) -> ReducedLattice:
    """The lattice, linear about rest, among the modes of the span of vectors (3 n, m)."""
    pushed = stiffness_at_rest(assembly, material) @ vectors
    squares, modes = eigh(vectors.T @ pushed)
    shapes = extended(assembly, np.asarray(vectors @ modes))
    load, others = shapes.T @ assembly.load.ravel(), _further_loads(assembly) @ shapes
    return ReducedLattice(shapes.reshape(-1, 3, len(squares)), squares, load, others)


class ReducedMotion:
    """The motion of a reduced lattice, from rest, under the load times `factor` of the time [s].

    `further`: factors of the other loads. `t` [s]: where it is. It is stepped by an integrator of
    lattices; where a step is longer than the integrator takes these modes, equal parts of it are.
    """

    def __init__(
        self,
        lattice: ReducedLattice,
        damping: NodalDamping,
        factor: Callable[[Floats], Floats],
        integrator: str,
        further: tuple[Callable[[Floats], Floats], ...] = (),
    ) -> None:
        self.method, self.factor = INTEGRATORS[integrator], factor
        self.law, self.net = Hooke(1.0), mass_points(lattice, damping)
        self.burden = _burden(lattice, further) if further else None
        if self.burden is not None:
            stages, place = len(self.method.at), np.arange(len(lattice.squares))
            given = self.burden.dead, self.burden.loads, stages, self.burden.width
            self.net = self.net._replace(outer=Outer(place, *given, None))
        self.u, self.v = np.zeros_like(self.net.load), np.zeros_like(self.net.load)
        self.t = 0.0
        fastest = float(np.sqrt(lattice.squares.max()))
        self.limit = longest_step(self.method, fastest, damping.gamma_0, damping.beta)

    @property
    def coordinates(self) -> Floats:
        """Modal coordinates (m,)."""
        return self.u[:, 0]

    @property
    def rates(self) -> Floats:
        """Their rates [1/s] (m,)."""
        return self.v[:, 0]

    def advance(self, count: int, dt: float) -> None:
        """Take so many steps of dt [s]."""
        parts = whole_steps(dt, ALLOWED * self.limit)
        step = dt / parts
        starts = np.asarray(self.t + step * np.arange(count * parts), dtype=np.float64)
        factors = np.stack([self.factor(starts + at * step) for at in self.method.at], axis=1)
        if self.burden is not None:
            factors = np.hstack([factors, self.burden.drive(starts, step, self.method.at)])
        self.method.advance(self.law, self.net, factors, step, self.u, self.v)
        self.t += count * dt

    def restart(self) -> None:
        """Put it at rest again, at the time zero."""
        self.u[:], self.v[:], self.t = 0.0, 0.0, 0.0


def _burden(lattice: ReducedLattice, factors: tuple[Callable[[Floats], Floats], ...]) -> Burden:
    """The further loads on the modes as mass points."""
    count = len(lattice.squares)
    loads = np.zeros((len(factors), count, 3))
    loads[:, :, 0] = lattice.others
    return Burden(np.zeros((count, 3)), np.zeros(count), loads, factors)


def mass_points(lattice: ReducedLattice, damping: NodalDamping) -> Network:
    """The modes as mass points of 1 kg that move along x, each on a foundation of its own."""
    count = len(lattice.squares)
    load = np.zeros((count, 3))
    load[:, 0] = lattice.load
    ground = csr_array(diags_array(lattice.squares))
    at_rest = NodalDamping(damping.gamma_0, beta=damping.beta)
    still = volumes.none(1.0)
    return network(NO_SPRINGS, np.ones(count), ground, load, still, at_rest, linear=True)
