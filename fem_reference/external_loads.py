"""External loads of a body: further loads, attached weights and gravity."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.assembly import by_component, rows
from fem_reference.elasticity import FACET_ORDER, Body, decoupled, patch_load, without_fixed
from study.problem.contact import ToolPatch, Weight
from study.problem.problem import Problem

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ExternalLoads:
    """Further `loads`, attached `weights`, and `gravity` [m/s^2] (3,) on weights and tissue.

    `given_loaded`: whether the given shape is in equilibrium under gravity. Small displacements
    from it are those of a weightless body, and gravity does not enter. `full` (loads,): share of
    each load, the first tool's included, in the static solution under all loads; None for 1 each.
    """

    loads: tuple[ToolPatch, ...] = ()
    weights: tuple[Weight, ...] = ()
    gravity: Floats = field(default_factory=lambda: np.zeros(3))
    given_loaded: bool = False
    full: Floats | None = None


def external_loads(problem: Problem) -> ExternalLoads:
    """The external loads of a problem beside its first."""
    loads = tuple(load.tool for load in problem.loads)
    given = problem.weights, problem.gravity, problem.given_loaded
    return ExternalLoads(loads, *given, problem.full)


def with_external_loads(body: Body, external: ExternalLoads) -> Body:
    """The body with further loads, the mass of weights, and the dead load of gravity.

    ValueError for a load or a weight that touches no surface of the mesh.
    """
    others: tuple[Floats, ...] = ()
    mass, nodal = body.mass, body.nodal_mass
    if external.loads or external.weights:
        nodes = body.nodes
        surface = skfem.FacetBasis(nodes.mesh, nodes.elem, nodes.mapping, intorder=FACET_ORDER)
        forces = (_patch_forces(surface, patch) for patch in external.loads)
        others = tuple(without_fixed(force, body.fixed) for force in forces)
        for attached in _weight_masses(surface, external.weights):
            mass = csc_array(mass + decoupled(attached, body.fixed))
            nodal = nodal + attached.sum(axis=1)
    dead: Floats | None = None
    if external.gravity.any() and not external.given_loaded:
        dead = without_fixed(nodal * np.tile(external.gravity, body.node_count), body.fixed)
    return replace(body, mass=mass, nodal_mass=nodal, others=others, dead=dead, full=external.full)


def weight_forces(body: Body, external: ExternalLoads) -> Floats:
    """Nodal forces [N] (n,) of gravity on the attached weights alone."""
    nodes = body.nodes
    surface = skfem.FacetBasis(nodes.mesh, nodes.elem, nodes.mapping, intorder=FACET_ORDER)
    nodal = np.zeros_like(body.load)
    for attached in _weight_masses(surface, external.weights):
        nodal += attached.sum(axis=1)
    return without_fixed(nodal * np.tile(external.gravity, body.node_count), body.fixed)


def _weight_masses(surface: skfem.FacetBasis, weights: tuple[Weight, ...]) -> list[csc_array]:
    return [_weight_mass(surface, one, f"weight.{n}") for n, one in enumerate(weights, 1)]


def _patch_forces(surface: skfem.FacetBasis, patch: ToolPatch) -> Floats:
    """Nodal forces [N] (n,) of a load."""
    if not patch.profile(rows(surface.global_coordinates()), rows(surface.normals)).any():
        raise _untouched(surface, patch.name)
    return patch_load(surface, patch)


def _weight_mass(surface: skfem.FacetBasis, weight: Weight, name: str) -> csc_array:
    """Mass matrix [kg] (n, n) of a weight distributed over its patch."""
    patch = weight.patch
    form = skfem.BilinearForm(lambda u, v, w: patch.profile(rows(w.x), rows(w.n)) * u * v)
    distribution = csc_array(form.assemble(surface))
    total = float(distribution.sum())  # the shape functions sum to one
    if not total > 0.0:
        raise _untouched(surface, name)
    return by_component((weight.mass / total) * distribution)


def _untouched(surface: skfem.FacetBasis, name: str) -> ValueError:
    return ValueError(
        f"{name}: touches no surface on a mesh of {surface.mesh.nelements} tetrahedra; enlarge "
        f"{name}.radius, move {name}.place or reduce reference.element_size"
    )
