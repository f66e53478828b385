"""The commands of `liver-study`, a file each. Each imports what it needs, so `--help` is quick."""

from study.commands.application import app, main

__all__ = ["app", "main"]
