"""`run`: a scene through every model, to a results folder and its report."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.flags import EXIT_FAILED_CHECK, EXIT_MACHINE, Overrides, Switch

if TYPE_CHECKING:
    from study.plan.plan import Plan
    from study.progress import Progress
    from study.results import Results
    from study.scene import Scene


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
        if chosen.require is not None:
            planned = _planned(chosen, progress)
            if not planned.moves:
                _run_at_rest(planned, out or folder.with_name(f"{folder.name}-rest"), progress)
                return
            chosen = planned.scene
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


def _planned(scene: Scene, progress: Progress) -> Plan:
    """What is modelled of a scene that says what it requires; the plan is told and kept."""
    from study.plan.plan import lines, plan
    from study.run.suiting import suited

    with progress.stage("plan"):
        found = plan(suited(scene, progress))
    told = lines(found)
    print("\n".join(told))
    remarks = (*found.scene.remarks, *(f"Planned: {line}." for line in told))
    return replace(found, scene=replace(found.scene, remarks=remarks))


def _run_at_rest(planned: Plan, folder: Path, progress: Progress) -> None:
    """Solve at rest and write a folder of that, which has no curves and so no report."""
    from study.results import rest as results
    from study.run.rest import rest_of
    from study.scene.file import write_scene

    required = planned.scene.require
    with results.replacing(folder) as partial:
        found = rest_of(planned.scene, progress, large=planned.large)
        results.write(found.rows, write_scene(planned.scene), partial)
        if required is not None and "field" in required.quantities:
            results.write_field(found.mesh, found.displacement, partial)
    for row in found.rows:
        errors = (row.mesh_error, row.large_displacement_error)
        known = " and ".join("unknown" if e is None else f"{100.0 * e:.2g} %" for e in errors)
        print(
            f"{row.probe}: {1e3 * row.along_push_m:.4g} mm along the push, estimated error "
            f"{known} by mesh and large displacements"
        )
    print(f"results in {folder}")


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
