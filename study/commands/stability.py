"""`stability`: every model at its extremes."""

from __future__ import annotations

import sys
from pathlib import Path

from study.commands.flags import EXIT_FAILED_CHECK, HERE, Switch, Workers


def stability(
    scene: str = "block",
    *,
    out: Path | None = None,
    quick: Switch = False,
    dry_run: Switch = False,
    where: Workers = HERE,
) -> None:
    """Run every model at its extremes and check each case against a known outcome.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file, whose models are tested too.
    out
        Folder to write; results/NAME-stability by default. Finished cases are kept beside it.
    quick
        A subset of the cases, half a minute.
    dry_run
        Print what would be run, and stop.
    """
    from study.known import request as asked
    from study.known import table
    from study.sweep.status import on_stderr

    request = asked.StabilityRequest(
        scene=scene,
        out=out,
        workers=where.workers,
        scheduler=where.scheduler,
        quick=quick,
    )
    if dry_run:
        print(asked.planned(request))
        return
    with on_stderr("stability") as progress:
        verdicts = asked.study(request, progress)
    from reports.stability_map import write_figures

    print("\n".join(table.stability_lines(verdicts)))
    print(f"table in {request.folder / table.NAME}")
    print("\n".join(map(str, write_figures(request.folder))))
    if not asked.all_passed(verdicts):
        sys.exit(EXIT_FAILED_CHECK)
