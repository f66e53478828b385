"""What the finite-element reference costs: beside other codes, and as it grows.

    python -m tests.benchmarks.bench_fem [PYTHON]

prints the figures and writes reports/data/fem_cost.csv; it takes ten minutes and 4 GB. PYTHON has
FElupe (GPL, so in an environment of its own); DOLFINx is asked for of the system's Python,
CalculiX of the path. What is missing is left out. Programs take turns, each on one thread; of the
repeats stand the least, which others on the machine disturb least, and the median.

Tasks, all on the built-in liver with straight quadratic tetrahedra:

assembly   from mesh to stiffness matrix, pattern and edge numbering included, for DOLFINx only what
           follows its mesh; the matrices' norms are compared
job        a whole process: ours makes the mesh, assembles, solves and stores the displacement at
           rest; CalculiX reads the deck, solves (SPOOLES) and prints
growth     ours alone, parts of the job as the mesh is refined, and the process' largest memory
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity

from fem_reference.assembly import elastic
from fem_reference.elasticity import Body, discretise
from fem_reference.exchange import calculix
from fem_reference.exchange.nodal import nodal_problem
from fem_reference.grid import straight
from fem_reference.solvers import solve_static
from study.problem.problem import Problem
from study.scene import Scene
from study.scene.file import read_scene
from study.scene.problem import problem_of
from tests.benchmarks.machine import machine
from tests.benchmarks.tables import cells, write
from tests.oracles.calculix import PROGRAM as CCX
from tests.oracles.calculix import version as release

HERE = Path(__file__).parent
TABLE = HERE.parents[1] / "reports" / "data" / "fem_cost.csv"
SYSTEM = "/usr/bin/python3"
OURS = version("liver-study")
COMPARED = 0.0122
"""Element size [m] of the comparison: 50 000 unknowns."""
GROWTH = (0.027, 0.0212, 0.0168, 0.0122, 0.0097, 0.00745)
ROUNDS, REPEATS = 3, 3
SAME = 1e-7
"""Relative difference of the norms of two matrices that are the same.

FElupe's quadrature points have eight digits.
"""
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class Row(NamedTuple):
    """Seconds of one task: least and median; of compilation apart; largest memory [MiB]."""

    task: str
    program: str
    version: str
    unknowns: int
    least_s: float
    median_s: float
    repeats: int
    compile_s: float | None
    peak_mib: float | None
    machine: str


class Timed(NamedTuple):
    """What a program measured of itself."""

    version: str
    seconds: list[float]
    norm: float
    compiled: float


def case(element_size: float) -> tuple[Scene, Problem]:
    """The built-in liver."""
    scene = read_scene("liver", (f"reference.element_size={1e3 * element_size:g} mm",))
    return scene, problem_of(scene)


def discretised(element_size: float) -> tuple[Scene, Problem, Body]:
    """Its body of straight quadratic tetrahedra."""
    scene, posed = case(element_size)
    body = discretise(posed.geometry.mesh, scene.tissue, posed.foundation, posed.tool, element="p2")
    return scene, posed, body


# --- assembly ------------------------------------------------------------------------------------


def assembly(felupe: str | None) -> list[Row]:
    """Stiffness matrix of the same mesh by every program."""
    scene, posed, body = discretised(COMPARED)
    given = nodal_problem(body, scene.tissue, posed.foundation)
    found: dict[str, list[Timed]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.npz"
        E, nu = scene.tissue.youngs_modulus, scene.tissue.poisson_ratio
        nodes, elements = given.nodes, given.elements
        np.savez(path, modulus=E, poisson_ratio=nu, nodes=nodes, elements=elements)
        for _ in range(ROUNDS):
            found.setdefault("scikit-fem, as the reference", []).append(ours(scene, posed))
            found.setdefault("scikit-fem, form on vectors", []).append(on_vectors(scene, posed))
            for name, python in (("felupe", felupe), ("dolfinx", SYSTEM)):
                if python is not None and has(python, name):
                    found.setdefault(name, []).append(measured(python, name, path))
    norm = float(np.linalg.norm((body.stiffness.matrix - body.support).data))
    return [assembly_row(name, runs, norm, len(body.load)) for name, runs in found.items()]


def ours(scene: Scene, posed: Problem) -> Timed:
    """Sums of scalar forms, as the reference assembles."""
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        found = elastic(straight(posed.geometry.mesh), "p2", scene.tissue)
        seconds.append(time.perf_counter() - start)
    return Timed(version("scikit-fem"), seconds, float(np.linalg.norm(found.matrix.data)), 0.0)


def on_vectors(scene: Scene, posed: Problem) -> Timed:
    """scikit-fem's own form of elasticity, on vectors."""
    seconds = []
    form = linear_elasticity(
        *lame_parameters(scene.tissue.youngs_modulus, scene.tissue.poisson_ratio)
    )
    for _ in range(REPEATS):
        start = time.perf_counter()
        element = skfem.ElementVector(skfem.ElementTetP2())
        basis = skfem.Basis(straight(posed.geometry.mesh), element, intorder=2)
        matrix = form.assemble(basis)
        seconds.append(time.perf_counter() - start)
    return Timed(version("scikit-fem"), seconds, float(np.linalg.norm(matrix.data)), 0.0)


