"""How often the truth lies within the error stated on graded meshes of organs from files.

    python -m tests.benchmarks.error_bar_livers [FILE UNIT]...

writes reports/data/error_bar_livers.csv: for the default scene suited to surfaces of many shapes
the stated and the true error of every control point's curves and of the field, the true one against
a graded mesh two refinements finer, at least four times the elements of the one judged. Mesh files
that are given are judged too. It takes some minutes a shape.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh
from study.mesh.tetrahedra import boundary
from study.models.finite_elements import PreparedElements, reference_of
from study.models.mesh_error import MeshSolution, mesh_error
from study.organ.geometry import built_in_liver
from study.run.suiting import read_suited
from study.scene.problem import problem_of
from study.similarity.fields import relative_l2
from study.system.progress import Silent
from tests.benchmarks.tables import write
from tests.mesh_samples import ellipsoid_surface, torus, write_surface

Floats = NDArray[np.float64]

TABLE = Path(__file__).parents[2] / "reports" / "data" / "error_bar_livers.csv"
JUDGED = 9_000
"""Elements of the largest mesh that is judged."""


class Row(NamedTuple):
    """Relative L2 errors of one curve, or of the field, on one mesh; `truth`: elements behind."""

    shape: str
    elements: int
    quantity: str
    stated: float
    true: float
    truth: int


def liver(stretch: tuple[float, float, float], bend: float = 0.0) -> SurfaceMesh:
    """Surface of the built-in liver, stretched and bent, as facets of some 6 mm."""
    found = boundary(built_in_liver(1.5e-3, 0.008).mesh)
    points = found.points * stretch
    points[:, 2] += bend * points[:, 0] ** 2
    return SurfaceMesh(points, found.triangles)


def bumpy(height: float, waves: int) -> SurfaceMesh:
    """An ellipsoid with bumps of a height relative to its radius."""
    points, triangles = ellipsoid_surface(4)
    points = points / np.abs(points).max(axis=0)
    bumps = np.prod(np.sin(waves * points + 0.5), axis=1)
    return SurfaceMesh(points * (1.0 + height * bumps[:, None]) * [0.1, 0.07, 0.06], triangles)


SHAPES = {
    "liver, stretched": liver((1.25, 0.9, 0.8)),
    "liver, thin and bent": liver((1.2, 1.0, 0.55), bend=-2.0),
    "ellipsoid with bumps": bumpy(0.15, 4),
    "torus": SurfaceMesh(*torus(0.075, 0.035, 48)),
}


def rows(shape: str, path: Path, unit: str) -> Iterator[Row]:
    """Of one organ, on each graded mesh that has two coarser ones and two finer ones."""
    sys.stdout.write(f"{shape}\n")
    overrides = (f"organ.mesh={path}", f"organ.unit={unit}", 'models=["fem"]')
    scene = read_suited("liver", overrides)
    problem = problem_of(scene)
    solved = _solved(reference_of(scene).prepare(problem))
    truth, volumes = solved[-1].found, problem.volume_rule.weights
    for last in range(2, len(solved) - 2):
        errors = mesh_error(problem, solved[: last + 1], graded=True)
        run = solved[last].found
        if errors is None:
            continue
        ours, exact = run.trajectory, truth.trajectory
        for i, (probe, stated) in enumerate(errors.by_probe.items()):
            for kind in ("displacement", "velocity"):
                a, b = (getattr(one, kind)[:, i] for one in (ours, exact))
                true = relative_l2(a, b, np.ones(len(b)))
                named = f"{kind}, {probe}"
                yield Row(shape, run.elements, named, getattr(stated, kind), true, truth.elements)
        true = relative_l2(ours.volume_field[0], exact.volume_field[0], volumes)
        yield Row(shape, run.elements, "field", errors.field_peak, true, truth.elements)


def _solved(prepared: PreparedElements) -> list[MeshSolution]:
    """Two meshes beyond the last that is judged."""
    solved = [prepared.solved_on(prepared.coarsest, Silent())]
    while len(solved) < 3 or solved[-3].found.elements < JUDGED:
        finer = prepared.refined(solved[-1].level, solved[-1].body)
        if finer is None:
            break
        solved.append(prepared.solved_on(finer, Silent()))
        sys.stdout.write(f"  {solved[-1].found.elements} tetrahedra\n")
        sys.stdout.flush()
        if solved[-1].found.elements > JUDGED and len(solved) > 4:
            break
    return solved


def main() -> None:
    """Write the table, and print how often the truth was within."""
    files = zip(sys.argv[1::2], sys.argv[2::2], strict=True)
    given = [(Path(one).stem, Path(one), unit) for one, unit in files]
    with TemporaryDirectory() as folder:
        for n, (name, surface) in enumerate(SHAPES.items()):
            path = Path(folder) / f"{n}.obj"
            write_surface(path, surface.points, surface.triangles)
            given.insert(n, (name, path, "m"))
        found = write(TABLE, (row for shape in given for row in rows(*shape)))
    ratios = [row.true / row.stated for row in found]
    sys.stdout.write(
        f"{sum(ratio <= 1.0 for ratio in ratios)} of {len(ratios)} within, true over stated at "
        f"most {max(ratios):.2g}, median {np.median(ratios):.2g}\n"
    )


if __name__ == "__main__":
    main()
