"""The recommended configuration, for a reader: in lines, and as a scene to run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from study.scene import Scene
from study.scene.file import write_scene
from study.tradeoff.candidates import Candidate
from study.tradeoff.errors import Errors
from study.tradeoff.prediction import Prediction
from study.tradeoff.rates import SLOW, Frame
from study.tradeoff.selection import described, scene_with
from study.tradeoff.table import is_dominated


@dataclass(frozen=True)
class Recommended:
    """A candidate, whether it meets the demand, and its measured error and cost.

    `others`: the candidates. `against`: the reference of the errors, if it is not the converged
    one.
    """

    candidate: Candidate
    met: bool
    measured: Errors
    frame: Frame | None
    wall_per_second: float
    others: tuple[Candidate, ...] = ()
    against: str = ""


def recommended_scene(scene: Scene, found: Recommended) -> str:
    """TOML text of the scene with the recommended lattice, its prediction and measurement.

    It names the measured model, with springs of the tissue's own modulus, and the reference.
    """
    head = "".join(f"# {line}\n" for line in lines(found))
    return head + "\n" + write_scene(scene_with(scene, found.candidate.configuration))


def lines(found: Recommended) -> list[str]:
    """The recommendation, its prediction and measurement, for a reader."""
    one, measured = found.candidate, found.measured
    text = [described(one.configuration), _compared(one.prediction, measured)]
    if measured.of_force:
        text += [f"errors are against {found.against}", *_beside_force(measured)]
    if found.frame is not None:
        text.append(_frame(found.frame))
    text.append(f"{found.wall_per_second:.3g} s of wall per simulated second on this machine")
    if one.cost.memory is not None:
        text.append(f"{_in_mb(one.cost.memory)} of memory during the steps, besides the program")
    if not one.configuration.any_load:
        text.append(
            "It is valid for this place or path of the load only. The error is that against linear "
            "elements with the correction of corrected lattices."
        )
    text.append(
        "The error is for springs with the modulus of the tissue, tissue.youngs_modulus; the error "
        "of a fuzzy estimate adds to it."
    )
    return [*text, *table_of(found.others, _quantity(measured), one)]


def _compared(prediction: Prediction, measured: Errors) -> str:
    """The predicted error beside the measured one."""
    verdict = ""
    if measured.judged is not None:
        expected = prediction.contains(measured.judged)
        verdict = ", as expected" if expected else ", not as expected"
    return (
        f"{_quantity(measured)} error expected {100 * prediction.error:.1f} +- "
        f"{100 * prediction.bar:.1f} %, measured {_measured(measured)}{verdict}"
    )


def _measured(found: Errors) -> str:
    """The measured error, or why there is none."""
    if found.judged is not None:
        return f"{100 * found.judged:.1f} %"
    if found.status == "not resolved":
        against = "comparison" if found.of_force else "reference"
        return f"{found.status}, below the error of the {against}"
    return f"none: {found.status} {found.message}"


def _frame(found: Frame) -> str:
    slow = "" if found.slow is None else f", {SLOW:g} % of them within {1e3 * found.slow:.3g} ms"
    return f"frame: {found.substeps} steps in {1e3 * found.wall:.3g} ms{slow}"


def _in_mb(count: float) -> str:
    """Bytes in MB, to a tenth below ten."""
    found = count / 1e6
    return f"{found:.0f} MB" if found >= 10.0 else f"{found:.1f} MB"


def _quantity(measured: Errors) -> str:
    return "force" if measured.of_force else "field"


def _beside_force(measured: Errors) -> Iterator[str]:
    """The other measured errors of a configuration whose criterion is the force over time."""
    others = {
        "the largest force": measured.peak_force,
        "the displacement at the control points": measured.worst,
        "the displacement over the organ": measured.field,
    }
    if measured.discretisation != measured.force:  # against a reference, and not the same again
        others["the force against the finest lattice of the same springs"] = measured.discretisation
    parts = [f"of {of} {100 * error:.1f} %" for of, error in others.items() if error is not None]
    if parts:
        yield f"other measured errors: {', '.join(parts)}"


def table_of(
    candidates: Sequence[Candidate], quantity: str = "field", taken: Candidate | None = None
) -> Iterator[str]:
    """The Pareto front of error and cost, and the candidate taken; the cheapest first.

    For a rate alone a lattice in double precision is taken where it keeps up, though single
    precision is cheaper with the same predicted error but for rounding.
    """
    positions = [(one.prediction.error, one.wall_per_second) for one in candidates]
    front = [
        one
        for one, at in zip(candidates, positions, strict=True)
        if one is taken or not is_dominated(at, positions)
    ]
    if not front:
        return
    framed = any(one.frame is not None for one in front)
    yield (
        f"candidates (wall time per simulated second, expected error of the {quantity}, memory"
        + (f", {SLOW:g} % of its frames):" if framed else "):")
    )
    for one in sorted(front, key=lambda one: one.wall_per_second):
        memory = "" if one.cost.memory is None else _in_mb(one.cost.memory)
        yield (
            f"{one.wall_per_second:>8.3g} s  {100 * one.prediction.error:>5.1f} +- "
            f"{100 * one.prediction.bar:.1f} %  {memory:>7}  {_frame_column(one)}"
            f"{described(one.configuration)}" + (" <- selected" if one is taken else "")
        )


def _frame_column(one: Candidate) -> str:
    """How long frames take at most, and whether they are late: why a candidate is not taken."""
    if one.frame is None:
        return ""
    within = one.frame.wall if one.frame.slow is None else one.frame.slow
    verdict = "in time" if one.frame.in_time else "late"
    return f"{1e3 * within:>7.3g} ms, {verdict:<7}  "
