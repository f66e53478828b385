"""How often the truth lies within the error that the reference states.

    python -m tests.benchmarks.error_bar

writes reports/data/error_bar.csv: for scenes of many kinds the stated and the true error of every
control point's curves and of the field, the true one against a mesh that is at least two levels
finer than the one judged; it takes some minutes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.models.finite_elements import models
from study.models.mesh_error import MeshSolution, mesh_error
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.similarity.fields import relative_l2
from study.system.progress import Silent
from tests.benchmarks.tables import write

Floats = NDArray[np.float64]

TABLE = Path(__file__).parents[2] / "reports" / "data" / "error_bar.csv"
COARSE = "reference.element_size=25 mm"
OFF = '{side="superior", at=[0.37, 0.61]}'
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "block": ("block", (COARSE,)),
    "block, nu 0": ("block", (COARSE, "tissue.poisson_ratio=0")),
    "block, nu 0.49": ("block", (COARSE, "tissue.poisson_ratio=0.49")),
    "block, nu 0.499": ("block", (COARSE, "tissue.poisson_ratio=0.499")),
    "block, tool off centre": (
        "block",
        (COARSE, f"tool.place={OFF}", f"control_points.tool={OFF}"),
    ),
    "block, small tool": ("block", (COARSE, "tool.radius=10 mm")),
    "block, held at a side": ("block", (COARSE, "support.side=right")),
    "block, step": ("block", (COARSE, 'tool.history={kind="step"}')),
    "block, Rayleigh damping": (
        "block",
        (COARSE, "damping.kind=rayleigh", "damping.mass=20 s^-1", "damping.stiffness=1 ms"),
    ),
    "cantilever": (
        "block",
        (
            COARSE,
            'organ.size=["160 mm", "40 mm", "40 mm"]',
            "support.side=right",
            'tool.place={side="superior", at=[0.85, 0.5]}',
            "tool.radius=18 mm",
            'control_points.tool={side="superior", at=[0.85, 0.5]}',
        ),
    ),
    "liver": ("liver", ("reference.element_size=30 mm",)),
    "liver, nu 0.49": ("liver", ("reference.element_size=30 mm", "tissue.poisson_ratio=0.49")),
    "liver, held from below": (
        "liver",
        ("reference.element_size=30 mm", "support.side=inferior"),
    ),
    "liver, small tool": ("liver", ("reference.element_size=30 mm", "tool.radius=12 mm")),
}
FINEST = 4
"""Level of the truth; the levels up to two below are judged."""


class Row(NamedTuple):
    """Relative L2 errors of one curve, or of the field, on one mesh."""

    scene: str
    level: int
    quantity: str
    stated: float
    true: float
    observed_order: float


def rows(name: str) -> Iterator[Row]:
    """Of one scene, on each mesh that has two coarser ones."""
    base, overrides = SCENES[name]
    scene = read_scene(base, ('models=["fem"]', *overrides))
    posed = problem_of(scene)
    levels = [found for k in range(-2, FINEST + 1) if (found := posed.geometry.level(k))]
    (reference,) = models(scene, {})
    prepared = reference.prepare(posed)
    solved: list[MeshSolution] = []
    for level in levels:  # as a run does, each from the one before
        coarser = solved[-1].outlined if solved else None
        solved[-1:] = [coarser] if coarser else []
        solved.append(prepared.solved_on(level, Silent(), coarser))
    truth, volumes = solved[-1].found.trajectory, posed.volume_rule.weights
    for last in range(2, len(solved) - 2):
        errors = mesh_error(posed, solved[: last + 1])
        run = solved[last].found.trajectory
        if errors is None:
            continue
        for i, probe in enumerate(posed.probes):
            for kind in ("displacement", "velocity"):
                stated, order, ours, exact = (
                    getattr(one, kind)
                    for one in (errors.by_probe[probe], errors.order_by_probe[probe], run, truth)
                )
                every = np.ones(len(exact))
                true = relative_l2(ours[:, i], exact[:, i], every)
                yield Row(name, last - 2, f"{kind}, {probe}", stated, true, _order(order))
        true = relative_l2(run.volume_field[0], truth.volume_field[0], volumes)
        order = _order(errors.field_order)
        yield Row(name, last - 2, "field", errors.field_peak, true, order)


def _order(observed: float | None) -> float:
    return float("nan") if observed is None else observed


def main() -> None:
    """Write the table, and print how often the truth was within."""
    found = write(TABLE, (row for name in SCENES for row in rows(name)))
    for level, group in groupby(sorted(found, key=lambda r: r.level), key=lambda r: r.level):
        ratios = [row.true / row.stated for row in group]
        within = sum(ratio <= 1.0 for ratio in ratios)
        sys.stdout.write(
            f"level {level}: {within} of {len(ratios)} within, true over stated at most "
            f"{max(ratios):.2g}, median {np.median(ratios):.2g}\n"
        )


if __name__ == "__main__":
    main()
