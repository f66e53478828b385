"""Loads up to total collapse: the automatic step completes whatever any fixed step completes.

A body falls on its support under multiples of its weight. With a constant load from the start,
kinetic energy plus strain energy minus the work of the load equals minus the dissipation of
damping. A finished run whose energies do not balance is therefore wrong, however smooth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material, arrays
from msm.damping import NodalDamping
from msm.laws import initial_stiffness
from msm.model import Automatic, Fixed, Run, Step, critical_time_step, run
from msm.network import Network
from msm.timestep import whole_steps
from study.known.case import Case, Family
from study.known.finding import Finding, value
from study.known.stability import energy
from study.known.stability.bodies import Make, lattice_of, watch

Floats = NDArray[np.float64]

FRACTIONS = (1.0, 0.5, 0.2, 0.05)
"""Fixed steps over the critical step at rest."""
SAMPLES = 121
RATE = 10.0
"""Damping to ground, per mass [1/s]."""
DISSIPATIVE = ("implicit-euler", "split-volume")
"""Integrators with numerical dissipation, which must not gain energy."""
FALLS = 8.0
"""Duration over the time of a free fall by the size of the body, at most SECONDS."""
SECONDS = 0.6
WEIGHTS = (1.0, 3.0, 6.0, 10.0, 20.0, 40.0, 100.0, 1000.0)
LOST_FROM = {None: 3.0, 0.45: 20.0, 0.49: 20.0}
"""Multiples of the weight from which the body inverts, by Poisson ratio."""
BALANCE = 0.02
"""Admissible energy error of coarse steps, over the work of the load."""
LOOKED_AT = 0.15
"""Tolerance of the time of divergence, relative to it."""
FAMILY = Family("collapse", __name__)


def cases() -> Iterator[Case]:
    """Cases of a body under multiples of its weight, by Poisson ratio and integrator."""
    for weights in WEIGHTS:
        for nu in LOST_FROM:
            yield _case("symplectic-euler", nu, weights)
        for name in ("velocity-verlet", "runge-kutta-4", "split-volume", "implicit-euler"):
            yield _case(name, 0.45, weights)


def _case(name: str, nu: float | None, weights: float) -> Case:
    springs, lost = "springs" if nu is None else f"nu {nu:g}", weights >= LOST_FROM[nu]
    return FAMILY.case(
        f"{weights:g} times its weight, {springs}: {name}",
        "fall",
        {"integrator": name, "nu": nu, "weights": weights},
        LOOKED_AT if lost else BALANCE,
        expected="diverged" if lost else "bounded",
        quick=name == "symplectic-euler" and weights in (10.0, 1000.0),
    )


@dataclass
class Ledger:
    """Energies [J] of a run by sample: kinetic, and potential including that of the load."""

    k: float
    net: Network
    kinetic: dict[int, float] = field(default_factory=dict)
    potential: dict[int, float] = field(default_factory=dict)
    work: float = 0.0

    def note(self, sample: int, u: Floats, v: Floats) -> None:
        """Record one sample; a sample that is repeated is overwritten."""
        self.kinetic[sample] = energy.kinetic(self.net, v)
        self.potential[sample] = energy.potential(self.k, self.net, u)
        self.work = max(self.work, abs(float((self.net.load * u).sum())))

    def balance(self, interval: float) -> Floats:
        """Energy error beyond the dissipation by damping, over the largest work of the load."""
        order = sorted(self.kinetic)
        kinetic = np.array([self.kinetic[sample] for sample in order])
        total = kinetic + [self.potential[sample] for sample in order]
        power = 2.0 * RATE * kinetic
        taken = np.concatenate([[0.0], np.cumsum(0.5 * interval * (power[1:] + power[:-1]))])
        return np.asarray((total + taken) / self.work)


def fall(integrator: str, nu: float | None, weights: float) -> Finding:
    """The automatic step and several fixed ones under `weights` times the weight.

    Where none completes, the load destroys the body whatever the step: the finest fixed step then
    diverges at the same time.
    """
    gravity = 9.81 * weights
    make = Make(counts=(3, 3, 5), poisson_ratio=nu, gravity=gravity, damping=NodalDamping(RATE))
    assembly, material = lattice_of(make)
    size = float(np.ptp(assembly.lattice.nodes, axis=0).max())
    interval = min(SECONDS, FALLS * float(np.sqrt(2.0 * size / gravity))) / (SAMPLES - 1)
    limit = critical_time_step(assembly, material)
    found, ledger = _run(assembly, material, integrator, Automatic(), interval)
    steps = [Fixed(interval / whole_steps(interval, part * limit)) for part in FRACTIONS]
    fixed = [_run(assembly, material, integrator, step, interval) for step in steps]
    complete = sum(one.trajectory.status == "finished" for one, _ in fixed)
    message = (
        f"{complete} of {len(fixed)} fixed steps complete; smallest step "
        f"{found.smallest_step / limit:.2g} of the limit, strain {found.largest_strain:.2g}, "
        f"{found.inverted_cells} cells inverted"
    )
    if found.trajectory.ended_at is None:
        return _balanced(integrator, ledger.balance(interval), message)
    finest = fixed[-1][0].trajectory.ended_at
    if complete or finest is None:
        return Finding("error", message=f"lost by its step: {message}")
    return value(finest, found.trajectory.ended_at, message, "diverged")


def _balanced(integrator: str, balance: Floats, message: str) -> Finding:
    """Largest energy error; for dissipative integrators only gains count."""
    off = balance if integrator in DISSIPATIVE else np.abs(balance)
    worst = float(balance[off.argmax()])
    return Finding("bounded", 0.0, worst, float(off.max()), message)


def _run(
    assembly: Assembly, material: Material, integrator: str, step: Step, interval: float
) -> tuple[Run, Ledger]:
    ledger = Ledger(initial_stiffness(material.law), arrays(assembly, material))
    seen = watch(assembly, interval * (SAMPLES - 1), SAMPLES)
    found = run(
        assembly,
        material,
        np.ones_like,
        seen,
        step,
        integrator=integrator,
        on_sample=ledger.note,
    )
    return found, ledger
