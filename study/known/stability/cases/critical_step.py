"""The critical step, predicted and measured over the range of every parameter it depends on.

Without damping the prediction is the limit that a run's step follows. Damping extends the limit
where it is implicit and shortens that of Runge-Kutta, and an implicit volume term stabilises the
springs slightly. A run does not use such extensions, and is conservative about reductions. In these
cases the sharp theoretical limit is compared with the measurement, and the run's limit must not
exceed the measured one either.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array

from msm.assembly import Assembly, Material, arrays
from msm.damping import NodalDamping, eq_2
from msm.integrators import INTEGRATORS
from msm.laws import Basafa, initial_stiffness
from msm.model import critical_time_step
from msm.stability import bounding, cell_bound, largest_frequency, longest_step
from msm.tetrahedra import assemble as springs_on
from study.known.case import Case, Family
from study.known.finding import Finding, value
from study.known.pressed import DOWN
from study.known.stability.bodies import Make, lattice_of
from study.known.stability.growth import EXPLICIT, longest_stable_step, measured_limit
from study.known.stability.modes import frequencies, sharp_limit, split_limit
from study.mesh.quadrature import over_surface
from study.mesh.tetrahedra import boundary
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch

PLAIN = ("symplectic-euler", "velocity-verlet", "runge-kutta-4")
AGREEMENT = 5e-3
"""Bisection leaves 1e-3, growth slowed by damping another 1e-3, the frequency 5e-4."""
FAMILY = Family("critical step", __name__)


def cases() -> Iterator[Case]:
    """Cases by stiffness, density, Poisson ratio, damping, law and deformed state."""
    for name in EXPLICIT:
        split = name == "split-volume"
        function, nu = ("split", 0.45) if split else ("undamped", None)
        for modulus in (1.0, 1e2, 1e4, 1e6):
            title = f"E {modulus:g} Pa"
            yield _case(title, name, function, youngs_modulus=modulus, poisson_ratio=nu)
        for density in (1e-1, 1e1, 1e3, 1e5):
            title = f"density {density:g} kg/m3"
            yield _case(title, name, function, density=density, poisson_ratio=nu)
        for ratio in (0.25, 0.3, 0.4, 0.45, 0.49, 0.499, 0.4999):
            yield _case(f"nu {ratio:g} by volume term", name, function, poisson_ratio=ratio)
    for name in PLAIN:
        for zeta in (0.05, 0.3, 1.0, 3.0, 12.0):
            yield _case(f"damping ratio {zeta:g}", name, "damped", zeta=zeta)
    for beta in (1e-5, 1e-3, 1e-1):
        title = f"Rayleigh damping, beta {beta:g} s"
        yield _case(title, "symplectic-euler", "damped", zeta=0.3, beta=beta)
    for name in PLAIN:
        yield _case("30 % stretched, nu 0.45", name, "deformed", stretch=1.3)
        yield _case("30 % compressed, nu 0.45", name, "deformed", stretch=0.7)
    yield _case("springs of the benchmark", "symplectic-euler", "benchmark")
    yield _case("springs on tetrahedra", "symplectic-euler", "on_tetrahedra")
    for nu in (0.25, 0.45, 0.4999):
        yield _case(f"free single cell, closed form, nu {nu:g}", "velocity-verlet", "cell", nu=nu)


def _case(title: str, integrator: str, function: str = "undamped", **arguments: Any) -> Case:
    return FAMILY.case(
        f"{title}: {integrator}",
        function,
        {"integrator": integrator} | arguments,
        AGREEMENT,
        quick="E 1 Pa" in title or "0.4999" in title or "ratio 12" in title or "stretch" in title,
    )


def undamped(integrator: str, **make: Any) -> Finding:
    """The limit at rest of a block of springs, with or without a volume term."""
    assembly, material = lattice_of(Make(**make))
    predicted = critical_time_step(assembly, material, integrator)
    return value(predicted, _measured(assembly, material, integrator, predicted))


def damped(integrator: str, zeta: float, beta: float = 0.0) -> Finding:
    """The sharp limit with nodal damping of ratio zeta, eq. (2), and Rayleigh's beta [s]."""
    make = Make()
    assembly, material = lattice_of(make)
    c = eq_2(zeta, initial_stiffness(material.law), make.density * make.spacing**3).gamma_0
    material = replace(material, damping=NodalDamping(c, beta=beta))
    followed = critical_time_step(assembly, material, integrator)
    sharp = sharp_limit(integrator, frequencies(assembly, material), c, beta)
    measured = _measured(assembly, material, integrator, sharp)
    return _sharp(sharp, measured, followed)


