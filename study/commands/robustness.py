"""`robustness`: the paper's ranking over all that is open of a control point, or of an organ."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.flags import HERE, Overrides, Switch, Whole, WholeOrNone, Workers

if TYPE_CHECKING:
    from study.robustness.organ_request import OrganRequest
    from study.robustness.request import RobustnessRequest

POINT_SIZE, ORGAN_SIZE, AGAIN = 4096, 64, 32


def robustness(
    scene: str | None = None,
    *,
    set_: Overrides = None,
    size: WholeOrNone = None,
    seed: Whole = 0,
    spacing: str | None = None,
    again: WholeOrNone = None,
    out: Path | None = None,
    dry_run: Switch = False,
    where: Workers = HERE,
) -> None:
    """Sample everything that the paper leaves open and rank the fuzzy systems in each sample.

    Without a scene, the paper's single mass point; with a scene, variations of its organ on coarse
    lattices.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file, with an organ.
    set_
        Override of a scene value, table.key=value. May be repeated.
    size
        Rows of the Sobol' design, a power of two; each has two samples of all unknowns and one more
        for every unknown or group of unknowns. By default 4096 for the mass point, 64 for an organ.
    seed
        Seed of the scrambled points.
    spacing
        Mean spacing of an organ's lattices; by default a fifth of the organ's size.
    again
        Number of an organ's samples repeated on lattices twice as fine, 32 by default.
    out
        Folder to write; results/robustness or results/NAME-robustness by default. Finished blocks
        are kept beside it.
    dry_run
        Print what would be run, and stop.
    """
    from study.robustness import organ_request, request

    if scene is None:
        _refuse_of_organ({"--set": set_, "--spacing": spacing, "--again": again})
        point = request.RobustnessRequest(
            size=POINT_SIZE if size is None else size,
            seed=seed,
            out=out,
            workers=where.workers,
            scheduler=where.scheduler,
        )
        _of_point(point, dry=dry_run)
        return
    organ = organ_request.OrganRequest(
        scene=scene,
        overrides=set_ or (),
        size=ORGAN_SIZE if size is None else size,
        seed=seed,
        spacing=_length(spacing),
        again=AGAIN if again is None else again,
        out=out,
        workers=where.workers,
        scheduler=where.scheduler,
    )
    _of_organ(organ, dry=dry_run)


def _refuse_of_organ(flags: Mapping[str, object]) -> None:
    """ValueError for a flag that means nothing without an organ."""
    for flag, value in flags.items():
        if value is not None:
            raise ValueError(f"{flag}: is of an organ; name a scene, as in robustness liver")


def _length(text: str | None) -> float | None:
    """The length [m] of --spacing. ValueError naming the flag for what is none."""
    from study.annotation.quantity import Quantity

    if text is None:
        return None
    try:
        return Quantity("m", 1e-4, 1.0).read(text)
    except ValueError as error:
        raise ValueError(f"--spacing: {error}") from None


def _of_point(asked: RobustnessRequest, *, dry: bool) -> None:
    from reports.ranking_study import sentences
    from reports.ranking_study_figure import write_figures
    from study.robustness import request
    from study.sweep.status import on_stderr

    if dry:
        print(request.planned(asked))
        return
    with on_stderr("robustness") as progress:
        found = request.study(asked, progress)
    print("\n".join([*request.lines(found), *sentences(asked.folder)]))
    _print_paths(asked.folder, request.FILES, write_figures(asked.folder))


def _of_organ(asked: OrganRequest, *, dry: bool) -> None:
    from reports.organ_ranking import sentences
    from reports.organ_ranking_figure import write_figures
    from study.robustness import organ_request
    from study.sweep.status import on_stderr

    if dry:
        print(organ_request.planned(asked))
        return
    with on_stderr("robustness") as progress:
        found = organ_request.study(asked, progress)
    print("\n".join([*organ_request.lines(found, asked), *sentences(asked.folder)]))
    _print_paths(asked.folder, organ_request.FILES, write_figures(asked.folder))


def _print_paths(folder: Path, tables: Iterable[str], pictures: Iterable[Path]) -> None:
    print("\n".join(map(str, [*(folder / name for name in tables), *pictures])))
