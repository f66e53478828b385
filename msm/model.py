"""The mass-spring lattice as a model of the study: a body under the tool, from rest."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array, eye_array, kron
from scipy.sparse.linalg import cg, eigsh

from msm import lattice as cells
from msm.damping import Damping
from msm.kernel import Network, advance
from msm.laws import Law, initial_stiffness, largest_stiffness
from msm.springs import Springs, connect, stiffness_matrix
from study.contact import Foundation, ToolPatch
from study.mesh.quadrature import SurfaceRule
from study.organ.occupancy import Body
from study.trajectory import Observation, Trajectory, empty_trajectory

Floats = NDArray[np.float64]

STATIC_TOLERANCE = 1e-10
MAX_STEPS = 300_000

FAR = 1.0
"""A displacement of more than this many organ sizes is divergence, however finite."""


@dataclass(frozen=True)
class Assembly:
    """A lattice over an organ with its springs, support and load, whatever the springs' law.

    `mass` [kg] (n,); `foundation` [N/m] (n, n), acting alike along each axis; `load` [N] (n, 3).
    """

    lattice: cells.CellLattice
    springs: Springs
    mass: Floats
    foundation: csr_array
    load: Floats


@dataclass(frozen=True)
class Run:
    """Trajectory with what it took; `wall` [s] is the kernel alone, without compilation.

    `largest_strain`: largest absolute strain of a spring, `inverted_cells`: largest number of cells
    turned inside out, both over the samples.
    """

    trajectory: Trajectory
    time_step: float
    critical_time_step: float
    steps: int
    wall: float
    largest_strain: float
    inverted_cells: int


def assemble(
    body: Body,
    surface: SurfaceRule,
    density: float,
    spacing: float,
    foundation: Foundation,
    tool: ToolPatch,
    flexion: float = 0.0,
    body_diagonals: float = 0.0,
) -> Assembly:
    """Lattice over the body. ValueError if it is empty, not held, or not touched by the tool."""
    margin = 1e-9 * np.ptp(surface.points, axis=0).max()
    lower, upper = surface.points.min(axis=0) - margin, surface.points.max(axis=0) + margin
    lattice = cells.build(body, lower, upper, spacing)
    held = foundation.density(surface.points, surface.normals) * surface.weights
    pushed = tool.profile(surface.points, surface.normals) * surface.weights
    if not held.any():
        raise ValueError("the support holds no surface; enlarge support.depth")
    if not pushed.any():
        raise ValueError("the tool touches no surface; move tool.place or enlarge tool.radius")
    weights, _ = cells.interpolation(lattice, surface.points)
    support = csr_array(weights.T @ diags_array(held) @ weights)
    nodal = weights.T @ (pushed * tool.force / pushed.sum())
    return Assembly(
        lattice,
        connect(lattice, flexion, body_diagonals),
        density * cells.node_volumes(lattice),
        support,
        np.outer(nodal, tool.direction),
    )


def critical_time_step(assembly: Assembly, law: Law) -> float:
    """Largest stable step [s] of the undamped lattice, 2 / omega_max, at the law's largest slope.

    Implicit damping only lengthens it. It is the limit at rest: springs pressed to half their
    length are stiffer across than along and may fail below it.
    """
    stiffness = _stiffness(assembly, largest_stiffness(law))
    count = len(assembly.mass)
    scale = diags_array(np.repeat(1.0 / np.sqrt(assembly.mass), 3))
    start = np.random.default_rng(0).standard_normal(3 * count)
    operator = csc_array(scale @ stiffness @ scale)
    omega_squared = eigsh(operator, k=1, which="LA", v0=start, return_eigenvectors=False)
    return float(2.0 / np.sqrt(omega_squared[0]))


def static_displacement(assembly: Assembly, law: Law) -> Floats:
    """Displacement [m] (n, 3) at rest under the full load, springs linearised at rest."""
    stiffness = _stiffness(assembly, initial_stiffness(law))
    # Factors of a 3-D lattice fill in: at 20 000 nodes they take gigabytes. The lattice is well
    # conditioned but for a stiff support, which the diagonal takes care of.
    found, failed = cg(
        stiffness,
        assembly.load.ravel(),
        rtol=STATIC_TOLERANCE,
        maxiter=20 * len(assembly.mass),
        M=diags_array(1.0 / stiffness.diagonal()),
    )
    if failed:
        raise ValueError("the lattice finds no rest: the support does not hold it")
    return np.asarray(found.reshape(-1, 3))


def _stiffness(assembly: Assembly, k_ref: float) -> csr_array:
    """Stiffness [N/m] (3 n, 3 n) of springs and support at rest."""
    springs = stiffness_matrix(assembly.springs, len(assembly.mass), k_ref)
    return csr_array(springs + kron(assembly.foundation, eye_array(3)))


def run(
    assembly: Assembly,
    law: Law,
    damping: Damping,
    factor: Callable[[Floats], Floats],
    observation: Observation,
    step_fraction: float,
    refinement: int = 1,
    on_progress: Callable[[float], None] = lambda _: None,
) -> Run:
    """Motion from rest with steps of at most `step_fraction` of the critical one.

    `refinement` divides those steps, whatever their length. ValueError if there would be too many.
    """
    critical = critical_time_step(assembly, law)
    interval = float(observation.times[1] - observation.times[0])
    per_sample = refinement * int(np.ceil(interval / (step_fraction * critical) - 1e-9))
    if per_sample * len(observation.times) > MAX_STEPS:
        raise ValueError(
            f"the lattice needs {per_sample * len(observation.times):.2g} steps of at most "
            f"{step_fraction * critical:.2g} s, the limit is {MAX_STEPS:.0e}: reduce "
            "time.duration or support.stiffness, or enlarge lattice.spacing"
        )
    dt = interval / per_sample
    net = _network(assembly, damping)
    advance(law, net, np.zeros(0), dt, *np.zeros((2, *net.load.shape)))  # compiles, or loads
    trajectory, wall, strain, inverted = _march(
        net, law, factor, observation, assembly, per_sample, on_progress
    )
    steps = per_sample * (len(observation.times) - 1)
    return Run(trajectory, dt, critical, steps, wall, strain, inverted)


def _network(assembly: Assembly, damping: Damping) -> Network:
    foundation, springs = assembly.foundation, assembly.springs
    length = springs.rest_length
    return Network(
        ends=np.ascontiguousarray(springs.ends, dtype=np.int32),
        rest=np.ascontiguousarray(springs.rest),
        length=length,
        scale=springs.weight * length,
        mass=assembly.mass,
        gamma_0=damping.gamma_0 * assembly.mass,
        gamma_1=damping.gamma_1 * assembly.mass,
        row=foundation.indptr.astype(np.int32),
        column=foundation.indices.astype(np.int32),
        value=foundation.data,
        load=np.ascontiguousarray(assembly.load),
    )


def _march(
    net: Network,
    law: Law,
    factor: Callable[[Floats], Floats],
    observation: Observation,
    assembly: Assembly,
    per_sample: int,
    on_progress: Callable[[float], None],
) -> tuple[Trajectory, float, float, int]:
    """Trajectory, time in the kernel [s], largest spring strain, most cells inverted at once."""
    u, v = np.zeros_like(net.load), np.zeros_like(net.load)
    wall, largest, inverted = 0.0, 0.0, 0
    recorder = _Recorder(assembly.lattice, observation)
    limit = FAR * float(np.ptp(assembly.lattice.nodes, axis=0).max())
    times = observation.times
    dt = float(times[1] - times[0]) / per_sample
    recorder.record(0, u, v)
    for sample in range(1, len(times)):
        # The load at the end of each step, as the position it drives.
        ends = times[sample - 1] + dt * np.arange(1, per_sample + 1)
        factors = factor(ends)
        started = time.perf_counter()
        advance(law, net, factors, dt, u, v)
        wall += time.perf_counter() - started
        size = np.abs(u).max(axis=1)
        if not (size < limit).all():
            worst = int(np.argmax(np.where(np.isnan(size), np.inf, size)))
            diverged = replace(
                recorder.trajectory,
                status="diverged",
                diverged_at=float(times[sample]),
                diverged_near=assembly.lattice.nodes[worst],
            )
            return diverged, wall, largest, inverted
        recorder.record(sample, u, v)
        largest = max(largest, _largest_strain(net, u))
        inverted = max(inverted, cells.inverted_cells(assembly.lattice, u))
        on_progress(sample / (len(times) - 1))
    return recorder.trajectory, wall, largest, inverted


def _largest_strain(net: Network, u: Floats) -> float:
    """Largest absolute strain of the springs."""
    stretched = net.rest + u[net.ends[:, 1]] - u[net.ends[:, 0]]
    return float(np.abs(np.linalg.norm(stretched, axis=1) / net.length - 1.0).max())


class _Recorder:
    """Writes what is observed into the arrays of a trajectory."""

    def __init__(self, lattice: cells.CellLattice, observation: Observation) -> None:
        self.frames = observation.frames
        self.trajectory = empty_trajectory(observation)
        self.at_probes, _ = cells.interpolation(lattice, observation.probes)
        self.in_volume, _ = cells.interpolation(lattice, observation.volume_points)
        self.on_surface, _ = cells.interpolation(lattice, observation.surface_points)

    def record(self, sample: int, u: Floats, v: Floats) -> None:
        """Keep the motion at one sample."""
        self.trajectory.displacement[sample] = self.at_probes @ u
        self.trajectory.velocity[sample] = self.at_probes @ v
        for i, frame in enumerate(self.frames):  # the peak may be the last sample too
            if frame == sample:
                self.trajectory.volume_field[i] = self.in_volume @ u
                self.trajectory.surface_field[i] = self.on_surface @ u
