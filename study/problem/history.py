"""Load histories, and the sample at which a load peaks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from study.annotation.choice import Choice
from study.annotation.quantity import Quantity

Floats = NDArray[np.float64]
Duration = Annotated[float, Quantity("s", 0.0, 3600.0)]


@dataclass(frozen=True, kw_only=True)
class LoadHistory:
    """Load factor over time: a name of `HISTORIES` and the parameters that it uses."""

    kind: Annotated[str, Choice("study.problem.history:HISTORIES")] = "ramp-hold-release"
    ramp: Duration = 1.0
    hold: Duration = 6.0
    release: Duration = 1.0
    frequency: Annotated[float, Quantity("Hz", 1e-3, 1e3)] = 1.0

    def factor(self, times: Floats) -> Floats:
        """Share of the tool's force at each time [s]; same shape as `times`."""
        return HISTORIES[self.kind](self, times)


def _step(_: LoadHistory, times: Floats) -> Floats:
    return np.ones_like(times)


def _ramp_hold_release(history: LoadHistory, times: Floats) -> Floats:
    corners = np.cumsum([0.0, history.ramp, history.hold, history.release])
    return np.interp(times, corners, [0.0, 1.0, 1.0, 0.0])


def _sinusoid(history: LoadHistory, times: Floats) -> Floats:
    return np.asarray(np.sin(2.0 * np.pi * history.frequency * times))


HISTORIES: dict[str, Callable[[LoadHistory, Floats], Floats]] = {
    "step": _step,  # from the start
    "ramp-hold-release": _ramp_hold_release,
    "sinusoid": _sinusoid,
}


def peak_sample(factors: Floats) -> int:
    """Last sample at which the load is largest, where the organ has had most time to yield."""
    size = np.abs(factors)
    return int(np.flatnonzero(size >= size.max() * (1.0 - 1e-9))[-1])
