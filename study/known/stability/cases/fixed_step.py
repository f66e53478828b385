"""A fixed step beyond the limit diverges at the step and place that a dense computation predicts.

The run checks every step, and the dense computation shares none of its kernels: it has matrices of
the lattice and the textbook form of each integrator. So the step of divergence must agree exactly,
and below the limit the motion must agree to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material
from msm.model import DIVERGED_SIZE, Fixed, Rate, critical_time_step, run
from msm.statics import stiffness_at_rest
from study.known.case import Case, Family
from study.known.finding import Finding, beside, value
from study.known.stability.bodies import Make, lattice_of, watch
from study.known.stability.growth import EXPLICIT
from study.known.stability.modes import split_limit

Floats = NDArray[np.float64]
Step = Callable[[Floats, Floats], tuple[Floats, Floats]]

STEPS = 400
ROUNDING = 1e-9
PRESSURES = 1e-5
"""Error of the displacement due to the iterative solver of the split integrator."""
FAMILY = Family("fixed step", __name__)


def cases() -> Iterator[Case]:
    """Cases of steps below and beyond the limit, and of steps that are refused."""
    for name in EXPLICIT:
        for times in (0.98, 1.02, 1.5, 10.0):
            yield FAMILY.case(
                f"{times:g} of the limit: {name}",
                "held",
                {"integrator": name, "times": times},
                PRESSURES if name == "split-volume" else ROUNDING,
                expected="bounded" if times < 1.0 else "diverged",
                quick=times in (0.98, 1.02),
            )
    for title, kind, size, says in (
        ("a step that does not divide the samples", "seconds", 3e-3, r"step\.seconds.*take"),
        ("a step of zero", "seconds", 0.0, r"step\.seconds must be positive"),
        ("a negative rate", "hertz", -1.0, r"step\.hertz must be positive"),
        ("a step that is not a number", "seconds", None, r"step\.seconds must be positive"),
        ("ten million steps", "hertz", 1e8, r"the limit is 3e\+05"),
    ):
        yield FAMILY.case(title, "asked", {kind: size}, says)


def held(integrator: str, times: float) -> Finding:
    """A linear lattice under an uneven load at `times` its critical step."""
    assembly, material = _uneven()
    limit = critical_time_step(assembly, material, integrator)
    if integrator == "split-volume":  # the run uses the conservative limit of springs alone
        limit = split_limit(assembly, material)
    dt = times * limit
    far = DIVERGED_SIZE * float(np.ptp(assembly.lattice.nodes, axis=0).max())
    seen = watch(assembly, STEPS * dt, STEPS + 1)
    dt = float(seen.times[1] - seen.times[0])
    found = run(
        assembly, material, np.ones_like, seen, Fixed(dt), integrator=integrator, linear=True
    ).trajectory
    count, u = _march(_dense(integrator, assembly, material, dt), len(assembly.mass), far)
    if found.ended_at is None or found.ended_near is None:
        return beside(u, found.displacement[-1], "bounded")
    node = int(np.abs(u).max(axis=1).argmax())
    if not (assembly.lattice.nodes[node] == found.ended_near).all():
        return Finding("error", message=f"not at node {node} but near {found.ended_near}")
    return value(count * dt, found.ended_at, f"step {count}, node {node}", "diverged")


def asked(seconds: float | None = 0.0, hertz: float | None = None) -> Finding:
    """A run with an inadmissible step."""
    assembly, material = _uneven()
    step = Fixed(float("nan") if seconds is None else seconds) if hertz is None else Rate(hertz)
    found = run(assembly, material, np.ones_like, watch(assembly, 0.1, 11), step)
    return value(0.0, float(found.steps))


def _uneven() -> tuple[Assembly, Material]:
    """A load without symmetry, which excites every mode."""
    assembly, material = lattice_of(Make(counts=(2, 2, 2), poisson_ratio=0.45))
    load = np.random.default_rng(1).standard_normal(assembly.load.shape)
    return replace(assembly, load=1e-4 * load), material


def _march(step: Step, nodes: int, far: float) -> tuple[int, Floats]:
    """Number of steps until a component of u exceeds `far`, at most STEPS, and u (n, 3) then."""
    u, v = np.zeros((2, 3 * nodes))
    count = 0
    while count < STEPS and np.abs(u).max() < far:
        u, v = step(u, v)
        count += 1
    return count, u.reshape(-1, 3)


def _dense(name: str, assembly: Assembly, material: Material, dt: float) -> Step:
    """One step of an undamped integrator by matrices, in textbook form."""
    inverse = 1.0 / np.repeat(assembly.mass, 3)
    K = inverse[:, None] * stiffness_at_rest(assembly, material).toarray()
    b = inverse * assembly.load.ravel()
    if name == "symplectic-euler":
        return lambda u, v: (u + dt * (w := v + dt * (b - K @ u)), w)
    if name == "velocity-verlet":
        return lambda u, v: _verlet(K, b, dt, u, v)
    if name == "runge-kutta-4":
        return lambda u, v: _taylor(K, b, dt, u, v)
    springs = inverse[:, None] * stiffness_at_rest(assembly, Material(material.law)).toarray()
    implicit = np.linalg.inv(np.eye(len(K)) + dt**2 * (K - springs))
    return lambda u, v: (u + dt * (w := implicit @ (v + dt * (b - K @ u))), w)


def _verlet(K: Floats, b: Floats, dt: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    half = v + 0.5 * dt * (b - K @ u)
    there = u + dt * half
    return there, half + 0.5 * dt * (b - K @ there)


def _taylor(K: Floats, b: Floats, dt: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """The four stages of Runge-Kutta on a linear problem: the first four terms of its series."""
    du, dv = v, b - K @ u
    at, speed, share = u, v, 1.0
    for k in range(1, 5):
        share *= dt / k
        at, speed = at + share * du, speed + share * dv
        du, dv = dv, -K @ du
    return at, speed
