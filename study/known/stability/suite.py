"""All cases in their order. A new family is a module in `cases` and a line here."""

from __future__ import annotations

from collections.abc import Iterator

from study.known.stability.case import Case
from study.known.stability.cases import (
    collapse,
    critical_step,
    curves,
    damping,
    drift,
    elements,
    fixed_step,
    fuzzy_readings,
    large_strain,
    lattice_shapes,
    long_steps,
    own_scene,
)
from study.scene import Scene

FAMILIES = (
    critical_step,
    fixed_step,
    long_steps,
    damping,
    drift,
    collapse,
    lattice_shapes,
    elements,
    large_strain,
    fuzzy_readings,
    curves,
)


def cases(scene: Scene, *, quick: bool = False) -> list[Case]:
    """The scene's own cases and those of every family, or the quick ones of them."""
    return [case for case in _all(scene) if case.quick or not quick]


def _all(scene: Scene) -> Iterator[Case]:
    yield from own_scene.cases(scene)
    for family in FAMILIES:
        yield from family.cases()
