"""What a run answers, in plain sentences and three numbers with their errors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from reports import budget, tradeoff
from reports.appearance import labels, reference_name, system_name
from reports.differences import (
    ELEMENTS,
    elements,
    field_errors,
    finite_elements,
    own_error,
    resolved,
)
from reports.digits import DASH, fixed, percent, significant, spread, with_error, words
from reports.motion_figures import peak
from reports.ranking import references, tool_probe
from reports.reference import is_built_in_liver
from reports.summary import printed_peak, status
from reports.tool_force import MOST_TOOLS, printed_force, tools
from study.results.folder import Results
from study.results.numerical import numerical_errors, whole_error
from study.results.records import BudgetPart, ModelRecord

MILLI = 1e3
NEGLIGIBLE = 5e-5
"""Relative error below which it shows in none of four digits."""
PEAK = "field-relative-l2-peak"
FRAME_RATE = 60.0
"""Of a display [Hz], by whose frames a cost is told."""
MEASURED_RATE = "60hz"
"""The same among the rates of the trade-off measured before."""
GLOSSES = {
    "reading": ", springs of the stiffness that is read, without a fuzzy system",
    "tissue": ", springs of the stiffness that the reference has",
    "basafa": ", the nonlinear mass-spring model of the paper",
}
"""What models without a fuzzy system are, by name."""
CHOOSE = 'What your own machine has time for is told by liver-study recommend SCENE --rate "60 Hz".'
REMEDIES = {
    "stiffness": (
        "another estimate of stiffness (patient, fuzzy.knowledge) changes it; a finer lattice "
        "does not"
    ),
    "spring law": "lattice.law changes it",
    "Poisson ratio": "lattice.volume_term = true frees the Poisson ratio of the springs",
    "geometric nonlinearity": "the finite elements are linear, and the lattice is not",
    "lattice spacing": "a smaller lattice.spacing changes it",
    "time step": "a smaller lattice.step_fraction changes it",
    "damping": "the constants of damping change it",
}
"""What to change of a scene, by the largest cause in the budget of a difference."""


@dataclass(frozen=True)
class Number:
    """A number of the first lines: what it is, as printed with its error, and what the error is."""

    name: str
    value: str
    error: str


@dataclass(frozen=True)
class Answer:
    """Sentences on which model, how wrong, how fast and what limits it; numbers beside them."""

    sentences: tuple[str, ...]
    numbers: tuple[Number, ...]


@dataclass(frozen=True)
class Nearest:
    """The model that differs least from a reference, by `share`, and what the reference hides.

    `share` and `error` relative: of the whole field at the peak where `is_field`, else of the
    displacement curve at the tool. `error`: None where it is not known. `alike`: models that this
    error does not tell from the nearest.
    """

    model: ModelRecord
    reference: str
    share: float
    error: float | None
    is_field: bool
    alike: tuple[str, ...] = ()


def answer(results: Results) -> Answer:
    """What the run answers, whatever it has: also where a model diverged or nothing is resolved."""
    found = nearest(results)
    lines = [*_lost(results), *(_answers(results, found) if found else _nothing(results))]
    numbers = tuple(_numbers(results, found)) if found else ()
    return Answer(tuple(lines), numbers)


def nearest(results: Results) -> Nearest | None:
    """The finished model nearest to the finite elements, or else to the first reference."""
    for reference in dict.fromkeys([elements(results), *references(results)]):
        found = _shares(results, reference)
        if found:
            error = own_error(results, reference)
            best = min(found, key=lambda name: found[name])
            within = found[best] + (error or 0.0)
            alike = tuple(n for n, share in found.items() if n != best and share <= within)
            return Nearest(results.model(best), reference, found[best], error, True, alike)
    return _nearest_curve(results)


def _shares(results: Results, reference: str) -> dict[str, float]:
    """Differences of the field at the peak of the models that finished."""
    finished = {model.name for model in results.record.models if model.status == "finished"}
    return {
        model: values[PEAK]
        for (model, of), values in field_errors(results).items()
        if of == reference and model in finished and PEAK in values
    }


def _nearest_curve(results: Results) -> Nearest | None:
    """By the displacement at the tool, of a scene without a field."""
    probe = tool_probe(results)
    for reference in references(results):
        shares = {
            model.name: share
            for model in results.record.models
            if model.status == "finished"
            and model.name not in references(results)
            and (share := curve_difference(results, model.name, reference, probe)) is not None
        }
        if shares:
            best = results.model(min(shares, key=lambda name: shares[name]))
            parts = numerical_errors(results.model(reference), [best], probe, "displacement")
            error = whole_error(parts)
            within = shares[best.name] + (error or 0.0)
            alike = tuple(n for n, s in shares.items() if n != best.name and s <= within)
            return Nearest(best, reference, shares[best.name], error, False, alike)
    return None


def curve_difference(results: Results, model: str, reference: str, probe: str) -> float | None:
    """Relative L2 difference of two displacement curves at a control point over their samples.

    None where one of them is not whole, or the reference does not move.
    """
    one = results.curve(model, probe).displacement
    other = results.curve(reference, probe).displacement
    norm = float(np.linalg.norm(other))
    if one.shape != other.shape or norm == 0.0:
        return None
    return float(np.linalg.norm(one - other)) / norm


# --- sentences -----------------------------------------------------------------------------------


def _lost(results: Results) -> Iterator[str]:
    for model in results.record.models:
        if model.status == "diverged":
            yield f"{model.label} {status(model)}, and is not to be used with these settings."
        elif model.status == "not finished":
            yield f"{model.label} is not finished: {model.reason}. To have it run, {model.remedy}."


def _nothing(results: Results) -> Iterator[str]:
    if not any(model.status == "finished" for model in results.record.models):
        yield "No model finished: this run tells neither an error nor a cost."
    else:
        yield (
            "This run compares no model that finished with a reference: how wrong one is cannot "
            "be said. Add fem to models."
        )


def _answers(results: Results, found: Nearest) -> Iterator[str]:
    yield _which(results, found)
    yield from _at_the_tool(results, found)
    yield _cost(results, found.model)
    yield from _in_time(results, found)
    yield from _limit(results, found)
    if found.is_field:
        yield " ".join([*_measured_before(results), CHOOSE])


def _which(results: Results, found: Nearest) -> str:
    named, reference = labels(results), reference_name(results, found.reference)
    what = (
        "over the whole organ at the peak of the load its displacement"
        if found.is_field
        else f"its displacement over time at {words(tool_probe(results))}"
    )
    alike = (
        f" This reference cannot tell it apart from {_listed(named[n] for n in found.alike)}."
        if found.alike
        else ""
    )
    caution = (
        ""
        if found.reference in ELEMENTS
        else " That is a difference of two models: without finite elements it is no error."
    )
    return (
        f"Nearest to {reference} is {found.model.label}{_gloss(found.model)}: {what} differs by "
        f"{_difference(found)}, relative L2.{alike}{caution}"
    )


def _listed(names: Iterable[str]) -> str:
    """Names in a row of words, the last after an "or"."""
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else last


def _gloss(model: ModelRecord) -> str:
    """What a model is, for whoever meets its name here first."""
    if model.system is None:
        return GLOSSES.get(model.name, "")
    return f", springs of the stiffness that the fuzzy system {system_name(model.system)} estimates"


def _difference(found: Nearest) -> str:
    if found.error is None:
        return f"{percent(found.share)} (the error of that is not known)"
    if found.share < found.error:
        return f"less than {percent(found.error)}, which is {_whose(found)}"
    small = found.error < NEGLIGIBLE * found.share
    meant = f"{_whose(found)} is below the last digit" if small else f"± is {_whose(found)}"
    stated = _stated(100.0 * found.share, 100.0 * found.error)
    return f"{stated} % ({meant})"


def _whose(found: Nearest) -> str:
    """What the error of a difference is the error of."""
    return "the reference's own error" if found.is_field else "the numerical error of both curves"


def _stated(value: float, error: float) -> str:
    """A number with its error, or to four digits where it is known to more."""
    return significant(value, 4) if error < NEGLIGIBLE * abs(value) else with_error(value, error)


def _at_the_tool(results: Results, found: Nearest) -> Iterator[str]:
    own, theirs = (_peak(results, name) for name in (found.model.name, found.reference))
    if DASH not in {own, theirs}:
        gap = _gap(results, found)
        yield (
            f"At the control point {words(tool_probe(results))} it moves by {own} mm at most, "
            f"{reference_name(results, found.reference)} by {theirs} mm: {gap.told}."
        )
    yield from _forces(results, found)


def _forces(results: Results, found: Nearest) -> Iterator[str]:
    """Largest force on each tool that is moved, of the nearest model and of the reference."""
    forces = {(one.model, one.tool): one for one in results.record.tools}
    for tool in tools(results)[:MOST_TOOLS]:
        pair = [forces.get((name, tool)) for name in (found.model.name, found.reference)]
        own, theirs = ("not known" if one is None else printed_force(one) for one in pair)
        yield (
            f"The largest force on {words(tool)} is {own} N, of "
            f"{reference_name(results, found.reference)} {theirs} N."
        )


@dataclass(frozen=True)
class _Gap:
    """How far the largest displacements at the tool are apart, printed with the errors of both."""

    value: str
    share: str
    is_more: bool
    is_resolved: bool
    is_known: bool

    @property
    def told(self) -> str:
        """As the end of a sentence."""
        if not self.is_resolved:
            return f"they are apart by less than their errors, {self.value}"
        caution = "" if self.is_known else ", by errors that are not all known"
        too = "more" if self.is_more else "less"
        return f"{self.value} ({self.share}) {too}{caution}"


def _gap(results: Results, found: Nearest) -> _Gap:
    """Of two models that both moved."""
    probe = tool_probe(results)
    models = found.model, results.model(found.reference)
    own, theirs = (MILLI * (peak(results, one.name, probe) or 0.0) for one in models)
    errors = [curve_error(one, probe) for one in models]
    gap, share = abs(own - theirs), abs(own - theirs) / theirs if theirs else 0.0
    known = [e * u for e, u in zip(errors, (own, theirs), strict=True) if e is not None]
    is_known, is_resolved = len(known) == len(errors), gap > sum(known)
    if not is_resolved:
        value = significant(sum(known), 2)
    else:
        value = _stated(gap, sum(known)) if is_known else significant(gap, 2)
    return _Gap(f"{value} mm", _two_digits(share), own > theirs, is_resolved, is_known)


def _peak(results: Results, name: str) -> str:
    """Largest displacement [mm] at the tool, with the error of its curve by mesh or steps."""
    probe, model = tool_probe(results), results.model(name)
    largest = peak(results, name, probe)
    if largest is None or model.mesh_error is not None:
        return printed_peak(results, model, probe)
    error = curve_error(model, probe)
    if error is None:
        return significant(MILLI * largest)
    return _stated(MILLI * largest, MILLI * largest * error)


def curve_error(
    model: ModelRecord, probe: str, curve: Literal["displacement", "velocity"] = "displacement"
) -> float | None:
    """Relative numerical error of a curve, None where a part is not known."""
    return whole_error(numerical_errors(model, [], probe, curve))


def _cost(results: Results, model: ModelRecord) -> str:
    share = frame_share(model)
    if share is None:
        return f"{model.label} was not timed."
    factor = significant(1.0 / share, 2)
    workers = results.record.workers
    beside = f", with {workers} stages at a time on this machine" if workers > 1 else ""
    wall, simulated = significant(model.wall_s or 0.0, 2), significant(model.simulated_s)
    return (
        f"It took {wall} s for {simulated} s of motion, {factor} times as fast as real time: in "
        f"the mean a frame at 60 Hz takes {_frame(share)}; timed once{beside}."
    )


def frame_share(model: ModelRecord) -> float | None:
    """Share of the time of a frame, at any rate, that the motion within it took in the mean."""
    return model.wall_s / model.simulated_s if model.wall_s else None


def _two_digits(share: float) -> str:
    """A share as a percentage that is known to no more."""
    return f"{significant(100.0 * share, 2)} %"


def _frame(share: float) -> str:
    """The time of a frame at 60 Hz and whether it is ready in time."""
    period = MILLI / FRAME_RATE
    taken = f"{significant(share * period, 2)} of its {fixed(period, 1)} ms"
    if share > 1.0:
        return f"{taken}, and is not ready in time"
    return f"{taken} ({_two_digits(share)})"


def _in_time(results: Results, found: Nearest) -> Iterator[str]:
    """The nearest of the models that keep up, where the nearest of all does not."""
    if (frame_share(found.model) or 0.0) <= 1.0 or not found.is_field:
        return
    shares = {
        name: share
        for name, share in _shares(results, found.reference).items()
        if 0.0 < (frame_share(results.model(name)) or 0.0) <= 1.0
    }
    if not shares:
        yield "No model that finished is ready in time here."
        return
    best = min(shares, key=lambda name: shares[name])
    taken = frame_share(results.model(best)) or 0.0
    off = f"{percent(shares[best])} off"
    if found.error is not None and shares[best] < found.error:
        off = f"how far off is {resolved(shares[best], found.error)}"
    yield (
        f"Of those in time the nearest is {labels(results)[best]}: {off}, a frame takes "
        f"{_frame(taken)}."
    )


def _limit(results: Results, found: Nearest) -> Iterator[str]:
    if found.error is not None and found.share < found.error:
        yield (
            "What limits the answer is the reference: a finer one (reference.accuracy) would tell "
            "how wrong the model is."
        )
        return
    for one in results.record.budgets:
        if (one.model, one.reference) != (found.model.name, found.reference):
            continue
        parts = [part for part in one.parts if part.cause != "remainder"]
        largest = max(parts, key=lambda part: part.contribution, default=None)
        if largest is not None and largest.contribution > budget.SMALL:
            cause = budget.cause_name(largest.cause, one.reference)
            remedy = REMEDIES.get(largest.cause)
            yield (
                f"What limits it most is the {cause}, {budget.signed(largest.contribution)} of "
                f"{percent(one.total)}{': ' + remedy if remedy else ''}{_left(results, largest)}."
            )


def _measured_before(results: Results) -> Iterator[str]:
    """What other settings reached at the rate of frames, of the organ measured then."""
    free = [one for one in tradeoff.timed(tradeoff.configurations()) if one.any_load]
    chosen = tradeoff.best(free, MEASURED_RATE)
    if chosen is None or not is_built_in_liver(results.scene):
        return
    yield (
        "Of other settings, measured before on the built-in liver, the most accurate in time at "
        f"60 Hz under any load is {chosen.name}: off by {chosen.stated_error}, in "
        f"{percent(tradeoff.share(chosen, MEASURED_RATE), 2)} of the frame."
    )


def _left(results: Results, part: BudgetPart) -> str:
    """What freeing the Poisson ratio leaves, where that is the cause and was tried."""
    limits = results.record.lattice_limits
    if part.cause != "Poisson ratio" or limits is None:
        return ""
    left = limits.relative_l2_with_volume_term
    if left is None:
        return ""
    return f", and leaves {resolved(left, own_error(results))} at rest and with the exact modulus"


# --- numbers -------------------------------------------------------------------------------------


def _numbers(results: Results, found: Nearest) -> Iterator[Number]:
    what = "over the organ at the peak" if found.is_field else "at the control point, over time"
    if found.error is None:
        yield Number(f"difference {what}", percent(found.share), "error not known")
    elif found.share < found.error:
        yield Number(f"difference {what}", f"< {percent(found.error)}", "not resolved")
    else:
        value = f"{_stated(100.0 * found.share, 100.0 * found.error)} %"
        is_seen = found.error >= NEGLIGIBLE * found.share
        kind = f"± is {_whose(found)}" if is_seen else f"{_whose(found)} is below the last digit"
        yield Number(f"difference {what}", value, kind)
    if DASH not in {_peak(results, name) for name in (found.model.name, found.reference)}:
        yield _number_at_the_tool(results, found)
    yield from _third(results, found.model)


def _number_at_the_tool(results: Results, found: Nearest) -> Number:
    """How far the largest displacement is off that of the reference."""
    gap, probe = _gap(results, found), tool_probe(results)
    name = f"largest displacement at {words(probe)}, off by"
    theirs = _peak(results, found.reference)
    if not gap.is_resolved:
        return Number(name, f"< {gap.value}", f"not resolved, of {theirs} mm")
    sign = "+" if gap.is_more else "−"
    kind = "" if gap.is_known else "; errors not all known"
    return Number(name, f"{sign}{gap.value}", f"{gap.share} of {theirs} mm{kind}")


def _third(results: Results, model: ModelRecord) -> Iterator[Number]:
    """How fast, or of a point, which is not timed, how stiff."""
    share = frame_share(model)
    if share is not None:
        period = MILLI / FRAME_RATE
        value = f"{significant(share * period, 2)} ms of {fixed(period, 1)}"
        kept = "in time" if share <= 1.0 else "not in time"
        yield Number(
            "a frame at 60 Hz", value, f"{kept}, in the mean; timed once, spread not known"
        )
        return
    estimates = results.record.fuzzy.systems
    if model.system in estimates:
        one = estimates[model.system]
        bounds = one.interval_pa
        printed = significant(one.estimate_pa / MILLI)
        if bounds is None:
            yield Number("Young's modulus", f"{printed} kPa", "no interval: the system is type-1")
        else:
            span = spread([significant(bound / MILLI) for bound in bounds])
            yield Number("Young's modulus", f"{printed} kPa", f"type-2 interval {span} kPa")


def question(results: Results) -> str:
    """What the run asked, of every model but the finite elements."""
    compared_with = finite_elements(results)
    models = ", ".join(one.label for one in results.record.models if one is not compared_with)
    if not models:
        return "How does this organ move by finite elements, and how fast are they?"
    reference = "the finite elements" if compared_with else "each other"
    return f"How far from {reference} are these models of the same scene, and how fast: {models}?"
