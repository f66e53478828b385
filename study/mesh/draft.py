"""A mesh under repair: its arrays, their origin in the file, and the changes made."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from study.mesh.kinds import FloatArray, IndexArray, MeshError
from study.mesh.listing import listing
from study.mesh.topology import components, group_rows

WELD_TOLERANCE = 1e-6
"""Nodes closer than this fraction of the box diagonal are one node: 0.3 um in a liver."""

_MAX_TOLERANCE = 1e-4  # of the box diagonal; with coarser coordinates shapes are not to be trusted
_FAR = 10.0  # box diagonals from the origin at which a mesh is recentred


@dataclass(frozen=True)
class Draft:
    """A mesh in file units, with maps from the file's numbering."""

    points: FloatArray
    """Shape (n, 3)."""
    elements: IndexArray
    """Tetrahedra (t, 4) or triangles (k, 3)."""
    node_map: IndexArray
    """For each node of the file its number here, -1 if dropped."""
    element_ids: IndexArray
    """For each element here its number in the file."""
    offset: FloatArray
    """Subtracted from the file's coordinates, shape (3,)."""
    tolerance: float = 0.0
    """Distance below which two places are the same."""
    notes: tuple[str, ...] = ()

    def noting(self, note: str) -> Draft:
        """A copy with one more note."""
        return replace(self, notes=(*self.notes, note))

    def keeping(self, chosen: IndexArray) -> Draft:
        """A copy with the chosen elements only."""
        return replace(self, elements=self.elements[chosen], element_ids=self.element_ids[chosen])


def start_draft(points: FloatArray, elements: IndexArray, limit: float) -> Draft:
    """Draft of a raw mesh: numbers checked, unused nodes dropped, recentred if far away.

    Raises
    ------
    MeshError
        On coordinates that are not finite or exceed the limit [file units], on node numbers out
        of range, and if the coordinates are too coarsely rounded for the size of the mesh.
    """
    _check_points(points, limit)
    _check_indices(elements, len(points))
    draft = Draft(points, elements, np.arange(len(points)), np.arange(len(elements)), np.zeros(3))
    draft = drop_unused_nodes(draft)
    return _recentred(replace(draft, tolerance=_tolerance(draft.points)))


def drop_unused_nodes(draft: Draft, *, noted: bool = True) -> Draft:
    """Drop the nodes that no element uses: they would have neither mass nor stiffness."""
    used = np.zeros(len(draft.points), dtype=bool)
    used[draft.elements] = True
    if used.all():
        return draft
    dropped = np.flatnonzero(~used)
    number = np.where(used, np.cumsum(used) - 1, -1)
    note = f"{len(dropped)} nodes that no element uses dropped; first: {_files(draft, dropped)}"
    left = _renumbered(draft, number, np.flatnonzero(used))
    return left.noting(note) if noted else left


def weld(draft: Draft) -> Draft:
    """Merge nodes that lie within the tolerance of each other; the first of them stays."""
    piece = _coincident(draft.points, draft.tolerance)
    _, first, piece = np.unique(piece, return_index=True, return_inverse=True)
    if len(first) == len(draft.points):
        return draft
    order = np.argsort(first)  # keeps the file's order
    number = np.argsort(order)[piece]
    merged = np.setdiff1d(np.arange(len(draft.points)), first)
    note = (
        f"{len(merged)} nodes welded to another within {draft.tolerance:.3g} file units; "
        f"first: {_files(draft, merged)}"
    )
    return _renumbered(draft, number, first[order]).noting(note)


def drop_duplicates(draft: Draft) -> Draft:
    """Keep one of the elements that have the same nodes, in any order."""
    groups = group_rows(draft.elements)
    if len(groups.first) == len(draft.elements):
        return draft
    extra = np.setdiff1d(np.arange(len(draft.elements)), groups.first)
    return draft.keeping(np.sort(groups.first)).noting(
        f"{len(extra)} elements with the same nodes as an earlier one dropped; "
        f"first (0-based): {listing(draft.element_ids[extra])}"
    )


