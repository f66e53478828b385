"""What a run found: one row per model and a few sentences, for the first page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from reports.appearance import look, reference_name, system_name, system_of
from reports.differences import field_errors, own_error, resolved
from reports.digits import (
    DASH,
    PA_PER_KPA,
    fixed,
    percent,
    quantity,
    significant,
    spread,
    with_error,
    words,
)
from reports.fuzzy_tables import sensitivity_sentences
from reports.motion_figures import peak
from reports.ranking import Verdict, references, tool_probe, verdicts
from study.results.folder import Results

GLANCE = (
    "model",
    "modulus [kPa]",
    "÷ reference",
    "peak at tool [mm]",
    "field differs from FE",
    "at best factor",
    "× real time",
    "status",
)
ALWAYS = ("model", "status")
LAWS = {"neo-hookean": "neo-Hookean", "st-venant-kirchhoff": "Saint Venant-Kirchhoff"}
MILLI = 1e3


def glance(results: Results) -> dict[str, Any]:
    """Header and one row per model; a column that no model fills is left out."""
    rows = [_glance_row(results, record) for record in results.numbers["models"]]
    kept = [
        i for i, name in enumerate(GLANCE) if name in ALWAYS or any(row[i] != DASH for row in rows)
    ]
    return {"header": [GLANCE[i] for i in kept], "rows": [[row[i] for i in kept] for row in rows]}


def _glance_row(results: Results, record: dict[str, Any]) -> list[str]:
    name = record["name"]
    modulus, reference = young_modulus(results, record), _reference_modulus(results)
    errors = field_errors(results).get((name, "fem"), {})
    own = own_error(results)
    wall = record.get("wall_s")
    return [
        look(name).label,
        DASH if modulus is None else fixed(modulus / PA_PER_KPA, 2),
        DASH if modulus is None else fixed(modulus / reference, 2),
        _peak_at_tool(results, record),
        _own(own) if name == "fem" else _difference(errors.get("field-relative-l2-peak"), own),
        _difference(errors.get("field-relative-l2-peak-at-best-factor"), own),
        DASH if not wall else significant(record["simulated_s"] / wall, 2),
        status(record),
    ]


def _peak_at_tool(results: Results, record: dict[str, Any]) -> str:
    probe = tool_probe(results)
    if probe is None or record["status"] != "finished":
        return DASH
    return printed_peak(results, record, probe)


def printed_peak(results: Results, record: dict[str, Any], probe: str) -> str:
    """Largest displacement [mm] at a probe, with the error of that curve by the mesh if known."""
    largest = peak(results, record["name"], probe)
    if largest is None:
        return DASH
    there = record.get("mesh_error_by_probe", {}).get(probe)
    if not there:
        return significant(MILLI * largest)
    return with_error(MILLI * largest, MILLI * largest * there["displacement"])


def _own(error: float | None) -> str:
    return DASH if error is None else f"± {percent(error)}"


def _difference(share: float | None, error: float | None) -> str:
    return DASH if share is None else resolved(share, error)


def young_modulus(results: Results, record: dict[str, Any]) -> float | None:
    """Small-strain Young's modulus [Pa] of a model, or None if it has none."""
    if record["name"] == "fem":
        return _reference_modulus(results)
    system = system_of(record["name"])
    found = results.numbers["stiffness"].get(system, {}) if system else {}
    modulus = record.get("small_strain_modulus_pa", found.get("estimate_pa"))
    return None if modulus is None else float(modulus)


def status(record: dict[str, Any]) -> str:
    """Whether a model finished, or when it diverged."""
    if record["status"] != "diverged":
        return str(record["status"])
    when = record.get("diverged_at_s")
    return "diverged" if when is None else f"diverged at {significant(when)} s"


def sentences(results: Results) -> list[str]:
    """What this run found, in a few sentences."""
    return [
        *_estimates(results),
        *sensitivity_sentences(results),
        *_fields(results),
        *_limits(results),
        *_rankings(results),
        *_reference(results),
    ]


def _estimates(results: Results) -> Iterator[str]:
    found = results.numbers["stiffness"]
    if not found:
        return
    reference = _reference_modulus(results)
    printed = quantity(results.numbers["scene"]["tissue"]["youngs_modulus"])
    shares = sorted(one["estimate_pa"] / reference for one in found.values())
    kilo = sorted(one["estimate_pa"] / PA_PER_KPA for one in found.values())
    yield (
        f"Stiffness: the fuzzy systems estimate {spread([fixed(k, 2) for k in kilo])} kPa, "
        f"{spread([fixed(s, 2) for s in shares])} times the reference modulus of {printed}."
    )
    for name, one in found.items():
        if one.get("interval_pa"):
            low, high = one["interval_pa"]
            verb = "contains" if low <= reference <= high else "does not contain"
            yield (
                f"The interval of {system_name(name)}, {fixed(low / PA_PER_KPA, 2)} to "
                f"{fixed(high / PA_PER_KPA, 2)} kPa, {verb} the reference modulus."
            )


def _fields(results: Results) -> Iterator[str]:
    """Field differences from the reference, the lowest first, beside its own error."""
    found = {
        model: values["field-relative-l2-peak"]
        for (model, reference), values in field_errors(results).items()
        if reference == "fem"
    }
    if found:
        ranked = sorted(found, key=lambda model: found[model])
        error = own_error(results)
        parts = [f"{look(model).label} {resolved(found[model], error)}" for model in ranked]
        yield (
            "Field: at peak load the displacement over the whole organ differs from that of the "
            f"finite elements by, in relative L2, {', '.join(parts)}."
        )


