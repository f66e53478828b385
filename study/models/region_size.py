"""The radius of a region of interest: as given, or found from a tolerance at rest.

Candidates are solved at rest for small displacements under the full load, which is fast. A region
is large enough if its control points differ from those of a lattice with the finest cells
throughout by less than the tolerance. Motion and large displacements are not considered: motion is
governed by the same stiffness, and large displacements stay within the finest cells.
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
"""Factor from one candidate radius to the next."""
PATH_POINTS = 32
"""Number of places on the path of a moved tool around which cells are fine."""


@dataclass(frozen=True)
class SizedRegion:
    """A graded lattice, the radius [m] of its finest cells, and its difference at rest.

    `apart`: largest relative difference of a requested control point at rest from that with the
    finest cells throughout; None where the radius was given.
    """

    assembly: Assembly
    radius: float
    apart: float | None


@dataclass(frozen=True)
class RegionRequest:
    """The request for a region; `at`: names of control points beside the tools."""

    spacing: float
    levels: int
    radius: float | None
    tolerance: float
    at: tuple[str, ...]
    flexion: float


def sized_region(
    problem: Problem,
    request: RegionRequest,
    of_tissue: Callable[[Assembly], tuple[Assembly, Material]],
) -> SizedRegion:
    """The lattice of a given radius, or the smallest one that meets the tolerance.

    `of_tissue`: gives a lattice the material of its cells. ValueError for an unknown control point,
    for too many cells, and for a tolerance where more than one load acts.
    """
    centres = places(problem, request.at)
    if request.radius is not None:
        return SizedRegion(
            _assembled(problem, request, centres, request.radius), request.radius, None
        )
    if problem.has_further_loads:
        raise ValueError(NO_TOLERANCE)
    uniform = _assembled(problem, request, centres, None)
    probes = [problem.tool_probe, *(problem.probes.index(name) for name in request.at)]
    exact = _rest(problem, *of_tissue(uniform), probes)
    kept = SizedRegion(uniform, float(np.ptp(problem.surface_rule.points, axis=0).max()), 0.0)
    radii = list(_radii(problem))
    while radii:  # bisection: the difference falls with the radius but for noise
        middle = len(radii) // 2
        found = _assembled(problem, request, centres, radii[middle])
        rest = _rest(problem, *of_tissue(found), probes)
        apart = float((_lengths(rest - exact) / _lengths(exact)).max())
        if apart <= request.tolerance:
            kept, radii = SizedRegion(found, radii[middle], apart), radii[:middle]
        else:
            radii = radii[middle + 1 :]
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
    """Candidate radii [m], from a fraction of the tool's radius up to the size of the organ."""
    radius, largest = FIRST * problem.tool.radius, np.ptp(problem.surface_rule.points, axis=0).max()
    while radius < largest:
        yield radius
        radius *= LARGER


def _assembled(
    problem: Problem, request: RegionRequest, centres: Floats, radius: float | None
) -> Assembly:
    """Graded cells up to a radius [m], or uniform cells throughout."""
    levels = request.levels if radius is not None else 1
    reach = tuple((radius or 0.0) * 2.0**level for level in range(levels - 1))
    return assemble_graded(
        problem.geometry.body,
        problem.surface_rule,
        problem.tissue.density,
        Grading(request.spacing, centres, reach),
        problem.foundation,
        problem.tool,
        request.flexion,
        problem.tissue,
    )


def _rest(problem: Problem, of: Assembly, material: Material, probes: list[int]) -> Floats:
    """Displacement [m] (p, 3) of control points at rest under the full load, linearised."""
    weights, _ = of.lattice.interpolation(problem.observation.probes[probes])
    return np.asarray(weights @ msm.static_displacement(of, material))


def _lengths(vectors: Floats) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=1))
