"""The answer of a run: sentences, and three numbers with their errors."""

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
from reports.digits import (
    DASH,
    control_point,
    percent,
    percent_known,
    significant,
    spread,
    with_error,
    words,
)
from reports.motion_figures import peak
from reports.page.cost import (
    cost_sentences,
    frame,
    frame_number,
    frame_share,
    is_undecided,
    two_digits,
)
from reports.page.required import error_checks, required_sentences
from reports.ranking import references, tool_probe
from reports.reference import is_built_in_liver
from reports.summary import printed_peak, status
from reports.tool_force import MOST_TOOLS, printed_force, tools
from study.results import Results
from study.results.numerical import numerical_errors, whole_error
from study.results.records import BudgetPart, ModelRecord

MILLI = 1e3
NEGLIGIBLE = 5e-5
"""Relative error below which it shows in none of four digits."""
PEAK = "field-relative-l2-peak"
MEASURED_RATE = "60hz"
"""The same among the rates of the trade-off measured beforehand."""
BENCHMARK = ", the nonlinear mass-spring benchmark of the paper"
SOURCES = {
    "reading": "the stiffness of the elastography reading, without a fuzzy system",
    "tissue": "the stiffness of the reference",
}
"""Where the stiffness of models without a fuzzy system is from, by name."""
CHOOSE = (
    "To find a configuration for your own scene and machine, run "
    'liver-study recommend SCENE --rate "60 Hz".'
)
REMEDIES = {
    "stiffness": (
        "Another estimate of the stiffness (patient, fuzzy.knowledge) changes it; a finer lattice "
        "does not."
    ),
    "spring law": "It depends on lattice.law.",
    "Poisson ratio": "Setting lattice.volume_term = true corrects the Poisson ratio.",
    "geometric nonlinearity": "The finite elements are geometrically linear, the lattice is not.",
    "lattice spacing": "It depends on lattice.spacing; a smaller spacing is the remedy.",
    "time step": "A smaller lattice.step_fraction reduces it.",
    "damping": "It depends on the damping constants.",
}
"""What to change in a scene, by the largest cause in the budget of a difference."""


@dataclass(frozen=True)
class Number:
    """A number of the answer: its name, its printed value with error, and what the error is."""

    name: str
    value: str
    error: str


@dataclass(frozen=True)
class Answer:
    """Sentences on the nearest model, its error, cost and largest cause of error; key numbers."""

    sentences: tuple[str, ...]
    numbers: tuple[Number, ...]


@dataclass(frozen=True)
class Nearest:
    """The model with the smallest difference from a reference, and those not resolved from it.

    `share` and its `error` are relative: of the whole field at the peak load where `is_field`, else
    of the displacement curve at the tool. `error`: None where it is not known. `alike`: models
    whose difference exceeds `share` by no more than `error`.
    """

    model: ModelRecord
    reference: str
    share: float
    error: float | None
    is_field: bool
    alike: tuple[str, ...] = ()


def answer(results: Results) -> Answer:
    """The answer of any run, also where a model diverged or nothing is resolved."""
    found = nearest(results)
    lines = [*_lost(results), *required_sentences(results)]
    lines += _answers(results, found) if found else _nothing(results)
    numbers = _numbers(results, found) if found else _numbers_alone(results)
    return Answer(tuple(lines), tuple(numbers))


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
    diverged = [one for one in results.record.models if one.status == "diverged"]
    if diverged:
        told = _listed(f"{model.label} {status(model)}" for model in diverged)
        yield f"{told}: do not use {'it' if len(diverged) == 1 else 'them'} with these settings."
    for model in results.record.models:
        if model.status == "not finished":
            yield f"{model.label} did not finish: {model.reason}. Remedy: {model.remedy}."


def _nothing(results: Results) -> Iterator[str]:
    finished = [one for one in results.record.models if one.status == "finished"]
    if not finished:
        yield "No model finished: this run states neither an error nor a cost."
        return
    if results.scene.require is not None:
        for model in finished:
            yield " ".join([*_alone_at_the_tool(results, model), *cost_sentences(results, model)])
        return
    can_add = finite_elements(results) is None and not results.scene.is_point
    remedy = " Add fem to models." if can_add else ""
    yield f"No finished model is compared with a reference: no error can be stated.{remedy}"


def _answers(results: Results, found: Nearest) -> Iterator[str]:
    yield _nearest_sentence(results, found)
    yield from _at_the_tool(results, found)
    yield " ".join(cost_sentences(results, found.model))
    yield from _in_time(results, found)
    yield from _limit(results, found)
    if found.is_field:
        yield " ".join([*_measured_beforehand(results), CHOOSE])


