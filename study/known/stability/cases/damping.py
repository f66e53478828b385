"""Free motion of single modes under damping, from none to far above critical, in closed form.

Mass-proportional and stiffness-proportional damping leave modes uncoupled: each is an oscillator
with its own frequency w and ratio zeta = (alpha / w + beta w) / 2. The lattice is released in the
shape of its slowest or fastest mode, the single control point at rest under a constant force.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msm import control_point
from msm.assembly import arrays
from msm.damping import NodalDamping
from msm.integrators import INTEGRATORS
from msm.laws import Hooke
from study.known.case import Case, Family
from study.known.finding import Finding, beside
from study.known.stability.bodies import Make, lattice_of
from study.known.stability.modes import shapes

Floats = NDArray[np.float64]

STEP = 2e-3
"""Phase angle [rad] per step; symplectic Euler has an error of half of it, in damping too."""
PERIODS, LOOKS = 2.0, 50
CLOSE, SOLVED = STEP, 1e-6
FAMILY = Family("damping", __name__, quick=True)


def cases() -> Iterator[Case]:
    """Cases of both parts of Rayleigh damping, and of the control point up to a zeta of 12."""
    for which in ("slowest", "fastest"):
        for alpha, beta in ((0.0, 0.0), (0.05, 0.0), (3.0, 0.0), (0.0, 0.05), (0.5, 0.5)):
            title = f"{which} mode, ratios {alpha:g} by mass and {beta:g} by stiffness"
            settings = {"which": which, "by_mass": alpha, "by_stiffness": beta}
            yield FAMILY.case(title, "rings", settings, CLOSE)
    for zeta in (0.0, 0.05, 1.0, 3.0, 12.0):
        yield FAMILY.case(f"control point, ratio {zeta:g}", "pushed", {"zeta": zeta}, SOLVED)


def rings(which: str, by_mass: float, by_stiffness: float) -> Finding:
    """Coordinate of one mode, released at 1."""
    assembly, material = lattice_of(Make(counts=(2, 2, 2), poisson_ratio=0.45))
    omegas, vectors = shapes(assembly, material)
    index = 0 if which == "slowest" else -1
    omega, mode = float(omegas[index]), vectors[:, index].reshape(-1, 3)
    damping = NodalDamping(2.0 * by_mass * omega, beta=2.0 * by_stiffness / omega)
    net = arrays(assembly, replace(material, damping=damping), linear=True)
    dt, method = STEP / omega, INTEGRATORS["symplectic-euler"]
    per_look = round(2.0 * np.pi * PERIODS / (LOOKS * STEP))
    u, v, found = mode.copy(), np.zeros_like(mode), []
    for _ in range(LOOKS):
        method.advance(material.law, net, np.zeros((per_look, 1)), dt, u, v)
        found.append(float((net.mass[:, None] * mode * u).sum()))
    times = np.asarray(dt * per_look * np.arange(1, LOOKS + 1), dtype=np.float64)
    return beside(released(omega, by_mass + by_stiffness, times), np.array(found))


def pushed(zeta: float) -> Finding:
    """Displacement of the control point under a step force, over the static one."""
    k, mass, force = 20.0, 1e-3, 1e-4
    omega = float(np.sqrt(k / mass))
    times = np.linspace(0.0, 2.0 * np.pi * PERIODS / omega, LOOKS)
    damping = NodalDamping(2.0 * zeta * omega)
    found = control_point.run(Hooke(k), 1.0, mass, damping, lambda _: force, times)
    return beside(1.0 - released(omega, zeta, times), found.displacement[:, 0, 0] * k / force)


def released(omega: float, zeta: float, t: Floats) -> Floats:
    """Oscillator released at 1, by the roots s of s^2 + 2 zeta w s + w^2 or their limit."""
    if zeta == 1.0:
        return np.asarray((1.0 + omega * t) * np.exp(-omega * t))
    root = np.sqrt(complex(zeta**2 - 1.0))
    a, b = omega * (-zeta + root), omega * (-zeta - root)
    return np.asarray(((a * np.exp(b * t) - b * np.exp(a * t)) / (a - b)).real)
