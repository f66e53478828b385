"""The figures that matter over the history of the program, kept by asv (airspeed velocity).

    python -m tests.benchmarks.over_time [ARGUMENTS OF asv run]

measures this commit in the environment that runs it and adds it to the `results` beside this file.
It takes three minutes and wants `pip install asv`. Commit first: a figure is stored under the
commit that is checked out. Each is the processor time of a task over that of a calibration loop, so
that machines can be compared. `asv show`, `asv compare A B` and `asv publish`, each with
`--config tests/benchmarks/over_time/asv.conf.json`, read the history.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

from tests.benchmarks.machine import machine

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]


def described() -> dict[str, str]:
    """What asv keeps of the machine: its processor, and no name of its own."""
    cpu = machine().partition(",")[0]
    name = "-".join(cpu.lower().replace("(", " ").replace(")", " ").split())
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {
        "machine": f"{name}-{os.cpu_count()}",
        "os": platform.system(),
        "arch": platform.machine(),
        "cpu": cpu,
        "num_cpu": str(os.cpu_count()),
        "ram": f"{memory / 2**30:.0f} GiB",
    }


def main() -> int:
    """Run asv on one thread; its exit code."""
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    environment = os.environ | threads | {"ASV_PYTHONPATH": str(ROOT)}
    asv = [sys.executable, "-m", "asv"]
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, check=True, text=True
    ).stdout.strip()
    known = [f"--{name}={value}" for name, value in described().items()]
    stored = ["--set-commit-hash", commit, "--machine", described()["machine"]]
    run = ["run", "--python=same", *stored, "--show-stderr", *sys.argv[1:]]
    for arguments in (["machine", *known], run):
        done = subprocess.run([*asv, *arguments], cwd=HERE, env=environment, check=False)
        if done.returncode != 0:
            return done.returncode
    for path in (HERE / "results").glob("*/*-existing-*.json"):
        without_folders(path)
    return 0


def without_folders(path: Path) -> None:
    """Name the environment of a result by its Python and not by the folder that holds it.

    asv names an environment that exists by the path of its interpreter.
    """
    found = json.loads(path.read_text(encoding="utf-8"))
    name = f"python{platform.python_version()}"
    found |= {"env_name": name, "python": name, "params": found["params"] | {"python": name}}
    target = path.with_name(f"{path.name.partition('-')[0]}-{name}.json")
    if target.exists():  # some figures measured again
        before = json.loads(target.read_text(encoding="utf-8"))
        found["results"] = before["results"] | found["results"]
    target.write_text(json.dumps(found), encoding="utf-8")
    path.unlink()


if __name__ == "__main__":
    sys.exit(main())
