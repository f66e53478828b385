"""Reduced linear lattice: modal equations in a subspace of load-dependent Ritz vectors.

The first Ritz vector is the static displacement under the load; each further one is the static
displacement under the inertia forces of the one before (Wilson, Yuan and Dickens 1982, Earthquake
Eng. Struct. Dyn. 10:813). In the modes of the subspace the equations of motion decouple. Each is
that of a mass point of 1 kg on a spring to ground, so that the integrators of the lattice step
them, with the same time-step error.
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
from msm.external_loads import ExternalArrays, ExternalLoads
from msm.integrators import INTEGRATORS
from msm.laws import Hooke
from msm.network import Network, network
from msm.springs import Springs
from msm.stability import longest_step
from msm.statics import TOLERANCE, extended, solved, stiffness_at_rest
from msm.timestep import ALLOWED, whole_steps

Floats = NDArray[np.float64]

LOOSE = 1e-2
"""Relative residual of all vectors but the first; the projected equations stay exact."""
DEPENDENT = 1e-8
"""Norm of the orthogonal part of a vector, relative to the vector, below which it is dependent."""
NO_SPRINGS = Springs(np.zeros((0, 2), dtype=np.int64), np.zeros((0, 3)), np.zeros(0))


@dataclass(frozen=True)
class ReducedLattice:
    """A lattice, linearised at rest, in the modes of a subspace.

    `shapes` (n, 3, m): nodal displacements of the modes, of modal mass 1 kg; `squares` [1/s^2]
    (m,): squared angular frequencies; `load` (m,): modal component of the full load; `others`
    (loads, m): those of the further loads.
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
    """At most `count` load-dependent Ritz vectors (3 n, m), orthonormal in the mass matrix.

    Each load has a sequence of its own, and the sequences alternate. There are fewer vectors where
    the Krylov space of the loads is exhausted. ValueError if the support does not hold the lattice.
    """
    return np.column_stack(list(islice(_ritz_vectors(assembly, material), max(count, 1))))


def _ritz_vectors(assembly: Assembly, material: Material) -> Iterator[Floats]:
    mass, stiffness = np.repeat(assembly.mass, 3), stiffness_at_rest(assembly, material)
    basis = np.zeros((len(mass), 0))
    loads, tolerance = [assembly.load.ravel(), *_further_loads(assembly)], TOLERANCE
    while loads and basis.shape[1] < len(mass):
        inertia_forces = []
        for load in loads:
            vector = _orthonormalised(solved(stiffness, load, tolerance), basis, mass)
            if vector is not None:  # otherwise the sequence of this load is exhausted
                yield vector
                basis = np.column_stack([basis, vector])
                inertia_forces.append(mass * vector)
        loads, tolerance = inertia_forces, LOOSE


def _further_loads(assembly: Assembly) -> Floats:
    """Loads [N] (loads, 3 n) beside the first."""
    if assembly.external_loads is None:
        return np.zeros((0, assembly.load.size))
    return assembly.external_loads.loads.reshape(-1, assembly.load.size)


def _orthonormalised(vector: Floats, basis: Floats, mass: Floats) -> Floats | None:
    """The part of a vector orthogonal to the basis, of unit modal mass; None if it is dependent."""
    norm = np.sqrt(vector @ (mass * vector))
    for _ in range(2):  # one pass of Gram-Schmidt loses orthogonality to rounding
        vector = vector - basis @ (basis.T @ (mass * vector))
    remaining = np.sqrt(vector @ (mass * vector))
    return vector / remaining if remaining > DEPENDENT * norm else None


def reduced(assembly: Assembly, material: Material, vectors: Floats) -> ReducedLattice:
    """The lattice, linearised at rest, in the modes of the span of vectors (3 n, m)."""
    forces = stiffness_at_rest(assembly, material) @ vectors
    squares, modes = eigh(vectors.T @ forces)
    shapes = extended(assembly, np.asarray(vectors @ modes))
    load, others = shapes.T @ assembly.load.ravel(), _further_loads(assembly) @ shapes
    return ReducedLattice(shapes.reshape(-1, 3, len(squares)), squares, load, others)


class ReducedMotion:
    """Motion of a reduced lattice from rest under its load times `factor` of the time [s].

    `further`: factors of the other loads; `t` [s]: current time. An integrator of the lattice steps
    the modal equations; a step beyond its stability limit is divided into equal substeps.
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
        self.external_loads = _external_loads(lattice, further) if further else None
        if self.external_loads is not None:
            stages, place = len(self.method.at), np.arange(len(lattice.squares))
            loads = self.external_loads
            given = loads.dead, loads.loads, stages, loads.width
            self.net = self.net._replace(external=ExternalArrays(place, *given, None))
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
        """Rates [1/s] (m,) of the modal coordinates."""
        return self.v[:, 0]

    def advance(self, count: int, dt: float) -> None:
        """Take `count` steps of dt [s]."""
        parts = whole_steps(dt, ALLOWED * self.limit)
        step = dt / parts
        starts = np.asarray(self.t + step * np.arange(count * parts), dtype=np.float64)
        factors = np.stack([self.factor(starts + at * step) for at in self.method.at], axis=1)
        if self.external_loads is not None:
            rows = self.external_loads.factor_rows(starts, step, self.method.at)
            factors = np.hstack([factors, rows])
        self.method.advance(self.law, self.net, factors, step, self.u, self.v)
        self.t += count * dt

    def restart(self) -> None:
        """Return to rest at time zero."""
        self.u[:], self.v[:], self.t = 0.0, 0.0, 0.0


def _external_loads(
    lattice: ReducedLattice, factors: tuple[Callable[[Floats], Floats], ...]
) -> ExternalLoads:
    """The further loads on the mass points of the modes."""
    count = len(lattice.squares)
    loads = np.zeros((len(factors), count, 3))
    loads[:, :, 0] = lattice.others
    return ExternalLoads(np.zeros((count, 3)), np.zeros(count), loads, factors)


def mass_points(lattice: ReducedLattice, damping: NodalDamping) -> Network:
    """The modes as mass points of 1 kg that move along x, each on its own spring to ground."""
    count = len(lattice.squares)
    load = np.zeros((count, 3))
    load[:, 0] = lattice.load
    ground = csr_array(diags_array(lattice.squares))
    at_zero_displacement = NodalDamping(damping.gamma_0, beta=damping.beta)
    no_cells, ones = volumes.none(1.0), np.ones(count)
    return network(NO_SPRINGS, ones, ground, load, no_cells, at_zero_displacement, linear=True)
