"""`recommend`: the lattice that meets a rate or an error on this machine."""

from __future__ import annotations

import sys
from pathlib import Path

from study.commands.flags import EXIT_FAILED_CHECK, HERE, Overrides, Workers


def recommend(
    scene: str = "liver",
    *,
    rate: str | None = None,
    error: str | None = None,
    set_: Overrides = None,
    known_place: bool = False,
    out: Path | None = None,
    where: Workers = HERE,
) -> None:
    """Write the scene of the lattice that meets a rate or an error on this machine.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    rate
        States per second that must be ready in real time, for example "60 Hz", "60 fps" or 60.
    error
        Error of the displacement over the organ to stay below, for example "5 %"; a length such as
        "0.5 mm" is taken as a share of the largest displacement at rest.
    known_place
        The load stays where the scene has it: corrected lattices, which follow it only there, are
        chosen from too.
    set_
        Override of the scene, table.key=value. May be repeated.
    out
        Scene file to write; NAME-60Hz.toml or NAME-5percent.toml by default.
    """
    from study.system.progress import on_stderr
    from study.tradeoff import request as asked

    request = asked.TradeoffRequest(
        scene=scene, overrides=set_ or (), out=out, workers=where.workers, scheduler=where.scheduler
    )
    with on_stderr() as progress:
        met, lines = asked.advise(request, rate, error, progress, known_place=known_place)
    print("\n".join(lines))
    if not met:
        sys.exit(EXIT_FAILED_CHECK)
