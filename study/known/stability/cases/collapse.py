"""Loads up to total collapse: the automatic step completes whatever any fixed step completes.

A body falls on its support under many times its weight. With a load that is constant from the
start, the energy of motion and deformation less the work of the load is what damping has taken. So
a finished run whose energies do not balance is wrong, however smooth.
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
"""Lengths of the fixed steps over the limit at rest."""
SAMPLES = 121
RATE = 10.0
"""Damping to ground, per mass [1/s]."""
DISSIPATIVE = ("implicit-euler", "split-volume")
"""Integrators that take energy by themselves, and may not give any."""
FALLS = 8.0
"""Duration over the time of a free fall by the size of the body, at most SECONDS."""
SECONDS = 0.6
WEIGHTS = (1.0, 3.0, 6.0, 10.0, 20.0, 40.0, 100.0, 1000.0)
LOST_FROM = {None: 3.0, 0.45: 20.0, 0.49: 20.0}
"""Weights, by Poisson ratio, from which the body turns inside out and falls through its support."""
BALANCE = 0.02
"""Share of the work of the load by which the energies of coarse steps may beat."""
LOOKED_AT = 0.15
"""Share of the time of divergence: two sampling intervals of a free fall's fifteen."""
FAMILY = Family("collapse", __name__)


def cases() -> Iterator[Case]:
    """Cases of a body under times of its weight, by Poisson ratio and integrator."""
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
    """Energies [J] of a run, sample by sample: of motion, and potential with that of the load."""

    k: float
    net: Network
    kinetic: dict[int, float] = field(default_factory=dict)
    potential: dict[int, float] = field(default_factory=dict)
    work: float = 0.0

    def note(self, sample: int, u: Floats, v: Floats) -> None:
        """Keep one sample; one that was undone is written over."""
        self.kinetic[sample] = energy.kinetic(self.net, v)
        self.potential[sample] = energy.potential(self.k, self.net, u)
        self.work = max(self.work, abs(float((self.net.load * u).sum())))

    def balance(self, interval: float) -> Floats:
        """What is there beside what damping has taken, over the largest work; zero if all is."""
        order = sorted(self.kinetic)
        kinetic = np.array([self.kinetic[sample] for sample in order])
        total = kinetic + [self.potential[sample] for sample in order]
        power = 2.0 * RATE * kinetic
        taken = np.concatenate([[0.0], np.cumsum(0.5 * interval * (power[1:] + power[:-1]))])
        return np.asarray((total + taken) / self.work)


def fall(integrator: str, nu: float | None, weights: float) -> Finding:
    """The automatic step and several fixed ones under so many times the weight.

    Where none completes, the body is lost by its load and not by its step: the finest fixed one
    then loses it at the same time.
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
    told = (
        f"{complete} of {len(fixed)} fixed steps complete; smallest step "
        f"{found.smallest_step / limit:.2g} of the limit, strain {found.largest_strain:.2g}, "
        f"{found.inverted_cells} cells inverted"
    )
    if found.trajectory.ended_at is None:
        return _balanced(integrator, ledger.balance(interval), told)
    finest = fixed[-1][0].trajectory.ended_at
    if complete or finest is None:
        return Finding("error", message=f"lost by its step: {told}")
    return value(finest, found.trajectory.ended_at, told, "diverged")


def _balanced(integrator: str, balance: Floats, message: str) -> Finding:
    """How far the energy is from balance, at worst; upwards only for what dissipates."""
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
