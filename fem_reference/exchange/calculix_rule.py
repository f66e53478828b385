"""Stiffness and mass with the quadrature of CalculiX, for a comparison to all printed digits.

C3D4 has one point, C3D10 four: enough for the stiffness of straight elements, too few for the mass
and for curved elements. The reference itself integrates with more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import skfem
from scipy.sparse import csc_array
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

from fem_reference.elasticity import Body
from fem_reference.exchange.nodal import NodalProblem
from fem_reference.stiffness import Stiffness
from study.problem.tissue import Tissue

ONE_POINT = (np.full((3, 1), 0.25), np.array([1.0 / 6.0]))
NEAR, FAR = (5.0 - np.sqrt(5.0)) / 20.0, (5.0 + 3.0 * np.sqrt(5.0)) / 20.0
FOUR_POINTS = (
    np.array([[NEAR, FAR, NEAR, NEAR], [NEAR, NEAR, FAR, NEAR], [NEAR, NEAR, NEAR, FAR]]),
    np.full(4, 1.0 / 24.0),
)
RULES = {12: ONE_POINT, 30: FOUR_POINTS}
"""By the number of unknowns of an element."""


def integrated(body: Body, tissue: Tissue, given: NodalProblem | None = None) -> Body:
    """The body with stiffness, mass and weight as CalculiX integrates them, all else as before.

    For displacement elements alone. Attached weights have no mass in it, but act as `given` has it.
    """
    grid, element = body.basis.mesh, body.basis.elem
    basis = skfem.Basis(grid, element, quadrature=RULES[body.basis.Nbfun])
    elastic = linear_elasticity(*lame_parameters(tissue.youngs_modulus, tissue.poisson_ratio))
    inertia = skfem.BilinearForm(lambda u, v, _: tissue.density * dot(u, v))
    stiffness = Stiffness(csc_array(csc_array(elastic.assemble(basis)) + body.support))
    mass = csc_array(inertia.assemble(basis))
    dead = None
    if given is not None and given.gravity is not None:
        dead = mass.sum(axis=1) * np.tile(given.gravity, body.node_count)
        dead += 0.0 if given.weight_forces is None else given.weight_forces.ravel()
    return replace(body, stiffness=stiffness, mass=mass, dead=dead)
