"""What a run takes, stage by stage: one after another, side by side, and with what was kept.

    python -m tests.benchmarks.run_stages [SCENE]

takes some five minutes on two quiet cores for the built-in liver. It writes the rows of this
machine to reports/data/run_stages.csv and leaves those of others. Each case is a process of its
own with its report, on a store that is empty at first; the first case compiles the kernels too. A
stage has the wall time that its record has; a whole run also the processor time of all its
processes, which other work on the machine touches least, and the largest memory of all together
at one time, what they share counted once. `load` is what the machine had to do as the case ended.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import psutil

from tests.benchmarks.machine import load, machine

COLD = "after install"
"""The case whose kernels are compiled within it, as in the first run of all."""
CASES = {
    COLD: ("--fresh", "--workers", "2"),
    "side by side": ("--fresh", "--workers", "2"),
    "unchanged": (),
    "other title": ("--set", "title=Another"),
    "no renders": ("--set", "renders=false"),
    "other reading": ("--set", "patient.hcv=14 kPa"),
    "other spacing": ("--set", "lattice.spacing=9 mm"),
    "one after another": ("--fresh", "--workers", "1"),
}
"""Flags by case; those between are of the first, whose stages are kept, or change it."""
PAUSE = 0.5
"""Seconds between two looks at the memory."""
TABLE = Path(__file__).parents[2] / "reports" / "data" / "run_stages.csv"
COLUMNS = ("machine", "case", "stage", "kept", "wall_s", "processor_s", "memory_mb", "load")


def main(scene: str) -> None:
    """Measure all cases and write them to the table."""
    here = machine()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["LIVER_STUDY_STORE"] = str(Path(folder) / "store")
        rows = [
            (here, *row)
            for case, flags in CASES.items()
            for row in measured(case, scene, flags, Path(folder))
        ]
    others = [row for row in read(TABLE) if row[0] != here]
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *others, *rows])


def read(path: Path) -> list[tuple[str, ...]]:
    """Rows of a table without its head; none if there is no table."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [tuple(row) for row in csv.reader(file)][1:]


def measured(
    case: str, scene: str, flags: tuple[str, ...], folder: Path
) -> Iterator[tuple[object, ...]]:
    """Rows of a case: the whole run, then its stages but for those of a run that was not made."""
    out = folder / ("changed" if "--set" in flags else "out")
    command = [sys.executable, "-m", "study", "run", scene, "--out", str(out), *flags]
    compiled = {"NUMBA_CACHE_DIR": str(folder / "kernels")} if case == COLD else {}
    started = time.perf_counter()
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | compiled,
    )
    with watched(process.pid) as sizes:
        said = process.stderr.read() if process.stderr else ""
        _, status, used = os.wait4(process.pid, 0)
        wall = time.perf_counter() - started
    if status:
        sys.exit(said)
    spent = used.ru_utime + used.ru_stime
    yield (
        case,
        "whole",
        "",
        f"{wall:.2f}",
        f"{spent:.2f}",
        f"{max(sizes) / 1e6:.0f}",
        f"{load():.1f}",
    )
    if "nothing to compute" in said:
        return
    record = json.loads((out / "results.json").read_text())
    for stage in record["stages"]:
        yield case, stage["name"], stage["kept"], f"{stage['wall_s']:.2f}", "", "", ""
    for line in said.splitlines():
        name, _, seconds = line.partition(": ")
        if name in {"similarity", "results", "report"}:
            yield case, name, False, seconds.removesuffix(" s"), "", "", ""


@contextmanager
def watched(process: int) -> Iterator[list[float]]:
    """Memory [bytes] of a process and all that it has started, every half second of the block."""
    sizes, ended = [0.0], Event()

    def watch() -> None:
        while not ended.wait(PAUSE):
            with suppress(psutil.Error):
                top = psutil.Process(process)
                sizes.append(sum(map(share_of_memory, [top, *top.children(recursive=True)])))

    thread = Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield sizes
    finally:
        ended.set()
        thread.join()


def share_of_memory(process: psutil.Process) -> float:
    """What it uses [bytes], its part of what it shares; none once it has ended."""
    try:
        return float(process.memory_full_info().pss)
    except psutil.Error:
        return 0.0


if __name__ == "__main__":
    main(*(sys.argv[1:] or ["liver"]))
