"""Checks and repairs of closed triangle surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from study.mesh.draft import (
    Draft,
    drop_duplicates,
    drop_unused_nodes,
    keep_largest,
    weld,
)
from study.mesh.kinds import FloatArray, IndexArray, MeshError
from study.mesh.listing import listing
from study.mesh.topology import (
    components,
    edges_of,
    group_rows,
    linked_rows,
    same_turn,
    shared_pairs,
)

_INSIDE = 0.5
"""Winding number above which a point counts as inside: 1 but for rounding and openings."""


def repair_surface(draft: Draft, *, largest: bool = False) -> Draft:
    """Weld nodes, drop useless triangles and turn the rest outwards; refuse what is not closed.

    With `largest`, the piece of the largest area is kept of several. Crossings of the surface with
    itself are not looked for.

    Raises
    ------
    MeshError
        On open or crowded edges, several pieces, one-sided surfaces, and a surface without volume.
    """
    draft = drop_unused_nodes(drop_duplicates(_without_degenerate(weld(draft))))
    if not len(draft.elements):
        raise MeshError("no triangle with three distinct corners is left; export the mesh again")
    if largest:
        neighbours = linked_rows(group_rows(edges_of(draft.elements))) // 3
        draft = keep_largest(draft, neighbours, _areas(draft), "area")
    edges = edges_of(draft.elements)
    pairs = _edge_pairs(draft, edges)
    draft = _outward(_consistent(draft, edges, pairs))
    return _noting_flat(_noting_shape(draft))


def enclosed_volume(points: FloatArray, triangles: IndexArray) -> float:
    """Volume inside a closed surface, negative if its normals point inwards."""
    corner = points[triangles] - points.mean(axis=0)  # against cancellation
    return float(np.linalg.det(corner).sum() / 6)


def genus(triangles: IndexArray) -> int:
    """Number of handles of a closed surface in one piece, from V - E + F = 2 - 2 g.

    A node where the surface only touches itself counts once for each of its fans of triangles.
    """
    return (2 - (_fan_count(triangles) - len(triangles) // 2)) // 2


def _without_degenerate(draft: Draft) -> Draft:
    a, b, c = draft.elements.T
    degenerate = (a == b) | (b == c) | (c == a)
    if not degenerate.any():
        return draft
    return draft.keeping(np.flatnonzero(~degenerate)).noting(
        f"{int(degenerate.sum())} degenerate triangles (two equal corners) dropped; "
        f"first (0-based): {listing(draft.element_ids[degenerate])}"
    )


def _areas(draft: Draft) -> FloatArray:
    corner = draft.points[draft.elements]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.asarray(0.5 * np.linalg.norm(normal, axis=1))


def _edge_pairs(draft: Draft, edges: IndexArray) -> IndexArray:
    """The two directed edges along every edge of a closed surface in one piece, shape (e, 2)."""
    groups = group_rows(edges)
    problems = [
        *_holes(draft, edges, groups.first[groups.count == 1]),
        *_walls(draft, groups.first[groups.count > 2]),
        *_pieces(draft, linked_rows(groups) // 3),
    ]
    if problems:
        raise MeshError("not the surface of a body: " + "; ".join(problems))
    return shared_pairs(groups)


def _holes(draft: Draft, edges: IndexArray, rows: IndexArray) -> list[str]:
    """The openings: edges that belong to one triangle only."""
    if not len(rows):
        return []
    nodes, numbered = np.unique(edges[rows], return_inverse=True)
    ends = numbered.reshape(-1, 2)
    count, loop = components(ends, len(nodes))
    sizes = np.sort(np.bincount(loop[ends[:, 0]]))[::-1]
    widest = max(np.ptp(draft.points[nodes[loop == i]], axis=0).max() for i in range(count))
    return [
        f"{len(rows)} open edges in {count} holes, of {listing(sizes)} edges, the widest "
        f"{widest:.3g} file units across, the first at triangles (0-based) "
        f"{listing(draft.element_ids[rows // 3])}; close the surface (fill its holes in the tool "
        "that made it)"
    ]


def _walls(draft: Draft, rows: IndexArray) -> list[str]:
    if not len(rows):
        return []
    return [
        f"{len(rows)} non-manifold edges with more than two triangles, the first at triangles "
        f"(0-based) {listing(draft.element_ids[rows // 3])}; remove inner walls"
    ]


def _pieces(draft: Draft, neighbours: IndexArray) -> list[str]:
    count, piece = components(neighbours, len(draft.elements))
    if count == 1:
        return []
    sizes = np.bincount(piece)
    main = int(np.bincount(piece, weights=_areas(draft)).argmax())
    body = draft.points[draft.elements[piece == main]]
    first = np.unique(piece, return_index=True)[1]
    inner = sum(
        _winding(body, draft.points[draft.elements[first[i], 0]]) > _INSIDE
        for i in range(count)
        if i != main
    )
    within = f", {inner} of them inside the largest (cavities)" if inner else ""
    return [
        f"{count} separate surfaces, of {listing(np.sort(sizes)[::-1])} triangles{within}; keep "
        'one piece (`organ.pieces` = "largest" does, and so fills cavities), or join them'
    ]


def _winding(triangles: FloatArray, point: FloatArray) -> float:
    """Absolute winding number of triangles (k, 3, 3) around a point: solid angles over 4 pi."""
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    volume = np.einsum("kd,kd->k", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("kd,kd->k", x, y) for x, y in ((a, b), (b, c), (c, a)))
    angle = 2.0 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(abs(angle.sum()) / (4.0 * np.pi))


def _consistent(draft: Draft, edges: IndexArray, pairs: IndexArray) -> Draft:
    """Orient triangles so that neighbours traverse their common edge in opposite directions.

    Every triangle is two items, as it is and reversed; compatible items are linked. A
    triangle linked to its own reversed form lies on a one-sided surface.
    """
    count = len(draft.elements)
    clash = same_turn(edges[pairs[:, 0]], edges[pairs[:, 1]])
    if not clash.any():
        return draft
    one, other = pairs.T // 3
    links = np.stack([one, other + count * clash], axis=1)
    mirrored = np.stack([one + count, other + count * ~clash], axis=1)
    side = components(np.concatenate([links, mirrored]), 2 * count)[1]
    if np.any(side[:count] == side[count:]):
        raise MeshError("one-sided surface: no consistent outside; mesh the organ again")
    turned = side[:count] != side[0]
    turned = ~turned if turned.sum() > count / 2 else turned
    return _turning(draft, turned).noting(
        f"{int(turned.sum())} triangles wound against their neighbours, now turned round; "
        f"first (0-based): {listing(draft.element_ids[turned])}"
    )


def _outward(draft: Draft) -> Draft:
    volume = enclosed_volume(draft.points, draft.elements)
    area = np.prod(np.sort(np.ptp(draft.points, axis=0))[1:])
    if abs(volume) <= draft.tolerance * area:
        raise MeshError("the surface encloses no volume: a sheet, or a surface folded onto itself")
    if volume > 0:
        return draft
    everything = np.ones(len(draft.elements), dtype=bool)
    return _turning(draft, everything).noting("normals pointed inwards, all triangles turned round")


def _turning(draft: Draft, turned: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Draft:
    elements = draft.elements.copy()
    elements[turned, 1:] = elements[turned, :0:-1]
    return replace(draft, elements=elements)


def _noting_shape(draft: Draft) -> Draft:
    handles = genus(draft.elements)
    pinched = _fan_count(draft.elements) - len(draft.points)
    if handles:
        draft = draft.noting(f"WARNING: genus {handles}: handles, usually a segmentation artefact")
    if pinched:
        draft = draft.noting(f"WARNING: the surface touches itself at {pinched} nodes")
    return draft


def _fan_count(triangles: IndexArray) -> int:
    """Number of closed fans around a node of a closed, consistently oriented surface.

    Edge row i starts at corner i; across the edge the same node is where the other row ends.
    """
    one, other = shared_pairs(group_rows(edges_of(triangles))).T
    links = np.concatenate(
        [np.stack([one, _next(other)], axis=1), np.stack([_next(one), other], axis=1)]
    )
    return components(links, triangles.size)[0]


def _next(corner: IndexArray) -> IndexArray:
    """The next of the three corners of the same triangle."""
    return corner - corner % 3 + (corner + 1) % 3


def _noting_flat(draft: Draft) -> Draft:
    corner = draft.points[draft.elements]
    sides = corner - np.roll(corner, 1, axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    height = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / longest
    flat = np.flatnonzero(height <= draft.tolerance)
    if not len(flat):
        return draft
    return draft.noting(
        f"{len(flat)} triangles without area kept, since dropping them would open the surface; "
        f"first (0-based): {listing(draft.element_ids[flat])}"
    )
