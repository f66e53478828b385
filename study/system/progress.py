"""Progress of a study on stderr: a bar per stage on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from study.system.signals import stop_if_asked

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

Advance = Callable[[float], None]


class Progress(Protocol):
    """Reports what is being done."""

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:
        """One stage; it yields a function that takes the completed share, from 0 to 1."""


class Silent:
    """Reports nothing."""

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:  # noqa: ARG002 - the name is for those that speak
        """See Progress."""
        yield lambda _: None


class Lines:
    """One line when a stage ends."""

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:
        """See Progress."""
        stop_if_asked()
        start = time.perf_counter()
        yield lambda _: None
        print(f"{name}: {time.perf_counter() - start:.1f} s", file=sys.stderr, flush=True)  # noqa: T201 - its job


class Bars:
    """A bar per stage."""

    def __init__(self, bars: RichProgress) -> None:
        self.bars = bars

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:
        """See Progress."""
        stop_if_asked()
        task = self.bars.add_task(name, total=1.0)
        yield lambda share: self.bars.update(task, completed=share)
        self.bars.update(task, completed=1.0)


@contextmanager
def on_stderr() -> Iterator[Progress]:
    """Bars if stderr is a terminal, else lines."""
    if not sys.stderr.isatty():
        yield Lines()
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.progress import (
        Progress as RichProgress,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with RichProgress(*columns, console=Console(stderr=True)) as bars:
        yield Bars(bars)
