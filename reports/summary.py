"""Findings of a run: one row per model, and sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from reports import budget
from reports.appearance import labels, reference_name, system_name
from reports.differences import elements, field_errors, finite_elements, own_error, resolved
from reports.digits import (
    DASH,
    PA_PER_KPA,
    Table,
    control_point,
    fixed,
    percent,
    quantity,
    significant,
    spread,
    with_error,
)
from reports.fuzzy_tables import sensitivity_sentences
from reports.motion_figures import peak
from reports.page.cost import frame_share
from reports.ranking import (
    Lead,
    columns,
    leads,
    rank_table,
    references,
    score_table,
    times_first,
    tool_probe,
)
from reports.score_digits import decimals
from study.results import Results
from study.results.records import LargeStrain, LatticeLimits, ModelRecord

GLANCE = (
    "model",
    "modulus [kPa]",
    "÷ reference",
    "peak at tool [mm]",
    "field difference from FE",
    "at best scale factor",
    "real-time factor",
    "status",
)
ALWAYS = ("model", "status")
LAWS = {"neo-hookean": "neo-Hookean", "st-venant-kirchhoff": "Saint Venant-Kirchhoff"}
MILLI = 1e3


def glance(results: Results) -> dict[str, list[str] | Table]:
    """Table of the first page as the template takes it; see `glance_table`."""
    header, rows = glance_table(results)
    return {"header": header, "rows": rows}


def glance_table(results: Results) -> tuple[list[str], Table]:
    """Header and rows, one per model; a column that no model fills is left out."""
    rows = [_glance_row(results, model) for model in results.record.models]
    kept = [
        i for i, name in enumerate(GLANCE) if name in ALWAYS or any(row[i] != DASH for row in rows)
    ]
    return [GLANCE[i] for i in kept], [[row[i] for i in kept] for row in rows]


def _glance_row(results: Results, model: ModelRecord) -> list[str]:
    modulus, reference = young_modulus(results, model), results.scene.tissue.youngs_modulus
    errors = field_errors(results).get((model.name, elements(results)), {})
    own = own_error(results)
    return [
        model.label,
        DASH if modulus is None else fixed(modulus / PA_PER_KPA, 2),
        DASH if modulus is None else fixed(modulus / reference, 2),
        _peak_at_tool(results, model),
        _own(own)
        if model.name == elements(results)
        else _difference(errors.get("field-relative-l2-peak"), own),
        _difference(errors.get("field-relative-l2-peak-at-best-factor"), own),
        real_time_factor(model),
        status(model),
    ]


def _peak_at_tool(results: Results, model: ModelRecord) -> str:
    if model.status != "finished":
        return DASH
    return printed_peak(results, model, tool_probe(results))


def printed_peak(results: Results, model: ModelRecord, probe: str) -> str:
    """Largest displacement [mm] at a probe, with the error of that curve by the mesh if known."""
    largest = peak(results, model.name, probe)
    if largest is None:
        return DASH
    if model.mesh_error is None:
        return significant(MILLI * largest)
    return with_error(
        MILLI * largest, MILLI * largest * model.mesh_error.by_probe[probe].displacement
    )


def real_time_factor(model: ModelRecord) -> str:
    """Simulated over wall time as printed; a dash where a model was not timed or ended early.

    A dash too where its time includes what is computed before the motion.
    """
    share = frame_share(model)
    return DASH if share is None or model.status != "finished" else significant(1.0 / share, 2)


def _own(error: float | None) -> str:
    return DASH if error is None else f"± {percent(error)}"


def _difference(share: float | None, error: float | None) -> str:
    return DASH if share is None else resolved(share, error)


def young_modulus(results: Results, model: ModelRecord) -> float | None:
    """Small-strain Young's modulus [Pa] of a model, or None if it has none."""
    if model.name == "fem":
        return results.scene.tissue.youngs_modulus
    if model.small_strain_modulus_pa is not None or model.system is None:
        return model.small_strain_modulus_pa
    return results.record.fuzzy.systems[model.system].estimate_pa


def status(model: ModelRecord) -> str:
    """Whether a model finished, or when its motion ended before."""
    if not model.ended_at_s and model.status != "diverged":  # at 0 one that never began
        return model.status
    if model.ended_at_s is None:
        return model.status
    return f"{model.status} at {significant(model.ended_at_s)} s"


def sentences(results: Results) -> list[str]:
    """Findings of the run, in sentences."""
    return [
        *_estimates(results),
        *sensitivity_sentences(results),
        *_fields(results),
        *budget.sentences(results),
        *_limits(results),
        *_rankings(results),
        *_reference(results),
    ]


