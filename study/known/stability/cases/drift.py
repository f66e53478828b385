"""Energy over a million undamped steps: it may oscillate, but must not leave its band or drift.

Symplectic integrators conserve a modified energy near the true one, so that the true one oscillates
by (omega dt)^2. The drift is the slope of the mean over a hundred stretches, whose scatter gives
the slope its standard error. The first fifth is omitted: until the rough initial state has spread
over all modes, the distance of the two energies changes. What remains of that, in the nonlinear
lattice at nu 0.45, grows fourfold for twice the step, as a distance does and a drift does not.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from msm.assembly import arrays
from msm.forces import internal_forces
from msm.integrators import INTEGRATORS
from msm.laws import initial_stiffness
from msm.model import critical_time_step
from study.known.case import Case, Family
from study.known.finding import Finding
from study.known.stability import energy
from study.known.stability.bodies import Make, lattice_of

Floats = NDArray[np.float64]

STRETCHES = 100
LOOKS = 100
"""Energies per stretch, over which the mean is taken."""
SETTLING = 25
"""Stretches that are left out before those whose drift is measured."""
SHARE = 0.1
"""Time step over the critical one."""
RESOLVED = 1e-3
"""Relative drift over the whole run that must be detected."""
ERRORS = 4.0
"""Standard errors by which a slope may differ from zero."""
FAMILY = Family("energy drift", __name__)


def cases() -> Iterator[Case]:
    """Cases of both symplectic integrators, in long runs and in short ones."""
    for name in ("symplectic-euler", "velocity-verlet"):
        for nu in (None, 0.45):
            for linear in (True, False):
                yield _case(name, nu, linear=linear, steps=1_000_000)
        yield _case(name, 0.45, linear=False, steps=25_000)


def _case(name: str, nu: float | None, *, linear: bool, steps: int) -> Case:
    springs = "springs" if nu is None else f"nu {nu:g}"
    return FAMILY.case(
        f"{steps} steps, {springs}, {'linear' if linear else 'nonlinear'}: {name}",
        "drifting",
        {"integrator": name, "nu": nu, "linear": linear, "steps": steps},
        RESOLVED,
        expected="bounded",
        quick=steps < 1e5,
    )


def drifting(integrator: str, nu: float | None, *, linear: bool, steps: int) -> Finding:
    """A block released from a rough state, in steps of a tenth of the limit."""
    energies = history(integrator, nu, linear=linear, steps=steps)
    return verdict(energies)


def history(integrator: str, nu: float | None, *, linear: bool, steps: int) -> Floats:
    """Energies [J] (STRETCHES, LOOKS) of a motion that strains springs by some tenths."""
    assembly, material = lattice_of(Make(counts=(2, 2, 2), poisson_ratio=nu))
    dt = SHARE * critical_time_step(assembly, material, integrator)
    net, method = arrays(assembly, material, linear=linear), INTEGRATORS[integrator]
    u = 0.03 * net.spacing * np.random.default_rng(2).standard_normal(net.load.shape)
    v = np.zeros_like(u)
    k = initial_stiffness(material.law)
    found = np.empty((SETTLING + STRETCHES, LOOKS))
    factors, force = np.zeros((steps // found.size, len(method.at))), np.empty_like(u)
    for i in range(found.size):
        method.advance(material.law, net, factors, dt, u, v)
        at_once = v
        if integrator == "symplectic-euler":  # its velocities are staggered by half a step
            internal_forces(material.law, net, u, force)
            at_once = v + 0.5 * dt * force / net.mass[:, None]
        found.flat[i] = energy.kinetic(net, at_once) + energy.potential(k, net, u)
    return found[SETTLING:]


def verdict(energies: Floats) -> Finding:
    """The predicted drift is none; measured is its slope over the run, over the mean energy.

    The difference is the part of the slope beyond ERRORS of its standard error. A run that leaves
    its band, which its first tenth defines, counts in full.
    """
    mean = float(energies.mean())
    x = np.linspace(-0.5, 0.5, len(energies))
    y = energies.mean(axis=1) / mean
    slope = float(x @ y / (x @ x))
    scatter = y - y.mean() - slope * x
    error = float(np.sqrt(scatter @ scatter / (len(x) - 2) / (x @ x)))
    early = np.ptp(energies[: len(energies) // 10])
    band = float(np.ptp(energies) / early) if early else np.inf
    message = f"slope {slope:.1e} +- {error:.1e} over the run; {band:.2f} times its first band"
    beyond = max(0.0, abs(slope) - ERRORS * error)
    difference = beyond if band < 3.0 and error < RESOLVED / 2.0 else np.inf
    return Finding("bounded", 0.0, slope, difference, message)
