"""A rigid sphere and a flat punch that are pressed into a half space, whose forces are known.

A smooth sphere of radius R goes in by d with the force 4/3 E* R^(1/2) d^(3/2) (Hertz, 1882), a
smooth punch of radius a with 2 E* a d (Boussinesq, 1885), where E* is E / (1 - nu^2): Johnson
(1985), Contact Mechanics, eqs. 4.23 and 3.36. A bonded punch needs 4 mu a d log(3 - 4 nu) /
(1 - 2 nu): Mossakovskii (1954); Spence (1968), Proc. R. Soc. A 305:55. A quarter of a block is
solved; its far faces move as those of the half space under a force at the tool do, so that its
size leaves no error beyond the square of the radius over it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, diags_array

from fem_reference.contact.linear import LinearContact
from fem_reference.contact.patch import patch
from fem_reference.contact.reduction import ContactResponse
from fem_reference.elasticity import Body, discretise
from fem_reference.solvers import by_factors
from fem_reference.stiffness import Stiffness
from study.known.finding import Finding, number_of
from study.known.verification.half_space import DOWN, point_force
from study.known.verification.moduli import shear_modulus
from study.mesh.bisection import cut_into
from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.rigid import PUNCH, SPHERE, RigidTool
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

TOUCHED = 0.01
"""Radius [m] of the area of contact, of a sphere as Hertz has it."""
DEPTH = 1e-4
"""[m], small enough for the sphere to be a paraboloid."""
SIZE = 6.0 * TOUCHED
FINEST = {SPHERE: 1 / 2, PUNCH: 1 / 8}
"""Longest edge of the elements near the tool over that radius; the edge of a punch is singular."""
COARSEST, GROWTH, HALVINGS = 2, 1.0, 40
"""Cells along the block, growth of the elements away from the tool, and rounds of bisection."""
LIMIT = 1e-2
STIFF = 1e7
"""Stiffness of the springs that hold nodes, over the largest stiffness of any node."""
CASES = (
    ("sliding sphere", SPHERE, False, "p2", 0.45),
    ("sliding punch", PUNCH, False, "p2", 0.45),
    ("bonded punch", PUNCH, True, "p2", 0.3),
    ("sliding sphere", SPHERE, False, "taylor-hood", 0.4999),
)


def findings() -> Iterator[Finding]:
    """Forces of tools that are pressed into a half space."""
    for what, shape, bonded, element, nu in CASES:
        tissue = Tissue(poisson_ratio=nu)
        tool, exact = tool_of(shape, bonded=bonded), exact_force(shape, tissue, bonded=bonded)
        found = 4.0 * force(tool, tissue, element, FINEST[shape] * TOUCHED)
        label = f"force [N], {what}, {element}, nu {nu:g}"
        yield number_of(label, exact, found, LIMIT)


def tool_of(shape: int, *, bonded: bool) -> RigidTool:
    """The tool that touches the area of TOUCHED when it is DEPTH deep, after a second."""
    radius = TOUCHED if shape == PUNCH else TOUCHED**2 / DEPTH

    def travel(times: Floats) -> Floats:
        return np.outer(times, DEPTH * DOWN)

    return RigidTool("tool", shape, radius, np.zeros(3), DOWN, travel, bonded)


def exact_force(shape: int, tissue: Tissue, *, bonded: bool) -> float:
    """Force [N] on it in closed form."""
    nu, mu = tissue.poisson_ratio, shear_modulus(tissue)
    stiffness = tissue.youngs_modulus / (1.0 - nu**2)
    if shape == SPHERE:
        return float(
            4.0 / 3.0 * stiffness * TOUCHED * DEPTH
        )  # the contact radius is R^(1/2) d^(1/2)
    if bonded:
        return float(4.0 * mu * TOUCHED * DEPTH * np.log(3.0 - 4.0 * nu) / (1.0 - 2.0 * nu))
    return float(2.0 * stiffness * TOUCHED * DEPTH)


def force(tool: RigidTool, tissue: Tissue, element: str, finest: float) -> float:
    """Force [N] that presses a quarter of a tool in, elements being `finest` [m] near it."""
    body = held(quarter(tissue, element, finest, flat=tool.shape == PUNCH))
    ways = np.array([0.0, 1.0])
    contact = LinearContact.of([patch(body, tool, ways, 0.0)])
    solve = by_factors(body)
    far = body.support @ far_field(body, tissue)
    nodal_forces = contact.nodal_forces.toarray()
    downwards = -nodal_forces[2::3].sum(axis=0)
    loads = (nodal_forces + np.outer(far, downwards)).T
    responses = np.column_stack([solve(one) for one in loads])
    given = ContactResponse(body, contact, solve, responses)
    solution = given.at_rest(np.zeros(len(body.load)), given.free, ways)
    return float(contact.tool_forces(solution.force)[0] @ -DOWN)


def quarter(tissue: Tissue, element: str, finest: float, *, flat: bool) -> Body:
    """A quarter of the half space round the tool, on nothing that counts.

    Its elements are finest under a sphere, or at the edge of a flat punch, and grow with the
    distance.
    """
    return on_nothing(quarter_mesh(finest, flat=flat), tissue, element)


def quarter_mesh(finest: float, *, flat: bool) -> TetrahedralMesh:
    """Mesh of the quarter; edges are at most `finest` [m] at the contact or a punch's edge."""
    mesh = block_mesh((SIZE, SIZE, SIZE), SIZE / COARSEST)
    mesh = TetrahedralMesh(mesh.points * [1.0, 1.0, -1.0], mesh.tetrahedra[:, [0, 2, 1, 3]])
    for _ in range(HALVINGS):
        size, away = _sizes(mesh, flat=flat)
        wanted = np.maximum(finest, GROWTH * away)
        if (size <= wanted).all():
            break
        mesh = cut_into(mesh, np.where(size > wanted, 2.0, 1.0)).mesh
    return mesh


