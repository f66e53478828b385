"""Local refinement of tetrahedra by bisection, until no node hangs on a neighbour's edge.

A tetrahedron is cut through the middle of its longest edge; one that has that middle on one of its
own edges is cut through its longest edge in turn, and so on. As all edges are in one order, two
tetrahedra cut their common face alike. Every child lies within its parent, so that functions that
are piecewise polynomial on the old mesh are so on the new one. Rivara and Levin (1992), Commun.
Appl. Numer. Methods 8:281. scikit-fem's own bisection returns neither parents nor cut edges, and
sets the seed of numpy's global generator.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import EDGES, volumes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_KEY = 2**31
"""Above any number of nodes; an edge's key is its lower node times this, plus the higher."""


@dataclass(frozen=True)
class Bisection:
    """A refined mesh, whose first points are those of the previous one.

    `parents` (t,): tetrahedron of the old mesh that contains each new one.
    """

    mesh: TetrahedralMesh
    parents: Ints


def cut_into(mesh: TetrahedralMesh, parts: Floats) -> Bisection:
    """Each tetrahedron (t,) bisected until its pieces have at most its volume over its `parts`.

    To keep the mesh conforming, neighbours may be bisected too.
    """
    wanted = np.abs(volumes(mesh)) / parts
    found = Bisection(mesh, np.arange(len(mesh.tetrahedra)))
    while True:
        marked = np.abs(volumes(found.mesh)) > wanted[found.parents] * (1.0 + 1e-9)
        if not marked.any():
            return found
        once = bisected(found.mesh, marked)
        found = Bisection(once.mesh, found.parents[once.parents])


def bisected(mesh: TetrahedralMesh, marked: Booleans) -> Bisection:
    """The marked tetrahedra (t,) bisected, and those beside them that would have a hanging node."""
    points, tetrahedra = mesh.points, mesh.tetrahedra
    parents, split = np.arange(len(tetrahedra)), np.empty(0, dtype=np.int64)
    while marked.any():
        ends = _longest_edges(points, tetrahedra[marked])
        fresh = np.setdiff1d(_keys(ends), split)
        split = np.concatenate([split, fresh])
        middles = points[np.stack([fresh // _KEY, fresh % _KEY])].mean(axis=0)
        points = np.concatenate([points, middles])
        order = np.argsort(split)
        place = np.searchsorted(split, _keys(ends), sorter=order)
        middle = len(mesh.points) + order[place]
        children = [_replaced(tetrahedra[marked], ends[:, i], middle) for i in range(2)]
        tetrahedra = np.concatenate([tetrahedra, children[1]])
        tetrahedra[: len(marked)][marked] = children[0]
        parents = np.concatenate([parents, parents[marked]])
        marked = _with_hanging_nodes(tetrahedra, np.sort(split), len(points))
    return Bisection(TetrahedralMesh(points, tetrahedra), parents)


def _with_hanging_nodes(tetrahedra: Ints, split: Ints, count: int) -> Booleans:
    """Which tetrahedra have an edge of those, in order, that have been cut; of `count` nodes."""
    is_end = np.zeros(count, dtype=np.bool_)
    is_end[split // _KEY] = is_end[split % _KEY] = True
    near = np.flatnonzero(is_end[tetrahedra].sum(axis=1) > 1)
    keys = _keys(tetrahedra[near][:, EDGES])
    place = np.minimum(np.searchsorted(split, keys), len(split) - 1)
    found = np.zeros(len(tetrahedra), dtype=np.bool_)
    found[near] = (split[place] == keys).any(axis=1)
    return found


def _keys(ends: Ints) -> Ints:
    """One number per edge of ends (..., 2)."""
    return np.asarray(ends.min(axis=-1) * _KEY + ends.max(axis=-1))


def _longest_edges(points: Floats, tetrahedra: Ints) -> Ints:
    """Ends (t, 2) of the longest edge; of equal ones that with the highest key."""
    ends = tetrahedra[:, EDGES]
    square = ((points[ends[..., 1]] - points[ends[..., 0]]) ** 2).sum(axis=2)
    longest = square == square.max(axis=1, keepdims=True)
    chosen = np.where(longest, _keys(ends), -1).argmax(axis=1)
    return np.asarray(ends[np.arange(len(ends)), chosen])


def _replaced(tetrahedra: Ints, nodes: Ints, by: Ints) -> Ints:
    """Each tetrahedron with one of its nodes replaced, which keeps its orientation."""
    return np.where(tetrahedra == nodes[:, None], by[:, None], tetrahedra)
