"""Elements that share nodes, edges and faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import IndexArray
from study.mesh.tetrahedra import FACES


@dataclass(frozen=True)
class RowGroups:
    """Rows that contain the same nodes in any order."""

    group: IndexArray
    """Number of the group each row belongs to, shape (rows,)."""
    first: IndexArray
    """First row of each group."""
    count: IndexArray
    """Rows in each group."""


def group_rows(rows: IndexArray) -> RowGroups:
    """Group rows by their set of nodes.

    One column is merged at a time, so the keys stay below rows x nodes and never overflow.
    """
    ordered = np.sort(rows, axis=1)
    nodes = int(rows.max(initial=0)) + 1
    key = ordered[:, 0]
    for column in ordered.T[1:]:
        key = np.unique(key, return_inverse=True)[1] * nodes + column
    _, first, group, count = np.unique(
        key, return_index=True, return_inverse=True, return_counts=True
    )
    return RowGroups(group, first, count)


def faces_of(tetrahedra: IndexArray) -> IndexArray:
    """Outward faces of every tetrahedron, shape (4 t, 3); rows 4 e to 4 e + 3 are element e's."""
    return np.asarray(tetrahedra[:, FACES].reshape(-1, 3))


def edges_of(triangles: IndexArray) -> IndexArray:
    """Directed edges of every triangle, shape (3 k, 2); rows 3 e to 3 e + 2 are triangle e's."""
    return triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)


def shared_pairs(groups: RowGroups) -> IndexArray:
    """The two rows of every group that has exactly two, shape (pairs, 2)."""
    order = np.argsort(groups.group, kind="stable")
    in_pair = groups.count[groups.group[order]] == 2
    return np.asarray(order[in_pair].reshape(-1, 2))


def linked_rows(groups: RowGroups) -> IndexArray:
    """Every row with the first one of its group, shape (rows, 2), however many a group has."""
    return np.stack([groups.first[groups.group], np.arange(len(groups.group))], axis=1)


def same_turn(first: IndexArray, second: IndexArray) -> NDArray[np.bool_]:
    """Whether rows with the same nodes (edges or triangles) have the same orientation."""
    return np.asarray(_even(first) == _even(second))


def _even(rows: IndexArray) -> NDArray[np.bool_]:
    """Whether an even permutation sorts the row; an edge counts as even if it ascends."""
    if rows.shape[1] == 2:
        return rows[:, 0] < rows[:, 1]
    return np.asarray((rows < np.roll(rows, -1, axis=1)).sum(axis=1) == 2)


def components(pairs: IndexArray, count: int) -> tuple[int, IndexArray]:
    """Number of connected pieces among `count` items linked by pairs, and each item's piece."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(pairs), dtype=np.int8), tuple(pairs.T)), shape=(count, count))
    found: tuple[int, NDArray[Any]] = connected_components(links, directed=False)
    return int(found[0]), found[1].astype(np.int64)
