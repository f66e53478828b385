"""All verification problems."""

from __future__ import annotations

from study.known.verification import (
    bent_bar,
    column,
    damped_motion,
    half_space,
    iterations,
    manufactured,
    patch_test,
    rigid_motion,
    standing_wave,
    thick_sphere,
    torsional_modes,
)
from study.known.verification.finding import Problem

PROBLEMS = (
    Problem("patch test", "uniform strain", patch_test.findings),
    Problem("rigid motion", "mechanics of rigid bodies", rigid_motion.findings),
    Problem("manufactured, linear", "Roache 2002; Ciarlet 1978", manufactured.linear, quick=False),
    Problem(
        "manufactured, quadratic", "Roache 2002; Ciarlet 1978", manufactured.quadratic, quick=False
    ),
    Problem("manufactured, mixed", "Roache 2002; Boffi 2013", manufactured.mixed, quick=False),
    Problem("column between walls", "Winkler 1867", column.walled),
    Problem("column with free sides", "Winkler 1867", column.free, quick=False),
    Problem("thick sphere", "Lame 1833", thick_sphere.findings),
    Problem("bent bar", "Saint-Venant 1856; Love 1927", bent_bar.findings, quick=False),
    Problem("half space", "Boussinesq 1885; Johnson 1985", half_space.findings, quick=False),
    Problem("torsion of a ball", "Lamb 1881", torsional_modes.whole),
    Problem("torsion in an eighth", "Lamb 1881", torsional_modes.octant),
    Problem("damped motion, steps", "Clough and Penzien 1993", damped_motion.stepped),
    Problem("damped motion, subspaces", "Clough and Penzien 1993", damped_motion.superposed),
    Problem("standing wave", "waves in a box", standing_wave.findings, quick=False),
    Problem("iterative solvers", "factors of the same matrix", iterations.findings),
)