def has(python: str, package: str) -> bool:
    """Whether an interpreter has a package."""
    if shutil.which(python) is None:
        return False
    command = [python, "-c", f"import {package}"]
    return subprocess.run(command, check=False, capture_output=True).returncode == 0


def measured(python: str, name: str, mesh: Path) -> Timed:
    """Run a program's script."""
    command = [python, str(HERE / f"assemble_{name}.py"), str(mesh), str(REPEATS)]
    said = run(command, HERE)
    return Timed(*json.loads(said.splitlines()[-1]))


def run(command: Sequence[str], folder: Path) -> str:
    """Output of a process on one thread."""
    environment = os.environ | ONE_THREAD
    done = subprocess.run(
        command, cwd=folder, env=environment, check=True, capture_output=True, text=True
    )
    return done.stdout


def assembly_row(name: str, runs: list[Timed], norm: float, unknowns: int) -> Row:
    """ValueError if the program's matrix is another one."""
    if abs(runs[0].norm / norm - 1.0) > SAME:
        raise ValueError(f"{name} assembled another matrix: norm {runs[0].norm}, not {norm}")
    seconds = [second for one in runs for second in one.seconds]
    compiled = min(one.compiled for one in runs) or None
    return row("assembly", name, runs[0].version, unknowns, seconds, compiled=compiled)


def row(
    task: str,
    program: str,
    release: str,
    unknowns: int,
    seconds: list[float],
    compiled: float | None = None,
    peak: float | None = None,
) -> Row:
    """A line of the table."""
    times = min(seconds), statistics.median(seconds), len(seconds)
    return Row(task, program, release, unknowns, *times, compiled, peak, machine())


# --- whole jobs and growth -----------------------------------------------------------------------


def jobs() -> list[Row]:
    """Whole static jobs of the same mesh, ours beside CalculiX."""
    scene, posed, body = discretised(COMPARED)
    ours_s: list[float] = []
    theirs_s: list[float] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in calculix.files(
            nodal_problem(body, scene.tissue, posed.foundation)
        ).items():
            (folder / file).write_text(text, encoding="utf-8")
        for _ in range(ROUNDS):
            command = [sys.executable, "-m", __spec__.name, "--job", str(COMPARED)]
            ours_s.append(seconds_of(command, HERE.parents[1]))
            if CCX is not None:
                theirs_s.append(seconds_of([CCX, "static"], folder))
    found = [row("job", "this study", OURS, len(body.load), ours_s)]
    if CCX is not None:
        found.append(row("job", "calculix", release(), len(body.load), theirs_s))
    return found


def seconds_of(command: Sequence[str], folder: Path) -> float:
    """Wall time of a process."""
    start = time.perf_counter()
    run(command, folder)
    return time.perf_counter() - start


def growth() -> list[Row]:
    """Parts of our static job, each mesh in processes of its own."""
    found = []
    for size in GROWTH:
        command = [sys.executable, "-m", __spec__.name, "--job", str(size)]
        runs = [json.loads(run(command, HERE.parents[1])) for _ in range(ROUNDS)]
        peak = max(one["peak_mib"] for one in runs)
        for part in ("mesh", "assembly", "solution"):
            seconds = [one[part] for one in runs]
            unknowns = runs[0]["unknowns"]
            found.append(row(f"growth: {part}", "this study", OURS, unknowns, seconds, peak=peak))
    return found


def job(element_size: float) -> None:
    """Our static job; its parts [s] and memory to standard output."""
    times = [time.perf_counter()]
    scene, posed = case(element_size)
    times.append(time.perf_counter())
    body = discretise(posed.geometry.mesh, scene.tissue, posed.foundation, posed.tool, element="p2")
    times.append(time.perf_counter())
    displacement = solve_static(body)
    times.append(time.perf_counter())
    with tempfile.TemporaryFile() as file:
        np.save(file, displacement)
    parts = dict(zip(("mesh", "assembly", "solution"), np.diff(times).tolist(), strict=True))
    found = {"unknowns": len(body.load), "peak_mib": peak_memory()}
    sys.stdout.write(json.dumps(found | parts))


def peak_memory() -> float:
    """Largest memory [MiB] of this process; getrusage would count the one that started it."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return float(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024.0


def main() -> None:
    """Print the figures and write the table."""
    felupe = sys.argv[1] if len(sys.argv) > 1 else None
    for row in write(TABLE, [*assembly(felupe), *jobs(), *growth()]):
        sys.stdout.write("  ".join(map(str, cells(row)[:-1])) + "\n")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--job"]:
        job(float(sys.argv[2]))
    else:
        main()
