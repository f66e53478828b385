"""`run`: a scene through every model, to a results folder and its report."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

from cyclopts import Parameter

from study.commands.flags import EXIT_FAILED_CHECK, Overrides, Switch, WholeOrNone
from study.system.folders import tell
from study.system.signals import EXIT_MACHINE

if TYPE_CHECKING:
    from study.results import Results
    from study.scene import Scene
    from study.stages.store import Store
    from study.system.progress import Progress

REPORT, PAGE = "report.pdf", "report.html"


@dataclass(frozen=True, kw_only=True)
class RunFlags:
    """What a run makes and keeps, and what it may take.

    Parameters
    ----------
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
        Most that a model may take; one that needs longer is reported as not finished, and the
        others go on.
    """

    report: bool = True
    html: bool = True
    open_: Annotated[bool, Parameter(name="--open", negative=())] = False
    fields: Switch = False
    save_mesh: Switch = False
    resume: Switch = False
    fresh: Switch = False
    workers: WholeOrNone = None
    minutes: float | None = None

    @property
    def page(self) -> bool:
        """Whether to make report.html: --no-report leaves out both reports."""
        return self.report and self.html

    @property
    def of_a_body(self) -> dict[str, bool]:
        """Flags that mean nothing for a single point, and whether they are given."""
        return {"--fields": self.fields, "--save-mesh": self.save_mesh}

    @property
    def of_a_motion(self) -> dict[str, bool]:
        """Flags that mean nothing where the rest alone is asked for, and whether they are given."""
        timed = self.minutes is not None
        others = {"--resume": self.resume, "--open": self.open_, "--minutes": timed}
        return self.of_a_body | others

    def refuse(self) -> None:
        """Raise ValueError for values out of range, or flags that contradict each other."""
        if self.resume and self.fresh:
            raise ValueError("--resume and --fresh: give one; --fresh takes nothing from before")
        if self.workers is not None and self.workers < 1:
            raise ValueError(f"--workers {self.workers}: give 1 or more")
        if self.minutes is not None and not self.minutes > 0.0:
            raise ValueError(
                f"--minutes {self.minutes:g}: give more than 0, or leave it out for no end"
            )
        if self.open_ and not self.page:
            raise ValueError("--open: opens report.html; leave out --no-report and --no-html")


AS_DEFAULT = RunFlags()


def run(
    scene: str = "liver",
    *,
    set_: Overrides = None,
    out: Path | None = None,
    flags: Annotated[RunFlags, Parameter(name="*")] = AS_DEFAULT,
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
    """
    from study.results.folder import default_folder
    from study.scene.file import read_scene

    flags.refuse()
    chosen = read_scene(scene, set_ or ())
    if chosen.is_point:
        _refuse_any(flags.of_a_body, "a single point has none; leave it out")
    folder = out or default_folder(scene)
    if chosen.require is not None and not chosen.require.moves:
        _refuse_any(
            flags.of_a_motion,
            "require.quantities asks for the rest alone, whose folder has no motion and no report; "
            "leave it out, or ask for history too",
        )
        _at_rest(chosen, out or folder.with_name(f"{folder.name}-rest"))
        return
    if chosen.require is not None:
        chosen = _planned(chosen)
    results = _results(chosen, folder, flags)
    if flags.open_:
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


def _results(scene: Scene, folder: Path, flags: RunFlags) -> Results:
    """Results that the folder has, or that are written into it, once a person is told of them."""
    from study.run import up_to_date
    from study.stages.store import user_store
    from study.system.progress import on_stderr

    store, key, earlier = user_store(), "", None
    if store is not None:
        key = up_to_date.run_key(scene, folder, fields=flags.fields, mesh=flags.save_mesh)
    if store is not None and not flags.fresh:
        earlier = up_to_date.up_to_date_run(store, key, folder, scene)
    if earlier is not None:
        tell(f"nothing to compute: {folder} holds this run, of {earlier.at}; or give --fresh")
    with on_stderr() as progress:
        results = earlier.results if earlier else _computed(scene, folder, flags, store, progress)
        report = flags.report and not (earlier and earlier.has_report)
        page = flags.page and not (earlier and earlier.has_page)
        failure = _report_failure(folder, flags, store, progress, report=report, page=page)
    # What is not finished is sought anew by the next run.
    whole = all(model.status != "not finished" for model in results.record.models)
    if store is not None and whole and (earlier is None or report or page):
        up_to_date.record_run(store, key, folder)
    _print_summary(results, folder)
    if failure is not None:
        _end_without_report(failure, folder)
    return results


def _end_without_report(failure: BaseException, folder: Path) -> NoReturn:
    reason = str(failure) or type(failure).__name__
    print(
        f"liver-study: results kept, but no report: {reason}; liver-study report {folder} makes it",
        file=sys.stderr,
    )
    sys.exit(EXIT_MACHINE)


def _computed(
    scene: Scene, folder: Path, flags: RunFlags, store: Store | None, progress: Progress
) -> Results:
    from study.models.model import Watch
    from study.models.persistence import Persistence
    from study.results import manifest
    from study.results.folder import advising_restart, continuing, replacing, write
    from study.run.stages import RunOptions, store_summary
    from study.run.study import run_study
    from study.stages.job_pool import available

    with (
        advising_restart(),
        replacing(folder) as partial,
        continuing(folder, scene, resume=flags.resume) as state,
    ):
        mesh = partial / manifest.MESH if flags.save_mesh else None
        options = RunOptions(store, flags.fresh, flags.workers or available(), mesh, flags.minutes)
        persistence = Persistence(state, flags.resume, partial if flags.fields else None)
        results = run_study(scene, Watch(progress, persistence), options)
        with progress.stage("results"):
            write(results, partial)
    if store is not None:
        tell(store_summary(results.record.stages, store))
    return results


def _report_failure(
    folder: Path,
    flags: RunFlags,
    store: Store | None,
    progress: Progress,
    *,
    report: bool,
    page: bool,
) -> Exception | KeyboardInterrupt | None:
    """Make the reports; neither a fault in them nor a signal must cost a finished run."""
    from study.stages.cached_arrays import using_store
    from study.stages.job_pool import available
    from study.stages.threads import threads
    from study.system.folders import claimed

    if not (report or page):
        return None
    try:
        with (
            progress.stage("report"),
            claimed(folder),
            using_store(store, readable=not flags.fresh),
            threads(flags.workers or available()),
        ):
            from study.commands.report import make

            make(folder, report=report, page=page)
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
