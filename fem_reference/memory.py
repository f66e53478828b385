"""What a body takes of memory, before it is assembled."""

from __future__ import annotations

import os

from fem_reference.elements import ELEMENTS, chosen_element
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import edges
from study.problem.tissue import Tissue

FACTORS = 15.0
"""Bytes of the factors are this times unknowns^(5/3), measured at 20 000 and 43 000."""
SHARE = 0.7
"""Of the memory that is free."""


def unknowns(mesh: TetrahedralMesh, element: str) -> int:
    """Unknowns of the body on a mesh, displacements and pressures."""
    kind, vertices = ELEMENTS[element], len(mesh.points)
    middles = len(edges(mesh.tetrahedra)) if kind.quadratic else 0
    return 3 * (vertices + middles) + (vertices if kind.mixed else 0)


def needed(count: int, element: str, *, stepping: bool) -> float:
    """Bytes for so many unknowns; stepping in time factors the matrix."""
    assembled = ELEMENTS[element].bytes_per_unknown * count
    return assembled + (FACTORS * count ** (5.0 / 3.0) if stepping else 0)


def factors_fit(count: int, element: str) -> bool:
    """Whether the memory that is free holds the factors of so many unknowns beside the body."""
    return needed(count, element, stepping=True) <= SHARE * available()


def available() -> float:
    """Bytes of memory that are free."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # not told on this system
        return float("inf")


def refuse_too_large(
    mesh: TetrahedralMesh, tissue: Tissue, element: str, *, stepping: bool
) -> None:
    """ValueError with the size of elements that would fit."""
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
