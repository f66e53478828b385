"""Finite-element reference: linear elasticity on tetrahedra by scikit-fem, and motion in time.

A block of tissue between a foundation below and a tool above; `run` moves the body:

    >>> import numpy as np
    >>> from fem_reference import Foundation, Tissue, ToolPatch, build, static_field
    >>> from study.organ.block import block_mesh
    >>> down, top = np.array([0.0, 0.0, -1.0]), np.array([0.03, 0.02, 0.03])
    >>> support, tool = Foundation(down, 0.0, 1e-3, 1e7), ToolPatch(top, down, 0.015, 0.05)
    >>> body = build(block_mesh((0.06, 0.04, 0.03), 0.015), Tissue(), support, tool)
    >>> f"{1e3 * static_field(body, top[None])[0, 2]:.2f} mm at rest"
    '-0.22 mm at rest'

Names listed in `__all__` keep their meaning and their arguments from one minor version to the next;
everything else may change.
"""

from fem_reference.certificate import Certificate, Comparison, comparison
from fem_reference.certified import CertifiedMotion
from fem_reference.dynamics import Oscillator, SteppedMotion
from fem_reference.elasticity import Body, discretise
from fem_reference.elements import ELEMENTS, Element
from fem_reference.error_estimate import ErrorEstimate, discretisation_error
from fem_reference.laws import LAWS, Law
from fem_reference.model import METHODS, Method, Solution, build, run, static_field
from fem_reference.newton import solve as solve_hyperelastic
from fem_reference.observation import at_points, evaluation, largest_rotation, largest_strain
from fem_reference.solvers import solve_static
from fem_reference.subspace import Subspace, SubspaceMotion, modal_subspace, ritz_subspace
from study.numerics.continuation import EquilibriumPath
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation, Trajectory

__all__ = [
    "ELEMENTS",
    "LAWS",
    "METHODS",
    "Body",
    "Certificate",
    "CertifiedMotion",
    "Comparison",
    "Element",
    "EquilibriumPath",
    "ErrorEstimate",
    "Foundation",
    "Law",
    "Method",
    "Observation",
    "Oscillator",
    "RayleighDamping",
    "Solution",
    "SteppedMotion",
    "Subspace",
    "SubspaceMotion",
    "Tissue",
    "ToolPatch",
    "Trajectory",
    "at_points",
    "build",
    "comparison",
    "discretisation_error",
    "discretise",
    "evaluation",
    "largest_rotation",
    "largest_strain",
    "modal_subspace",
    "ritz_subspace",
    "run",
    "solve_hyperelastic",
    "solve_static",
    "static_field",
]
