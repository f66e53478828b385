"""Similarity of curves that are constant, empty, huge, tiny, broken or equal.

A score must have the properties of the measures: 1 for equal curves, invariance to a common scale
of both, and a value from 0 to 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.known.case import Case, Family
from study.known.finding import Finding, beside, value
from study.problem.response import Motion
from study.similarity.score import scores

Floats = NDArray[np.float64]

ROUNDING = 1e-9
FAMILY = Family("similarity", __name__, quick=True)
Change = Callable[[Motion], Motion]

REFUSED: tuple[tuple[str, str], ...] = (
    ("empty", "0 samples"),
    ("single-sample", "1 samples"),
    ("seven-samples", "7 samples"),
    ("constant", "reference displacement is flat"),
    ("huge", "displacement is .*e\\+299 at sample 1"),
    ("tiny", "reference displacement is flat"),
    ("nan", "is nan at sample 17"),
    ("infinite", "is inf at sample 17"),
    ("all-nan", "is nan at sample 0"),
    ("no-time", "not uniform and increasing"),
    ("backward-time", "not uniform and increasing"),
    ("nan-time", "time is nan at sample 17"),
    ("shape", "has shape"),
)
"""Changes of both curves that must be refused, and a pattern of the message."""


def cases() -> Iterator[Case]:
    """Cases of curves that are refused, and of curves whose score is known."""
    for change, says in REFUSED:
        yield FAMILY.case(f"both curves {change}", "changed", {"change": change}, says)
    for scale in (1e-28, 1e-9, 1e9, 1e28):
        yield FAMILY.case(f"both curves times {scale:g}", "scaled", {"scale": scale}, ROUNDING)
    for kind in ("oscillation", "ramp", "step", "spike"):
        yield FAMILY.case(f"equal curves, {kind}", "equal", {"kind": kind}, ROUNDING)
    for times in (0.0, -1.0, 1e6, 1e20):
        yield FAMILY.case(
            f"a candidate of {times:g} times the reference", "within", {"times": times}, ROUNDING
        )


def changed(change: str) -> Finding:
    """The mean score of a curve and itself after a change."""
    motion = _CHANGES[change](_motion())
    return value(1.0, float(np.mean(_scores(motion, motion))))


def scaled(scale: float) -> Finding:
    """Scores of two curves, and of both at another scale."""
    candidate, reference = _motion(phase=0.3), _motion()
    return beside(
        _scores(candidate, reference), _scores(*(_times(m, scale) for m in (candidate, reference)))
    )


def equal(kind: str) -> Finding:
    """The least score of a curve and itself."""
    t = np.asarray(0.01 * np.arange(101), dtype=np.float64)
    x: Floats = {
        "oscillation": np.sin(40.0 * t),
        "ramp": t,
        "step": np.where(t < 0.5, 0.0, 1.0),
        "spike": np.exp(-(((t - 0.5) / 0.01) ** 2)),
    }[kind]
    v = np.gradient(x, t) + (kind == "ramp") * 1e-3 * t  # a velocity may not be flat
    motion = Motion(t, x, np.asarray(v, dtype=np.float64))
    return value(1.0, float(_scores(motion, motion).min()))


def within(times: float) -> Finding:
    """By how much a score leaves the range 0 to 1.

    A candidate that differs from the reference must not be a perfect match.
    """
    found = _scores(_times(_motion(), times), _motion())
    outside = max(0.0, float(found.max()) - 1.0, -float(found.min()))
    if not np.isfinite(found).all() or found.min() >= 0.9:
        return Finding("error", message=f"scores {found}")
    return value(0.0, outside, f"scores {found.min():.3g} to {found.max():.3g}")


def _scores(candidate: Motion, reference: Motion) -> Floats:
    return np.array([score.value for score in scores(candidate, reference)])


def _motion(phase: float = 0.0, samples: int = 64) -> Motion:
    t = np.asarray(0.01 * np.arange(samples), dtype=np.float64)
    return Motion(t, np.sin(12.0 * t + phase), 12.0 * np.cos(12.0 * t + phase))


def _times(motion: Motion, scale: float) -> Motion:
    return Motion(motion.time, scale * motion.displacement, scale * motion.velocity)


def _spoiled(name: str, bad: float) -> Change:
    def spoil(motion: Motion) -> Motion:
        values = getattr(motion, name).copy()
        values[17] = bad
        return replace(motion, **{name: values})

    return spoil


_CHANGES: dict[str, Change] = {
    "empty": lambda _: _motion(samples=0),
    "single-sample": lambda _: _motion(samples=1),
    "seven-samples": lambda _: _motion(samples=7),
    "constant": lambda m: replace(m, displacement=np.full_like(m.time, 0.3)),
    "huge": lambda m: _times(m, 1e300),
    "tiny": lambda m: _times(m, 1e-300),
    "nan": _spoiled("displacement", np.nan),
    "infinite": _spoiled("velocity", np.inf),
    "all-nan": lambda m: _times(m, np.nan),
    "no-time": lambda m: replace(m, time=np.zeros_like(m.time)),
    "backward-time": lambda m: replace(m, time=m.time[::-1]),
    "nan-time": _spoiled("time", np.nan),
    "shape": lambda m: replace(m, velocity=m.velocity[:-1]),
}
