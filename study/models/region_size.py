"""How far a region of interest reaches: as given, or as a tolerance at rest asks for.

Rest is that of small displacements under the full load, where lattices are solved in moments. A
region is large enough where its control points are off those of a lattice of the finest cells
throughout by less than the tolerance. Motion and large displacements are not looked at: the one
is led by the same stiffness, the other stays where cells are finest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msm import model as msm
from msm.assembly import assemble_graded
from msm.model import Assembly, Material
from msm.octree import Grading
from study.problem.problem import Problem
from study.scene.graded import NO_TOLERANCE

Floats = NDArray[np.float64]

FIRST = 0.5
"""The smallest region tried, in radii of the tool."""
LARGER = 1.25
"""How much farther the next one reaches."""
PATH_POINTS = 32
"""Of a tool that is moved: places on its way round which cells are fine."""


@dataclass(frozen=True)
class Sized:
    """A graded lattice, how far its finest cells reach [m], and what of a rest it is off.

    `apart`: largest relative difference of a wanted control point's rest from that of the finest
    cells throughout, None where the radius was given.
    """

    assembly: Assembly
    radius: float
    apart: float | None


@dataclass(frozen=True)
class Wanted:
    """What a region is asked for: `at`, control points beside the tools, by name."""

    spacing: float
    levels: int
    radius: float | None
    tolerance: float
    at: tuple[str, ...]
    flexion: float


def sized(
    problem: Problem, wanted: Wanted, of_tissue: Callable[[Assembly], tuple[Assembly, Material]]
) -> Sized:
    """The lattice of a given radius, or the smallest that keeps the tolerance.

    `of_tissue`: a lattice with what its cells are made of. ValueError for a control point that
    there is not, for too many cells, and for a tolerance where more acts than one load.
    """
    where = places(problem, wanted.at)
    if wanted.radius is not None:
        return Sized(_assembled(problem, wanted, where, wanted.radius), wanted.radius, None)
    if problem.has_further_loads:
        raise ValueError(NO_TOLERANCE)
    whole = _assembled(problem, wanted, where, None)
    probes = [problem.tool_probe, *(problem.probes.index(name) for name in wanted.at)]
    aim = _rest(problem, *of_tissue(whole), probes)
    kept = Sized(whole, float(np.ptp(problem.surface_rule.points, axis=0).max()), 0.0)
    radii = list(_radii(problem))
    while radii:  # halved, for larger ones come closer but for the chance of how cells lie
        middle = len(radii) // 2
        found = _assembled(problem, wanted, where, radii[middle])
        rest = _rest(problem, *of_tissue(found), probes)
        apart = float((_size(rest - aim) / _size(aim)).max())
        if apart <= wanted.tolerance:
            kept = Sized(found, radii[middle], apart)
        radii = radii[:middle] if apart <= wanted.tolerance else radii[middle + 1 :]
    return kept


def places(problem: Problem, at: tuple[str, ...] = ()) -> Floats:
    """Where cells are finest [m] (k, 3): at the tools, along their paths, at control points."""
    for name in at:
        if name not in problem.probes:
            raise ValueError(
                f"region.at: {name!r} is no control point; there are {', '.join(problem.probes)}"
            )
    patches = [problem.tool, *(one.tool for one in problem.loads)]
    times = np.linspace(0.0, problem.observation.times[-1], PATH_POINTS)
    paths = [one.tip + one.travel(times) for one in problem.rigid_tools]
    points = [problem.observation.probes[problem.probes.index(name)] for name in at]
    return np.unique(np.vstack([*(one.centre for one in patches), *paths, *points]), axis=0)


def _radii(problem: Problem) -> Iterator[float]:
    """From a part of the tool's radius on, each a little larger, to the size of the organ."""
    radius, largest = FIRST * problem.tool.radius, np.ptp(problem.surface_rule.points, axis=0).max()
    while radius < largest:
        yield radius
        radius *= LARGER


def _assembled(problem: Problem, wanted: Wanted, where: Floats, radius: float | None) -> Assembly:
    """Cells up to a radius [m], or of one size throughout."""
    levels = wanted.levels if radius is not None else 1
    reach = tuple((radius or 0.0) * 2.0**level for level in range(levels - 1))
    return assemble_graded(
        problem.geometry.body,
        problem.surface_rule,
        problem.tissue.density,
        Grading(wanted.spacing, where, reach),
        problem.foundation,
        problem.tool,
        wanted.flexion,
        problem.tissue,
    )


def _rest(problem: Problem, of: Assembly, material: Material, probes: list[int]) -> Floats:
    """Displacement [m] (p, 3) of control points at rest under the full load, linearised."""
    weights, _ = of.lattice.interpolation(problem.observation.probes[probes])
    return np.asarray(weights @ msm.static_displacement(of, material))


def _size(of: Floats) -> Floats:
    return np.asarray(np.linalg.norm(of, axis=1))
