"""Steps far beyond the explicit limit: convergence to rest, energy conservation, or boundedness.

Implicit Euler ends at the static solution, found for the linear lattice by conjugate gradients and
for the nonlinear one by relaxation. Implicit midpoint conserves energy. Position-based dynamics
becomes softer with the step, never stiffer: each part returns only 1 / (1 + (omega dt)^2) of its
force.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material, arrays
from msm.damping import UNDAMPED, NodalDamping
from msm.integrators import INTEGRATORS
from msm.laws import initial_stiffness
from msm.model import Fixed, critical_time_step, run
from msm.network import Network
from msm.relaxation import relax
from msm.statics import static_displacement
from study.known.case import Case, Family
from study.known.finding import Ending, Finding, at_most, beside, value
from study.known.stability import energy
from study.known.stability.bodies import Make, lattice_of, watch
from study.problem.trajectory import Trajectory

Floats = NDArray[np.float64]

TIMES = (10.0, 100.0, 1e3, 1e4)
SOLVED = 1e-6
"""Error of the displacement by Newton's method and by relaxation."""
SHORT = 1e-3
"""(omega dt)^2 at 0.02 of the limit: the share of a force that a short step does not return."""
FAMILY = Family("long steps", __name__)


def cases() -> Iterator[Case]:
    """Cases of each integrator without a limit, by the length of its steps."""
    for times in TIMES:
        long, quick = f"{times:g} times the explicit limit", times == 1e3
        bounded = partial(FAMILY.case, expected="bounded", quick=quick)
        for linear in (True, False):
            kind = "linear" if linear else "nonlinear"
            settings = {"times": times, "linear": linear}
            title = f"{long}, {kind}, to rest: implicit-euler"
            yield FAMILY.case(title, "to_rest", settings, SOLVED)
            yield bounded(f"{long}, {kind}: xpbd", "softened", settings, 0.0)
        title = f"{long}, linear, energy kept: implicit-midpoint"
        yield bounded(title, "kept", {"times": times}, SOLVED)
    title = "0.02 times the explicit limit, linear, to rest: xpbd"
    yield FAMILY.case(title, "to_rest_by_position", {"times": 0.02}, SHORT)
    for times in (1e3, 1e4):
        title = f"{times:g} times the explicit limit, moved by more than its size: xpbd"
        yield FAMILY.case(title, "called_lost", {"times": times}, SOLVED, expected="diverged")


def to_rest(times: float, *, linear: bool) -> Finding:
    """Implicit Euler under a constant load, until the motion has stopped."""
    assembly, material = _loaded()
    u, _ = _march("implicit-euler", assembly, material, times, 600, linear=linear)
    if linear:
        rest = static_displacement(assembly, material)
    else:
        rest, _ = relax(material.law, arrays(assembly, material))
    return beside(rest, u)


def to_rest_by_position(times: float) -> Finding:
    """Position-based dynamics in short steps, damped until the motion has stopped."""
    assembly, material = _loaded(NodalDamping(60.0))
    u, _ = _march("xpbd", assembly, material, times, 60_000, linear=True)
    return beside(static_displacement(assembly, material), u)


def kept(times: float) -> Finding:
    """Energy of implicit midpoint under a constant load from rest, over the work of the load."""
    assembly, material = _loaded()
    net = arrays(assembly, material, linear=True)
    u, v = _march("implicit-midpoint", assembly, material, times, 200, linear=True)
    total = energy.kinetic(net, v) + energy.potential(initial_stiffness(material.law), net, u)
    work = abs(float((net.load * static_displacement(assembly, material)).sum()))
    return value(0.0, total / work, "total energy over the static work of the load", "bounded")


def softened(times: float, *, linear: bool) -> Finding:
    """Work of the load up to the rest of position-based dynamics: bounded, above the static one.

    The bound is the static work over the smallest share of a force that is returned.
    """
    assembly, material = _loaded(NodalDamping(20.0))
    net = arrays(assembly, material, linear=linear)
    u, _ = _march("xpbd", assembly, material, times, 4000, linear=linear)
    rest = static_displacement(assembly, material)
    work, static = (float((net.load * d).sum()) for d in (u, rest))
    dt = times * critical_time_step(assembly, material)
    softest = 1.0 + dt**2 * fastest_part(net, initial_stiffness(material.law))
    found = at_most(softest * static, work, f"{work / static:.4g} times as soft as at rest")
    return found if work >= (1.0 - SOLVED) * static else replace(found, ending="error")


def fastest_part(net: Network, k: float) -> float:
    """Largest frequency squared [1/s^2] of a spring, a cell or a support alone."""
    i, j = net.ends.T.astype(int)
    lightness = 1.0 / net.mass
    springs = k * net.scale / net.length * (lightness[i] + lightness[j])
    per_corner = 3.0 * net.bulk / (4.0 * net.spacing) ** 2
    cells = per_corner * lightness[net.cells.astype(int)].sum(axis=1)
    support = net.value * lightness[net.column.astype(int)]  # here a diagonal
    return float(max(springs.max(), cells.max(), support.max()))


def called_lost(times: float) -> Finding:
    """A run whose body moves by more than its size counts as diverged."""
    assembly, material = _loaded()
    dt = times * critical_time_step(assembly, material)
    seen = watch(assembly, 100 * dt, 101)
    step = Fixed(float(seen.times[1]))
    found = run(assembly, material, np.ones_like, seen, step, integrator="xpbd").trajectory
    lost = np.isnan(found.displacement).any(axis=(1, 2))
    first = int(lost.argmax()) * step.seconds
    return value(first, found.ended_at or 0.0, "first sample without a number", _ending(found))


def _ending(found: Trajectory) -> Ending:
    return "diverged" if found.status == "diverged" else "bounded"


def _loaded(damping: NodalDamping = UNDAMPED) -> tuple[Assembly, Material]:
    """A block under a tenth of its own weight, at nu 0.45."""
    return lattice_of(Make(poisson_ratio=0.45, gravity=1.0, damping=damping))


def _march(
    name: str, assembly: Assembly, material: Material, times: float, count: int, *, linear: bool
) -> tuple[Floats, Floats]:
    net, method = arrays(assembly, material, linear=linear), INTEGRATORS[name]
    dt = times * critical_time_step(assembly, material)
    u, v = np.zeros((2, *net.load.shape))
    method.advance(material.law, net, np.ones((count, len(method.at))), dt, u, v)
    return u, v
