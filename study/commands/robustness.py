"""`robustness`: the paper's ranking over all that the paper leaves open."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import HERE, Switch, Workers


def robustness(
    *,
    size: int = 4096,
    seed: int = 0,
    out: Path | None = None,
    dry_run: Switch = False,
    where: Workers = HERE,
) -> None:
    """Draw all that the paper leaves open of its control point, and rank the systems in each draw.

    Parameters
    ----------
    size
        Rows of the design, a power of two; each has two draws of all unknowns and one more for
        every unknown.
    seed
        Of the points, which are scrambled.
    out
        Folder to write; results/robustness by default. Finished blocks are kept beside it.
    dry_run
        Say what would be run, and stop.
    """
    from study.robustness import request as asked
    from study.sweep.tally import on_stderr

    request = asked.RobustnessRequest(
        size=size, seed=seed, out=out, workers=where.workers, scheduler=where.scheduler
    )
    if dry_run:
        print(asked.planned(request))
        return
    with on_stderr("robustness") as progress:
        found = asked.study(request, progress)
    from reports.ranking_study import sentences
    from reports.ranking_study_figure import write_figures

    print("\n".join([*asked.lines(found), *sentences(request.folder)]))
    tables = [request.folder / name for name in asked.FILES]
    print("\n".join(map(str, [*tables, *write_figures(request.folder)])))
