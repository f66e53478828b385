"""What a run answers, in plain sentences and three numbers with their errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from reports import budget
from reports.appearance import labels, reference_name
from reports.differences import ELEMENTS, elements, field_errors, finite_elements, own_error
from reports.digits import DASH, percent, significant, spread, with_error, words
from reports.motion_figures import peak
from reports.ranking import references, tool_probe
from reports.summary import printed_peak, status
from study.results.folder import Results
from study.results.numerical import numerical_errors, whole_error
from study.results.records import ModelRecord

MILLI = 1e3
NEGLIGIBLE = 5e-4
"""Relative error below which it shows in none of three digits."""
PEAK = "field-relative-l2-peak"
_KINDS = {
    False: "± by the time steps, not of the model",
    True: "the time steps' error shows in no digit",
}
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
    yield from _limit(results, found)


def _which(results: Results, found: Nearest) -> str:
    named, reference = labels(results), reference_name(results, found.reference)
    what = (
        "over the whole organ at the peak of the load its displacement"
        if found.is_field
        else f"its displacement over time at {words(tool_probe(results))}"
    )
    alike = (
        f" This reference does not tell it from {', '.join(named[name] for name in found.alike)}."
        if found.alike
        else ""
    )
    caution = (
        ""
        if found.reference in ELEMENTS
        else " That is a difference of two models: without finite elements it is no error."
    )
    return (
        f"Nearest to {reference} is {found.model.label}: {what} differs by "
        f"{_difference(found)}, relative L2.{alike}{caution}"
    )


def _difference(found: Nearest) -> str:
    if found.error is None:
        return f"{percent(found.share)} (the error of that is not known)"
    if found.share < found.error:
        return f"less than {percent(found.error)}, which is {_whose(found)}"
    by = "which shows in no digit" if found.error < NEGLIGIBLE * found.share else "shown by ±"
    stated = _stated(100.0 * found.share, 100.0 * found.error)
    return f"{stated} % ({_whose(found)}, {by})"


def _whose(found: Nearest) -> str:
    """What the error of a difference is the error of."""
    return "the reference's own error" if found.is_field else "the numerical error of both curves"


def _stated(value: float, error: float) -> str:
    """A number with its error, or to three digits where it is known to more."""
    return significant(value) if error < NEGLIGIBLE * abs(value) else with_error(value, error)


def _at_the_tool(results: Results, found: Nearest) -> Iterator[str]:
    own, theirs = (_peak(results, name) for name in (found.model.name, found.reference))
    if DASH not in {own, theirs}:
        yield (
            f"At the control point {words(tool_probe(results))} it moves by {own} mm at most, "
            f"{reference_name(results, found.reference)} by {theirs} mm."
        )


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


def curve_error(model: ModelRecord, probe: str) -> float | None:
    """Relative numerical error of a displacement curve, None where a part is not known."""
    return whole_error(numerical_errors(model, [], probe, "displacement"))


def _cost(results: Results, model: ModelRecord) -> str:
    if not model.wall_s:
        return f"{model.label} was not timed."
    factor = significant(model.simulated_s / model.wall_s, 2)
    workers = results.record.workers
    beside = f", with {workers} stages at a time on this machine" if workers > 1 else ""
    return (
        f"It took {significant(model.wall_s, 2)} s for {significant(model.simulated_s)} s of "
        f"motion, {factor} times as fast as real time; timed once{beside}."
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
                f"{percent(one.total)}{': ' + remedy if remedy else ''}."
            )


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
        kind = f"± is {_whose(found)}" if is_seen else f"{_whose(found)} shows in no digit"
        yield Number(f"difference {what}", value, kind)
    own = _peak(results, found.model.name)
    if own != DASH:
        error = curve_error(found.model, tool_probe(results))
        kind = "error of the steps not known" if error is None else _KINDS[error < NEGLIGIBLE]
        yield Number(f"largest displacement at {words(tool_probe(results))}", f"{own} mm", kind)
    yield from _third(results, found.model)


def _third(results: Results, model: ModelRecord) -> Iterator[Number]:
    """How fast, or of a point, which is not timed, how stiff."""
    if model.wall_s:
        factor = significant(model.simulated_s / model.wall_s, 2)
        yield Number("speed", f"{factor} × real time", "timed once: its spread is not known")
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
    """What the run asked."""
    models = ", ".join(model.label for model in results.record.models)
    reference = "the finite elements" if finite_elements(results) else "each other"
    return f"How far from {reference}, and how fast, are these models of one scene: {models}?"
