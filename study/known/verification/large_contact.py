"""Rigid tools pressed on neo-Hookean elements: a plate at large strain, a sphere at small.

A plate in frictionless contact compresses a block as sliding plates do that hold its faces: by the
two equations of `finite_strain.uniaxial`. A sphere at small depth is Hertz's, as in `indentation`,
with the far faces of the block displaced as those of the half space are by that force.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.contact.balance import Balance, Balanced, Demand
from fem_reference.contact.large_motion import Steps, pressed, touched
from fem_reference.elasticity import discretise
from study.known.finding import Finding, number_of
from study.known.verification import indentation
from study.known.verification.finite_strain import EDGE, STRETCH, uniaxial
from study.known.verification.half_space import DOWN
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.rigid import PLATE, SPHERE, RigidTool
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

SQUEEZED, PRESSED = (0.3, 0.499), (0.45, 0.4999)
"""Poisson ratios under the plate and under the sphere."""
EXACT, HERTZ = 1e-4, 1e-2
"""Limits of the errors: that of the plate is the tolerance of equilibrium alone."""
FINEST = 0.5
"""Longest edge of the elements under the sphere over the radius of contact."""


def findings() -> Iterator[Finding]:
    """Forces of a plate and of a sphere."""
    for nu in SQUEEZED:
        tissue = Tissue(poisson_ratio=nu)
        stress = uniaxial(tissue, STRETCH)[1]
        label = f"force of a plate in contact [N], neo-Hookean, nu {nu:g}"
        yield number_of(label, stress * EDGE**2, squeezed(tissue), EXACT)
    for nu in PRESSED:
        tissue = Tissue(poisson_ratio=nu)
        exact = indentation.exact_force(SPHERE, tissue, bonded=False)
        label = f"force of a sliding sphere [N], neo-Hookean, nu {nu:g}"
        yield number_of(label, exact, sphere(tissue, FINEST), HERTZ)


def squeezed(tissue: Tissue) -> float:
    """Force [N] of a plate on an eighth of a block, at a large stretch."""
    blunt = ToolPatch(np.full(3, EDGE), DOWN, EDGE, 0.0)
    mesh = block_mesh((EDGE, EDGE, EDGE), 0.5 * EDGE)
    bare = discretise(mesh, tissue, Foundation(DOWN, 0.0, 1e-3, 1.0), blunt, "taylor-hood")
    nothing = csc_array(bare.support.shape)
    body = replace(bare, support=nothing, fixed=(bare.points < 1e-9).ravel())

    def travel(times: Floats) -> Floats:
        return np.outer(times, (1.0 - STRETCH) * EDGE * DOWN)

    plate = RigidTool("tool", PLATE, EDGE, np.array([0.0, 0.0, EDGE]), DOWN, travel)
    ways = np.array([0.0, 1.0])
    given = pressed(body, tissue, (plate,), RayleighDamping(0.0), np.zeros_like, ways)
    state = Steps(given).peak(1.0, np.zeros(given.body.solid.size))
    return float(given.on_tools(state)[0] @ DOWN)


def sphere(tissue: Tissue, finest: float) -> float:
    """Force [N] that presses a sphere in; elements are `finest` times the contact radius."""
    tool = indentation.tool_of(SPHERE, bonded=False)
    size = finest * indentation.TOUCHED
    bare = indentation.quarter(tissue, "taylor-hood", size, flat=False)
    held = indentation.held(bare)
    fixed = (bare.points < 1e-9) & [True, True, False]
    fixed[indentation.is_far(bare.points)] = True
    body = replace(bare, support=csc_array(bare.support.shape), fixed=fixed.ravel())
    given = touched(body, tissue, (tool,), np.array([0.0, 1.0]))
    start = np.zeros(len(given.free))
    exact = indentation.exact_force(SPHERE, tissue, bonded=False)
    start[: given.solid.size] = 0.25 * exact * indentation.far_field(held, tissue)
    guess = Balanced(start, np.zeros(len(given.contact.held)))
    state = Balance(given).found(guess, Demand(1.0, 0.0, np.zeros(given.solid.size)))
    forces = given.contact.on_tools(given.given(state.w), 1.0, state.force)
    return float(4.0 * forces[0] @ -DOWN)
