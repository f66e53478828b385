"""A standing shear wave between smooth walls, exact in space and time.

In the unit cube u = g(t) U, with U_x = 2 sin(pi x) cos(pi y) cos(pi z), and U_y and U_z alike with
factor -1 and the sine in y and in z. It is free of divergence, slides along all walls without
shear, and vibrates at omega^2 = 3 pi^2 mu / rho for any nu. Under a body force rho U factor(t), g
moves as one damped oscillator.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.dynamics import Oscillator
from fem_reference.elements import ElementName
from fem_reference.grid import straight
from fem_reference.model import STEPPING
from study.known.finding import Finding, error_of, observed_order
from study.known.verification.moduli import shear_modulus
from study.known.verification.oscillation import factor, response
from study.known.verification.solid import body_force, l2_error, mass_matrix, restricted, solid
from study.organ.block import block_mesh
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

CASES: tuple[tuple[ElementName, float], ...] = (("p2", 0.3), ("taylor-hood", 0.4999))
STEPS_PER_CELL = 8
PERIODS = 0.8
"""Duration of the motion, and period of the load, in periods of the wave."""
RATIO, SHARE = 0.1, 0.5
"""Damping ratio of the wave, and the share of it that is stiffness-proportional."""


def findings() -> Iterator[Finding]:
    """Displacement at the end, with cells and steps halved together.

    The steps are short, so the order is that of the elements: between 3 of the shape and 4 of the
    frequency.
    """
    for name, nu in CASES:
        for method in STEPPING:
            errors = [error(name, Tissue(poisson_ratio=nu), method, cells) for cells in (3, 6)]
            label = f"displacement, L2, {method}, {name}, nu {nu:g}"
            yield error_of(label, errors[-1], 0.01, order=observed_order(errors))


def error(name: ElementName, tissue: Tissue, method: str, cells: int) -> float:
    """Relative L2 error at the end of the motion."""
    omega = float(np.sqrt(3.0 * shear_modulus(tissue) / tissue.density) * np.pi)
    damping = RayleighDamping(2.0 * RATIO * omega * (1.0 - SHARE), 2.0 * RATIO / omega * SHARE)
    end, count = PERIODS * 2.0 * np.pi / omega, STEPS_PER_CELL * cells
    body = solid(straight(block_mesh((1.0, 1.0, 1.0), 1.0 / cells)), name, tissue)
    sliding = ((body.points > 1e-9) & (body.points < 1.0 - 1e-9)).ravel()
    mass = mass_matrix(body, tissue.density)
    load = body_force(body, lambda x: tissue.density * shape(x))
    system = Oscillator(
        csc_array(mass[sliding][:, sliding]),
        restricted(body.stiffness, sliding),
        load[sliding],
        damping,
    )
    *_, (last, _) = STEPPING[method](system, partial(factor, period=end), end / count, count)
    u = np.zeros(load.size)
    u[sliding] = last
    rates = np.array([omega**2]), np.array([damping.mass + damping.stiffness * omega**2])
    exact = response(*rates, np.array([end]), end)[0][0, 0]
    return l2_error(body.nodes, u, lambda x: exact * shape(x))


def shape(x: Floats) -> Floats:
    """Shape U of the wave (..., 3) at points (..., 3) of the unit cube."""
    sine, cosine = np.sin(np.pi * x), np.cos(np.pi * x)
    others = np.roll(cosine, -1, axis=-1) * np.roll(cosine, -2, axis=-1)
    return np.asarray(np.array([2.0, -1.0, -1.0]) * sine * others)
