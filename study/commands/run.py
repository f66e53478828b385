"""`run`: a scene through every model, to a results folder and its report."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.flags import EXIT_FAILED_CHECK, EXIT_MACHINE, Overrides, Switch

if TYPE_CHECKING:
    from study.progress import Progress
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
    with on_stderr() as progress:
        with replacing(folder) as partial, continuing(folder, resume=resume) as state:
            keeping = Keeping(state, resume, partial if fields else None)
            results = run_study(chosen, Watch(progress, keeping))
            with progress.stage("results"):
                write(results, partial)
        failure = _report_failure(folder, progress) if report else None  # the results are safe
    _print_summary(results, folder)
    if failure is not None:
        reason = str(failure) or type(failure).__name__
        print(
            f"liver-study: results kept, but no report: {reason}; liver-study report {folder} "
            "makes it",
            file=sys.stderr,
        )
        sys.exit(EXIT_MACHINE)
    if any(not check.passed for check in results.record.checks):
        sys.exit(EXIT_FAILED_CHECK)


def _report_failure(folder: Path, progress: Progress) -> Exception | KeyboardInterrupt | None:
    """Make the report; neither a fault in it nor a signal must cost a finished run."""
    from study.folders import claimed

    try:
        with progress.stage("report"), claimed(folder):
            from reports.report import make_report

            make_report(folder)
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
    pdf = folder / "report.pdf"
    print(f"results in {folder}" + (f", report {pdf}" if pdf.exists() else ""))
