"""All cases in their order. A new family is a module in `stability.cases` and a line here."""

from __future__ import annotations

from collections.abc import Iterator

from study.known.case import Case
from study.scene import Scene

LONG = 600.0
"""Seconds after which a problem of the verification counts as hanging."""


def _problem(name: str, source: str, function: str, *, quick: bool = True) -> Case:
    """A problem whose findings each state a limit; quick if it is solved in about a second."""
    return Case(
        family="verification",
        name=name,
        function=f"study.known.verification.{function}",
        source=source,
        seconds=LONG,
        quick=quick,
    )


PROBLEMS = (
    _problem("patch test", "uniform strain", "patch_test:findings"),
    _problem("rigid motion", "mechanics of rigid bodies", "rigid_motion:findings"),
    _problem(
        "manufactured, linear", "Roache 2002; Ciarlet 1978", "manufactured:linear", quick=False
    ),
    _problem(
        "manufactured, quadratic",
        "Roache 2002; Ciarlet 1978",
        "manufactured:quadratic",
        quick=False,
    ),
    _problem("manufactured, mixed", "Roache 2002; Boffi 2013", "manufactured:mixed", quick=False),
    _problem("column between walls", "Winkler 1867", "column:walled"),
    _problem("column with free sides", "Winkler 1867", "column:free", quick=False),
    _problem("thick sphere", "Lame 1833", "thick_sphere:findings"),
    _problem("bent bar", "Saint-Venant 1856; Love 1927", "bent_bar:findings", quick=False),
    _problem("half space", "Boussinesq 1885; Johnson 1985", "half_space:findings", quick=False),
    _problem(
        "indentation",
        "Hertz 1882; Boussinesq 1885; Spence 1968",
        "indentation:findings",
        quick=False,
    ),
    _problem("torsion of a ball", "Lamb 1881", "torsional_modes:whole"),
    _problem("torsion in an eighth", "Lamb 1881", "torsional_modes:octant"),
    _problem("damped motion, steps", "Clough and Penzien 1993", "damped_motion:stepped"),
    _problem("damped motion, subspaces", "Clough and Penzien 1993", "damped_motion:superposed"),
    _problem("standing wave", "waves in a box", "standing_wave:findings", quick=False),
    _problem("ball in a body", "Eshelby 1957", "ball_inclusion:findings", quick=False),
    _problem("iterative solvers", "factors of the same matrix", "iterations:findings"),
    _problem("moved faces", "neo-Hooke's law; Gent and Lindley 1959", "finite_strain:findings"),
    _problem(
        "tools at large strain",
        "neo-Hooke's law; Hertz 1882; Boussinesq 1885; Mindlin 1949",
        "large_contact:findings",
        quick=False,
    ),
)
"""Problems with exact solutions that `verify` solves by the finite-element reference."""


def stability_cases(scene: Scene, *, quick: bool = False) -> list[Case]:
    """A scene's own cases and those of every family of `stability`, or the quick ones of them."""
    return [case for case in _stability(scene) if case.quick or not quick]


def _stability(scene: Scene) -> Iterator[Case]:
    # Here, so that the problems are listed without the lattice's compiled kernels.
    from study.known.stability.cases import (
        collapse,
        critical_step,
        curves,
        damping,
        drift,
        element_contact,
        elements,
        fixed_step,
        fuzzy_readings,
        inclusions,
        large_contact,
        large_strain,
        lattice_contact,
        lattice_shapes,
        long_steps,
        own_scene,
    )

    yield from own_scene.cases(scene)
    for family in (
        critical_step,
        fixed_step,
        long_steps,
        damping,
        drift,
        collapse,
        lattice_contact,
        lattice_shapes,
        elements,
        large_strain,
        inclusions,
        element_contact,
        large_contact,
        fuzzy_readings,
        curves,
    ):
        yield from family.cases()
