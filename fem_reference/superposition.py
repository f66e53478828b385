"""Motion as a superposition of few vectors, and how many of them it takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fem_reference.dynamics import Damping
from fem_reference.elasticity import Body
from fem_reference.recording import Recorder
from fem_reference.solvers import solver
from fem_reference.subspace import Subspace, eigenvectors, empty, extended, superposition

Floats = NDArray[np.float64]
Factor = Callable[[Floats], Floats]
Advance = Callable[[float], None]

LOAD_STEPS = 16
"""Per sample: the load is linear between them."""
GROWTH = 4
MAX_VECTORS = 80
TINY = 1e-300
TRUNCATION = 1e-3
"""Relative L2 change of a control point's motion by the last vectors, at which there are enough."""
LOOSE = 1e-2
"""Residual of all Ritz vectors but the first: any vector serves, what is projected is exact."""


class Curves(NamedTuple):
    """Displacement [m] and velocity [m/s] of the control points, (samples, probes, 3)."""

    displacement: Floats
    velocity: Floats


@dataclass(frozen=True)
class Superposed:
    """Motion in a subspace: `coordinates` and their `rates` (samples, m).

    `curves`: at the control points; `truncation_error`: their largest relative L2 change by the
    last quarter of the vectors; `time_step` [s] and `steps` of the load.
    """

    subspace: Subspace
    coordinates: Floats
    rates: Floats
    curves: Curves
    truncation_error: float
    time_step: float
    steps: int

    def state(self, sample: int) -> tuple[Floats, Floats]:
        """Displacement [m] and velocity [m/s] (n,) of all unknowns at a sample."""
        V = self.subspace.vectors
        return V @ self.coordinates[sample], V @ self.rates[sample]


@dataclass(frozen=True)
class Posing:
    """What the motion follows from beside the body; the load is linear between `times` [s].

    Every `every`-th of the times is a sample; `at_probes` takes nodal values to control points.
    """

    damping: Damping
    factor: Factor
    times: Floats
    every: int
    at_probes: csr_array

    def coordinates(self, subspace: Subspace) -> tuple[Floats, Floats]:
        """Coordinates and rates (samples, m)."""
        y, rate = superposition(subspace, self.damping, self.factor, self.times)
        return y[:: self.every], rate[:: self.every]

    def curves(self, subspace: Subspace) -> Curves:
        """The motion of the control points."""
        nodes, m = self.at_probes.shape[1], subspace.load.size
        shapes = (self.at_probes @ subspace.vectors.reshape(nodes, 3 * m)).reshape(-1, 3, m)
        return Curves(*(np.einsum("pdm,tm->tpd", shapes, y) for y in self.coordinates(subspace)))

    def change(self, subspace: Subspace) -> float:
        """Largest relative L2 change of a curve by the last quarter of the vectors."""
        whole = self.curves(subspace)
        fewer = self.curves(subspace.leading(max(1, (3 * subspace.load.size) // 4)))
        return max(
            float(np.linalg.norm(a[:, i] - b[:, i])) / max(float(np.linalg.norm(a[:, i])), TINY)
            for a, b in zip(whole, fewer, strict=True)
            for i in range(a.shape[1])
        )


def superposed(
    body: Body,
    damping: Damping,
    factor: Factor,
    recorder: Recorder,
    steps_per_sample: int,
    modes: int | None,
    advance: Advance,
) -> Superposed:
    """Motion by so many modes of vibration, or by as many Ritz vectors as it takes."""
    samples, every = recorder.observation.times, LOAD_STEPS * steps_per_sample
    times = np.linspace(samples[0], samples[-1], (len(samples) - 1) * every + 1)
    posing = Posing(damping, factor, times, every, recorder.at_probes)
    subspace = _ritz(body, posing, advance) if modes is None else _modal(body, modes)
    return Superposed(
        subspace,
        *posing.coordinates(subspace),
        posing.curves(subspace),
        posing.change(subspace),
        float(times[1] - times[0]),
        len(times) - 1,
    )


def _modal(body: Body, modes: int) -> Subspace:
    vectors = eigenvectors(body, solver(body), min(modes, body.stiffness.size - 2))
    return reduce(partial(extended, body), vectors.T, empty(body.stiffness.size))


def _ritz(body: Body, posing: Posing, advance: Advance) -> Subspace:
    """Load-dependent Ritz vectors, until the last ones change little."""
    found = extended(body, empty(body.stiffness.size), solver(body)(body.load))
    loose, limit = solver(body, LOOSE), min(MAX_VECTORS, body.stiffness.size)
    change = np.inf
    while found.load.size < limit and change > TRUNCATION:
        for _ in range(min(GROWTH, limit - found.load.size)):
            found = extended(body, found, loose(body.mass @ found.vectors[:, -1]))
        change = posing.change(found)
        advance(found.load.size / limit)
    return found
