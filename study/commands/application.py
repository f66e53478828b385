"""The command line: every command by its name, and how a failure ends."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.metadata import version
from inspect import getdoc
from pathlib import Path

from cyclopts import App, CycloptsError, Parameter, UnusedCliTokensError

from study.commands.bundle import bundle
from study.commands.check import check
from study.commands.cohort import cohort
from study.commands.compare import compare
from study.commands.estimate import estimate
from study.commands.export import export
from study.commands.fit import fit
from study.commands.flags import EXIT_BAD_INPUT
from study.commands.plan import plan
from study.commands.recommend import recommend
from study.commands.report import report
from study.commands.robustness import robustness
from study.commands.rules import rules
from study.commands.run import run
from study.commands.scenes import scenes
from study.commands.stability import stability
from study.commands.tradeoff import tradeoff
from study.commands.validate import validate
from study.commands.verify import verify
from study.commands.view import view
from study.system import signals
from study.system.signals import EXIT_MACHINE

app = App(
    name="liver-study",
    help="Fuzzy-tuned mass-spring liver beside finite elements and the Basafa benchmark.",
    help_epilogue=(
        "Exit codes: 0 done, 1 a check of the study failed, 2 bad input, 3 ended by the machine "
        "(disk, memory) or by a signal."
    ),
    version=lambda: version("liver-study"),
    version_flags=["--version"],
    default_parameter=Parameter(negative_iterable=()),  # no --empty-set and the like
    help_format="plaintext",  # markdown would triple the time of --help
    suppress_keyboard_interrupt=False,  # it would leave without a word
)


def main() -> int:
    """Run the command line and say what went wrong; the exit code."""
    signals.listen(signals.stop)
    signals.keep_quiet()
    return max(_code(_command), _code(_shown))


def _command() -> None:
    app(exit_on_error=False, print_error=False)


def _shown() -> None:
    """Send what was printed on its way, while a failure can still be told."""
    with suppress(ValueError):  # a stream that is closed
        sys.stdout.flush()


def _code(work: Callable[[], None]) -> int:
    """Exit code of a piece of work, after a message on what failed."""
    try:
        work()
    except SystemExit as left:
        return left.code if isinstance(left.code, int) else 0
    except BaseException as error:  # each ends by its message, a defect by its traceback too
        code, reason = _ending(error)
        _say("; ".join([reason, *getattr(error, "__notes__", ())]))
        return code
    return 0


def _ending(error: BaseException) -> tuple[int, str]:
    """Exit code and reason of what ended a piece of work."""
    covered = error.__context__ if isinstance(error, ValueError) else None
    if isinstance(covered, OSError) and not error.__suppress_context__:
        return _ending(covered)  # zipfile covers a full disk by an error of its own
    if signals.asked() or isinstance(error, KeyboardInterrupt):
        # An import that is interrupted fails in its own words.
        return EXIT_MACHINE, str(error if isinstance(error, KeyboardInterrupt) else "interrupted")
    match error:
        case OSError():
            return EXIT_MACHINE, ": ".join(_place_and_fault(error))
        case MemoryError():
            given = f" ({error})" if str(error) else ""
            return EXIT_MACHINE, f"out of memory{given}; make the scene smaller"
        case ValueError() | CycloptsError():
            return EXIT_BAD_INPUT, _refusal(error)
        case _:
            _show(error)
            return EXIT_MACHINE, "a defect of the program, please report it with the lines above"


def _refusal(error: ValueError | CycloptsError) -> str:
    """What is wrong with the input, in one line; each of several problems of a scene in its own."""
    if isinstance(error, UnusedCliTokensError):
        rest = " ".join(error.unused_tokens or ())
        return f"{rest}: the command takes no more; --help lists what it takes"
    return "\n  ".join(" ".join(line.split()) for line in str(error).split("\n  "))


def _show(error: BaseException) -> None:
    with suppress(OSError, ValueError):  # a stream that is closed
        traceback.print_exception(error)


def _place_and_fault(error: OSError) -> Iterator[str]:
    if error.filename is not None:
        yield str(error.filename)
    elif _is_lost():
        yield "the current folder"
    yield error.strerror or str(error)


def _is_lost() -> bool:
    try:
        return not Path.cwd().is_dir()
    except OSError:
        return True


def _say(message: str) -> None:
    with suppress(OSError, ValueError):
        print(f"liver-study: {message}", file=sys.stderr, flush=True)


def _description(command: Callable[..., None]) -> str:
    """Text of a docstring before its parameters, each paragraph on one line to be wrapped anew."""
    text = (getdoc(command) or "").partition("\n\nParameters\n")[0]
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in text.split("\n\n"))


for command in (
    *(run, scenes, check, report, view, compare, bundle, export, verify, validate, fit),
    *(plan, tradeoff, recommend, stability, robustness, estimate, rules, cohort),
):
    app.command(command, help=_description(command))
