"""The commands of `liver-study`, a file each. Each imports what it needs, so `--help` is quick."""

from study.commands.application import app, main
from study.commands.flags import EXIT_BAD_INPUT, EXIT_FAILED_CHECK

__all__ = ["EXIT_BAD_INPUT", "EXIT_FAILED_CHECK", "app", "main"]