def _estimates(results: Results) -> Iterator[str]:
    found = results.record.fuzzy.systems
    if not found:
        return
    reference = results.scene.tissue.youngs_modulus
    printed = quantity(f"{reference} Pa")
    shares = sorted(one.estimate_pa / reference for one in found.values())
    kilo = sorted(one.estimate_pa / PA_PER_KPA for one in found.values())
    yield (
        f"Stiffness: the fuzzy systems estimate {spread([fixed(k, 2) for k in kilo])} kPa, "
        f"{spread([fixed(s, 2) for s in shares])} times the reference modulus of {printed}."
    )
    for name, one in found.items():
        if one.interval_pa is not None:
            low, high = one.interval_pa
            verb = "contains" if low <= reference <= high else "does not contain"
            yield (
                f"The stiffness interval of the fuzzy system {system_name(name)}, "
                f"{fixed(low / PA_PER_KPA, 2)} to {fixed(high / PA_PER_KPA, 2)} kPa, {verb} the "
                "reference modulus."
            )


def _fields(results: Results) -> Iterator[str]:
    """Field differences from the reference, the lowest first, beside its own error."""
    found = {
        model: values["field-relative-l2-peak"]
        for (model, reference), values in field_errors(results).items()
        if reference == elements(results)
    }
    if found:
        error, named = own_error(results), labels(results)
        ranked = sorted(found, key=lambda model: found[model])
        parts = [f"{named[model]} {resolved(found[model], error)}" for model in ranked]
        yield (
            "Field: relative L2 difference of the displacement over the whole organ from the "
            f"finite elements at the peak load: {', '.join(parts)}."
        )


def _limits(results: Results) -> Iterator[str]:
    limits, error = results.record.lattice_limits, own_error(results)
    if limits is not None:
        parts = [f"{resolved(share, error)} {place}" for share, place in _by_place(limits)]
        yield (
            "Limit of the spring lattice: at rest and with the exact modulus, the relative L2 "
            f"difference of its field from finite elements is {', '.join(parts)}."
        )


def _by_place(limits: LatticeLimits) -> Iterator[tuple[float, str]]:
    yield limits.relative_l2, f"at Poisson ratio {limits.poisson_ratio:g}"
    yield limits.relative_l2_at_best_factor, "at the best scale factor"
    yield limits.relative_l2_at_quarter, "against Poisson ratio 0.25"
    if limits.relative_l2_with_volume_term is not None:
        place = "with one volume term per cell, which corrects the Poisson ratio"
        yield limits.relative_l2_with_volume_term, place


def _rankings(results: Results) -> Iterator[str]:
    probe, named = tool_probe(results), labels(results)
    for reference in references(results):
        found = list(leads(results, reference, probe))
        if found:
            yield (
                f"Similarity of the fuzzy-tuned models to {reference_name(results, reference)} at "
                f"{control_point(probe)}: {_winners(found, named)}"
                f"{_elsewhere(results, reference, probe)}"
            )
            yield from _first_ranks(results, reference, probe)
            yield from _baseline(results, reference, probe)


def _first_ranks(results: Results, reference: str, probe: str) -> Iterator[str]:
    """In how many measures each model is first, alone or with others within the error."""
    named, parts = labels(results), list[str]()
    for model, ranks in rank_table(results, reference, probe).items():
        alone, shared = times_first(ranks)
        if alone or shared:
            parts.append(f"{named[model]} alone in {alone}, shared in {shared}")
    yield (
        f"First rank against {reference_name(results, reference)} at {control_point(probe)}, in "
        f"{len(columns(results))} measures (models whose difference is within its error share a "
        f"rank): {'; '.join(parts)}."
    )


def _baseline(results: Results, reference: str, probe: str) -> Iterator[str]:
    """In how many measures the reading without a fuzzy system scores above all of them."""
    scores = score_table(results, reference, probe)
    own = scores.get("reading")
    tuned = [scores[m.name] for m in results.record.models if m.system and m.name in scores]
    if own is None or not tuned:
        return
    shared = [column for column in own if all(column in row for row in tuned)]
    ahead = sum(own[column] > max(row[column] for row in tuned) for column in shared)
    verb = "scores" if ahead else "never scores"
    of = f" in {ahead} of {len(shared)} measures{_alone(results, reference, probe)}"
    yield (
        f"{labels(results)['reading']}, which uses no fuzzy system, {verb} higher than every "
        f"fuzzy-tuned model against {reference_name(results, reference)} at "
        f"{control_point(probe)}{of if ahead else ''}."
    )


