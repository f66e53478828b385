"""Mass-spring models: the fuzzy-tuned lattice, the Basafa benchmark, the single control point.

A lattice over an organ, made of linear springs of E = 4 kPa, under the tool of a scene:

>>> import msm
>>> from study.scene.file import read_scene
>>> from study.scene.problem import problem_of
>>> problem = problem_of(read_scene("block"))
>>> organ = problem.geometry.body, problem.surface_rule
>>> body = msm.assemble(*organ, 1060.0, 0.02, problem.foundation, problem.tool)
>>> springs = msm.Hooke(msm.calibration.reference_stiffness(4e3, 0.02))
>>> material = msm.Material(springs, damping=msm.NodalDamping(30.0))
>>> found = msm.run(body, material, problem.factor, problem.observation)
>>> found.trajectory.status, found.trajectory.displacement.shape
('finished', (101, 2, 3))

What `__all__` names keeps its name and meaning; everything else may change with the package.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from study.system.compiled import drop_outdated

if TYPE_CHECKING:
    from msm import calibration, control_point
    from msm.assembly import Assembly, Material, assemble
    from msm.checkpoint import Checkpoint
    from msm.damping import NodalDamping, eq_2, eq_9
    from msm.integrators import INTEGRATORS, Integrator
    from msm.laws import LAWS, Basafa, ForceLaw, Hooke, Piecewise, piecewise
    from msm.model import Run, run
    from msm.stability import critical_time_step
    from msm.statics import static_displacement
    from msm.stepper import LatticeStepper
    from msm.timestep import Automatic, Counts, Fixed, Rate
    from msm.volume import volume_term

__all__ = [
    "INTEGRATORS",
    "LAWS",
    "Assembly",
    "Automatic",
    "Basafa",
    "Checkpoint",
    "Counts",
    "Fixed",
    "ForceLaw",
    "Hooke",
    "Integrator",
    "LatticeStepper",
    "Material",
    "NodalDamping",
    "Piecewise",
    "Rate",
    "Run",
    "assemble",
    "calibration",
    "control_point",
    "critical_time_step",
    "eq_2",
    "eq_9",
    "piecewise",
    "run",
    "static_displacement",
    "volume_term",
]

drop_outdated(Path(__file__).parent)  # before any kernel is loaded

# Numba alone takes as long to import as the quick commands to run, and these want calibration only.
_HOMES = {
    "msm.damping": ("NodalDamping", "eq_2", "eq_9"),
    "msm.laws": ("LAWS", "Basafa", "ForceLaw", "Hooke", "Piecewise", "piecewise"),
    "msm.integrators": ("INTEGRATORS", "Integrator"),
    "msm.volume": ("volume_term",),
}


if not TYPE_CHECKING:  # which would take any name then

    def __getattr__(name: str) -> object:
        """Import what `__all__` names when it is first asked for."""
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        if name in {"calibration", "control_point"}:
            return import_module(f"msm.{name}")
        home = next((home for home, names in _HOMES.items() if name in names), "msm.model")
        return getattr(import_module(home), name)
