"""The scene: everything a study is told, in SI units; `study.scene.file` reads it."""

from study.problem.history import LoadHistory
from study.problem.tissue import Tissue
from study.scene.law import SpringLaw
from study.scene.schema import (
    Aetiology,
    AttachedWeight,
    BasafaConstants,
    Corrected,
    Damping,
    Fuzzy,
    Gravity,
    Lattice,
    Organ,
    Patient,
    Place,
    Reference,
    Require,
    Scene,
    Side,
    Superposition,
    Support,
    Time,
    Tool,
    Waypoint,
)

__all__ = [
    "Aetiology",
    "AttachedWeight",
    "BasafaConstants",
    "Corrected",
    "Damping",
    "Fuzzy",
    "Gravity",
    "Lattice",
    "LoadHistory",
    "Organ",
    "Patient",
    "Place",
    "Reference",
    "Require",
    "Scene",
    "Side",
    "SpringLaw",
    "Superposition",
    "Support",
    "Time",
    "Tissue",
    "Tool",
    "Waypoint",
]
