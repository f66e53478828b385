"""CalculiX on an exported problem."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from fem_reference.exchange.calculix import Transient, files
from fem_reference.exchange.nodal import NodalProblem

PROGRAM = shutil.which("ccx")


def version() -> str:
    """Its version number."""
    said = subprocess.run([str(PROGRAM), "-v"], capture_output=True, text=True, check=False).stdout
    return said.split()[-1]


def at_rest(given: NodalProblem) -> np.ndarray:
    """Displacement [m] (n, 3) under full load."""
    (found,) = _solve(files(given), "static")
    return found


def moving(given: NodalProblem, motion: Transient) -> list[np.ndarray]:
    """Displacement [m] (n, 3) at each time that is printed."""
    return _solve(files(given, motion), "dynamic")


def _solve(decks: dict[str, str], deck: str) -> list[np.ndarray]:
    with tempfile.TemporaryDirectory() as folder:
        for name, text in decks.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        subprocess.run([str(PROGRAM), deck], cwd=folder, check=True, capture_output=True)
        return printed((Path(folder) / f"{deck}.dat").read_text(encoding="utf-8"))


def printed(text: str) -> list[np.ndarray]:
    """Displacements of each time in a .dat file."""
    tables = [
        [line.split() for line in t.splitlines()] for t in re.split("displacements", text)[1:]
    ]
    return [np.array([row[1:] for row in t if len(row) == 4], float) for t in tables]
