"""Frequencies by dense matrices, and the sharp critical step of each integrator for them.

With mass-proportional damping c, equal for all nodes, and Rayleigh's beta, modes stay uncoupled,
u'' + (c + beta w^2) u' + w^2 u = 0. Each is a two-term recurrence whose roots leave the unit circle
at a known step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material
from msm.statics import stiffness_at_rest

Floats = NDArray[np.float64]


def frequencies(assembly: Assembly, material: Material) -> Floats:
    """All frequencies [rad/s] of a small lattice at rest, ascending; zero for rigid motions."""
    return shapes(assembly, material)[0]


def shapes(assembly: Assembly, material: Material) -> tuple[Floats, Floats]:
    """Frequencies [rad/s] and mass-normalised modes, the columns of (3 n, 3 n)."""
    squares, vectors = np.linalg.eigh(_over_mass(assembly, material))
    root = np.sqrt(np.repeat(assembly.mass, 3))
    return np.sqrt(np.clip(squares, 0.0, None)), vectors / root[:, None]


def sharp_limit(integrator: str, omega: Floats, c: float, beta: float) -> float:
    """Critical step [s] of an explicit integrator for modes of frequencies omega [rad/s].

    `c` [1/s], `beta` [s]. ValueError for an integrator without such a theory here.
    """
    omega = omega[omega > 1e-6 * omega.max()]
    if integrator == "symplectic-euler":
        # A root at -1: w^2 dt^2 + 2 (beta w^2 - c) dt = 4, damping to ground at the end of a step.
        lead = beta * omega**2 - c
        return float(((np.sqrt(lead**2 + 4.0 * omega**2) - lead) / omega**2).min())
    if integrator == "velocity-verlet":
        return float(2.0 / omega.max())  # half the damping before and half after: none in the limit
    if integrator == "runge-kutta-4":
        return min(_runge_kutta_limit(w, c) for w in omega)
    raise ValueError(f"no sharp limit is known for {integrator}")


def split_limit(assembly: Assembly, material: Material) -> float:
    """Critical step [s] with springs explicit, volume term implicit, without damping.

    (M + dt^2 K_v) v' = M v - dt (K_s + K_v) u, u' = u + dt v' has a root of -1 where dt^2 (K_s -
    K_v) u = 4 M u.
    """
    springs = _over_mass(assembly, Material(material.law))
    volume = _over_mass(assembly, material) - springs
    return float(2.0 / np.sqrt(np.linalg.eigvalsh(springs - volume)[-1]))


def _over_mass(assembly: Assembly, material: Material) -> Floats:
    """M^-1/2 K M^-1/2 of a lattice at rest."""
    root = np.sqrt(np.repeat(assembly.mass, 3))
    return np.asarray(stiffness_at_rest(assembly, material).toarray() / np.outer(root, root))


def _runge_kutta_limit(omega: float, c: float) -> float:
    """Where |1 + z + z^2/2 + z^3/6 + z^4/24| = 1 for a root z / dt of the mode, by bisection."""
    roots = np.roots([1.0, c, omega**2]).astype(np.complex128)
    low, high = 0.0, 4.0 / float(np.abs(roots).max())  # outside the region, whatever the angle
    for _ in range(50):
        middle = 0.5 * (low + high)
        z = roots * middle
        grown = np.abs(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))).max()
        low, high = (middle, high) if grown <= 1.0 + 1e-12 else (low, middle)
    return low
