"""Displacement error of the lattice at rest against converged finite elements.

    python -m tests.benchmarks.field_error

writes reports/data/field_error.csv, a row per body, Poisson ratio, volume term and spacing, in a
few minutes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.grid import Projection
from msm.assembly import Assembly, Material, assemble
from msm.calibration import reference_stiffness
from msm.lattice import interpolation
from msm.laws import Hooke
from msm.statics import static_displacement
from msm.volume import volume_term
from study.mesh.kinds import TetrahedralMesh
from study.mesh.quadrature import over_surface, over_volume
from study.mesh.tetrahedra import boundary
from study.organ import liver as implicit
from study.organ.block import block_mesh
from study.organ.isosurface_stuffing import stuff
from study.organ.occupancy import MeshBody, SolidShape
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.similarity.fields import best_factor, relative_l2
from tests.benchmarks import tables
from tests.benchmarks.converged import Converged, converged

Floats = NDArray[np.float64]

TABLE = Path(__file__).parents[2] / "reports" / "data" / "field_error.csv"
RATIOS = (0.25, 0.45, 0.49)
SPACINGS = (0.02, 0.01, 0.02 / 3, 0.005)
SIZE = (0.20, 0.16, 0.08)
"""Of the block [m], a multiple of every spacing."""
DENSITY = 1054.0
DOWN = np.array([0.0, 0.0, -1.0])


class Row(NamedTuple):
    """One lattice against the reference of its body and Poisson ratio.

    `work` [J]: of the load along its displacement, which identifies the lattice's solution;
    `error`: relative L2 difference of the displacement over the body; `best_factor`: on the
    lattice's displacement, nearest to the reference; `order`: slope of the error over the spacings.
    """

    body: str
    nu: float
    volume_term: bool
    spacing_m: float
    nodes: int
    work_j: float
    error: float
    best_factor: float
    error_at_best_factor: float
    reference_error: float
    order: float


@dataclass(frozen=True)
class Case:
    """A body under its tool; `meshes` of the reference and their element sizes, coarse to fine.

    `project`: onto the curved surface, if it is known.
    """

    name: str
    youngs_modulus: float
    body: SolidShape
    meshes: tuple[TetrahedralMesh, ...]
    sizes: tuple[float, ...]
    foundation: Foundation
    tool: ToolPatch
    project: Projection | None = None

    def tissue(self, nu: float) -> Tissue:
        """Its material at a Poisson ratio."""
        return Tissue(youngs_modulus=self.youngs_modulus, poisson_ratio=nu, density=DENSITY)


def block(sizes: tuple[float, ...] = (0.02, 0.010, 0.02 / 3)) -> Case:
    """A block on its base, pressed from above, with finite elements of the given sizes [m]."""
    meshes = tuple(block_mesh(SIZE, size) for size in sizes)
    foundation = Foundation(DOWN, 0.0, 1e-3, 1e9)
    tool = ToolPatch(np.array([0.10, 0.08, 0.08]), DOWN, 0.03, 1.0)
    whole = MeshBody(block_mesh(SIZE, max(SIZE)))
    return Case("block", 4e3, whole, meshes, sizes, foundation, tool)


def liver(sizes: tuple[float, ...] = (0.016, 0.012, 0.009)) -> Case:
    """The built-in liver as its scene poses it; the lattice is given its exact shape."""
    scene = read_scene("liver")
    posed = problem_of(scene)
    meshes = tuple(map(liver_mesh, sizes))
    modulus, known = scene.tissue.youngs_modulus, posed.geometry
    where = (posed.foundation, posed.tool, known.project)
    return Case("liver", modulus, known.body, meshes, sizes, *where)


def liver_mesh(size: float) -> TetrahedralMesh:
    """Tetrahedra of the built-in liver of about `size` [m]."""
    volume = read_scene("liver").organ.volume
    box = implicit.bounding_box(volume)
    return stuff(lambda points: implicit.signed_function(points, volume), *box, size)


def lattice(case: Case, spacing: float) -> Assembly:
    """The lattice over the body, without springs that only the model's options add."""
    surface = over_surface(boundary(case.meshes[-1]), 6)
    return assemble(case.body, surface, DENSITY, spacing, case.foundation, case.tool)


def material(case: Case, assembly: Assembly, nu: float, *, with_volume: bool) -> Material:
    """Springs of the shear modulus with the volume term, or springs of E alone."""
    spacing, modulus = assembly.lattice.spacing, case.youngs_modulus
    if not with_volume:
        return Material(Hooke(reference_stiffness(modulus, spacing)))
    term = volume_term(assembly.lattice, modulus, nu)
    return Material(Hooke(reference_stiffness(modulus, spacing, nu)), term)


def reference(case: Case, nu: float) -> tuple[Converged, Floats, Floats]:
    """Finite elements at the points [m] of a rule over the middle mesh, and its weights [m^3]."""
    rule = over_volume(case.meshes[-2], 2)
    found = converged(
        case.meshes,
        case.sizes,
        case.tissue(nu),
        case.foundation,
        case.tool,
        rule.points,
        rule.weights,
        case.project,
    )
    return found, rule.points, rule.weights


def rows(case: Case, nu: float, assemblies: list[Assembly]) -> Iterator[Row]:
    """Rows of one body at one Poisson ratio."""
    truth, points, volumes = reference(case, nu)
    for with_volume in (False, True):
        found = [
            row(case, nu, assembly, truth, points, volumes, with_volume=with_volume)
            for assembly in assemblies
        ]
        slope = order([r.spacing_m for r in found], [r.error for r in found])
        yield from (r._replace(order=slope) for r in found)


def row(
    case: Case,
    nu: float,
    assembly: Assembly,
    truth: Converged,
    points: Floats,
    volumes: Floats,
    *,
    with_volume: bool,
) -> Row:
    """One lattice against the reference; the order is left open."""
    nodal = static_displacement(assembly, material(case, assembly, nu, with_volume=with_volume))
    field = interpolation(assembly.lattice, points)[0] @ nodal
    factor = best_factor(field, truth.field, volumes)
    return Row(
        case.name,
        nu,
        with_volume,
        assembly.lattice.spacing,
        len(assembly.mass),
        float((assembly.load * nodal).sum()),
        relative_l2(field, truth.field, volumes),
        factor,
        relative_l2(factor * field, truth.field, volumes),
        truth.error,
        float("nan"),
    )


def order(spacings: list[float], errors: list[float]) -> float:
    """Slope of the error over the spacing in logarithms, by least squares."""
    return float(np.polyfit(np.log(spacings), np.log(errors), 1)[0])


def read() -> list[Row]:
    """Rows of the table as written."""
    return tables.read(TABLE, Row)


def _all_rows() -> Iterator[Row]:
    for case in (block(), liver()):
        assemblies = [lattice(case, spacing) for spacing in SPACINGS]
        for nu in RATIOS:
            yield from rows(case, nu, assemblies)


def main() -> None:
    """Write the table."""
    tables.write(TABLE, _all_rows(), digits=8)


if __name__ == "__main__":
    main()
