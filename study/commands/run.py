"""`run`: a scene through every model, to a results folder and its report."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from study.commands.flags import EXIT_FAILED_CHECK, EXIT_MACHINE, Overrides, Switch, WholeOrNone
from study.system.folders import tell

if TYPE_CHECKING:
    from study.results import Results
    from study.scene import Scene
    from study.stages.store import Store
    from study.system.progress import Progress

REPORT, PAGE = "report.pdf", "report.html"


def run(
    scene: str = "liver",
    *,
    set_: Overrides = None,
    out: Path | None = None,
    report: bool = True,
    html: bool = True,
    open_: Annotated[bool, Parameter(name="--open", negative=())] = False,
    fields: Switch = False,
    save_mesh: Switch = False,
    resume: Switch = False,
    fresh: Switch = False,
    workers: WholeOrNone = None,
    minutes: float | None = None,
) -> None:
    """Run a scene through every model it names and write a results folder with its report.

    What an earlier run has computed, and this one would again, is taken from the user's store.

    Parameters
    ----------
    scene
        A built-in scene (see `liver-study scenes`) or a TOML file.
    set_
        Override of the scene, table.key=value, for example tool.force="1 N". May be repeated.
    out
        Results folder; results/NAME by default. Earlier results in it are replaced.
    report
        Whether to make report.pdf and report.html.
    html
        Whether to make report.html.
    open_
        Open report.html once it is made.
    fields
        Keep the motion of all nodes of lattices and fem as MODEL.vtkhdf, which ParaView reads.
    save_mesh
        Keep the tetrahedra of the organ as mesh.msh, which organ.mesh reads again.
    resume
        Go on within the models that an interrupted run into the same folder was at.
    fresh
        Compute everything anew.
    workers
        Processors to use, all by default: stages run side by side in as many processes, the
        products of the finite elements in two threads. With 1 all is done one after another.
    minutes
        Most that a model may take; one that needs longer is told as not finished, and the others
        go on.
    """
    from study.results.folder import default_folder
    from study.scene.file import read_scene
    from study.stages.store import user_store

    if resume and fresh:
        raise ValueError("--resume and --fresh: give one; --fresh takes nothing from before")
    if workers is not None and workers < 1:
        raise ValueError(f"--workers {workers}: give 1 or more")
    if minutes is not None and not minutes > 0.0:
        raise ValueError(f"--minutes {minutes:g}: give more than 0, or leave it out for no end")
    if open_ and not (report and html):
        raise ValueError("--open: opens report.html; leave out --no-report and --no-html")
    chosen = read_scene(scene, set_ or ())
    of_a_body = {"--fields": fields, "--save-mesh": save_mesh}
    if chosen.is_point:
        _refuse_any(of_a_body, "a single point has none; leave it out")
    folder = out or default_folder(scene)
    if chosen.require is not None and not chosen.require.moves:
        _refuse_any(
            of_a_body | {"--resume": resume, "--open": open_, "--minutes": minutes is not None},
            "require.quantities asks for the rest alone, whose folder has no motion and no report; "
            "leave it out, or ask for history too",
        )
        _at_rest(chosen, out or folder.with_name(f"{folder.name}-rest"))
        return
    if chosen.require is not None:
        chosen = _planned(chosen)
    how = _How(folder, report, report and html, fields, save_mesh, resume, fresh, workers, minutes)
    results = _results(chosen, how, user_store())
    if open_:
        from study.commands.view import show

        show(folder / PAGE)
    if any(not check.passed for check in results.record.checks):
        sys.exit(EXIT_FAILED_CHECK)


def _refuse_any(flags: Mapping[str, bool], why: str) -> None:
    """Refuse the first flag that is set."""
    for flag, given in flags.items():
        if given:
            raise ValueError(f"{flag}: {why}")


def _planned(scene: Scene) -> Scene:
    """The scene that keeps what is required, once a person is told of the plan."""
    from study.plan.plan import lines
    from study.run import planned
    from study.system.progress import on_stderr

    with on_stderr() as progress:
        found = planned.planned(scene, progress)
    print("\n".join(lines(found)))
    return found.scene


def _at_rest(scene: Scene, folder: Path) -> None:
    """Plan a scene of which the rest alone is wanted, and write a folder of that."""
    from study.plan.plan import lines
    from study.run import planned
    from study.system.progress import on_stderr

    with on_stderr() as progress:
        found = planned.planned(scene, progress)
        print("\n".join(lines(found)))
        print("\n".join(planned.at_rest(found, folder, progress)))


@dataclass(frozen=True)
class _How:
    """Flags of a run."""

    folder: Path
    report: bool
    page: bool
    fields: bool
    mesh: bool
    resume: bool
    fresh: bool
    workers: int | None
    minutes: float | None


def _results(scene: Scene, how: _How, store: Store | None) -> Results:
    """Results that the folder has, or that are written into it, once a person is told of them."""
    from study.run import up_to_date
    from study.system.progress import on_stderr

    key = (
        ""
        if store is None
        else up_to_date.run_key(scene, how.folder, fields=how.fields, mesh=how.mesh)
    )
    earlier = (
        None
        if store is None or how.fresh
        else up_to_date.up_to_date_run(store, key, how.folder, scene)
    )
    if earlier is not None:
        tell(f"nothing to compute: {how.folder} holds this run, of {earlier.at}; or give --fresh")
    with on_stderr() as progress:
        results = _computed(scene, how, store, progress) if earlier is None else earlier.results
        report = how.report and not (earlier and earlier.has_report)
        page = how.page and not (earlier and earlier.has_page)
        failure = _report_failure(_Wanted(report, page), how, store, progress)
    # What is not finished is sought anew by the next run.
    whole = all(model.status != "not finished" for model in results.record.models)
    if store is not None and whole and (earlier is None or report or page):
        up_to_date.record_run(store, key, how.folder)
    _print_summary(results, how.folder)
    if failure is not None:
        reason = str(failure) or type(failure).__name__
        print(
            f"liver-study: results kept, but no report: {reason}; liver-study report {how.folder} "
            "makes it",
            file=sys.stderr,
        )
        sys.exit(EXIT_MACHINE)
    return results


@dataclass(frozen=True)
class _Wanted:
    """Which reports are to be made."""

    report: bool
    page: bool


def _computed(scene: Scene, how: _How, store: Store | None, progress: Progress) -> Results:
    from study.models.model import Watch
    from study.models.persistence import Persistence
    from study.results import manifest
    from study.results.folder import continuing, replacing, told_to_start_again, write
    from study.run.stages import RunOptions, store_summary
    from study.run.study import run_study
    from study.stages.job_pool import available

    with (
        told_to_start_again(),
        replacing(how.folder) as partial,
        continuing(how.folder, scene, resume=how.resume) as state,
    ):
        mesh = partial / manifest.MESH if how.mesh else None
        options = RunOptions(store, how.fresh, how.workers or available(), mesh, how.minutes)
        persistence = Persistence(state, how.resume, partial if how.fields else None)
        results = run_study(scene, Watch(progress, persistence), options)
        with progress.stage("results"):
            write(results, partial)
    if store is not None:
        tell(store_summary(results.record.stages, store))
    return results


def _report_failure(
    wanted: _Wanted, how: _How, store: Store | None, progress: Progress
) -> Exception | KeyboardInterrupt | None:
    """Make the reports; neither a fault in them nor a signal must cost a finished run."""
    from study.stages.cached_arrays import using_store
    from study.stages.job_pool import available
    from study.stages.threads import threads
    from study.system.folders import claimed

    if not (wanted.report or wanted.page):
        return None
    try:
        with (
            progress.stage("report"),
            claimed(how.folder),
            using_store(store, readable=not how.fresh),
            threads(how.workers or available()),
        ):
            from study.commands.report import make

            make(how.folder, report=wanted.report, page=wanted.page)
    except (Exception, KeyboardInterrupt) as error:  # whatever it is, the results stay
        return error
    return None


def _print_summary(results: Results, folder: Path) -> None:
    from reports.differences import own_error, resolved

    for warning in results.record.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    for system, found in results.record.fuzzy.systems.items():
        interval = found.interval_pa
        span = f" [{interval[0] / 1e3:.2f}, {interval[1] / 1e3:.2f}]" if interval else ""
        print(
            f"{system}: {found.estimate_pa / 1e3:.2f} kPa{span}, "
            f"{found.relative_to_reference:.2f} of the reference modulus"
        )
    for row in results.field_differences:
        if row.quantity == "field-relative-l2-peak":
            share = resolved(row.value, own_error(results, row.reference))
            print(f"{row.model} against {row.reference}: field difference {share}")
    made = [str(folder / name) for name in (REPORT, PAGE) if (folder / name).exists()]
    print(f"results in {folder}" + (f", report {' and '.join(made)}" if made else ""))
