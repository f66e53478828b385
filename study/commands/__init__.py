"""The commands of `liver-study`, a file each. Each imports what it needs, so `--help` is quick."""

from study.commands.application import app, main
from study.commands.flags import EXIT_BAD_INPUT, EXIT_FAILED_CHECK
from study.system.signals import EXIT_MACHINE

__all__ = ["EXIT_BAD_INPUT", "EXIT_FAILED_CHECK", "EXIT_MACHINE", "app", "main"]
