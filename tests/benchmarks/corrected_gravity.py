"""What corrected lattices are off under gravity and weights, against finer ones and neo-Hooke.

    python -m tests.benchmarks.corrected_gravity

writes reports/data/corrected_gravity.csv, a row for each scene, control point and spacing. Rows
that are there are kept: started again, it goes on where it was stopped.

Held against is the motion of the same linear elements and what a lattice of the finest spacing adds
to them; where there are neo-Hookean elements too, columns `neo_hooke_*` are against these, which
know nothing of springs.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.models.corrected import CorrectedLattice, PreparedCorrected
from study.models.lattice import requested_step
from study.models.model import SILENT
from study.models.remainder import FINER, ORDER, Remainder
from study.models.table import model
from study.scene import Scene
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.similarity.fields import relative_l2_of_curves
from study.system.progress import Silent
from tests.benchmarks.corrected_places import TABLE as PLACES
from tests.benchmarks.tables import complete

Floats = NDArray[np.float64]

TABLE = PLACES.with_name("corrected_gravity.csv")
MOTION = (
    "gravity.acceleration=9.81 m/s^2",
    'tool.history={kind="ramp-hold-release", ramp="0.2 s", hold="0.3 s", release="0.2 s"}',
    "time.duration=0.4 s",
    "time.samples=41",
    'models=["fem", "hyperelastic", "corrected"]',
    "reference.accuracy=0.5",
)
BLOCK = (*MOTION, "tool.force=0.6 N", "reference.element_size=17 mm")
LIVER = (*MOTION, "tool.force=1.5 N")
HUNG = 'weight=[{mass="50 g", radius="20 mm", place={side="superior", at=[0.3, 0.5]}}]'
LOADED = "gravity.given=loaded"
SCENES = {
    "block, across": ("block", (*BLOCK, "gravity.towards=right")),
    "liver, off its bed": ("liver", (*LIVER, "gravity.towards=anterior")),
    "block, with a weight": ("block", (*BLOCK, "gravity.towards=right", HUNG)),
    "liver, given loaded": ("liver", (*LIVER, "gravity.towards=posterior", LOADED)),
}
STRAINED = ("block, across",)
"""Scenes in which neo-Hookean elements are run too."""
SPACINGS, FINEST = (0.02, 0.01), 0.005


class Row(NamedTuple):
    """Relative L2 errors of the displacement of a control point over time.

    `sag_m`: where it starts; `linear`: of the elements alone, `corrected` and `alone`: of a lattice
    of the spacing with and without them, `told`: what the former foretells of itself by half its
    spacing. `neo_hooke_*`: the same against those elements, and their own by their mesh; NaN where
    there are none.
    """

    scene: str
    probe: str
    spacing_m: float
    sag_m: float
    linear: float
    corrected: float
    told: float
    alone: float
    neo_hooke_own: float
    neo_hooke_linear: float
    neo_hooke_corrected: float
    neo_hooke_alone: float


def rows(name: str) -> Iterator[Row]:
    """All of a scene."""
    base, overrides = SCENES[name]
    scene = read_scene(base, overrides)
    problem = problem_of(scene)
    known = model(scene, "corrected")
    assert isinstance(known, CorrectedLattice)
    linear = known.fine.prepare(problem).solved_on(None, Silent()).found.trajectory.displacement
    added = {
        h: _remainder(known.varied(spacing=h).prepare(problem))
        for h in (*SPACINGS, FINER * SPACINGS[-1])
    }
    truth = linear + added[FINEST].trajectory.displacement
    strained, own = _neo_hooke(scene) if name in STRAINED else (truth * np.nan, {})
    for h in SPACINGS:
        part, finer = (added[one].trajectory.displacement for one in (h, FINER * h))
        alone = added[h].lattice.trajectory.displacement
        share = 1.0 / (1.0 - FINER**ORDER)
        told = relative_l2_of_curves(share * (part - finer), linear + part)
        off = [
            relative_l2_of_curves(one - other, other)
            for other in (truth, strained)
            for one in (linear, linear + part, alone)
        ]
        for i, probe in enumerate(problem.probes):
            sag = float(np.linalg.norm(truth[0, i]))
            first, second = ([float(one[i]) for one in of] for of in (off[:3], off[3:]))
            found = (*first[:2], float(told[i]), first[2], own.get(probe, np.nan), *second)
            yield Row(name, probe, h, sag, *found)


def _remainder(one: PreparedCorrected) -> Remainder:
    return one._remainder(one._on_level).run(requested_step(one.model.coarse.lattice))


def _neo_hooke(scene: Scene) -> tuple[Floats, dict[str, float]]:
    """Displacement [m] (samples, probes, 3) of these elements, and their errors by the mesh."""
    ran = model(scene, "hyperelastic").prepare(problem_of(scene)).run(SILENT)
    found = None if ran.record.elements is None else ran.record.elements.mesh_error
    assert found is not None
    return ran.trajectory.displacement, {k: one.displacement for k, one in found.by_probe.items()}


def main() -> None:
    """Write what is missing of the table."""
    tasks = {name: partial(rows, name) for name in SCENES}
    complete(TABLE, Row, tasks, lambda one: one.scene)


if __name__ == "__main__":
    main()