def keep_largest(draft: Draft, neighbours: IndexArray, size: FloatArray, what: str) -> Draft:
    """Drop all pieces but the largest by the summed `size` (elements,) of a `what`, with a note."""
    count, piece = components(neighbours, len(draft.elements))
    if count == 1:
        return draft
    sizes = np.bincount(piece, weights=size)
    kept = piece == sizes.argmax()
    dropped = np.flatnonzero(~kept)
    share = 100 * (1.0 - sizes.max() / sizes.sum())
    return drop_unused_nodes(draft.keeping(np.flatnonzero(kept)), noted=False).noting(
        f"{count - 1} of {count} pieces dropped for the largest, {len(dropped)} elements with "
        f"{share:.3g} % of the {what}; first (0-based): {listing(draft.element_ids[dropped])}"
    )


def element_map(draft: Draft, file_count: int) -> IndexArray:
    """For each element of the file its number in the draft, -1 if dropped."""
    numbers = np.full(file_count, -1, dtype=np.int64)
    numbers[draft.element_ids] = np.arange(len(draft.element_ids))
    return numbers


def _check_points(points: FloatArray, limit: float) -> None:
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(~(np.abs(points) <= limit).all(axis=1))
    if len(bad):
        raise MeshError(
            f"{len(bad)} of {len(points)} nodes have coordinates that are not finite or beyond "
            f"{limit:g} file units; first (0-based): {listing(bad)}: a damaged file or `organ.unit`"
        )


def _check_indices(elements: IndexArray, node_count: int) -> None:
    bad = np.flatnonzero(((elements < 0) | (elements >= node_count)).any(axis=1))
    if len(bad):
        raise MeshError(
            f"{len(bad)} of {len(elements)} elements use node numbers outside 0 to "
            f"{node_count - 1}; first element (0-based) {bad[0]}: {elements[bad[0]].tolist()}; "
            "export the mesh again"
        )


def _tolerance(points: FloatArray) -> float:
    """Weld tolerance: a fraction of the box, but not finer than the file's own rounding."""
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    single = np.array_equal(points, points.astype(np.float32))
    rounding = float(np.abs(points).max() * np.finfo(np.float32 if single else float).eps)
    if not 4 * rounding <= _MAX_TOLERANCE * diagonal:
        raise MeshError(
            f"coordinates up to {np.abs(points).max():.6g} are rounded to {rounding:.2g} for a "
            f"mesh only {diagonal:.3g} across: move it to the origin before exporting it"
        )
    return max(WELD_TOLERANCE * diagonal, 4 * rounding)


def _recentred(draft: Draft) -> Draft:
    low, high = draft.points.min(axis=0), draft.points.max(axis=0)
    centre = (low + high) / 2
    if np.linalg.norm(centre) <= _FAR * np.linalg.norm(high - low):
        return draft
    moved = replace(draft, points=draft.points - centre, offset=centre)
    return moved.noting(
        f"far from the origin: moved there by subtracting {centre.tolist()} file units"
    )


def _coincident(points: FloatArray, tolerance: float) -> IndexArray:
    """Number of the cluster each point belongs to."""
    from scipy.spatial import KDTree

    # Exact copies first: a surface stored corner by corner has six of each node.
    order = np.lexsort(points.T)
    differs = np.any(np.diff(points[order], axis=0) != 0, axis=1)
    cluster = np.empty(len(points), dtype=np.int64)
    cluster[order] = np.concatenate([[0], np.cumsum(differs)])
    distinct = points[order[np.concatenate([[True], differs])]]
    near = KDTree(distinct).query_pairs(tolerance, output_type="ndarray")
    return components(near, len(distinct))[1][cluster]


def _renumbered(draft: Draft, number: IndexArray, kept: IndexArray) -> Draft:
    return replace(
        draft,
        points=draft.points[kept],
        elements=number[draft.elements],
        node_map=np.where(draft.node_map >= 0, number[draft.node_map], -1),
    )


def _files(draft: Draft, nodes: IndexArray) -> str:
    """First few nodes of the draft by their numbers in the file."""
    in_file = np.flatnonzero(np.isin(draft.node_map, nodes))
    return listing(in_file) + " (0-based)"