def _nearest_sentence(results: Results, found: Nearest) -> str:
    named, reference = labels(results), reference_name(results, found.reference)
    what = (
        "over the whole organ at the peak load"
        if found.is_field
        else f"over time at {control_point(tool_probe(results))}"
    )
    by = "this reference" if found.is_field else "the numerical error of the curves"
    alike = (
        f" Its lead over {_listed(named[n] for n in found.alike)} is not resolved by {by}."
        if found.alike
        else ""
    )
    caution = (
        ""
        if found.reference in ELEMENTS
        else " This is a difference between two models, not an error against finite elements."
    )
    gloss = _gloss(found.model, "spring" if results.scene.is_point else "spring lattice")
    return (
        f"The model nearest to {reference} is {found.model.label}{gloss}: its displacement {what} "
        f"differs by {_difference(found)}.{alike}{caution}"
    )


def _listed(names: Iterable[str]) -> str:
    """Names in a row of words, the last after an "and"."""
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


def _gloss(model: ModelRecord, kind: str) -> str:
    """What a model of a `kind` is, for a reader who meets its name here first."""
    if model.name == "basafa":
        return BENCHMARK
    source = SOURCES.get(model.name)
    if model.system is not None:
        source = f"the stiffness that the fuzzy system {system_name(model.system)} estimates"
    return f", a {kind} with {source}" if source else ""


def _difference(found: Nearest) -> str:
    if found.error is None:
        return f"{percent(found.share)} in relative L2 (its error is not known)"
    if found.share < found.error:
        return f"less than {percent(found.error)} in relative L2, {_error_name(found)}"
    small = found.error < NEGLIGIBLE * found.share
    name = _error_name(found)
    meant = f"{name} is below the last digit" if small else f"± is {name}"
    return f"{_stated(100.0 * found.share, 100.0 * found.error)} % in relative L2 ({meant})"


def _error_name(found: Nearest) -> str:
    """Which error a difference has."""
    if found.is_field:
        return "the discretisation error of the reference"
    return "the numerical error of both curves"


def _stated(value: float, error: float) -> str:
    """A number with its error, or to four digits where it is known to more."""
    return significant(value, 4) if error < NEGLIGIBLE * abs(value) else with_error(value, error)


def _at_the_tool(results: Results, found: Nearest) -> Iterator[str]:
    own, theirs = (_peak(results, name) for name in (found.model.name, found.reference))
    if DASH not in {own, theirs}:
        gap = _gap(results, found)
        yield (
            f"Its largest displacement at {control_point(tool_probe(results))} is {own} "
            f"mm; that of {reference_name(results, found.reference)} is {theirs} mm. {gap.sentence}"
        )
    yield from _forces(results, found)


def _forces(results: Results, found: Nearest) -> Iterator[str]:
    """Largest force on each tool that is moved, of the nearest model and of the reference."""
    forces = {(one.model, one.tool): one for one in results.record.tools}
    for tool in tools(results)[:MOST_TOOLS]:
        pair = [forces.get((name, tool)) for name in (found.model.name, found.reference)]
        own, theirs = ("not known" if one is None else printed_force(one) for one in pair)
        yield (
            f"The largest force on {words(tool)} is {own} N; that of "
            f"{reference_name(results, found.reference)} is {theirs} N."
        )


@dataclass(frozen=True)
class _Gap:
    """Difference of the largest displacements at the tool, printed with the errors of both."""

    value: str
    share: str
    is_more: bool
    is_resolved: bool
    is_known: bool

    @property
    def signed(self) -> str:
        """With the sign of the model less the reference."""
        return f"{'+' if self.is_more else '−'}{self.value}"

    @property
    def sentence(self) -> str:
        """The difference in a sentence."""
        if not self.is_resolved:
            return (
                f"The difference is below the sum of their errors, {self.value}, and not resolved."
            )
        caution = "" if self.is_known else "; the errors of the two are not all known"
        return f"The difference is {self.signed} ({self.share} of the reference){caution}."


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
    return _Gap(f"{value} mm", two_digits(share), own > theirs, is_resolved, is_known)


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


def _in_time(results: Results, found: Nearest) -> Iterator[str]:
    """The nearest of the real-time models, where the nearest of all is not one."""
    share = frame_share(found.model)
    is_known = share is not None and not is_undecided(results, found.model)
    if not found.is_field or (share or 0.0) <= 1.0 or not is_known:
        return
    shares = {
        name: share
        for name, share in _shares(results, found.reference).items()
        if 0.0 < (frame_share(results.model(name)) or 0.0) <= 1.0
    }
    if not shares:
        yield "No finished model of this run is real time."
        return
    best = min(shares, key=lambda name: shares[name])
    taken = frame_share(results.model(best)) or 0.0
    yield (
        f"The nearest real-time model is {labels(results)[best]}: its difference is "
        f"{resolved(shares[best], found.error)}, and a frame takes {frame(taken)}."
    )


