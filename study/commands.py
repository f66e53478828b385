"""The commands of `liver-study`. Each imports what it needs, so that `--help` stays quick."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

from cyclopts import App, Parameter

if TYPE_CHECKING:
    from types import FrameType

    from fuzzy.stiffness import Estimate
    from study.results import Results

EXIT_FAILED_CHECK = 1
EXIT_BAD_INPUT = 2

app = App(
    name="liver-study",
    help="Fuzzy-tuned mass-spring liver beside finite elements and the Basafa benchmark.",
    version_flags=["--version"],
    help_format="plaintext",  # markdown would triple the time of --help
)


def main() -> None:
    """Run the command line; bad input ends with a message and exit code 2."""
    signal.signal(signal.SIGTERM, _leave)
    try:
        app()
    except ValueError as error:
        print(f"liver-study: {error}", file=sys.stderr)
        sys.exit(EXIT_BAD_INPUT)
    except KeyboardInterrupt:
        print("liver-study: interrupted, nothing written", file=sys.stderr)
        sys.exit(128 + signal.SIGINT)


def _leave(number: int, _: FrameType | None) -> NoReturn:
    """Let a termination unwind, so that half-written folders are removed."""
    sys.exit(128 + number)


@app.command
def run(
    scene: str = "liver",
    *,
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
    out: Path | None = None,
    report: bool = True,
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
    """
    from study.progress import on_stderr
    from study.results import replacing, write
    from study.run.whole import run_study
    from study.scene_file import read_scene

    chosen = read_scene(scene, set_ or ())
    folder = out or Path("results") / Path(scene).stem
    with replacing(folder) as partial, on_stderr() as progress:
        results = run_study(chosen, progress)
        with progress.stage("results"):
            write(results, partial)
        failure = None
        if report:
            with progress.stage("report"):
                failure = _report_failure(partial)
    _print_summary(results, folder)
    if failure:
        print(f"liver-study: results kept, but no report: {failure}", file=sys.stderr)
    if failure or any(not check["passed"] for check in results.numbers["checks"]):
        sys.exit(EXIT_FAILED_CHECK)


def _report_failure(folder: Path) -> Exception | None:
    """Make the report; a fault in it must not cost a finished run."""
    try:
        _make_report(folder)
    except Exception as error:  # whatever it is, the results stay
        return error
    return None


def _make_report(folder: Path) -> None:
    from reports.report import make_report

    make_report(folder)


def _print_summary(results: Results, folder: Path) -> None:
    numbers = results.numbers
    for warning in numbers["warnings"]:
        print(f"warning: {warning}", file=sys.stderr)
    for system, found in numbers["stiffness"].items():
        interval = found.get("interval_pa")
        span = f" [{interval[0] / 1e3:.2f}, {interval[1] / 1e3:.2f}]" if interval else ""
        print(
            f"{system}: {found['estimate_pa'] / 1e3:.2f} kPa{span}, "
            f"{found['relative_to_reference']:.2f} of the reference modulus"
        )
    for model, reference, quantity, value in results.tables["errors"]:
        if quantity == "field-relative-l2-peak":
            print(f"{model} against {reference}: field differs by {100 * float(value):.1f} %")
    pdf = folder / "report.pdf"
    print(f"results in {folder}" + (f", report {pdf}" if pdf.exists() else ""))


@app.command
def scenes() -> None:
    """List the built-in scenes."""
    from study.scene_file import BUILT_IN, built_in_title

    for name in BUILT_IN:
        print(f"{name:8s} {built_in_title(name)}")


@app.command
def check(
    target: str,
    *,
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
    unit: str | None = None,
) -> None:
    """Check a scene or a mesh file and say what would be run, without running it.

    Parameters
    ----------
    target
        A built-in scene, a TOML file, or a mesh file.
    set_
        Override of a scene, table.key=value. May be repeated.
    unit
        Unit of a mesh file, for example mm; guessed from the volume if it is not given.
    """
    from study.inspection import describe_mesh, describe_scene
    from study.scene_file import BUILT_IN

    if target in BUILT_IN or target.endswith(".toml") or not Path(target).exists():
        lines = describe_scene(target, set_ or ())
    else:
        lines = describe_mesh(Path(target), unit)
    print("\n".join(lines))


@app.command
def report(folder: Path) -> None:
    """Make report.pdf of a results folder again, without simulating.

    Parameters
    ----------
    folder
        Results folder of an earlier run.
    """
    _make_report(folder)
    print(folder / "report.pdf")


@app.command
def estimate(
    *,
    hcv: float | None = None,
    hbv: float | None = None,
    ald: float | None = None,
    cld: float | None = None,
    nafld: float | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> None:
    """Estimate liver stiffness from elastography readings by the three fuzzy systems.

    Parameters
    ----------
    hcv, hbv, ald, cld, nafld
        Reading per aetiology [kPa]; that of a normal liver if it is not given.
    as_json
        Print JSON in SI units instead of a table.
    """
    from fuzzy.stiffness import PA_PER_KPA, SYSTEMS
    from fuzzy.stiffness import estimate as fuzzy_estimate

    given = {"hcv": hcv, "hbv": hbv, "ald": ald, "cld": cld, "nafld": nafld}
    readings = {name: PA_PER_KPA * value for name, value in given.items() if value is not None}
    found = [fuzzy_estimate(readings, system) for system in SYSTEMS]
    for note in sorted({note for one in found for note in one.notes}):
        print(f"note: {note}", file=sys.stderr)
    if as_json:
        print(json.dumps({one.system: _estimate_numbers(one) for one in found}, indent=1))
        return
    for one in found:
        interval = [f"{bound / PA_PER_KPA:.2f}" for bound in one.interval or ()]
        span = f"   [{', '.join(interval)}]" if interval else ""
        print(f"{one.system:16s} {one.estimate / PA_PER_KPA:7.2f} kPa{span}")


def _estimate_numbers(found: Estimate) -> dict[str, object]:
    numbers: dict[str, object] = {
        "estimate_pa": found.estimate,
        "quadrature_error_pa": found.quadrature_error,
    }
    return numbers | ({"interval_pa": list(found.interval)} if found.interval else {})
