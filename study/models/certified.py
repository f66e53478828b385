"""The certified error of a superposition: bounds over a motion, and frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.certificate import Certificate
from fem_reference.certified import CertifiedMotion
from study.problem.damping import RayleighDamping
from study.problem.problem import Problem
from study.results.records import CertifiedReduction

Floats = NDArray[np.float64]


class Certified(NamedTuple):
    """A motion's record, and the bound [m] (samples, probes) that it is the summary of."""

    record: CertifiedReduction
    bounds: Floats


def certified(
    given: Certificate, damping: RayleighDamping, problem: Problem, steps: int, motion: Floats
) -> Certified:
    """Over a displacement [m] (samples, probes, 3) by so many steps of the load per sample."""
    sample = float(problem.observation.times[1])
    moving = CertifiedMotion(given, damping, problem.factor, sample / steps)
    bounds, energy, largest = [moving.bound.displacement], 0.0, 0.0
    for _ in problem.observation.times[1:]:
        for _ in range(steps):
            moving.take_step()
            energy = max(energy, moving.bound.energy)
            largest = max(largest, moving.energy_norm)
        bounds.append(moving.bound.displacement)
    found = np.array(bounds)
    curves = np.linalg.norm(motion, axis=(0, 2))
    over_time = np.linalg.norm(found, axis=0)
    shares = [share(bound, size) for bound, size in zip(over_time, curves, strict=True)]
    record = CertifiedReduction(
        vectors=len(given.squares),
        energy=share(energy, largest),
        rest=given.error_at_rest,
        rounding=given.rounding,
        displacement=dict(zip(problem.probes, shares, strict=True)),
        largest_m=dict(zip(problem.probes, found.max(axis=0).tolist(), strict=True)),
    )
    return Certified(record, found)


def share(bound: float, size: float) -> float | None:
    """A bound over the size of what it bounds; None of what is zero."""
    return float(bound / size) if size > 0.0 else None


def bound_on_demand(
    make: Callable[[], CertifiedMotion], time: Callable[[], float]
) -> Callable[[], Floats]:
    """The bound [m] (probes,) at a time [s] that goes on, computed when it is asked for."""
    begun: list[CertifiedMotion] = []

    def bound() -> Floats:
        if not begun:
            begun.append(make())
        moving = begun[0]
        while moving.time < time() - 0.5 * moving.step:
            moving.take_step()
        return moving.bound.displacement

    return bound
