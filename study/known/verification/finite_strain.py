"""Faces that are moved, at large strain and near incompressibility.

Between sliding plates the neo-Hookean law has two equations of its own, of the lateral stretch and
the stress along. A disc bonded to both plates is stiffer by its shape: (1 + 2 S^2) times Young's
modulus, S the loaded area over the free, for thin discs that keep their volume: Gent and Lindley
(1959), Proc. Inst. Mech. Eng. 173:111.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from fem_reference.displacement_control import Loading, equilibrium_path, solve_linear
from fem_reference.grid import curved, straight
from fem_reference.mixed_strain import MixedSolid, mixed_solid
from study.known.finding import Finding, error_of, number_of
from study.known.verification.moduli import lame_lambda, shear_modulus
from study.organ.block import block_mesh
from study.organ.cylinder import onto_side, quarter_cylinder
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

EDGE = 0.04
"""Edge of the cube [m]."""
STRETCH = 0.7
RATIOS = (0.3, 0.499, 0.4999)
SHAPE = 3.0
"""S of the disc: a quarter of its diameter over its height."""
RINGS, LAYERS = 6, 3
THIN = 0.06
"""How far the formula may be off: it leaves out the disc's own shear at the rim."""


def findings() -> Iterator[Finding]:
    """The cube between sliding plates, and the bonded disc."""
    for nu in RATIOS:
        yield from _sliding(Tissue(poisson_ratio=nu))
    yield _bonded(Tissue(poisson_ratio=0.4999))


def _sliding(tissue: Tissue) -> Iterator[Finding]:
    body = mixed_solid(straight(block_mesh((EDGE, EDGE, EDGE), 0.5 * EDGE)), tissue)
    prescribed, top = _symmetric(body, EDGE)
    prescribed[top, 2] = (STRETCH - 1.0) * EDGE
    path = equilibrium_path(body, Loading(prescribed, np.zeros(body.size)))
    lateral, stress = uniaxial(tissue, STRETCH)
    label = f"taylor-hood, nu {tissue.poisson_ratio:g}"
    if not path.converged:
        yield Finding("error", quantity=f"sliding plates, {label}", message=path.failure)
        return
    (state,) = path.states
    force = float(state.reaction[top, 2].sum())
    yield number_of(f"force of sliding plates [N], {label}", stress * EDGE**2, force, 1e-8)
    exact = body.points * (np.array([lateral, lateral, STRETCH]) - 1.0)
    off = float(np.abs(state.displacement - exact).max() / np.abs(exact).max())
    yield error_of(f"displacement, sliding plates, {label}", off, 1e-8)


def uniaxial(tissue: Tissue, stretch: float) -> tuple[float, float]:
    """Lateral stretch, and nominal stress [Pa] along, of a neo-Hookean bar with free sides."""
    first, mu = lame_lambda(tissue), shear_modulus(tissue)

    def side(a: float) -> float:
        return float(mu * (a * a - 1.0) + first * np.log(a * a * stretch))

    a = float(brentq(side, 0.5, 2.0, xtol=1e-15))
    return a, float(mu * (stretch - 1.0 / stretch) + first * np.log(a * a * stretch) / stretch)


def _bonded(tissue: Tissue) -> Finding:
    radius, half = 0.03, 0.5 * 0.03 / (2.0 * SHAPE)
    mesh = quarter_cylinder(radius, half, RINGS, LAYERS)
    body = mixed_solid(curved(mesh, onto_side(radius, RINGS)), tissue)
    prescribed, top = _symmetric(body, half)
    prescribed[top] = [0.0, 0.0, -0.01 * half]
    state = solve_linear(body, Loading(prescribed, np.zeros(body.size)))
    apparent = -4.0 * float(state.reaction[top, 2].sum()) / (np.pi * radius**2 * 0.01)
    expected = (1.0 + 2.0 * SHAPE**2) * tissue.youngs_modulus
    label = f"apparent modulus of a bonded disc [Pa], S = {SHAPE:g}"
    return number_of(label, expected, apparent, THIN)


def _symmetric(body: MixedSolid, height: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Prescribes planes of symmetry at zero, and which nodes are at the top."""
    x = body.points
    prescribed = np.full_like(x, np.nan)
    for axis in range(3):
        prescribed[x[:, axis] < 1e-9, axis] = 0.0
    return prescribed, x[:, 2] > height - 1e-9
