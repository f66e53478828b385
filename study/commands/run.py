"""`run`: a scene through every model, to a results folder and its report."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.flags import EXIT_FAILED_CHECK, Overrides, Switch

if TYPE_CHECKING:
    from study.results import Results


def run(
    scene: str = "liver",
    *,
    set_: Overrides = None,
    out: Path | None = None,
    report: bool = True,
    fields: Switch = False,
    resume: Switch = False,
) -> None:
    """Run a scene through every model it names and write a results folder with its report.

    Parameters
    ----------
    scene
        A built-in scene (see `liver-study scenes`) or a TOML file.
    set_
        Override of the scene, table.key=value, for example tool.force="1 N". May be repeated.
    out
        Results folder; results/NAME by default. Earlier results in it are replaced.
    report
        Whether to make report.pdf.
    fields
        Keep the motion of all nodes of lattices and fem as MODEL.vtkhdf, which ParaView reads.
    resume
        Go on from where an interrupted run into the same folder last kept its state.
    """
    from study.models.keeping import Keeping
    from study.models.model import Watch
    from study.progress import on_stderr
    from study.results.folder import continuing, default_folder, replacing, write
    from study.run.study import run_study
    from study.scene.file import read_scene

    chosen = read_scene(scene, set_ or ())
    if fields and chosen.is_point:
        raise ValueError("--fields: a single point has none; leave it out")
    folder = out or default_folder(scene)
    with (
        replacing(folder) as partial,
        continuing(folder, resume=resume) as state,
        on_stderr() as progress,
    ):
        keeping = Keeping(state, resume, partial if fields else None)
        results = run_study(chosen, Watch(progress, keeping))
        with progress.stage("results"):
            write(results, partial)
        failure = None
        if report:
            with progress.stage("report"):
                failure = _report_failure(partial)
    _print_summary(results, folder)
    if failure:
        print(f"liver-study: results kept, but no report: {failure}", file=sys.stderr)
    if failure or any(not check.passed for check in results.record.checks):
        sys.exit(EXIT_FAILED_CHECK)


def _report_failure(folder: Path) -> Exception | None:
    """Make the report; a fault in it must not cost a finished run."""
    try:
        from reports.report import make_report

        make_report(folder)
    except Exception as error:  # whatever it is, the results stay
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
    pdf = folder / "report.pdf"
    print(f"results in {folder}" + (f", report {pdf}" if pdf.exists() else ""))
