"""Checks and repairs of tetrahedra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from study.mesh.draft import Draft, drop_duplicates, keep_largest, weld
from study.mesh.kinds import FloatArray, IndexArray, MeshError, TetrahedralMesh
from study.mesh.listing import listing
from study.mesh.tetrahedra import EDGES, volumes
from study.mesh.topology import (
    RowGroups,
    components,
    edges_of,
    faces_of,
    group_rows,
    linked_rows,
    same_turn,
    shared_pairs,
)

_NEIGHBOURS = 16  # elements looked at for overlaps, by distance of their centroids
_INSIDE = 1e-3  # smallest barycentric weight of a point that counts as inside
# Where elements are sampled for overlaps, as weights of the corners: the middle, near the corners,
# near the middles of the faces and of the edges.
_SAMPLES = np.vstack(
    [
        np.full(4, 0.25),
        0.05 + 0.80 * np.eye(4),
        0.31 - 0.24 * np.eye(4),
        [0.05 + 0.40 * (np.eye(4)[a] + np.eye(4)[b]) for a, b in EDGES],
    ]
)
_MIXED = (0.3, 0.7)  # share of inverted elements that points to broken numbering


def repair_tetrahedra(draft: Draft, *, largest: bool = False) -> Draft:
    """Weld nodes, drop repeated elements and turn all volumes positive; refuse what is left.

    With `largest`, the piece of the largest volume is kept of several.

    Raises
    ------
    MeshError
        On elements that are flat, overlap a neighbour or share a face with more than one other,
        and on a mesh in several pieces.
    """
    draft = drop_duplicates(weld(draft))
    _refuse_flat(draft)
    draft = _oriented(draft)
    if largest:
        neighbours = linked_rows(group_rows(faces_of(draft.elements))) // 4
        size = volumes(TetrahedralMesh(draft.points, draft.elements))
        draft = keep_largest(draft, neighbours, size, "volume")
    faces = faces_of(draft.elements)
    groups = group_rows(faces)
    pairs = shared_pairs(groups)
    boundary = groups.first[groups.count == 1]
    problems = [
        *_crowded_faces(draft, groups),
        *_folds(draft, faces, pairs),
        *_pieces(draft, pairs // 4),
        *_overlaps(draft, np.unique(boundary // 4)),
    ]
    if problems:
        raise MeshError("; ".join(problems))
    return _noting_contacts(draft, faces[boundary])


def heights(points: FloatArray, tetrahedra: IndexArray) -> FloatArray:
    """Smallest height of each tetrahedron, 3 V / largest face; zero without any volume."""
    corner = points[faces_of(tetrahedra)]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = 0.5 * np.linalg.norm(normal, axis=1).reshape(-1, 4).max(axis=1)
    volume = np.abs(volumes(TetrahedralMesh(points, tetrahedra)))
    return np.asarray(np.divide(3 * volume, area, out=np.zeros_like(area), where=area > 0))


def _refuse_flat(draft: Draft) -> None:
    """A corner within the weld tolerance of the opposite face counts as lying on it."""
    flat = np.flatnonzero(heights(draft.points, draft.elements) <= draft.tolerance)
    if len(flat):
        raise MeshError(
            f"{len(flat)} of {len(draft.elements)} tetrahedra have no volume, exactly or up to "
            f"rounding (height below {draft.tolerance:.2g} file units); first (0-based): "
            f"{listing(draft.element_ids[flat])}; remove slivers in the mesher and export again"
        )


def _oriented(draft: Draft) -> Draft:
    inverted = volumes(TetrahedralMesh(draft.points, draft.elements)) < 0
    count, total = int(inverted.sum()), len(inverted)
    if count == 0:
        return draft
    elements = draft.elements.copy()
    elements[inverted, 2:] = elements[inverted, :1:-1]
    first = listing(draft.element_ids[inverted])
    note = f"{count} of {total} tetrahedra inverted, now turned round; first (0-based): {first}"
    if count == total:
        note = f"all {total} tetrahedra wound the other way, now turned round"
    elif _MIXED[0] <= count / total <= _MIXED[1]:
        note = f"WARNING: {note}: a mixture this even means that the node numbering is broken"
    return replace(draft, elements=elements).noting(note)


def _crowded_faces(draft: Draft, groups: RowGroups) -> list[str]:
    crowded = np.flatnonzero(groups.count > 2)
    if not len(crowded):
        return []
    users = np.flatnonzero(groups.group == crowded[0]) // 4
    return [
        f"{len(crowded)} faces belong to more than two tetrahedra, the first to (0-based) "
        f"{listing(draft.element_ids[users])}; elements overlap, mesh the body again"
    ]


def _folds(draft: Draft, faces: IndexArray, pairs: IndexArray) -> list[str]:
    """Neighbours see their common face from opposite sides, unless one overlaps the other."""
    folded = pairs[same_turn(faces[pairs[:, 0]], faces[pairs[:, 1]])] // 4
    if not len(folded):
        return []
    return [
        f"{len(folded)} pairs of neighbouring tetrahedra lie on the same side of their common "
        f"face and overlap; the first pair (0-based): {listing(draft.element_ids[folded[0]])}; "
        "a node is misplaced or misnumbered, mesh the body again"
    ]


def _pieces(draft: Draft, neighbours: IndexArray) -> list[str]:
    count, piece = components(neighbours, len(draft.elements))
    if count == 1:
        return []
    sizes = np.sort(np.bincount(piece))[::-1]
    return [
        f"{count} pieces without a common face, of {listing(sizes)} tetrahedra; they would float: "
        'keep one piece (`organ.pieces` = "largest" does), or join them in the mesher'
    ]


def _overlaps(draft: Draft, boundary_elements: IndexArray) -> list[str]:
    """Elements on the boundary that reach into another one nearby.

    Where well-connected elements overlap, the boundary of one lies inside another, so inner
    elements need no test. Sampling can miss a slight overlap.
    """
    from scipy.spatial import KDTree

    corner = draft.points[draft.elements]
    to_weights = np.linalg.inv(corner[:, 1:] - corner[:, :1])
    places = np.einsum("sv,tvd->tsd", _SAMPLES, corner[boundary_elements])
    tree = KDTree(corner.mean(axis=1))
    nearest = tree.query(places, min(_NEIGHBOURS, len(corner)))[1].reshape(*places.shape[:2], -1)
    overlapping = np.zeros(len(boundary_elements), dtype=bool)
    for other in np.moveaxis(nearest, 2, 0):
        weights = np.einsum("tsi,tsij->tsj", places - corner[other, 0], to_weights[other])
        inside = np.minimum(weights.min(axis=2), 1 - weights.sum(axis=2)) > _INSIDE
        overlapping |= (inside & (other != boundary_elements[:, None])).any(axis=1)
    if not overlapping.any():
        return []
    where = listing(draft.element_ids[boundary_elements[overlapping]])
    return [
        f"{int(overlapping.sum())} tetrahedra on the boundary reach into another one; first "
        f"(0-based): {where}; elements overlap, mesh the body again"
    ]


def _noting_contacts(draft: Draft, boundary: IndexArray) -> Draft:
    contacts = int((group_rows(edges_of(boundary)).count > 2).sum())
    if not contacts:
        return draft
    return draft.noting(f"WARNING: the boundary touches itself along {contacts} edges: hinges")
