"""Rigid tools on neo-Hookean elements: a plate at large strain, a sphere and a punch at small.

A plate in frictionless contact compresses a block as sliding plates do that hold its faces: by the
two equations of `finite_strain.uniaxial`. A sphere at small depth is Hertz's, as in `indentation`,
with the far faces of the block displaced as those of the half space are by that force. A
frictionless punch is likewise Boussinesq's.

A sphere that is then dragged by d sticks in the middle of the contact and slips around it, until
all of it slides. With the normal force N, the coefficient m and the tangential stiffness k, the
tangential force is m N (1 - (1 - 2 k d / (3 m N))^(3/2)) for an incompressible body (Cattaneo 1938;
Mindlin 1949, J. Appl. Mech. 16:259; Johnson 1985, eq. 7.42). The formula neglects slip across the
direction of the tool. Boundary elements with that slip are 0.1 % above it at half the force of
sliding (`tests/test_partial_slip.py`). The finite elements are 1.8, 0.5 and 0.5 % above it with
edges of 1/2, 0.35 and 1/4 of the radius of contact, so that what the limit allows is their error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.contact.equilibrium import ContactState, EquilibriumSolver, Increment
from fem_reference.contact.kinematics import PreviousState
from fem_reference.contact.large_motion import Integrator, contact_body, contact_problem
from fem_reference.elasticity import Body, discretise
from study.known.finding import Finding, number_of
from study.known.verification import indentation
from study.known.verification.finite_strain import EDGE, STRETCH, uniaxial
from study.known.verification.half_space import DOWN, point_force
from study.known.verification.moduli import shear_modulus
from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.rigid import PLATE, PUNCH, SPHERE, RigidTool
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

SQUEEZED, PRESSED = (0.3, 0.499), (0.45, 0.4999)
"""Poisson ratios under the plate and under the sphere."""
EXACT, HERTZ, EDGED, MINDLIN = 1e-4, 1e-2, 1e-2, 1e-2
"""Limits of the errors: that of the plate is the tolerance of equilibrium alone."""
FINEST, IN_SLIP, AT_EDGE = 0.5, 0.35, 1 / 8
"""Longest edge of the elements, under a sphere over the radius of contact, shorter where it is
dragged and slips in a ring, and at the edge of a punch, where the pressure is singular, over its
radius."""
FRICTION, DRAGGED, DRAGGED_NU = 0.3, (0.5, 1.0), 0.4999
"""Coefficient of friction of the dragged sphere, tangential forces as shares of the one at which it
slides, and the Poisson ratio under it."""
ALONG, TOUCHING = np.array([1.0, 0.0, 0.0]), 1e-9


def findings() -> Iterator[Finding]:
    """Forces of a plate, of spheres and of a punch."""
    for nu in SQUEEZED:
        tissue = Tissue(poisson_ratio=nu)
        stress = uniaxial(tissue, STRETCH)[1]
        label = f"force of a plate in contact [N], neo-Hookean, nu {nu:g}"
        yield number_of(label, stress * EDGE**2, squeezed(tissue), EXACT)
    for nu in PRESSED:
        tissue = Tissue(poisson_ratio=nu)
        exact = indentation.exact_force(SPHERE, tissue, bonded=False)
        label = f"force of a sliding sphere [N], neo-Hookean, nu {nu:g}"
        yield number_of(label, exact, small(SPHERE, tissue, FINEST), HERTZ)
    tissue = Tissue(poisson_ratio=PRESSED[0])
    exact = indentation.exact_force(PUNCH, tissue, bonded=False)
    label = f"force of a sliding punch [N], neo-Hookean, nu {PRESSED[0]:g}"
    yield number_of(label, exact, small(PUNCH, tissue, AT_EDGE), EDGED)
    for exact, found in drags(IN_SLIP):
        label = f"T/N of a dragged sphere at {exact / FRICTION:.0%} of sliding"
        yield number_of(label, exact, found, MINDLIN)


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
    given = contact_problem(body, tissue, (plate,), RayleighDamping(0.0), np.zeros_like, ways)
    state = Integrator(given).peak_equilibrium(1.0, np.zeros(given.body.solid.size))
    return float(given.tool_forces(state)[0] @ DOWN)


def small(shape: int, tissue: Tissue, finest: float) -> float:
    """Force [N] of a frictionless sphere or punch at small depth.

    Elements are `finest` times the radius of contact, near the sphere or at the punch's edge.
    """
    tool = indentation.tool_of(shape, bonded=False)
    size = finest * indentation.TOUCHED
    bare = indentation.quarter(tissue, "taylor-hood", size, flat=shape == PUNCH)
    given = contact_body(_framed(bare, [True, True, False]), tissue, (tool,), np.array([0.0, 1.0]))
    exact = indentation.exact_force(shape, tissue, bonded=False)
    start = np.zeros(len(given.free))
    far = indentation.far_field(indentation.held(bare), tissue)
    start[: given.solid.size] = 0.25 * exact * far
    guess = ContactState(start, np.zeros(len(given.contact.bonded)))
    increment = Increment(1.0, 0.0, np.zeros(given.solid.size))
    state = EquilibriumSolver(given).solve(guess, increment)
    return float(4.0 * given.configuration(state.w, increment).tool_forces(state.force)[0] @ -DOWN)


def _framed(bare: Body, planes: Sequence[bool]) -> Body:
    """A part of a half space that nothing but its planes of symmetry and far faces hold."""
    fixed = (np.abs(bare.points) < TOUCHING) & planes
    fixed[indentation.is_far(bare.points)] = True
    return replace(bare, support=csc_array(bare.support.shape), fixed=fixed.ravel())


def drags(finest: float) -> list[tuple[float, float]]:
    """Tangential over normal force of a dragged sphere: the closed form and the computed one.

    A half of a half space without change of volume, elements `finest` times the radius of contact;
    the far faces are displaced as those of the half space are by the exact forces.
    """
    tissue = Tissue(poisson_ratio=DRAGGED_NU)
    bare = _half(tissue, finest * indentation.TOUCHED)
    normal = indentation.exact_force(SPHERE, tissue, bonded=False)
    shear = shear_modulus(tissue)
    # Mindlin's tangential stiffness 8 G* a, with G* = G / (2 - nu) beside a rigid sphere.
    stiffness = 8.0 * shear / (2.0 - tissue.poisson_ratio) * indentation.TOUCHED
    shares = np.array([0.0, *DRAGGED])
    slides = 1.5 * FRICTION * normal / stiffness
    aside = slides * (1.0 - (1.0 - shares) ** (2.0 / 3.0))

    def travel(times: Floats) -> Floats:
        down = np.outer(np.minimum(times, 1.0), indentation.DEPTH * DOWN)
        return down + np.outer(np.interp(times, 1.0 + np.arange(len(shares)), aside), ALONG)

    radius = indentation.TOUCHED**2 / indentation.DEPTH
    tool = RigidTool("tool", SPHERE, radius, np.zeros(3), DOWN, travel, friction=FRICTION)
    times = 1.0 + np.arange(len(shares))
    given = contact_body(
        _framed(bare, [False, True, False]), tissue, (tool,), np.append(0.0, times)
    )
    far, solver, n = indentation.is_far(bare.points), EquilibriumSolver(given), given.solid.size
    down, sideways = (
        kind(bare.points[far], tissue) * normal for kind in (point_force, tangential_force)
    )
    state, previous, found = (
        ContactState(np.zeros(len(given.free)), np.zeros(len(given.contact.bonded))),
        None,
        [],
    )
    for time, share in zip(times, shares, strict=True):
        w = state.w.copy()
        moved = w[:n].reshape(-1, 3)
        moved[far] = down + FRICTION * share * sideways
        moved[np.abs(bare.points[:, 1]) < TOUCHING, 1] = 0.0
        increment = Increment(float(time), 0.0, np.zeros(n), previous)
        state = solver.solve(ContactState(w, state.force), increment)
        force = given.configuration(state.w, increment).tool_forces(state.force)[0]
        previous = PreviousState(given.given(state.w), float(time))
        found.append(float(-(force @ ALONG) / (force @ -DOWN)))
    return list(zip(FRICTION * shares[1:], found[1:], strict=True))


def _half(tissue: Tissue, finest: float) -> Body:
    """Half of the half space: a quarter and its mirror image."""
    mesh = indentation.quarter_mesh(finest, flat=False)
    image = mesh.points * [-1.0, 1.0, 1.0]
    points, place = np.unique(
        np.round(np.concatenate([mesh.points, image]), 12), axis=0, return_inverse=True
    )
    own, other = place.ravel().reshape(2, -1)
    cells = np.concatenate([own[mesh.tetrahedra], other[mesh.tetrahedra][:, [0, 2, 1, 3]]])
    return indentation.on_nothing(TetrahedralMesh(points, cells), tissue, "taylor-hood")


def tangential_force(off: Floats, tissue: Tissue) -> Floats:
    """Displacement per newton [m/N] (..., 3) at places relative to a force along x.

    Of a half space below z = 0: Cerruti (1882); Johnson (1985), eq. 3.75.
    """
    nu, scale = tissue.poisson_ratio, 1.0 / (4.0 * np.pi * shear_modulus(tissue))
    R, x, y, z = np.linalg.norm(off, axis=-1), off[..., 0], off[..., 1], -off[..., 2]
    loose = 1.0 - 2.0 * nu
    along = 1.0 / R + x**2 / R**3 + loose * (1.0 / (R + z) - x**2 / (R * (R + z) ** 2))
    across = x * y / R**3 - loose * x * y / (R * (R + z) ** 2)
    down = x * z / R**3 + loose * x / (R * (R + z))
    return np.asarray(scale * np.stack([along, across, -down], axis=-1))
