"""Conforming tetrahedra of an implicit shape by isosurface stuffing.

Labelle and Shewchuk (2007), Isosurface stuffing, ACM Trans. Graph. 26(3):57. A body-centred cubic
lattice is laid over the shape; lattice nodes close to the surface are moved onto it and the edges
that still cross it are cut. The quadrilaterals left by the cut are split at their lowest node
number, so neighbours agree; the published angle bound is for other stencils, hence a test holds the
smallest dihedral angle instead.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
SignedFunction = Callable[[Floats], Floats]

# A node moves to a crossing nearer than this fraction of the edge (Labelle and Shewchuk, table 2).
SNAP_LONG = 0.24999
SNAP_SHORT = 0.41189
BISECTIONS = 40


def stuff(
    signed: SignedFunction, lower: Floats, upper: Floats, element_size: float
) -> TetrahedralMesh:
    """Tetrahedra of `signed(points) < 0` inside a box.

    `lower`, `upper`: corners [m] of a box that holds the shape; `element_size`: cube edge [m] of
    the lattice, the longest edge of interior elements.
    """
    nodes, tetrahedra = body_centred_lattice(lower, upper, element_size)
    value = signed(nodes)
    tetrahedra = tetrahedra[(value[tetrahedra] < 0).any(axis=1)]
    nodes, value = _snap(signed, nodes, value, tetrahedra, element_size)
    points, pieces = _cut(signed, nodes, value, tetrahedra)
    return _compact(points, _largest_component(len(points), _orient(points, pieces)))


def body_centred_lattice(lower: Floats, upper: Floats, size: float) -> tuple[Floats, Ints]:
    """Nodes and tetrahedra of a body-centred cubic lattice of cube edge `size` over a box."""
    shape = np.ceil((upper - lower) / size).astype(int) + 2
    origin = 0.5 * (lower + upper) - 0.5 * size * (shape - 1)
    corner = np.arange(np.prod(shape)).reshape(shape)
    centre = corner[:-1, :-1, :-1] + corner.size  # the centre keeps its lowest corner's number
    grid = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    nodes = np.concatenate([origin + size * grid, origin + size * (grid + 0.5)])
    return nodes, np.concatenate([_tetrahedra_across(corner, centre, axis) for axis in range(3)])


def _tetrahedra_across(corner: Ints, centre: Ints, axis: int) -> Ints:
    """Four tetrahedra round each pair of centres joined through a face normal to `axis`."""
    corner, centre = np.moveaxis(corner, axis, 0), np.moveaxis(centre, axis, 0)
    a, b = centre[:-1].ravel(), centre[1:].ravel()
    face = corner[1:-1]
    ring = [face[:, :-1, :-1], face[:, 1:, :-1], face[:, 1:, 1:], face[:, :-1, 1:]]
    ring = [r.ravel() for r in ring]
    return np.concatenate([np.stack([a, b, ring[i], ring[(i + 1) % 4]], axis=1) for i in range(4)])


def _edges(tetrahedra: Ints) -> Ints:
    pairs = tetrahedra[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _crossing(signed: SignedFunction, inside: Floats, outside: Floats) -> Floats:
    """Point where each segment meets the surface, by bisection."""
    low, high = np.zeros(len(inside)), np.ones(len(inside))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        is_inside = signed(inside + middle[:, None] * (outside - inside)) < 0
        low, high = np.where(is_inside, middle, low), np.where(is_inside, high, middle)
    return np.asarray(inside + low[:, None] * (outside - inside))


def _cut_edges(value: Floats, tetrahedra: Ints) -> Ints:
    """Edges that cross the surface, the inner node first."""
    edges = _edges(tetrahedra)
    sign = np.sign(value[edges])
    edges = edges[sign[:, 0] * sign[:, 1] < 0]
    return np.where(value[edges[:, :1]] < 0, edges, edges[:, ::-1])


def _snap(
    signed: SignedFunction, nodes: Floats, value: Floats, tetrahedra: Ints, size: float
) -> tuple[Floats, Floats]:
    """Move each node that lies close to a crossing onto the nearest one; its value becomes zero."""
    edges = _cut_edges(value, tetrahedra)
    ends = nodes[edges]
    points = _crossing(signed, ends[:, 0], ends[:, 1])
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    limit = np.where(length > 0.95 * size, SNAP_LONG, SNAP_SHORT) * length
    distance = np.linalg.norm(ends - points[:, None], axis=2)
    near, side = np.nonzero(distance < limit[:, None])
    order = np.argsort(-distance[near, side], kind="stable")  # the nearest crossing writes last
    near, side = near[order], side[order]
    moved, zeroed = nodes.copy(), value.copy()
    moved[edges[near, side]] = points[near]
    zeroed[edges[near, side]] = 0.0
    return moved, zeroed


def _cut(
    signed: SignedFunction, nodes: Floats, value: Floats, tetrahedra: Ints
) -> tuple[Floats, Ints]:
    """Points with the crossings appended, and the inner parts of all tetrahedra."""
    tetrahedra = tetrahedra[(value[tetrahedra] < 0).any(axis=1)]
    edges = _cut_edges(value, tetrahedra)
    crossings = _crossing(signed, nodes[edges[:, 0]], nodes[edges[:, 1]])
    key = np.sort(edges, axis=1) @ np.array([len(nodes), 1])
    order = np.argsort(key)

    def cut(a: Ints, b: Ints) -> Ints:
        """Number of the crossing on each edge a-b."""
        wanted = np.minimum(a, b) * len(nodes) + np.maximum(a, b)
        return np.asarray(len(nodes) + order[np.searchsorted(key, wanted, sorter=order)])

    order_in_tetrahedron = np.argsort(np.sign(value[tetrahedra]), axis=1, kind="stable")
    vertex = np.take_along_axis(tetrahedra, order_in_tetrahedron, axis=1)
    inside = (value[vertex] < 0).sum(axis=1)
    outside = (value[vertex] > 0).sum(axis=1)

    def group(n_inside: int, n_outside: int) -> Ints:
        return np.asarray(vertex[(inside == n_inside) & (outside == n_outside)].T)

    pieces = [vertex[outside == 0]]
    a, b, c, d = group(1, 3)
    pieces.append(np.stack([a, cut(a, b), cut(a, c), cut(a, d)], axis=1))
    a, z, c, d = group(1, 2)
    pieces.append(np.stack([a, z, cut(a, c), cut(a, d)], axis=1))
    a, z, y, d = group(1, 1)
    pieces.append(np.stack([a, z, y, cut(a, d)], axis=1))
    a, b, z, d = group(2, 1)
    pieces.append(_split_pyramids(np.stack([a, b, cut(b, d), cut(a, d)], axis=1), z))
    a, b, c, d = group(2, 2)
    wedge = np.stack([a, cut(a, c), cut(a, d), b, cut(b, c), cut(b, d)], axis=1)
    pieces.append(_split_prisms(wedge))
    a, b, c, d = group(3, 1)
    pieces.append(_split_prisms(np.stack([a, b, c, cut(a, d), cut(b, d), cut(c, d)], axis=1)))
    return np.concatenate([nodes, crossings]), np.concatenate(pieces)


def _split_pyramids(base: Ints, apex: Ints) -> Ints:
    """Two tetrahedra of each pyramid; its quadrilateral base is split at the lowest number."""
    turn = np.argmin(base, axis=1)
    b = np.take_along_axis(base, (np.arange(4) + turn[:, None]) % 4, axis=1)
    first = np.stack([b[:, 0], b[:, 1], b[:, 2], apex], axis=1)
    return np.concatenate([first, np.stack([b[:, 0], b[:, 2], b[:, 3], apex], axis=1)])


# Prism corners (triangle 0 1 2, above it 3 4 5) renumbered so that corner i comes first.
_PRISM_TURNS = np.array(
    [
        [0, 1, 2, 3, 4, 5],
        [1, 2, 0, 4, 5, 3],
        [2, 0, 1, 5, 3, 4],
        [3, 5, 4, 0, 2, 1],
        [4, 3, 5, 1, 0, 2],
        [5, 4, 3, 2, 1, 0],
    ]
)


def _split_prisms(prism: Ints) -> Ints:
    """Three tetrahedra of each prism; each side is split at its lowest number.

    Dompierre et al. (1999), How to subdivide pyramids, prisms and hexahedra into tetrahedra.
    """
    v = np.take_along_axis(prism, _PRISM_TURNS[np.argmin(prism, axis=1)], axis=1).T
    diagonal_15 = np.minimum(v[1], v[5]) < np.minimum(v[2], v[4])
    second = np.where(diagonal_15, [v[0], v[1], v[2], v[5]], [v[0], v[1], v[2], v[4]])
    third = np.where(diagonal_15, [v[0], v[1], v[5], v[4]], [v[0], v[4], v[2], v[5]])
    return np.concatenate([second.T, third.T, np.stack([v[0], v[4], v[5], v[3]], axis=1)])


def _orient(points: Floats, tetrahedra: Ints) -> Ints:
    edges = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    negative = np.linalg.det(edges) < 0
    oriented = tetrahedra.copy()
    oriented[negative, 2:] = oriented[negative, :1:-1]
    return oriented


def _largest_component(node_count: int, tetrahedra: Ints) -> Ints:
    """Drop crumbs that the lattice cuts off where the shape is thinner than an element."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first = np.repeat(tetrahedra[:, :1], 3, axis=1).ravel()
    links = (np.ones(first.size), (first, tetrahedra[:, 1:].ravel()))
    graph = coo_array(links, shape=(node_count, node_count))
    label = connected_components(graph, directed=False)[1][tetrahedra[:, 0]]
    return np.asarray(tetrahedra[label == np.bincount(label).argmax()])


def _compact(points: Floats, tetrahedra: Ints) -> TetrahedralMesh:
    used, renumbered = np.unique(tetrahedra, return_inverse=True)
    return TetrahedralMesh(points[used], renumbered.reshape(tetrahedra.shape))
