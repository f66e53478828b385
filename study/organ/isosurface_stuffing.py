"""Conforming tetrahedra of an implicit shape by isosurface stuffing.

Labelle and Shewchuk (2007), Isosurface stuffing, ACM Trans. Graph. 26(3):57. A body-centred cubic
lattice is laid over the shape; lattice nodes close to the surface are moved onto it and the edges
that still cross it are cut. The quadrilaterals left by the cut are split at their lowest node
number, so neighbours agree; the published angle bound is for other stencils, hence a test holds the
smallest dihedral angle instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
SignedFunction = Callable[[Floats], Floats]

# A node moves to a crossing nearer than this fraction of the edge (Labelle and Shewchuk, table 2).
SNAP_LONG = 0.24999
SNAP_SHORT = 0.41189
TO_NEAREST = 2.0 / math.sqrt(3.0)
"""Long edge over short edge of the lattice; a node has both."""
LONG = 0.95
"""Share of the long edge above which an edge counts as long."""
BISECTIONS = 40
PARTS = 2.0**BISECTIONS
"""Number of parts of a segment that bisection distinguishes."""
SURE, GUESSES = 5, 5
"""Bisections before false position, and evaluations by it."""
CLOSE = 1.5
"""Distance from the shape, in lattice cubes, within which a finer lattice may find more of it."""


class Stuffed(NamedTuple):
    """The part of a background mesh in which a shape's function is negative.

    `origins` (t,): tetrahedron of the background that each one is part of.
    """

    mesh: TetrahedralMesh
    origins: Ints


def stuff(
    signed: SignedFunction, lower: Floats, upper: Floats, element_size: float
) -> TetrahedralMesh:
    """Tetrahedra of `signed(points) < 0` inside a box.

    `lower`, `upper`: corners [m] of a box that holds the shape; `element_size`: cube edge [m] of
    the lattice, the longest edge of interior elements.
    """
    return stuffed(signed, lattice_round(signed, lower, upper, element_size)).mesh


def lattice_round(
    signed: SignedFunction, lower: Floats, upper: Floats, element_size: float
) -> TetrahedralMesh:
    """The tetrahedra of a lattice over a box that intersect the shape, or lie close to it."""
    nodes, tetrahedra = body_centred_lattice(lower, upper, element_size)
    close = (signed(nodes)[tetrahedra] < CLOSE * element_size).any(axis=1)
    return _compact(nodes, tetrahedra[close])


def stuffed(signed: SignedFunction, background: TetrahedralMesh) -> Stuffed:
    """Tetrahedra of `signed(points) < 0` in a mesh that is cut along the surface."""
    value = signed(background.points)
    inner = np.flatnonzero((value[background.tetrahedra] < 0).any(axis=1))
    tetrahedra = background.tetrahedra[inner]
    nodes, value = _snap(signed, background.points, value, tetrahedra)
    points, pieces, origins = _cut(signed, nodes, value, tetrahedra)
    kept = _largest_component(len(points), pieces)
    return Stuffed(_compact(points, _orient(points, pieces)[kept]), inner[origins[kept]])


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
    """Four tetrahedra around each pair of centres joined through a face normal to `axis`."""
    corner, centre = np.moveaxis(corner, axis, 0), np.moveaxis(centre, axis, 0)
    a, b = centre[:-1].ravel(), centre[1:].ravel()
    face = corner[1:-1]
    ring = [face[:, :-1, :-1], face[:, 1:, :-1], face[:, 1:, 1:], face[:, :-1, 1:]]
    ring = [r.ravel() for r in ring]
    return np.concatenate([np.stack([a, b, ring[i], ring[(i + 1) % 4]], axis=1) for i in range(4)])


def _crossing(signed: SignedFunction, inside: Floats, outside: Floats) -> Floats:
    """Point where each segment meets the surface: the last one inside that bisection reaches.

    After some bisections, false position needs less than half of the remaining evaluations. Its
    result counts if the adjacent points of bisection are inside and outside; otherwise bisection
    continues.
    """
    span = outside - inside

    def at(share: Floats, some: Any = slice(None)) -> Floats:
        return signed(inside[some] + share[:, None] * span[some])

    low, high = np.zeros(len(inside)), np.ones(len(inside))
    ends = at(low), at(high)
    for _ in range(SURE):
        low, high, ends = _narrowed(low, high, ends, 0.5 * (low + high), at)
    guess = np.clip(np.floor(_false_position(low, high, ends, at) * PARTS) / PARTS, low, high)
    is_it = (at(guess) < 0) & ~(at(guess + 1.0 / PARTS) < 0)
    left = np.flatnonzero(~is_it)
    a, b, some = low[left], high[left], (ends[0][left], ends[1][left])
    for _ in range(BISECTIONS - SURE if len(left) else 0):
        a, b, some = _narrowed(a, b, some, 0.5 * (a + b), lambda share: at(share, left))
    low = guess
    low[left] = a
    return np.asarray(inside + low[:, None] * span)


Ends = tuple[Floats, Floats]


def _narrowed(
    low: Floats, high: Floats, ends: Ends, share: Floats, at: Callable[[Floats], Floats]
) -> tuple[Floats, Floats, Ends]:
    """Brackets, and the function at their ends, after an evaluation at a share of each."""
    value = at(share)
    is_inside = value < 0
    narrowed = np.where(is_inside, value, ends[0]), np.where(is_inside, ends[1], value)
    return np.where(is_inside, share, low), np.where(is_inside, high, share), narrowed


def _false_position(
    low: Floats, high: Floats, ends: Ends, at: Callable[[Floats], Floats]
) -> Floats:
    """Where the function is about zero; the weight of an end that stays is halved.

    The Illinois method: Dowell and Jarratt (1971), BIT 11:168.
    """
    stayed = np.zeros(len(low))  # -1 where the lower end was moved last, 1 the higher

    def guess() -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):  # both ends on the surface
            found = low - ends[0] * (high - low) / (ends[1] - ends[0])
        return np.where((low <= found) & (found <= high), found, low)

    for _ in range(GUESSES):
        before, (low, high, ends) = low, _narrowed(low, high, ends, guess(), at)
        moved = np.where(low != before, -1.0, 1.0)
        again = moved == stayed
        ends = (
            np.where(again & (moved > 0), 0.5 * ends[0], ends[0]),
            np.where(again & (moved < 0), 0.5 * ends[1], ends[1]),
        )
        stayed = moved
    return guess()


def _cut_edges(value: Floats, tetrahedra: Ints) -> Ints:
    """Edges that cross the surface, the inner node first."""
    crossed = edges(tetrahedra)
    sign = np.sign(value[crossed])
    crossed = crossed[sign[:, 0] * sign[:, 1] < 0]
    return np.where(value[crossed[:, :1]] < 0, crossed, crossed[:, ::-1])


def _snap(
    signed: SignedFunction, nodes: Floats, value: Floats, tetrahedra: Ints
) -> tuple[Floats, Floats]:
    """Move each node close to a crossing onto the nearest one; its value becomes zero."""
    crossed = _cut_edges(value, tetrahedra)
    ends = nodes[crossed]
    points = _crossing(signed, ends[:, 0], ends[:, 1])
    limit = _snapping_distance(nodes, tetrahedra, crossed)
    distance = np.linalg.norm(ends - points[:, None], axis=2)
    near, side = np.nonzero(distance < limit)
    order = np.argsort(-distance[near, side], kind="stable")  # the nearest crossing writes last
    near, side = near[order], side[order]
    moved, zeroed = nodes.copy(), value.copy()
    moved[crossed[near, side]] = points[near]
    zeroed[crossed[near, side]] = 0.0
    return moved, zeroed


def _snapping_distance(nodes: Floats, tetrahedra: Ints, some: Ints) -> Floats:
    """Distance [m] that either end (e, 2) of some edges may move along it.

    In a graded lattice no farther than along an edge to the node's nearest neighbour.
    """
    every = edges(tetrahedra)
    length = np.linalg.norm(nodes[every[:, 1]] - nodes[every[:, 0]], axis=1)
    nearest = np.full(len(nodes), np.inf)
    np.minimum.at(nearest, every, length[:, None])
    own = np.linalg.norm(nodes[some[:, 1]] - nodes[some[:, 0]], axis=1)[:, None]
    short = own < LONG * TO_NEAREST * nearest[some]
    reach = np.minimum(own, np.where(short, 1.0, TO_NEAREST) * nearest[some])
    return np.asarray(np.where(short, SNAP_SHORT, SNAP_LONG) * reach)


def _cut(
    signed: SignedFunction, nodes: Floats, value: Floats, tetrahedra: Ints
) -> tuple[Floats, Ints, Ints]:
    """Points with the crossings appended, the inner parts of all tetrahedra, and their origins."""
    held = np.flatnonzero((value[tetrahedra] < 0).any(axis=1))
    tetrahedra = tetrahedra[held]
    crossed = _cut_edges(value, tetrahedra)
    crossings = _crossing(signed, nodes[crossed[:, 0]], nodes[crossed[:, 1]])
    key = np.sort(crossed, axis=1) @ np.array([len(nodes), 1])
    order = np.argsort(key)

    def cut(a: Ints, b: Ints) -> Ints:
        """Number of the crossing on each edge a-b."""
        wanted = np.minimum(a, b) * len(nodes) + np.maximum(a, b)
        return np.asarray(len(nodes) + order[np.searchsorted(key, wanted, sorter=order)])

    order_in_tetrahedron = np.argsort(np.sign(value[tetrahedra]), axis=1, kind="stable")
    vertex = np.take_along_axis(tetrahedra, order_in_tetrahedron, axis=1)
    inside = (value[vertex] < 0).sum(axis=1)
    outside = (value[vertex] > 0).sum(axis=1)

    origins = [held[outside == 0]]

    def group(n_inside: int, n_outside: int, count: int = 1) -> Ints:
        """Vertices of the tetrahedra so cut, each of which leaves `count` pieces."""
        chosen = (inside == n_inside) & (outside == n_outside)
        origins.append(np.tile(held[chosen], count))
        return np.asarray(vertex[chosen].T)

    pieces = [vertex[outside == 0]]
    a, b, c, d = group(1, 3)
    pieces.append(np.stack([a, cut(a, b), cut(a, c), cut(a, d)], axis=1))
    a, z, c, d = group(1, 2)
    pieces.append(np.stack([a, z, cut(a, c), cut(a, d)], axis=1))
    a, z, y, d = group(1, 1)
    pieces.append(np.stack([a, z, y, cut(a, d)], axis=1))
    a, b, z, d = group(2, 1, 2)
    pieces.append(_split_pyramids(np.stack([a, b, cut(b, d), cut(a, d)], axis=1), z))
    a, b, c, d = group(2, 2, 3)
    wedge = np.stack([a, cut(a, c), cut(a, d), b, cut(b, c), cut(b, d)], axis=1)
    pieces.append(_split_prisms(wedge))
    a, b, c, d = group(3, 1, 3)
    pieces.append(_split_prisms(np.stack([a, b, c, cut(a, d), cut(b, d), cut(c, d)], axis=1)))
    return np.concatenate([nodes, crossings]), np.concatenate(pieces), np.concatenate(origins)


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
    """Numbers of all tetrahedra except fragments of a shape thinner than an element."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first = np.repeat(tetrahedra[:, :1], 3, axis=1).ravel()
    links = (np.ones(first.size), (first, tetrahedra[:, 1:].ravel()))
    graph = coo_array(links, shape=(node_count, node_count))
    label = connected_components(graph, directed=False)[1][tetrahedra[:, 0]]
    return np.flatnonzero(label == np.bincount(label, minlength=1).argmax())


def _compact(points: Floats, tetrahedra: Ints) -> TetrahedralMesh:
    used, renumbered = np.unique(tetrahedra, return_inverse=True)
    return TetrahedralMesh(points[used], renumbered.reshape(tetrahedra.shape))
