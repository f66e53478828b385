"""What a body carries beside the first tool's pressure: further loads, weights, its own weight."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.elasticity import (
    FACET_ORDER,
    Body,
    by_component,
    decoupled,
    patch_load,
    rows,
    without_fixed,
)
from study.problem.contact import ToolPatch, Weight
from study.problem.problem import Problem

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Burden:
    """Further `loads`, attached `weights`, and `gravity` [m/s^2] (3,) on these and on the tissue.

    `given_loaded`: whether the given shape is that at rest under gravity. Small displacements from
    there are those of a weightless body, so that gravity leaves no trace in them. `full` (loads,):
    share of each load, the first tool's too, in the rest under all of them; None for all of each.
    """

    loads: tuple[ToolPatch, ...] = ()
    weights: tuple[Weight, ...] = ()
    gravity: Floats = field(default_factory=lambda: np.zeros(3))
    given_loaded: bool = False
    full: Floats | None = None


def burden_of(problem: Problem) -> Burden:
    """That of a problem."""
    loads = tuple(load.tool for load in problem.loads)
    given = problem.weights, problem.gravity, problem.given_loaded
    return Burden(loads, *given, problem.full)


def laden(body: Body, burden: Burden) -> Body:
    """The body with a burden: more loads, the mass of weights, and the dead load of gravity.

    ValueError for a load or a weight that touches no surface of the mesh.
    """
    others: tuple[Floats, ...] = ()
    mass, nodal = body.mass, body.nodal_mass
    if burden.loads or burden.weights:
        nodes = body.nodes
        surface = skfem.FacetBasis(nodes.mesh, nodes.elem, nodes.mapping, intorder=FACET_ORDER)
        others = tuple(without_fixed(_placed(surface, patch), body.fixed) for patch in burden.loads)
        for attached in _all_attached(surface, burden.weights):
            mass = csc_array(mass + decoupled(attached, body.fixed))
            nodal = nodal + attached.sum(axis=1)
    dead: Floats | None = None
    if burden.gravity.any() and not burden.given_loaded:
        dead = without_fixed(nodal * np.tile(burden.gravity, body.node_count), body.fixed)
    return replace(body, mass=mass, nodal_mass=nodal, others=others, dead=dead, full=burden.full)


def hanging(body: Body, burden: Burden) -> Floats:
    """Nodal forces [N] (n,) of attached weights alone under gravity."""
    nodes = body.nodes
    surface = skfem.FacetBasis(nodes.mesh, nodes.elem, nodes.mapping, intorder=FACET_ORDER)
    nodal = np.zeros_like(body.load)
    for attached in _all_attached(surface, burden.weights):
        nodal += attached.sum(axis=1)
    return without_fixed(nodal * np.tile(burden.gravity, body.node_count), body.fixed)


def _all_attached(surface: Any, weights: tuple[Weight, ...]) -> list[csc_array]:
    return [_attached(surface, one, f"weight.{n}") for n, one in enumerate(weights, 1)]


def _placed(surface: Any, patch: ToolPatch) -> Floats:
    """Nodal forces [N] (n,) of a load."""
    if not patch.profile(rows(surface.global_coordinates()), rows(surface.normals)).any():
        raise _untouched(surface, patch.name)
    return patch_load(surface, patch)


def _attached(surface: Any, weight: Weight, name: str) -> csc_array:
    """Mass matrix [kg] (n, n) of a weight that is shared out over its patch."""
    patch = weight.patch
    form = skfem.BilinearForm(lambda u, v, w: patch.profile(rows(w.x), rows(w.n)) * u * v)
    shared = csc_array(form.assemble(surface))
    whole = float(shared.sum())  # shape functions add up to one
    if not whole > 0.0:
        raise _untouched(surface, name)
    return by_component((weight.mass / whole) * shared)


def _untouched(surface: Any, name: str) -> ValueError:
    return ValueError(
        f"{name}: touches no surface on a mesh of {surface.mesh.nelements} tetrahedra; enlarge "
        f"{name}.radius, move {name}.place or reduce reference.element_size"
    )
