"""Contenders of a trade-off study and their settings in words."""

from __future__ import annotations

from collections.abc import Callable

from study.scene.schema import Reference

CONTENDERS = {
    "springs": "springs alone",
    "volume-springs": "springs and volume term",
    "single-precision": "single precision",
    "step-sizes": "the same, other steps",
    "integrators": "the same, other integrators",
    "basafa": "Basafa benchmark",
    "finite-elements": "finite elements in steps",
    "superposition": "superposition",
    "corrected": "corrected lattice",
    "region": "region of interest",
    "corrected-graded": "corrected, graded",
}
SPRINGS = {"True": "springs and volume term", "False": "springs alone"}
"""Name of a lattice by its setting `volume_term`."""
NAMES = {
    "p1": "linear",
    "p2": "quadratic",
    "taylor-hood": "Taylor-Hood",
    "ritz": "Ritz",
    "xpbd": "XPBD",
    "runge-kutta-4": "Runge-Kutta",
}
LIVER_EDGE = Reference().element_size
"""Elements of the scene's mesh [m], level 0, of the built-in liver on which was measured."""
FINER = 4.0 / 3.0
"""Ratio of the element sizes of a level of the built-in liver and the next finer one."""
WORDS: dict[str, Callable[[str], str]] = {
    "spacing": lambda value: f"{1e3 * float(value):.3g} mm",
    "step_fraction": lambda value: f"{value} of the critical step",
    "step_rate": lambda value: f"{value} Hz steps",
    "rate": lambda value: f"{value} Hz steps",
    "element": lambda value: NAMES.get(value, value),
    "level": lambda value: _mesh(int(value)),
    "integrator": lambda value: NAMES.get(value, value.replace("-", " ")),
    "vectors": lambda value: NAMES.get(value, value),
    "precision": lambda value: f"{value} precision",
    "radius": lambda value: f"to {1e3 * float(value):.3g} mm from the tool",
    "count": lambda value: f"{value} vectors",
}


def _mesh(level: int) -> str:
    if level == 0:
        return "the scene's mesh"
    steps = "a step" if abs(level) == 1 else f"{abs(level)} steps"
    return f"mesh {steps} {'finer' if level > 0 else 'coarser'}"


def contender_name(contender: str) -> str:
    """Name of a contender in legends; one that is not known has its own name."""
    return CONTENDERS.get(contender, contender)


def name_of(contender: str, settings: str, edge: float | None = None) -> str:
    """Name of a configuration in a sentence, from its settings "key=value key=value".

    `edge`: elements [m] of the mesh of level 0; where it is not known meshes are told from that.
    """
    known = dict(part.split("=", 1) for part in settings.split())
    head = SPRINGS.get(known.pop("volume_term", ""), contender_name(contender))
    return ", ".join([head, *(_said(key, value, edge) for key, value in known.items())])


def mark_of(settings: str, edge: float | None = None) -> str:
    """The setting that tells configurations of one contender apart first: the spacing, the mesh."""
    known = dict(part.split("=", 1) for part in settings.split())
    keys = (key for key in ("spacing", "element", "level") if key in known)
    return ", ".join(_said(key, known[key], edge) for key in keys)


def _said(key: str, value: str, edge: float | None) -> str:
    if key == "level" and edge is not None:
        return f"elements of {1e3 * edge / FINER ** int(value):.2g} mm"
    return WORDS[key](value) if key in WORDS else f"{key} {value}"
