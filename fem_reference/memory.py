"""Memory that a body needs, estimated before it is assembled."""

from __future__ import annotations

import os

from fem_reference.elements import ELEMENTS, chosen_element
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import edges
from study.problem.tissue import Tissue

FACTORS = 15.0
"""Bytes of the factors over unknowns^(5/3), measured at 20 000 and 43 000 unknowns."""
SHARE = 0.7
"""Usable share of the free memory."""


def unknowns(mesh: TetrahedralMesh, element: str) -> int:
    """Number of displacements and pressures of a body on a mesh."""
    kind, vertices = ELEMENTS[element], len(mesh.points)
    edge_nodes = len(edges(mesh.tetrahedra)) if kind.quadratic else 0
    return 3 * (vertices + edge_nodes) + (vertices if kind.mixed else 0)


def needed(count: int, element: str, *, stepping: bool) -> float:
    """Bytes for `count` unknowns; direct time integration (`stepping`) factors the matrix."""
    assembled = ELEMENTS[element].bytes_per_unknown * count
    return assembled + (FACTORS * count ** (5.0 / 3.0) if stepping else 0)


def factors_fit(count: int, element: str) -> bool:
    """Whether the free memory holds the body and the factors of `count` unknowns."""
    return needed(count, element, stepping=True) <= SHARE * available()


def available() -> float:
    """Bytes of free memory; infinite where the system does not report it."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # not available on this system
        return float("inf")


def refuse_too_large(
    mesh: TetrahedralMesh, tissue: Tissue, element: str, *, stepping: bool
) -> None:
    """ValueError, with the element size that would fit, if a body does not fit into memory."""
    name = chosen_element(element, tissue.highest_poisson_ratio)
    count = unknowns(mesh, name)
    limit, wanted = SHARE * available(), needed(count, name, stepping=stepping)
    if wanted > limit:
        larger = (wanted / limit) ** (0.2 if stepping else 1.0 / 3.0)
        advice = "; reference.method ritz-vectors needs far less" if stepping else ""
        raise ValueError(
            f"the finite-element mesh has {len(mesh.tetrahedra)} tetrahedra, about {count} "
            f"unknowns, which need {wanted / 2**30:.1f} GiB of {limit / 2**30:.1f}: make "
            f"reference.element_size {larger:.2g} times as large, or coarsen organ.mesh{advice}"
        )
