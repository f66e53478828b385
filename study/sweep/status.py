"""Progress of a sweep, shown as a bar on a terminal and as occasional lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple


class SweepStatus(NamedTuple):
    """Counts of a sweep: `stored` existed before; `failed` includes crashes."""

    total: int
    stored: int = 0
    done: int = 0
    failed: int = 0
    seconds: float = 0.0

    @property
    def finished(self) -> int:
        """Number of tasks that need no more work in this sweep."""
        return self.stored + self.done + self.failed

    @property
    def seconds_left(self) -> float | None:
        """Remaining time at the rate so far; None before the first run has finished."""
        ran = self.done + self.failed
        return self.seconds / ran * (self.total - self.finished) if ran else None

    def counting(self, seconds: float, *, done: bool) -> SweepStatus:
        """The status after one more run, done or failed, at a time [s] of the sweep."""
        return self._replace(
            done=self.done + done, failed=self.failed + (not done), seconds=seconds
        )

    def __str__(self) -> str:
        """One line for the terminal."""
        parts = [f"{self.finished} of {self.total}"]
        parts += [f"{self.stored} from before"] if self.stored else []
        parts += [f"{self.failed} failed"] if self.failed else []
        left = self.seconds_left
        parts += [f"{duration(left)} left"] if left else []
        return ", ".join(parts)


ReportStatus = Callable[[SweepStatus], None]

SECONDS = 15.0
"""Time between two lines where stderr is no terminal."""


def duration(seconds: float) -> str:
    """A time as text: "8 s", "3 min", "2.5 h"."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def silent(_: SweepStatus) -> None:
    """Report nothing."""


@dataclass
class StatusLines:
    """A line at the beginning, at the end, and at regular intervals between."""

    name: str
    seconds: float = SECONDS
    last_printed: float = float("-inf")

    def __call__(self, status: SweepStatus) -> None:
        """Print a line, if it is time."""
        now = time.monotonic()
        if now - self.last_printed >= self.seconds or status.finished == status.total:
            self.last_printed = now
            print(f"{self.name}: {status}", file=sys.stderr, flush=True)  # noqa: T201 - its job


@contextmanager
def on_stderr(name: str) -> Iterator[ReportStatus]:
    """A bar if stderr is a terminal, else lines."""
    if not sys.stderr.isatty():
        yield StatusLines(name)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn(name), BarColumn(), TextColumn("{task.fields[tally]}"))
    with Progress(*columns, console=Console(stderr=True)) as bars:
        bar = bars.add_task(name, status="")
        yield lambda status: bars.update(
            bar, total=status.total, completed=status.finished, status=str(status)
        )
