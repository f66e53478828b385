"""Meshes of an organ whose elements are small where a result needs it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from study.mesh.bisection import Bisection, cut_into
from study.mesh.kinds import TetrahedralMesh
from study.organ.geometry import MAX_TETRAHEDRA, Background, Geometry, Level

Floats = NDArray[np.float64]

MOST_PARTS = 64.0
"""Largest number of parts of an element at once: its error is not known well enough for more."""
TRIALS = 6
ROUNDS, TOO_MANY = 40, 8
"""Rounds of bisection, and limit of tetrahedra around the organ over those it may have."""
TOLERANCE = 0.05
"""Relative tolerance of the number of added elements."""


def graded(
    geometry: Geometry, level: Level, errors: Floats, order: float, growth: float
) -> Level | None:
    """A finer mesh of about `growth` times the elements, small where errors (cells,) are large.

    Elements are bisected, so that the new mesh is nested in the old one up to the surface, along
    which it is cut again. `order`: of the sum of the errors in the element size. None if the mesh
    would be too large.
    """
    background = level.background or Background(level.mesh, np.arange(len(level.mesh.tetrahedra)))
    share = np.zeros(len(background.mesh.tetrahedra))
    np.add.at(share, background.origins, errors)
    wanted = (growth - 1.0) * np.count_nonzero(np.bincount(background.origins))
    lattice = equidistributed(background.mesh, share, order, int(wanted)).mesh
    return _level(geometry, level, lattice)


def resolved(
    geometry: Geometry, level: Level, wanted: Callable[[Floats, Floats], Floats]
) -> Level | None:
    """A mesh with edges no longer than `wanted`; None if it would be too large.

    `wanted` [m] (n,) of tetrahedra: by their centres [m] (n, 3) and longest edges [m] (n,).
    """
    lattice = level.mesh if level.background is None else level.background.mesh
    for _ in range(ROUNDS):
        corner = lattice.points[lattice.tetrahedra]
        edges = corner[:, [0, 0, 0, 1, 1, 2]] - corner[:, [1, 2, 3, 2, 3, 3]]
        longest = np.linalg.norm(edges, axis=2).max(axis=1)
        parts = np.where(longest > wanted(corner.mean(axis=1), longest), 2.0, 1.0)
        if (parts == 1.0).all() or len(parts) > TOO_MANY * MAX_TETRAHEDRA:
            break
        lattice = cut_into(lattice, parts).mesh
    return _level(geometry, level, lattice)


def _level(geometry: Geometry, level: Level, lattice: TetrahedralMesh) -> Level | None:
    """The part of a background mesh within the organ, its size by the number of elements."""
    cut = None if geometry.cut is None else geometry.cut(lattice)
    mesh = lattice if cut is None else cut.mesh
    if len(mesh.tetrahedra) > MAX_TETRAHEDRA:
        return None
    size = level.size * (len(level.mesh.tetrahedra) / len(mesh.tetrahedra)) ** (1.0 / 3.0)
    return Level(mesh, size, None if cut is None else Background(lattice, cut.origins))


def equidistributed(mesh: TetrahedralMesh, errors: Floats, order: float, more: int) -> Bisection:
    """The mesh bisected into about `more` further tetrahedra, for the least sum of errors (t,).

    The error of a tetrahedron is taken to fall as its volume to the power order / 3 + 1. The sum is
    then least, for a number of tetrahedra, if the number of parts of each is proportional to its
    error to the power 1 / (1 + order / 3).
    """
    weight = errors ** (1.0 / (1.0 + order / 3.0))
    aim = float(more)
    for _ in range(TRIALS):
        found = cut_into(mesh, _parts(weight, len(errors) + aim))
        gained = len(found.mesh.tetrahedra) - len(errors)
        if abs(gained - more) <= TOLERANCE * more:
            break
        aim *= more / gained  # halves are no parts of any number, and neighbours are cut too
    return found


def _parts(weight: Floats, total: float) -> Floats:
    """Numbers proportional to the weight, between 1 and MOST_PARTS, with this sum or the most."""
    some = np.log(weight[weight > 0.0])
    if not some.size:
        return np.ones(len(weight))

    def parts(logarithm: float) -> Floats:
        return np.asarray(np.clip(np.exp(logarithm) * weight, 1.0, MOST_PARTS))

    fewest, most = -float(some.max()), float(np.log(MOST_PARTS) - some.min())
    if parts(most).sum() <= total:
        return parts(most)
    from scipy.optimize import brentq

    return parts(float(brentq(lambda x: parts(x).sum() - total, fewest, most, xtol=1e-9)))