def _limits(results: Results) -> Iterator[str]:
    limits = results.numbers.get("lattice_limits")
    if limits:
        places = {
            "relative_l2": f"at Poisson ratio {limits['poisson_ratio']:g}",
            "relative_l2_at_best_factor": "at best factor",
            "relative_l2_at_quarter": "against Poisson ratio 0.25",
            "relative_l2_with_volume_term": (
                "with one volume term per cell, which frees the Poisson ratio"
            ),
        }
        error = own_error(results)
        parts = [
            f"{resolved(limits[key], error)} {place}"
            for key, place in places.items()
            if limits.get(key) is not None
        ]
        yield (
            "Limit of the springs: at rest and with the exact modulus the lattice's field still "
            f"differs, in relative L2: {', '.join(parts)}."
        )


def _rankings(results: Results) -> Iterator[str]:
    probe = tool_probe(results)
    for reference in references(results) if probe else ():
        found = list(verdicts(results, reference, str(probe)))
        if found:
            yield (
                f"Similarity to {reference_name(reference)} at control point {words(str(probe))}: "
                f"{_winners(found)}{_elsewhere(results, reference, str(probe))}"
            )


def _winners(found: list[Verdict]) -> str:
    """Who scored highest by how many measures, and how many of the leads are resolved."""
    leaders = [verdict.best for verdict in found if verdict.lead > 0.0]
    ranked = sorted(dict.fromkeys(leaders), key=lambda model: -leaders.count(model))
    if not ranked:
        return f"the two highest scores are equal on all {len(found)} measures."
    first, *others = [f"on {leaders.count(model)}" for model in ranked]
    parts = [f"{look(ranked[0]).label} scores highest {first} of {len(found)} measures"]
    parts += [f"{look(m).label} {count}" for m, count in zip(ranked[1:], others, strict=True)]
    leads = sorted(verdict.lead for verdict in found)
    span = spread([fixed(lead, 4) for lead in (leads[0], leads[-1])])
    return f"{', '.join(parts)}; leads over the next: {span}. {_resolution(found)}"


def _elsewhere(results: Results, reference: str, probe: str) -> str:
    """Who scored highest how often at the other control points."""
    others = [name for name in results.numbers["probes"] if name != probe]
    found = [verdict for other in others for verdict in verdicts(results, reference, other)]
    leaders = [verdict.best for verdict in found if verdict.lead > 0.0]
    if not leaders:
        return ""
    ranked = sorted(dict.fromkeys(leaders), key=lambda model: -leaders.count(model))
    parts = [f"{look(model).label} {leaders.count(model)}" for model in ranked]
    return (
        f" Highest at the other control points, of {len(found)} scores: {', '.join(parts)}. "
        f"{_resolution(found)}"
    )


def _resolution(found: list[Verdict]) -> str:
    counts = {
        "{} above the numerical error of the curves": True,
        "{} not resolved": False,
        "{} beside an error that is not known": None,
    }
    parts = [
        text.format(n)
        for text, value in counts.items()
        if (n := sum(verdict.is_resolved is value for verdict in found))
    ]
    return f"Of these leads {', '.join(parts)}."


def _reference(results: Results) -> Iterator[str]:
    """Discretisation error and largest strain of the reference."""
    record = next((m for m in results.numbers["models"] if m["name"] == "fem"), None)
    if record is None:
        return
    error = record.get("mesh_error")
    if error:
        meshes = record.get("mesh_levels")
        source = f" from {min(len(meshes), 3)} meshes" if meshes else ""
        yield (
            f"Reference: its own discretisation error is estimated{source} at "
            f"{percent(error['field_peak'])} of the field at the peak and at most "
            f"{percent(error['displacement'])} of a displacement and {percent(error['velocity'])} "
            f"of a velocity curve{_at_tool(results, record)}."
        )
    else:
        yield "Reference: its discretisation error is not estimated."
    strain = record.get("largest_strain")
    if strain is not None:
        limit = results.numbers["strain_limit"]
        side = "below" if strain < limit else "not below"
        yield (
            f"Its largest strain is {percent(strain)}, {side} the {percent(limit)} up to "
            f"which linear strain is trusted here.{_beyond(record, strain, limit)}"
        )


def _beyond(record: dict[str, Any], strain: float, limit: float) -> str:
    """What large deformation changes where linear strain is not trusted, if it was computed."""
    found = record.get("hyperelastic")
    if not found or strain <= limit:
        return ""
    law = LAWS.get(found["law"], found["law"])
    return (
        f" A {law} solid on the same mesh moves otherwise by {percent(found['field_difference'])} "
        f"of the field at the peak (relative L2; largest logarithmic strain "
        f"{percent(found['largest_strain'])}): so much of a difference from the linear reference "
        "may be large deformation, which that leaves out."
    )


def _at_tool(results: Results, record: dict[str, Any]) -> str:
    probe = tool_probe(results)
    there = record.get("mesh_error_by_probe", {}).get(probe)
    if not there:
        return ""
    shares = f"{percent(there['displacement'])} and {percent(there['velocity'])}"
    return f" ({shares} at control point {words(str(probe))})"


def _reference_modulus(results: Results) -> float:
    return float(results.numbers["scene"]["tissue"]["youngs_modulus"].split()[0])
