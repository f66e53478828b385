"""The commands of `liver-study`. Each imports what it needs, so that `--help` stays quick."""

from __future__ import annotations

import signal
import sys
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from cyclopts import App, Parameter

if TYPE_CHECKING:
    from types import FrameType

    from study.results.folder import Results

EXIT_FAILED_CHECK = 1
EXIT_BAD_INPUT = 2

app = App(
    name="liver-study",
    help="Fuzzy-tuned mass-spring liver beside finite elements and the Basafa benchmark.",
    version=lambda: version("liver-study"),
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
        print("liver-study: interrupted; a run goes on with --resume", file=sys.stderr)
        sys.exit(128 + signal.SIGINT)


def _leave(number: int, _: FrameType | None) -> NoReturn:
    """Let a termination unwind, so that half-written folders are removed."""
    from study.progress import ask_to_stop

    ask_to_stop(number)
    sys.exit(128 + number)


@app.command
def run(
    scene: str = "liver",
    *,
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
    out: Path | None = None,
    report: bool = True,
    fields: Annotated[bool, Parameter(negative=())] = False,
    resume: Annotated[bool, Parameter(negative=())] = False,
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
        Keep the motion of all lattice nodes as MODEL.vtkhdf, which ParaView reads.
    resume
        Go on from where an interrupted run into the same folder last kept its state.
    """
    from study.progress import on_stderr
    from study.results.folder import continuing, replacing, write
    from study.run.keeping import Keeping
    from study.run.whole import run_study
    from study.scene.file import read_scene

    chosen = read_scene(scene, set_ or ())
    folder = out or Path("results") / Path(scene).stem
    with (
        replacing(folder) as partial,
        continuing(folder, resume=resume) as state,
        on_stderr() as progress,
    ):
        keeping = Keeping(state, resume, partial if fields else None)
        results = run_study(chosen, progress, keeping)
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
    from reports.differences import own_error, resolved

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
            share = resolved(float(value), own_error(results, str(reference)))
            print(f"{model} against {reference}: field difference {share}")
    pdf = folder / "report.pdf"
    print(f"results in {folder}" + (f", report {pdf}" if pdf.exists() else ""))


@app.command
def scenes() -> None:
    """List the built-in scenes."""
    from study.scene.file import BUILT_IN, built_in_title

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
    from study.check import describe_mesh, describe_scene
    from study.scene.file import BUILT_IN

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
def export(
    target: str,
    *,
    to: str,
    out: Path | None = None,
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
) -> None:
    """Write the finite-element problem of a scene or of results for another code.

    Parameters
    ----------
    target
        A built-in scene, a TOML file, or a results folder.
    to
        calculix (input decks, and our displacement to compare with) or vtu (for ParaView).
    out
        Folder to write; export in the results folder, or NAME-export here, by default.
    set_
        Override of a scene, table.key=value. May be repeated.
    """
    from study.export import Request
    from study.export import export as write
    from study.progress import on_stderr

    with on_stderr() as progress:
        folder = write(Request(target=target, to=to, out=out, overrides=set_ or ()), progress)
    print(folder)


@app.command
def verify(
    *,
    quick: Annotated[bool, Parameter(negative=())] = False,
    out: Path | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> None:
    """Solve problems with known answers by the finite-element reference and judge its errors.

    Parameters
    ----------
    quick
        Only the problems that take about a second each.
    out
        Table to write too (CSV).
    as_json
        Print JSON instead of a table.
    """
    from study.known import request, table
    from study.progress import on_stderr

    if out is not None and not out.parent.is_dir():
        raise ValueError(f"--out {out}: there is no folder {out.parent}; make it first")
    with on_stderr() as progress:
        verdicts = request.verify(progress, quick=quick)
    if out is not None:
        table.write_verification(verdicts, out)
    lines = [table.verification_json(verdicts)] if as_json else table.verification_lines(verdicts)
    print("\n".join(lines))
    if not request.all_passed(verdicts):
        sys.exit(EXIT_FAILED_CHECK)


@dataclass(frozen=True, kw_only=True)
class SweepFlags:
    """Where the runs of a sweep go.

    Parameters
    ----------
    workers
        Processes that runs are spread over; none by default.
    scheduler
        Address of a running Dask scheduler to use instead, tcp://HOST:PORT.
    dry_run
        Say what would be run, and stop.
    """

    workers: int = 0
    scheduler: str | None = None
    dry_run: Annotated[bool, Parameter(negative=())] = False


@app.command
def tradeoff(
    scene: str = "liver",
    *,
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
    contender: list[str] | None = None,
    out: Path | None = None,
    quick: Annotated[bool, Parameter(negative=())] = False,
    sweep: Annotated[SweepFlags, Parameter(name="*")] = SweepFlags(),
) -> None:
    """Measure error and cost of every model of a scene in many settings.

    Costs are always timed in this process, one configuration after another.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    set_
        Override of the scene, table.key=value. May be repeated.
    contender
        Only this one, for example volume-springs. May be repeated.
    out
        Folder to write; results/NAME-tradeoff by default. Finished runs are kept beside it.
    quick
        Time three turns instead of five.
    """
    from study.progress import on_stderr
    from study.tradeoff import request as asked

    request = asked.Request(
        scene=scene,
        overrides=set_ or (),
        contenders=contender or (),
        out=out,
        workers=sweep.workers,
        scheduler=sweep.scheduler,
        quick=quick,
    )
    if sweep.dry_run:
        print("\n".join(asked.planned(request)))
        return
    from reports import exchange, exchange_answers, exchange_figure

    with on_stderr() as progress:
        lines = asked.measure(request, progress)
        with progress.stage("pictures"):
            pictures = exchange_figure.write_figures(request.folder)
    found = exchange_answers.sentences(exchange.configurations(request.folder))
    print("\n".join([*lines, *found, *map(str, pictures)]))


@app.command
def recommend(
    scene: str = "liver",
    *,
    rate: str | None = None,
    error: str | None = None,
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
    out: Path | None = None,
    workers: int = 0,
    scheduler: str | None = None,
) -> None:
    """Write the scene of the lattice that meets a rate or an error on this machine.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    rate
        States per second that must be ready in real time, for example "60 Hz".
    error
        Error of the displacement over the organ to stay below, for example "5 %".
    set_
        Override of the scene, table.key=value. May be repeated.
    out
        Scene file to write; NAME-60Hz.toml or NAME-5percent.toml by default.
    workers
        Processes that runs are spread over; none by default.
    scheduler
        Address of a running Dask scheduler to use instead, tcp://HOST:PORT.
    """
    from study.progress import on_stderr
    from study.tradeoff import request as asked

    request = asked.Request(
        scene=scene, overrides=set_ or (), out=out, workers=workers, scheduler=scheduler
    )
    with on_stderr() as progress:
        met, lines = asked.advise(request, rate, error, progress)
    print("\n".join(lines))
    if not met:
        sys.exit(EXIT_FAILED_CHECK)


@app.command
def stability(
    scene: str = "block",
    *,
    out: Path | None = None,
    quick: Annotated[bool, Parameter(negative=())] = False,
    sweep: Annotated[SweepFlags, Parameter(name="*")] = SweepFlags(),
) -> None:
    """Try every model at its extremes, and hold what comes out to what is known beforehand.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file, whose own lattice is tried too.
    out
        Folder to write; results/NAME-stability by default. Finished cases are kept beside it.
    quick
        Only a part of the cases, half a minute.
    """
    from study.known import request as asked
    from study.known import table
    from study.sweep.tally import on_stderr

    request = asked.StabilityRequest(
        scene=scene,
        out=out,
        workers=sweep.workers,
        scheduler=sweep.scheduler,
        quick=quick,
    )
    if sweep.dry_run:
        print(asked.planned(request))
        return
    with on_stderr("stability") as progress:
        verdicts = asked.study(request, progress)
    from reports.stability_map import write_figures

    print("\n".join(table.stability_lines(verdicts)))
    print(f"table in {request.folder / table.NAME}")
    print("\n".join(map(str, write_figures(request.folder))))
    if not asked.all_passed(verdicts):
        sys.exit(EXIT_FAILED_CHECK)


@dataclass(frozen=True, kw_only=True)
class LiverFlags:
    """How the liver's rule base is read.

    Parameters
    ----------
    reading
        Reading of Table I, for example R1 or R4-pair.
    consequent
        Severity of a combination: max (the severest governs) or mean.
    placement
        Centres of the sets: stage-mean or cut-off.
    footprint
        What is uncertain of a type-2 set: uncertain-mean, uncertain-spread or scaled.
    footprint_factor
        Times the published spread; 0 makes type-2 type-1.
    absent
        Aetiology without a reading: normal (a normal liver's reading) or silent (no rules).
    """

    reading: str | None = None
    consequent: str | None = None
    placement: str | None = None
    footprint: str | None = None
    footprint_factor: float | None = None
    absent: str | None = None


@dataclass(frozen=True, kw_only=True)
class InferenceFlags:
    """How a fuzzy system is evaluated.

    Parameters
    ----------
    sampling
        Output curve: matlab (sums of samples), octave (trapezoidal rule) or exact.
    samples
        Number of samples, 101 by default.
    sugeno_aggregation
        Sugeno weighs every rule (sum, as MATLAB) or every output set (max).
    reducer
        Type-2: karnik-mendel, eiasc or nie-tan.
    out_of_range
        Reading outside its universe: clamp (and say so), raise, or matlab (take it as it is).
    """

    sampling: str | None = None
    samples: int | None = None
    sugeno_aggregation: str | None = None
    reducer: str | None = None
    out_of_range: str | None = None


def _given(*flags: LiverFlags | InferenceFlags) -> dict[str, Any]:
    """The flags that were given, by name."""
    every = {key: value for group in flags for key, value in asdict(group).items()}
    return {key: value for key, value in every.items() if value is not None}


@app.command
def estimate(
    *,
    hcv: float | None = None,
    hbv: float | None = None,
    ald: float | None = None,
    cld: float | None = None,
    nafld: float | None = None,
    inputs: Path | None = None,
    rule_base: Path | None = None,
    out: Path | None = None,
    system: list[str] | None = None,
    explain: Annotated[bool, Parameter(negative=())] = False,
    row: int | None = None,
    figures: Path | None = None,
    surface: tuple[str, str] | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    inference: Annotated[InferenceFlags, Parameter(name="*")] = InferenceFlags(),
    liver: Annotated[LiverFlags, Parameter(name="*")] = LiverFlags(),
) -> None:
    """Estimate liver stiffness from elastography readings, or evaluate a table by any rule base.

    Parameters
    ----------
    hcv
        Reading in hepatitis C [kPa]; one that is not given is that of a normal liver.
    hbv
        Reading in hepatitis B [kPa].
    ald
        Reading in alcoholic liver disease [kPa].
    cld
        Reading in cholestatic liver disease [kPa].
    nafld
        Reading in non-alcoholic fatty liver disease [kPa].
    inputs
        Table of readings (CSV, columns named as the inputs) instead of one patient.
    rule_base
        Fuzzy system to evaluate the table with (.fis or .json) instead of the liver's.
    out
        Table to write: that of --inputs with the column estimate, for type-2 also lower and upper.
    system
        mamdani, sugeno or interval-type-2; for one patient all three by default. May be repeated.
    explain
        Show the strongest rules, the sets, the output and the type-2 switch points.
    row
        Row of the table to explain, the first by default.
    figures
        Folder to draw sets, rules and output surfaces into, as SVG.
    surface
        The two readings of the output surfaces, hcv hbv by default.
    as_json
        Print JSON in SI units instead of a table.
    """
    from study.estimation import Request, answer

    given = {"hcv": hcv, "hbv": hbv, "ald": ald, "cld": cld, "nafld": nafld}
    found = answer(
        Request(
            readings={name: value for name, value in given.items() if value is not None},
            systems=system or (),
            settings=_given(liver, inference),
            rule_base=rule_base,
            inputs=inputs,
            out=out,
            explain=explain,
            row=row,
            figures=figures,
            surface=surface,
            as_json=as_json,
        )
    )
    for note in found.notes:
        print(f"note: {note}", file=sys.stderr)
    print("\n".join(found.lines))


@app.command
def rules(
    *,
    rule_base: Path | None = None,
    out: Path | None = None,
    sugeno: Annotated[bool, Parameter(negative=())] = False,
    liver: Annotated[LiverFlags, Parameter(name="*")] = LiverFlags(),
) -> None:
    """Audit a rule base (repeated, contradictory and idle rules, gaps), or write it to a file.

    Parameters
    ----------
    rule_base
        A .fis or .json file instead of the liver's rule base.
    out
        File to write the rule base to instead, .fis (type-1, MATLAB and Octave) or .json.
    sugeno
        Write it with constants in place of the output sets.
    """
    from study.estimation import rule_base_lines

    lines = rule_base_lines(rule_base, _given(liver), out, sugeno=sugeno)
    print("\n".join(lines))
