"""The lattice of homogeneous tissue on the organ of a problem, and all that acts on it."""

from __future__ import annotations

from functools import lru_cache

from msm import model as msm
from msm import tetrahedra
from msm.assembly import with_external_loads
from msm.model import Assembly
from study.models.touching import touchable
from study.problem.problem import Problem
from study.scene import Lattice


def assembled(problem: Problem, lattice: Lattice) -> Assembly:
    """The lattice of homogeneous tissue that all models of a scene share."""
    on_mesh = lattice.springs == "tetrahedra"
    mix = () if on_mesh else (lattice.spacing, lattice.flexion, lattice.body_diagonals)
    if problem.has_further_loads:
        return _with_further_loads(problem, *mix)
    return _cubic(problem, *mix) if mix else _on_mesh(problem)


@lru_cache(maxsize=1)
def _with_further_loads(problem: Problem, *mix: float) -> Assembly:
    """The lattice with everything that acts on it beside the first load.

    On a cubic lattice of a spacing, flexion and body diagonals, or on the mesh if none are given.
    """
    return loaded(problem, _cubic(problem, *mix) if mix else _on_mesh(problem))


def loaded(problem: Problem, bare: Assembly) -> Assembly:
    """Add gravity, weights, further loads and rigid tools to a lattice."""
    surface, times = problem.geometry.surface, problem.observation.times
    points = touchable(problem.rigid_tools, surface, bare.lattice.spacing, times)
    return with_external_loads(
        bare,
        problem.surface_rule,
        problem.gravity,
        problem.loads,
        problem.weights,
        problem.rigid_tools,
        touched=points,
        given_loaded=problem.given_loaded,
    )


@lru_cache(maxsize=1)
def _on_mesh(problem: Problem) -> Assembly:
    where = (problem.foundation, problem.tool)
    return tetrahedra.assemble(
        problem.geometry.mesh,
        problem.surface_rule,
        problem.tissue.density,
        *where,
        problem.tissue,
    )


@lru_cache(maxsize=1)
def _cubic(problem: Problem, spacing: float, flexion: float, body_diagonals: float) -> Assembly:
    return msm.assemble(
        problem.geometry.body,
        problem.surface_rule,
        problem.tissue.density,
        spacing,
        problem.foundation,
        problem.tool,
        flexion,
        body_diagonals,
        problem.tissue,
    )
