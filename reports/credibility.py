"""A summary of credibility in the terms of ASME V&V 40 (2018), of a run's own figures.

The standard asks for more than a program can know: model risk, and whether the evidence is enough
for it, are left to the reader and said to be.
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
from study.results.folder import Results
from study.results.records import ModelRecord


def credibility(results: Results) -> str:
    """The summary as Markdown; the same results give the same text."""
    sections = {
        "Question of interest": [question(results)],
        "Context of use": list(_context(results)),
        "Model risk": [
            "Left to the reader: how much a decision would rest on these models, and what follows "
            "from a wrong one, are no matter of this run. The levels of rigour below are therefore "
            "stated, not judged to be enough."
        ],
        "What the run answers": list(answer(results).sentences),
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
        yield "No table of verification was delivered with this version."
        return
    yield (
        f"The finite elements on problems with exact solutions: {outcomes(lines)}. Not of this "
        "run: measured before; `liver-study verify` repeats it."
    )


def _calculation(results: Results) -> Iterator[str]:
    yield (
        "Use error: inputs are refused before anything is computed where they cannot be meant "
        "(`liver-study check`); inputs/ has the scene as it was run, with every default, and no "
        "number of this summary was typed by hand."
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
        yield f"Finite elements: error of the field at the peak by the mesh, {percent(error)}."
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
    yield "No experiment is compared with in this run: the comparator is another model."
    measured = validation()
    if measured is not None:
        yield (
            f"Beside measurements on bodies of silicone at rest {measured['within']} differences "
            "lie within twice the measurement's uncertainty and the model's own error. Not of this "
            "run, and none is liver: `liver-study validate` repeats it."
        )
    if finite_elements(results) is None:
        yield "It has no finite elements either: differences of its models are no errors."
        return
    yield (
        "Comparator: the finite elements of the same scene. Organ, support, tools, load and "
        "damping are the same inputs; the modulus is the scene's own in the finite elements, and "
        "in the other models what they are tuned by."
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
                "carried through to the motion."
            )
    if results.sensitivity:
        row = max(results.sensitivity, key=lambda row: abs(row.change_at_readings_pa))
        yield (
            f"Largest change of an estimate by another choice on the fuzzy side: "
            f"{fixed(row.change_at_readings_pa / PA_PER_KPA, 2)} kPa ({row.choice}: "
            f"{row.base} to {row.alternative}, {system_name(row.system)})."
        )
    if results.score_errors:
        yield "Each score has an interval over blocks of the motion: score_errors.csv."
    if not (found or results.sensitivity or results.score_errors):
        yield "None is quantified: the run has neither fuzzy systems nor scores."


def _applicability(results: Results) -> Iterator[str]:
    yield (
        "Relevance to the context of use: the quantities are those compared; the comparison holds "
        "for this organ, support, tools, load and duration, and is no evidence for others."
    )
    model, limit = finite_elements(results), results.record.strain_limit
    is_linear = model is not None and model.elements is not None and model.elements.law is None
    if model is not None and is_linear and model.largest_strain is not None:
        side = "below" if model.largest_strain < limit else "not below"
        yield (
            f"Largest strain of the finite elements: {percent(model.largest_strain)}, {side} the "
            f"{percent(limit)} up to which linear strain is trusted here."
        )
    for text in results.record.assumptions:
        yield f"Assumed: {symbols(text)}"
    for warning in results.record.warnings:
        yield f"Warning of the run: {warning}"