def split(integrator: str, **make: Any) -> Finding:
    """The sharp limit with an implicit volume term."""
    assembly, material = lattice_of(Make(counts=(2, 2, 2), **make))
    followed = critical_time_step(assembly, material, integrator)
    measured = _measured(assembly, material, integrator, followed)
    return _sharp(split_limit(assembly, material), measured, followed)


def _sharp(sharp: float, measured: float, followed: float) -> Finding:
    """Theory beside measurement; the limit that a run follows must not exceed the measurement."""
    found = value(sharp, measured, f"a run takes {followed / measured:.3f} of it for the limit")
    return replace(found, difference=max(found.difference or 0.0, followed / measured - 1.0))


def deformed(integrator: str, stretch: float) -> Finding:
    """The limit about a stretched state, made an equilibrium by a load that balances its forces.

    A support of every node keeps the state from buckling, at any step.
    """
    from msm.forces import internal_forces

    assembly, material = lattice_of(Make(poisson_ratio=0.45))
    everywhere = csr_array(diags_array(np.full(len(assembly.mass), 200.0)))
    assembly = replace(assembly, foundation=everywhere)
    about = (stretch - 1.0) * assembly.lattice.nodes * [0.0, 0.0, 1.0]
    net, force = arrays(assembly, material), np.zeros_like(about)
    internal_forces(material.law, net, about, force)
    net, method = net._replace(load=-force), INTEGRATORS[integrator]
    omega, _ = largest_frequency(material.law, bounding(net, method), about)
    predicted = longest_step(method, omega, 0.0)
    measured = longest_stable_step(material.law, net, method, predicted, about, _steps(integrator))
    return value(predicted, measured)


def benchmark(integrator: str) -> Finding:
    """The limit at rest of springs of eq. (6), for motions small enough to be linear."""
    assembly, material = lattice_of(Make())
    material = replace(material, law=Basafa(8.0, 1600.0, 0.2))
    predicted = critical_time_step(assembly, material, integrator)
    return value(predicted, _measured(assembly, material, integrator, predicted, linear=False))


def on_tetrahedra(integrator: str) -> Finding:
    """The limit at rest of springs along the edges of a mesh."""
    mesh = block_mesh((0.03, 0.03, 0.03), 0.01)
    tool = ToolPatch(np.array([0.015, 0.015, 0.03]), DOWN, 0.02, 0.1)
    surface = over_surface(boundary(mesh), 3)
    assembly = springs_on(mesh, surface, 1054.0, Foundation(DOWN, 0.0, 1e-3, 1e5), tool)
    _, material = lattice_of(Make())
    predicted = critical_time_step(assembly, material, integrator)
    return value(predicted, _measured(assembly, material, integrator, predicted))


def cell(integrator: str, nu: float) -> Finding:
    """One free cell against the closed form of its breathing mode, h sqrt(rho / (3 K))."""
    make = Make(counts=(1, 1, 1), poisson_ratio=nu, held=False)
    assembly, material = lattice_of(make)
    closed = cell_bound(make.youngs_modulus, nu, make.density, make.spacing)
    return value(closed, _measured(assembly, material, integrator, closed))


def _measured(
    assembly: Assembly, material: Material, integrator: str, guess: float, *, linear: bool = True
) -> float:
    steps = _steps(integrator, damped=material.damping.gamma_0 > 0.0)
    return measured_limit(assembly, material, integrator, guess, steps, linear=linear)


def _steps(integrator: str, *, damped: bool = False) -> int:
    """Number of steps that shows growth just above the limit; damping slows it."""
    return {"split-volume": 400, "runge-kutta-4": 1600}.get(integrator, 8000 if damped else 1000)