def on_nothing(mesh: TetrahedralMesh, tissue: Tissue, element: str) -> Body:
    """The body on a mesh, with a support that does not count."""
    blunt = ToolPatch(np.zeros(3), DOWN, TOUCHED, 0.0)
    return discretise(mesh, tissue, Foundation(DOWN, SIZE, 1e-3, 1.0), blunt, element)


def _sizes(mesh: TetrahedralMesh, *, flat: bool) -> tuple[Floats, Floats]:
    """Longest edge [m] of each tetrahedron, and how far it is from where it has to be short."""
    corner = mesh.points[mesh.tetrahedra]
    edges = corner[:, [0, 0, 0, 1, 1, 2]] - corner[:, [1, 2, 3, 2, 3, 3]]
    out = np.linalg.norm(corner[..., :2], axis=2) - TOUCHED
    aside = np.abs(out) if flat else np.maximum(out, 0.0)
    away = np.hypot(aside, corner[..., 2])
    crossed = (out.min(axis=1) < 0.0) & (out.max(axis=1) > 0.0)
    least = np.where(flat & crossed, np.abs(corner[..., 2]).min(axis=1), away.min(axis=1))
    return np.linalg.norm(edges, axis=2).max(axis=1), least


def held(body: Body) -> Body:
    """With stiff springs instead of its support: across planes of symmetry, and at far faces."""
    x, stiffness = body.points, body.stiffness
    symmetric = (x < 1e-9) & [True, True, False]
    far = is_far(x)
    own = stiffness.matrix - body.support
    springs = np.where(symmetric | far[:, None], STIFF * np.abs(own.diagonal()).max(), 0.0)
    support = diags_array(np.where(far[:, None], springs, 0.0).ravel())
    matrix = bsr_array(own + diags_array(springs.ravel()), blocksize=(3, 3))
    return replace(body, stiffness=Stiffness(matrix, stiffness.pressure), support=support.tocsc())


def is_far(points: Floats) -> NDArray[np.bool_]:
    """Whether points [m] (n, 3) are on a face that no plane of symmetry or tool is at."""
    return np.asarray(np.any(np.abs(points) > SIZE - 1e-9, axis=1))


def far_field(body: Body, tissue: Tissue) -> Floats:
    """Displacement [m] (n,) of the far faces for a newton that nodal_forces down on the quarter."""
    x = body.points
    moved = np.zeros_like(x)
    far = is_far(x)
    moved[far] = 4.0 * point_force(x[far], tissue)
    moved[(x < 1e-9) & [True, True, False]] = 0.0
    return moved.ravel()
