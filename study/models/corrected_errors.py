"""What a corrected lattice leaves uncertain, each cause by itself: estimates and no bounds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from study.models.deformed import superposed
from study.models.errors import DISPLACEMENT_LIMIT, step_checks, time_step_errors
from study.models.mesh_error import MeshSolution
from study.models.remainder import FINER, Remainder, relative_sizes, remainder_errors
from study.problem.trajectory import Trajectory
from study.results.records import Check, CorrectionRecord, CurveErrors, ModelRecord, largest

SPACING_LIMIT = 0.05


@dataclass(frozen=True)
class Errors:
    """Errors of a `whole` motion at its control points, whose nonlinear part is `found`."""

    probes: tuple[str, ...]
    found: Remainder
    whole: Trajectory

    def by_steps(
        self, order: int, half: Trajectory, linear: dict[str, CurveErrors]
    ) -> dict[str, CurveErrors]:
        """Of the steps of the lattice by half as long ones, and those of the elements on top.

        Empty if half as long steps diverged.
        """
        errors = time_step_errors(order, self.probes, self.whole, half)
        return {
            probe: CurveErrors(
                displacement=one.displacement + linear[probe].displacement,
                velocity=one.velocity + linear[probe].velocity,
            )
            for probe, one in errors.items()
        }

    def by_spacing(self, spacing: float, compared: Trajectory | str) -> CorrectionRecord:
        """What the coarse lattice added, and its error if there is one to compare with."""
        known = not isinstance(compared, str)
        fine = self.found.trajectory
        return CorrectionRecord(
            spacing_m=spacing,
            compared_spacing_m=FINER * spacing if known else None,
            remainder=relative_sizes(self.probes, fine, self.whole),
            remainder_errors={}
            if isinstance(compared, str)
            else remainder_errors(self.probes, fine, compared, self.whole),
            vectors=self.found.vectors,
            truncation_error=self.found.truncation,
        )


def checks(record: ModelRecord, solved: MeshSolution) -> Iterator[Check]:
    """Whether steps, vectors of either linear part and spacing are good enough, by the record."""
    yield from step_checks(record.name, record.time_step_errors)
    found = record.correction
    assert found is not None  # noqa: S101 - of a corrected lattice that finished
    meaning = "largest relative L2 change of a curve by the last quarter of the vectors"
    errors = {"elements": superposed(solved).truncation_error, "lattice": found.truncation_error}
    for part, value in errors.items():
        title = f"{record.name}: vectors of the {part}"
        yield Check(name=title, value=value, limit=DISPLACEMENT_LIMIT, meaning=meaning)
    if found.remainder_errors:
        yield Check(
            name=f"{record.name}: spacing",
            value=largest(found.remainder_errors).displacement,
            limit=SPACING_LIMIT,
            meaning="largest estimated relative L2 error of a displacement curve by the spacing",
        )
