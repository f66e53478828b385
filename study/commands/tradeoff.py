"""`tradeoff`: error and cost of every model in many settings."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import HERE, Overrides, Switch, Workers


def tradeoff(
    scene: str = "liver",
    *,
    set_: Overrides = None,
    contender: list[str] | None = None,
    out: Path | None = None,
    quick: Switch = False,
    dry_run: Switch = False,
    where: Workers = HERE,
) -> None:
    """Measure error and cost of every model of a scene in many configurations.

    Costs are timed in this process, one configuration after another.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    set_
        Override of a scene value, table.key=value. May be repeated.
    contender
        Only this model, for example volume-springs. May be repeated.
    out
        Folder to write; results/NAME-tradeoff by default. Finished runs are kept beside it.
    quick
        Time three rounds instead of five.
    dry_run
        Print what would be run, and stop.
    """
    from study.system.progress import on_stderr
    from study.tradeoff import request as asked

    request = asked.TradeoffRequest(
        scene=scene,
        overrides=set_ or (),
        contenders=contender or (),
        out=out,
        workers=where.workers,
        scheduler=where.scheduler,
        quick=quick,
    )
    if dry_run:
        print("\n".join(asked.planned(request)))
        return
    from reports.tradeoff import configurations
    from reports.tradeoff_answers import sentences
    from reports.tradeoff_figure import write_figures

    with on_stderr() as progress:
        lines = asked.measure(request, progress)
        with progress.stage("pictures"):
            pictures = write_figures(request.folder)
    found = sentences(configurations(request.folder))
    print("\n".join([*lines, *found, *map(str, pictures)]))