def _alone(results: Results, reference: str, probe: str) -> str:
    """In how many measures the reading is ahead of every model by more than the errors."""
    ranks = rank_table(results, reference, probe).get("reading")
    if ranks is None:
        return ""
    alone, _ = times_first(ranks)
    return f"; in {alone or 'none'} of them it is resolved from every other model"


def _winners(found: list[Lead], named: dict[str, str]) -> str:
    """The models with the highest scores, and how many of their leads are resolved."""
    counts = _times_highest(found)
    if not counts:
        return f"the two highest scores are equal in all {len(found)} measures."
    (first, most), *others = counts
    parts = [f"{named[first]} scores highest in {most} of {len(found)} measures"]
    parts += [f"{named[model]} in {times}" for model, times in others]
    ends = min(found, key=lambda lead: lead.margin), max(found, key=lambda lead: lead.margin)
    span = spread([printed_margin(lead) for lead in ends])
    return f"{', '.join(parts)}; lead over the second: {span}. {_resolution(found)}"


def printed_margin(lead: Lead) -> str:
    """A lead to the digits that its errors leave."""
    return fixed(lead.margin, decimals(lead.error if lead.is_whole else None, lead.resampled))


def _times_highest(found: list[Lead]) -> list[tuple[str, int]]:
    """Models that scored highest, and how often, the most frequent first."""
    return Counter(lead.best for lead in found if lead.margin > 0.0).most_common()


def _elsewhere(results: Results, reference: str, probe: str) -> str:
    """The models with the highest scores at the other control points."""
    others = [name for name in results.record.probes if name != probe]
    found = [lead for other in others for lead in leads(results, reference, other)]
    named = labels(results)
    parts = [f"{named[model]}: {times}" for model, times in _times_highest(found)]
    if not parts:
        return ""
    return (
        f" Number of highest scores at the other control points, of {len(found)}: "
        f"{', '.join(parts)}. {_resolution(found)}"
    )


def _resolution(found: list[Lead]) -> str:
    counts = {
        "{} resolved": True,
        "{} not resolved": False,
        "{} with a numerical error that is not known": None,
    }
    parts = [
        text.format(n)
        for text, value in counts.items()
        if (n := sum(lead.is_resolved is value for lead in found))
    ]
    turned = sum(lead.hangs_on_view for lead in found)
    exceed = {0: "All exceed their", 1: "1 does not exceed its"}
    verb = exceed.get(turned, f"{turned} do not exceed their")
    view = f" {verb} range over time windows and scalings of the phase plane."
    return f"Of these leads: {', '.join(parts)}.{view}"


def _reference(results: Results) -> Iterator[str]:
    """Discretisation error and largest strain of the reference."""
    model = finite_elements(results)
    if model is None or model.elements is None:
        return
    error = model.elements.mesh_error
    if error is None:
        yield "Reference: its discretisation error is not estimated."
    else:
        worst, probe = error.worst, tool_probe(results)
        there = error.by_probe[probe]
        yield (
            "Reference: its discretisation error, estimated from "
            f"{min(len(model.elements.levels), 3)} meshes, is {percent(error.field_peak)} of the "
            f"field at the peak load and at most {percent(worst.displacement)} of a displacement "
            f"and {percent(worst.velocity)} of a velocity curve ({percent(there.displacement)} and "
            f"{percent(there.velocity)} at {control_point(probe)})."
        )
    strain, limit = model.largest_strain, results.record.strain_limit
    if strain is not None and model.elements.law is not None:
        law = LAWS.get(model.elements.law, model.elements.law)
        yield f"Reference: its largest logarithmic strain is {percent(strain)} ({law} law)."
    elif strain is not None:
        beyond = _large_strain(model.elements.large_strain) if strain > limit else ""
        side = "below" if strain < limit else "not below"
        yield (
            f"Reference: its largest strain is {percent(strain)}, {side} the limit of "
            f"{percent(limit)} assumed for linear strain.{beyond}"
        )


def _large_strain(found: LargeStrain | None) -> str:
    """The effect of large deformation where the strain is beyond the limit, if computed."""
    if found is None:
        return ""
    law = LAWS.get(found.law, found.law)
    return (
        f" The field of a {law} solid on the same mesh differs by "
        f"{percent(found.field_difference)} at the peak load (relative L2; largest logarithmic "
        f"strain {percent(found.largest_strain)}). A difference of this size from the linear "
        "reference may be due to large deformation, which the reference neglects."
    )
