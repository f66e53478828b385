"""A summary of credibility of a run in the terms of ASME V&V 40 (2018).

Model risk, and whether the evidence is sufficient for it, are left to the reader and stated so.
"""

from __future__ import annotations

from collections.abc import Iterator

from reports import summary
from reports.appearance import labels, system_name
from reports.benchmarks import read
from reports.differences import elements, finite_elements, own_error, resolved
from reports.digits import PA_PER_KPA, fixed, percent, quantity, significant, symbols
from reports.page.answer import answer, curve_error, question
from reports.ranking import tool_probe
from reports.validation import validation
from reports.verification import outcomes
from study.results import Results
from study.results.records import ModelRecord


def credibility(results: Results) -> str:
    """The summary as Markdown; the same results give the same text."""
    sections = {
        "Question of interest": [question(results)],
        "Context of use": list(_context(results)),
        "Model risk": [
            "Left to the reader: the influence of these models on a decision and the consequence "
            "of a wrong decision are not known to this program. The rigour of the evidence below "
            "is stated, but not judged to be sufficient."
        ],
        "Answer of the run": list(answer(results).sentences),
        "Verification of the code": list(_code()),
        "Verification of the calculation": list(_calculation(results)),
        "Validation": list(_validation(results)),
        "Uncertainty": list(_uncertainty(results)),
        "Applicability": list(_applicability(results)),
    }
    title = results.record.title or "Untitled scene"
    parts = [f"# Credibility of: {title}", "In the terms of ASME V&V 40-2018."]
    for name, lines in sections.items():
        parts += [f"## {name}", "\n".join(f"- {line}" for line in lines)]
    return "\n\n".join(parts) + "\n"


def _context(results: Results) -> Iterator[str]:
    scene, record = results.scene, results.record
    yield (
        f"Displacement of a soft organ under a tool: {record.title or 'untitled scene'}. Tissue of "
        f"{quantity(f'{scene.tissue.youngs_modulus} Pa')}, Poisson ratio "
        f"{scene.tissue.poisson_ratio:g}; {significant(scene.time.duration)} s of motion."
    )
    yield (
        f"Quantities of interest: displacement and velocity at {', '.join(record.probes)}, and the "
        "field over the organ at the peak of the load, where the scene has an organ."
    )
    yield f"Models: {', '.join(model.label for model in record.models)}."


def _code() -> Iterator[str]:
    yield (
        "Software quality: the program comes with its tests, types and import contracts, which "
        "`.ci/run` repeats on a clean clone; environment/ has the versions that made the results."
    )
    lines = read("verification")
    if not lines:
        yield "This version comes without a table of verification results."
        return
    yield (
        f"Finite elements on problems with exact solutions: {outcomes(lines)}. This was computed "
        "beforehand, not in this run; `liver-study verify` repeats it."
    )


def _calculation(results: Results) -> Iterator[str]:
    yield (
        "Use error: invalid inputs are refused before the computation (`liver-study check`). "
        "inputs/ contains the scene of the run with every default. All numbers of this summary "
        "are read from the results."
    )
    probe = tool_probe(results)
    for model in results.record.models:
        if model.status != "finished":
            yield f"{model.label}: {summary.status(model)}; no error is estimated."
            continue
        error = curve_error(model, probe)
        known = "not known" if error is None else percent(error)
        yield (
            f"{model.label}: numerical error of the displacement at {probe}, relative L2: "
            f"{known}{_parts(model)}."
        )
    error = own_error(results)
    if error is not None:
        yield f"Finite elements: discretisation error of the field at the peak, {percent(error)}."
    passed = sum(check.passed for check in results.record.checks)
    yield f"Checks of the run: {passed} of {len(results.record.checks)} passed."
    for check in results.record.checks:
        if not check.passed:
            yield f"Failed: {check.name}, {significant(check.value)} of at most {check.limit:g}."


def _parts(model: ModelRecord) -> str:
    if model.lattice is not None:
        return " (time steps; its spacing is part of the model)"
    return " (mesh, subspace and time steps)" if model.elements is not None else ""


def _validation(results: Results) -> Iterator[str]:
    yield "This run is not compared with an experiment: the comparator is another model."
    measured = validation()
    if measured is not None:
        yield (
            f"{measured['agreeing']} predictions of static measurements on silicone bodies agree "
            "within their expanded uncertainty plus the error of the model. This was computed "
            "beforehand, and no body is liver; `liver-study validate` repeats it."
        )
    if finite_elements(results) is None:
        yield "It has no finite elements: differences between its models are not errors."
        return
    yield (
        "Comparator: the finite elements of the same scene. Organ, support, tools, load and "
        "damping are the same inputs. The finite elements use the modulus of the scene, the other "
        "models that of their estimate or law."
    )
    named, own = labels(results), own_error(results)
    rows = [
        row
        for row in results.field_differences
        if (row.reference, row.quantity) == (elements(results), "field-relative-l2-peak")
    ]
    for row in sorted(rows, key=lambda row: row.value):
        yield (
            f"{named[row.model]} against the finite elements: {resolved(row.value, own)} of the "
            "field at the peak, relative L2."
        )


def _uncertainty(results: Results) -> Iterator[str]:
    found = results.record.fuzzy.systems
    for system, one in found.items():
        if one.interval_pa is not None:
            low, high = (fixed(bound / PA_PER_KPA, 2) for bound in one.interval_pa)
            value = fixed(one.estimate_pa / PA_PER_KPA, 2)
            yield (
                f"Stiffness by {system_name(system)}: {value} kPa, interval {low} to {high} kPa, "
                "propagated to the motion."
            )
    if results.sensitivity:
        row = max(results.sensitivity, key=lambda row: abs(row.change_at_readings_pa))
        yield (
            f"Largest change of an estimate by an open choice of the fuzzy systems: "
            f"{fixed(row.change_at_readings_pa / PA_PER_KPA, 2)} kPa ({row.choice}: "
            f"{row.base} to {row.alternative}, {system_name(row.system)})."
        )
    if results.score_errors:
        yield "Each score has an interval over blocks of the motion: score_errors.csv."
    if not (found or results.sensitivity or results.score_errors):
        yield "Not quantified: the run has neither fuzzy systems nor scores."


def _applicability(results: Results) -> Iterator[str]:
    yield (
        "Relevance to the context of use: the compared quantities are the quantities of interest. "
        "The comparison holds for this organ, support, tools, load and duration only."
    )
    model, limit = finite_elements(results), results.record.strain_limit
    is_linear = model is not None and model.elements is not None and model.elements.law is None
    if model is not None and is_linear and model.largest_strain is not None:
        side = "below" if model.largest_strain < limit else "not below"
        yield (
            f"Largest strain of the finite elements: {percent(model.largest_strain)}, {side} the "
            f"limit of {percent(limit)} assumed for linear strain."
        )
    for text in results.record.assumptions:
        yield f"Assumed: {symbols(text)}"
    for warning in results.record.warnings:
        yield f"Warning of the run: {warning}"
