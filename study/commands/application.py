"""The command line: every command by its name, and how a failure ends."""

from __future__ import annotations

import signal
import sys
from importlib.metadata import version
from typing import TYPE_CHECKING, NoReturn

from cyclopts import App

from study.commands.check import check
from study.commands.compare import compare
from study.commands.estimate import estimate
from study.commands.export import export
from study.commands.flags import EXIT_BAD_INPUT
from study.commands.recommend import recommend
from study.commands.report import report
from study.commands.robustness import robustness
from study.commands.rules import rules
from study.commands.run import run
from study.commands.scenes import scenes
from study.commands.stability import stability
from study.commands.tradeoff import tradeoff
from study.commands.verify import verify

if TYPE_CHECKING:
    from types import FrameType

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


for command in (
    *(run, scenes, check, report, compare, export, verify),
    *(tradeoff, recommend, stability, robustness, estimate, rules),
):
    app.command(command)
