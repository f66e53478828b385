"""Matrices that GetFEM and DOLFINx assemble of a case's points, elements and material.

Both are packages of the system's Python, not of this environment, and run there. Stiffness and mass
are all theirs; support and load are ours, but for DOLFINx also its own.
"""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.sparse import csc_array, load_npz

from fem_reference.elasticity import Body
from fem_reference.solvers import solve_static
from fem_reference.stiffness import Stiffness
from tests.oracles.cases import Built

PYTHON = "/usr/bin/python3"
PROGRAMS = ("getfem", "dolfinx")
# Inertia (1/s^2) that counts as much as the stiffness does, about.
SHAKEN = 1e4


@dataclass(frozen=True)
class Assembled:
    """What a program made of a case; `support` and `load` only by DOLFINx."""

    version: str
    stiffness: csc_array
    mass: csc_array
    support: csc_array | None
    load: np.ndarray | None

    def frames(self, body: Body) -> dict[str, np.ndarray]:
        """Displacements [m] (n, 3) of the body by its matrices."""
        theirs = replace(
            body, stiffness=Stiffness(csc_array(self.stiffness + body.support)), mass=self.mass
        )
        found = frames(theirs)
        if self.support is not None and self.load is not None:
            own = Stiffness(csc_array(self.stiffness + self.support))
            alone = replace(body, stiffness=own, support=self.support, load=self.load)
            found["alone"] = solve_static(alone, 1e-13).reshape(-1, 3)
        return found


def frames(body: Body) -> dict[str, np.ndarray]:
    """Displacement [m] (n, 3) at rest, and with its inertia beside the stiffness."""
    shaken = replace(body, stiffness=Stiffness(body.stiffness.matrix + SHAKEN * body.mass))
    return {
        name: solve_static(one, 1e-13).reshape(-1, 3)
        for name, one in (("rest", body), ("shaken", shaken))
    }


@cache
def installed(program: str) -> bool:
    """Whether the system's Python has it."""
    command = [PYTHON, "-I", "-c", f"import {program}"]
    if not Path(PYTHON).exists():
        return False
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def rule_for(program: str, case: Built) -> str:
    """GetFEM has the four-point rule of CalculiX: on curved elements all three can agree."""
    return "IM_TETRAHEDRON(2)" if program == "getfem" and case.problem.curved else ""


def assemble(program: str, case: Built, rule: str = "") -> Assembled:
    """Matrices by the program; `rule` names one of its quadratures."""
    script = Path(__file__).with_name(f"{program}_matrices.py")
    with tempfile.TemporaryDirectory() as folder:
        given, out = Path(folder) / "given.npz", Path(folder) / "found"
        np.savez(given, rule=rule, **case.numbers())
        command = [PYTHON, "-I", str(script), str(given), str(out)]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        found = {
            path.stem[6:]: csc_array(load_npz(path)) for path in Path(folder).glob("found-*.npz")
        }
        load = out.with_name("found-load.npy")
        nodal = np.load(load) if load.exists() else None
    version = said.split()[-1]
    return Assembled(version, found["stiffness"], found["mass"], found.get("support"), nodal)
