"""The cost of the models of a run, as sentences: a frame of a display, and how well it is known."""

from __future__ import annotations

from collections.abc import Iterator

from reports.digits import fixed, significant, spread
from study.results import Results
from study.results.records import ModelRecord

MILLI = 1e3
FRAME_RATE = 60.0
"""Of a display [Hz]; a cost is stated as a share of its frame."""
PERIOD = MILLI / FRAME_RATE
"""Of that display [ms]."""
ALIKE = 0.02
"""Relative difference of their numbers of steps up to which two runs do the same work."""


def has_setup(model: ModelRecord) -> bool:
    """Whether the time of a model includes vectors that are computed before the motion."""
    return model.name == "superposition" or model.correction is not None


def frame_share(model: ModelRecord) -> float | None:
    """Share of the time of a frame, at any rate, that the motion within it took in the mean.

    None where it was not timed, or not apart from the preparation.
    """
    if not model.wall_s or has_setup(model):
        return None
    return model.wall_s / model.simulated_s


def same_work(results: Results, model: ModelRecord) -> list[ModelRecord]:
    """Lattices of a run that take as many steps of as many springs by the same law as a model.

    They differ in their constants only, so that the spread of their times is that of the timing.
    The model itself is among them; empty for others than lattices.
    """
    return [
        one
        for one in results.record.models
        if model.lattice is not None
        and one.lattice is not None
        and one.status == "finished"
        and _kind(one) == _kind(model)
        and abs((one.steps or 0) - (model.steps or 0)) <= ALIKE * (model.steps or 0)
    ]


def _kind(model: ModelRecord) -> tuple[object, ...]:
    lattice = model.lattice
    how = () if lattice is None else (lattice.springs, lattice.integrator, lattice.precision)
    return (model.nodes, model.name == "basafa", *how)


def frame_range(results: Results, model: ModelRecord) -> tuple[float, float] | None:
    """Smallest and largest share of a frame of lattices that do the same work; None of one."""
    shares = [frame_share(one) for one in same_work(results, model)]
    known = [share for share in shares if share is not None]
    return (min(known), max(known)) if len(known) > 1 else None


def is_undecided(results: Results, model: ModelRecord) -> bool:
    """Whether some lattices of the same work were real time and others were not."""
    ends = frame_range(results, model)
    return ends is not None and ends[0] <= 1.0 < ends[1]


def cost_sentences(results: Results, model: ModelRecord) -> Iterator[str]:
    """What a frame of a model costs, and the spread of that where the run shows it."""
    if model.wall_s and has_setup(model):
        yield (
            f"{model.label} took {significant(model.wall_s, 2)} s for "
            f"{significant(model.simulated_s)} s of motion, including its vectors, which are "
            "computed before the motion. A frame was not timed apart; liver-study tradeoff does."
        )
        return
    share = frame_share(model)
    if share is None:
        yield f"{model.label} was not timed."
        return
    workers = results.record.workers
    beside = f", while {workers} stages ran at a time on the machine" if workers > 1 else ""
    wall, simulated = significant(model.wall_s or 0.0, 2), significant(model.simulated_s)
    yield (
        f"{model.label} took {wall} s for {simulated} s of motion, a real-time factor of "
        f"{significant(1.0 / share, 2)}: on average a frame at 60 Hz takes {frame(share)}. The "
        f"time was measured once{beside}."
    )
    ends = frame_range(results, model)
    if ends is not None:
        verdict = (
            ", so that this run does not decide whether they are real time"
            if is_undecided(results, model)
            else ""
        )
        yield (
            f"The {len(same_work(results, model))} lattices of this run that do the same work took "
            f"{_span(ends)} for such a frame{verdict}."
        )


def frame_number(results: Results, model: ModelRecord) -> tuple[str, str] | None:
    """The time of a frame and how well it is known, None where it was not timed."""
    share = frame_share(model)
    if share is None:
        return None
    value = f"{significant(share * PERIOD, 2)} of {fixed(PERIOD, 1)} ms"
    kept = "real time on average" if share <= 1.0 else "not real time on average"
    ends = frame_range(results, model)
    if ends is None:
        return value, f"{kept}; measured once, spread not known"
    kept = "real time not decided" if is_undecided(results, model) else kept
    return value, f"{kept}; lattices of the same work: {_span(ends)}"


def frame(share: float) -> str:
    """The time of a frame and whether it is within the period."""
    taken = f"{significant(share * PERIOD, 2)} ms"
    if share > 1.0:
        return f"{taken}, more than the available {fixed(PERIOD, 1)} ms"
    return f"{taken} of the available {fixed(PERIOD, 1)} ms ({two_digits(share)})"


def _span(ends: tuple[float, float]) -> str:
    return f"{spread([significant(share * PERIOD, 2) for share in ends])} ms"


def two_digits(share: float) -> str:
    """A share as a percentage that is known to no more."""
    return f"{significant(100.0 * share, 2)} %"
