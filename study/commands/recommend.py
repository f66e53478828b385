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
    """Find the lattice that meets a rate or an error on this machine, and write its scene.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    rate
        Frames per second to reach in real time, for example "60 Hz", "60 fps" or 60.
    error
        Largest error of the displacement over the organ, for example "5 %"; a length such as
        "0.5 mm" is divided by the largest displacement at rest.
    known_place
        The load stays at the place given in the scene, so that corrected lattices, which need it in
        advance, can be selected too.
    set_
        Override of a scene value, table.key=value. May be repeated.
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
