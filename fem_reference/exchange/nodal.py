"""A discretised body as plain arrays: nodes, elements, nodal forces, foundation, material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fem_reference.elasticity import Body
from fem_reference.external_loads import ExternalLoads, weight_forces
from study.mesh.tetrahedra import FACES
from study.problem.supports import Support
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DIRECTIONS = 3
WEIGHTLESS = ExternalLoads()
# Corners of an edge, and mid-side nodes of each face of FACES, by their place in an element.
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
FACE_EDGES = np.array([[5, 8, 9], [6, 7, 9], [4, 7, 8], [4, 5, 6]])


@dataclass(frozen=True)
class NodalProblem:
    """The problem in nodal quantities, for another code to solve.

    `nodes` [m] (n, 3), mid-side nodes where the element has them; `elements` (t, 4) or (t, 10),
    corners, then the middles of edges 01, 12, 02, 03, 13, 23, the order of C3D10 and of VTK;
    `load` [N] (n, 3), nodal forces at full load; `support` [N/m] (n, n), the foundation, which
    couples the nodes in each direction alike; `support_density` [Pa/m] (n,), its stiffness per
    area, mean of the facets at a node. `others` [N] (n, 3) each: further loads. `gravity` [m/s^2]
    (3,) on the tissue and `weight_forces` [N] (n, 3), its forces on attached weights; both None
    where the given shape is the one under gravity. `full` (loads,): factor of each load in the
    static problem, None for 1 each.
    """

    nodes: Floats
    elements: Ints
    tissue: Tissue
    load: Floats
    support: csr_array
    support_density: Floats
    others: tuple[Floats, ...] = ()
    gravity: Floats | None = None
    weight_forces: Floats | None = None
    full: Floats | None = None

    @property
    def full_load(self) -> Floats:
        """Nodal forces [N] (n, 3) of all loads in full: of one that travels, at one place."""
        full = np.ones(len(self.loads)) if self.full is None else self.full
        return np.asarray(np.einsum("k,knd->nd", full, np.array(self.loads)))

    @property
    def is_merged(self) -> bool:
        """Whether loads meet at a node, or are not all there in full at once."""
        loaded = [forces != 0.0 for forces in self.loads]
        meet = bool((np.sum(loaded, axis=0) > 1).any())
        return meet or (self.full is not None and bool((self.full != 1.0).any()))

    @property
    def loads(self) -> tuple[Floats, ...]:
        """Nodal forces [N] (n, 3) of each load that has a history."""
        return (self.load, *self.others)

    @property
    def curved(self) -> bool:
        """Whether a mid-side node lies off the middle of its edge."""
        if self.elements.shape[1] == 4:
            return False
        ends = self.nodes[self.elements[:, EDGES]]
        middle = self.nodes[self.elements[:, 4:]]
        edge = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
        offset = np.linalg.norm(ends.mean(axis=2) - middle, axis=2)
        return bool((offset > 1e-9 * edge).any())


def nodal_problem(
    body: Body, tissue: Tissue, foundation: Support, external: ExternalLoads = WEIGHTLESS
) -> NodalProblem:
    """The problem that a body is, as plain arrays.

    ValueError for Taylor-Hood elements: only the displacement elements have counterparts.
    """
    if body.element == "taylor-hood":
        raise ValueError(
            "reference.element: taylor-hood has no counterpart in other codes' files; set it to "
            '"p2" (or lower tissue.poisson_ratio)'
        )
    elements = np.asarray(body.nodes.element_dofs.T, dtype=np.int64)
    return NodalProblem(
        body.points,
        elements,
        tissue,
        body.load.reshape(-1, DIRECTIONS),
        csr_array(body.support[::DIRECTIONS, ::DIRECTIONS]),
        _density(body.points, elements, foundation),
        tuple(other.reshape(-1, DIRECTIONS) for other in body.others),
        None if body.dead is None else external.gravity,
        _weight_forces(body, external),
        body.full,
    )


def _weight_forces(body: Body, external: ExternalLoads) -> Floats | None:
    if body.dead is None or not external.weights:
        return None
    return weight_forces(body, external).reshape(-1, DIRECTIONS)


def _density(nodes: Floats, elements: Ints, foundation: Support) -> Floats:
    facets = _boundary_facets(elements)
    a, b, c = (nodes[facets[:, i]] for i in range(3))
    doubled = np.cross(b - a, c - a)
    area = np.linalg.norm(doubled, axis=1, keepdims=True)
    density = foundation.density(nodes[facets], (doubled / area)[:, None])
    total = np.bincount(facets.ravel(), (area * density).ravel(), len(nodes))
    around = np.bincount(facets.ravel(), np.broadcast_to(area, facets.shape).ravel(), len(nodes))
    return np.divide(total, around, out=np.zeros(len(nodes)), where=around > 0.0)


def _boundary_facets(elements: Ints) -> Ints:
    """Nodes of each facet on the boundary, corners first and outward: (k, 3) or (k, 6)."""
    corners = elements[:, FACES].reshape(-1, 3)
    whole = corners
    if elements.shape[1] > 4:
        whole = np.hstack([corners, elements[:, FACE_EDGES].reshape(-1, 3)])
    _, first, count = np.unique(
        np.sort(corners, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(whole[first[count == 1]])
