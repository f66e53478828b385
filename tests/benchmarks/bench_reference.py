"""What the reference of a run costs mesh by mesh, of this program and of another version of it.

    python -m tests.benchmarks.bench_reference [CHECKOUT ...]

writes reports/data/reference_cost.csv: processor seconds of every stage of the built-in liver's
finite elements, and the largest memory of the process up to its end. The checkouts take turns with
this one, each in a process of its own on one thread. Processor time too grows where others share
the memory's bandwidth, so only ratios within one table tell, and the load is stated.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from study.models.finite_elements import reference_of
from study.models.model import Watch
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.system.progress import Silent

HERE = Path(__file__)
ROOT = HERE.parents[2]
TABLE = ROOT / "reports" / "data" / "reference_cost.csv"
FIELDS = ("version", "stage", "processor_s", "peak_mib", "load")
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
MIB = 2.0**20


class Stages(Silent):
    """Writes what each stage took, a line each, to standard output."""

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[float], None]]:
        """One step of a run."""
        started = time.process_time()
        yield lambda _: None
        spent = time.process_time() - started
        sys.stdout.write(json.dumps((name, spent, peak(), os.getloadavg()[0])) + "\n")


def peak() -> float:
    """Largest memory [MiB] of this process so far; getrusage counts the one that started it too."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return float(next(line for line in lines if line.startswith("VmHWM")).split()[1]) * 1024 / MIB


def stages() -> None:
    """The reference of the default scene, and its rest at another Poisson ratio."""
    scene, told = read_scene("liver"), Stages()
    prepared = reference_of(scene).prepare(problem_of(scene))
    prepared.run(Watch(told))
    with told.stage("fem: rest at nu 1/4"):
        prepared.rest_at(0.25)


def measured(checkout: Path) -> Iterator[tuple[str, float, float, float]]:
    """Lines of a checkout, by this script."""
    environment = os.environ | ONE_THREAD | {"PYTHONPATH": str(checkout)}
    done = subprocess.run(
        [sys.executable, str(HERE), "--stages"],
        cwd=checkout,
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    )
    for line in done.stdout.splitlines():
        yield tuple(json.loads(line))


def commit(checkout: Path) -> str:
    """Its version, as git names it."""
    command = ["git", "rev-parse", "--short", "HEAD"]
    done = subprocess.run(command, cwd=checkout, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def main() -> None:
    """Write the table."""
    checkouts = {commit(path): path for path in (ROOT, *map(Path, sys.argv[1:]))}
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(FIELDS)
        for name, checkout in checkouts.items():
            for stage, spent, largest, load in measured(checkout):
                table.writerow((name, stage, f"{spent:.3g}", f"{largest:.4g}", f"{load:.3g}"))
            file.flush()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--stages"]:
        stages()
    else:
        main()