def _limit(results: Results, found: Nearest) -> Iterator[str]:
    if found.error is not None and found.share < found.error:
        yield (
            "The error of the model is below that of the reference: a more accurate reference "
            "(reference.accuracy) is needed to resolve it."
            if found.is_field
            else "The difference of the models is below the numerical error of their curves."
        )
        return
    for one in results.record.budgets:
        if (one.model, one.reference) != (found.model.name, found.reference):
            continue
        parts = [part for part in one.parts if part.cause != "remainder"]
        largest = max(parts, key=lambda part: part.contribution, default=None)
        if largest is not None and largest.contribution > budget.SMALL:
            cause = budget.cause_name(largest.cause, one.reference)
            found_remedy = [REMEDIES[largest.cause]] if largest.cause in REMEDIES else []
            yield " ".join(
                [
                    f"The largest cause of the difference is the {cause}, which contributes "
                    f"{budget.signed(largest.contribution, one.total_error)} to a total of "
                    f"{percent_known(one.total, one.total_error)}.",
                    *found_remedy,
                    *_left(results, largest),
                ]
            )


def _measured_beforehand(results: Results) -> Iterator[str]:
    """The most accurate configuration at the frame rate, of those measured on the same organ."""
    free = [one for one in tradeoff.timed(tradeoff.configurations()) if one.any_load]
    chosen = tradeoff.best(free, MEASURED_RATE)
    if chosen is None or not is_built_in_liver(results.scene):
        return
    yield (
        "Of the configurations measured beforehand on the built-in liver, the most accurate in "
        f"real time at 60 Hz under any load is {chosen.name}: its error is {chosen.stated_error}, "
        f"and a frame takes {two_digits(tradeoff.share(chosen, MEASURED_RATE))} of the period."
    )


def _left(results: Results, part: BudgetPart) -> Iterator[str]:
    """The difference with a correct Poisson ratio, where that is the cause and was computed."""
    limits = results.record.lattice_limits
    if part.cause != "Poisson ratio" or limits is None:
        return
    left = limits.relative_l2_with_volume_term
    if left is not None:
        yield (
            "At rest and with the exact modulus, the difference with this term is "
            f"{resolved(left, own_error(results))}."
        )


def _alone_at_the_tool(results: Results, model: ModelRecord) -> Iterator[str]:
    """The largest displacement of a model that is compared with none."""
    printed = _peak(results, model.name)
    if printed != DASH:
        yield (
            f"The largest displacement of {model.label} at {control_point(tool_probe(results))} is "
            f"{printed} mm."
        )


# --- numbers -------------------------------------------------------------------------------------


def _numbers(results: Results, found: Nearest) -> Iterator[Number]:
    what = "of the field at the peak load" if found.is_field else "at the control point over time"
    if found.error is None:
        yield Number(f"difference {what}", percent(found.share), "error not known")
    elif found.share < found.error:
        yield Number(f"difference {what}", f"< {percent(found.error)}", "not resolved")
    else:
        value = f"{_stated(100.0 * found.share, 100.0 * found.error)} %"
        is_seen = found.error >= NEGLIGIBLE * found.share
        name = _error_name(found)
        kind = f"± is {name}" if is_seen else f"{name} is below the last digit"
        yield Number(f"difference {what}", value, kind)
    if DASH not in {_peak(results, name) for name in (found.model.name, found.reference)}:
        yield _number_at_the_tool(results, found)
    yield from _third(results, found.model)


def _numbers_alone(results: Results) -> Iterator[Number]:
    """Of the first finished model, where none is compared: its error, displacement and cost."""
    model = next((one for one in results.record.models if one.status == "finished"), None)
    if model is None:
        return
    for check in error_checks(results)[:1]:
        yield Number("estimated error", percent(check.value), f"{percent(check.limit)} allowed")
    printed, probe = _peak(results, model.name), tool_probe(results)
    if printed != DASH:
        name = f"largest displacement at {words(probe)}, {model.label}"
        kind = "± is its numerical error" if "±" in printed else "error not known"
        yield Number(name, f"{printed} mm", kind)
    timed = frame_number(results, model)
    if timed is not None:
        yield Number("time of a frame at 60 Hz", *timed)


def _number_at_the_tool(results: Results, found: Nearest) -> Number:
    """Difference of the largest displacement from that of the reference."""
    gap, probe = _gap(results, found), tool_probe(results)
    name = f"difference of the largest displacement at {words(probe)}"
    theirs = _peak(results, found.reference)
    if not gap.is_resolved:
        return Number(name, f"< {gap.value}", f"not resolved, of {theirs} mm")
    kind = "" if gap.is_known else "; errors not all known"
    return Number(name, gap.signed, f"{gap.share} of {theirs} mm{kind}")


def _third(results: Results, model: ModelRecord) -> Iterator[Number]:
    """The cost of a frame, or the stiffness of a point, which is not timed."""
    timed = frame_number(results, model)
    if timed is not None:
        yield Number("time of a frame at 60 Hz", *timed)
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
    """The question of the run, on every model but the finite elements."""
    compared_with = finite_elements(results)
    models = [one.label for one in results.record.models if one is not compared_with]
    if not models:
        return "How does this organ move according to finite elements, and what do they cost?"
    if compared_with:
        return (
            "How large is the error of each model against finite elements of the same scene, and "
            f"what does it cost: {', '.join(models)}?"
        )
    if len(models) == 1:
        return f"How does the scene move according to {models[0]}, and what does it cost?"
    return (
        "How much do these models of the same scene differ, and what do they cost: "
        f"{', '.join(models)}?"
    )
