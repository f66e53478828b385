"""Motion of a body with Rayleigh damping C = a M + b K, beside the sum of all its modes.

The modes, by a dense solver, are decoupled, and each moves in closed form: Clough and Penzien
(1993), Dynamics of Structures, ch. 12.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from fem_reference import model
from fem_reference.dynamics import ORDER, March, Oscillator
from fem_reference.elasticity import Body
from fem_reference.elements import ElementName
from fem_reference.observation import at_points, evaluation
from study.known.finding import Finding, convergence, error_of
from study.known.pressed import block
from study.known.verification.oscillation import factor, response
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation

Floats = NDArray[np.float64]

DAMPING = RayleighDamping(mass=10.0, stiffness=2e-3)
PERIOD, DURATION = 0.2, 0.15
"""[s]"""
STEPS = (75, 150)
PROBES = np.array([[0.03, 0.025, 0.04], [0.055, 0.03, 0.02]])
TRUNCATED = 1e-3
"""The reference adds vectors until the last ones change a curve by less."""
CASES: tuple[tuple[ElementName, float], ...] = (("p2", 0.45), ("taylor-hood", 0.4999))


def stepped() -> Iterator[Finding]:
    """Errors of TR-BDF2 and HHT-alpha in all displacements and velocities at all steps."""
    for name, nu in CASES:
        body = _body(name, nu)
        system = Oscillator(body.mass, body.stiffness, body.load, DAMPING)
        for method, march in model.STEPPING.items():
            errors = [_errors(system, march, body, count) for count in STEPS]
            for i, what in enumerate(("displacement", "velocity")):
                label = f"{what}, {method}, {name}, nu {nu:g}"
                yield from convergence(label, [e[i] for e in errors], ORDER, 0.1, 1e-3)


def superposed() -> Iterator[Finding]:
    """Errors of sums of Ritz vectors and of eigenvectors at two points."""
    times = np.linspace(0.0, DURATION, 61)
    nothing = np.zeros((0, 3))
    observation = Observation(times, PROBES, (), nothing, nothing)
    for name, nu in CASES:
        body = _body(name, nu)
        exact = [_at_probes(body, field) for field in _exact(body, times)]
        for method in ("ritz-vectors", "modal"):
            found = model.run(
                body, DAMPING, partial(factor, period=PERIOD), observation, model.Method(method)
            ).trajectory
            pairs = zip(
                ("displacement", "velocity"),
                (found.displacement, found.velocity),
                exact,
                strict=True,
            )
            for what, ours, true in pairs:
                label = f"{what}, {method}, {name}, nu {nu:g}"
                yield error_of(label, _relative(ours, true), TRUNCATED)


def _body(name: ElementName, nu: float) -> Body:
    return block(Tissue(poisson_ratio=nu), name, 0.03)


def _errors(system: Oscillator, march: March, body: Body, count: int) -> tuple[float, ...]:
    step = DURATION / count
    steps = march(system, partial(factor, period=PERIOD), step, count)
    ours = map(np.array, zip(*steps, strict=True))
    exact = _exact(body, np.linspace(0.0, DURATION, count + 1))
    return tuple(_relative(a, b) for a, b in zip(ours, exact, strict=True))


def _exact(body: Body, times: Floats) -> tuple[Floats, Floats]:
    """Displacement and velocity (times, n) by all modes."""
    stiffness = body.stiffness @ np.eye(body.stiffness.size)
    squared, modes = eigh(0.5 * (stiffness + stiffness.T), body.mass.toarray())
    y, rate = response(squared, DAMPING.mass + DAMPING.stiffness * squared, times, PERIOD)
    share = modes.T @ body.load
    return (y * share) @ modes.T, (rate * share) @ modes.T


def _at_probes(body: Body, field: Floats) -> Floats:
    matrix = evaluation(body, PROBES)
    return np.stack([at_points(matrix, u) for u in field])


def _relative(ours: Floats, exact: Floats) -> float:
    return float(np.linalg.norm(ours - exact) / np.linalg.norm(exact))
