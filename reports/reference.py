"""What the finite-element reference is made of, and how large its own error is."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from reports.differences import finite_elements
from reports.digits import DASH, count, fixed, percent, significant, words
from reports.summary import LAWS, printed_peak
from study.results import Results
from study.results.records import ElementsRecord, MeshLevel, ModelRecord
from study.scene.schema import Scene

ELEMENTS = {
    "p1": "linear tetrahedra",
    "p2": "quadratic tetrahedra",
    "taylor-hood": "Taylor-Hood tetrahedra, quadratic in displacement and linear in pressure",
}
STEPPING = {"tr-bdf2": "TR-BDF2", "hht-alpha": "HHT-α", "sdirk2": "SDIRK2"}
# What the estimate rests on; the run makes it, and a test holds these to those of the run.
SAFETY = 1.25
SAFETY_ASSUMED = 3.0
ASSUMED_ORDER = 2.0
SAFETY_GRADED = 1.5
LEAST_ORDER = 1.0
REGULAR = 6.0 * 2.0**0.5
"""Cube of the edge of a regular tetrahedron over its volume."""
BEYOND = 0.5


def reference(results: Results) -> dict[str, object] | None:
    """How the reference was found, its meshes and its errors; None where there is none.

    `formal_order` is empty where two meshes had to do with an assumed order.
    """
    model = finite_elements(results)
    if model is None or model.elements is None or not model.elements.levels:
        return None
    found, error = model.elements, model.elements.mesh_error
    by_three, graded = len(found.levels) > 2, results.scene.is_graded
    assumed = error.formal_order if error and graded else ASSUMED_ORDER
    return {
        "how": _how(results.scene, model, found),
        "levels": [_level_row(results, level) for level in found.levels],
        "errors": list(_error_rows(results, model, found)),
        "formal_order": f"{error.formal_order:g}" if error and by_three else "",
        "graded": graded,
        "safety_graded": f"{SAFETY_GRADED:g}",
        "least_order": f"{LEAST_ORDER:g}",
        "assumed_order": f"{assumed:g}",
        "safety": f"{SAFETY:g}",
        "safety_assumed": f"{SAFETY_ASSUMED:g}",
        "beyond": f"{BEYOND:g}",
    }


def is_built_in_liver(scene: Scene) -> bool:
    """Whether the organ is the built-in shape, whose surface is known and curved."""
    return scene.organ.shape == "liver" and scene.organ.mesh is None


def _how(scene: Scene, model: ModelRecord, found: ElementsRecord) -> str:
    """Element and method in a sentence."""
    curved = found.element != "p1" and is_built_in_liver(scene)
    surface = ", curved along the organ's surface" if curved else ""
    law = "linear" if found.law is None else LAWS[found.law]
    made_of = f"{law} elasticity on {ELEMENTS[found.element]}{surface}"
    return f"{made_of[0].upper()}{made_of[1:]}; {_motion(model, found)}."


def _motion(model: ModelRecord, found: ElementsRecord) -> str:
    vectors = found.subspace_vectors
    if vectors is None:
        steps, step = count(model.steps or 0), significant(1e3 * (model.time_step_s or 0.0))
        return f"motion by {steps} implicit steps of {STEPPING[found.method]}, {step} ms"
    kind = (
        f"{vectors} load-dependent Ritz vectors"
        if found.method == "ritz-vectors"
        else f"the displacement at rest and {vectors - 1} modes of vibration"
    )
    return (
        f"motion by superposition of {kind}, the last quarter of which changes the curve of no "
        f"control point by more than {percent(found.truncation_error or 0.0)} in relative L2"
    )


def _level_row(results: Results, level: MeshLevel) -> list[str]:
    return [
        _edge(results, level),
        count(level.elements),
        count(level.unknowns),
        significant(level.wall_s, 2),
    ]


def _edge(results: Results, level: MeshLevel) -> str:
    """Edge [mm] of a regular tetrahedron as large as the mean one of a mesh."""
    known = results.record.dimensionless
    if known is None:
        return DASH
    return significant(1e3 * (REGULAR * known.volume_m3 / level.elements) ** (1.0 / 3.0))


def _error_rows(results: Results, model: ModelRecord, found: ElementsRecord) -> Iterator[list[str]]:
    """Control point, peak, error and order of displacement and velocity; the whole field last."""
    errors = found.mesh_error
    if errors is None:
        return

    formal = errors.formal_order if len(found.levels) > 2 else None
    assumed = errors.formal_order if results.scene.is_graded else ASSUMED_ORDER
    order = partial(_order, formal=None if results.scene.is_graded else formal, assumed=assumed)
    for probe, error in errors.by_probe.items():
        observed = errors.order_by_probe[probe]
        yield [
            words(probe),
            printed_peak(results, model, probe),
            *(percent(error.displacement), order(observed.displacement)),
            *(percent(error.velocity), order(observed.velocity)),
        ]
    field = percent(errors.field_peak), order(errors.field_order)
    yield ["whole field at the peak", DASH, *field, DASH, DASH]


def _order(observed: float | None, formal: float | None, assumed: float) -> str:
    """Observed order, and what was taken in its place where it was not fit to be used.

    `formal`: the highest that is taken, None where the order is `assumed`.
    """
    if formal is None:
        return f"{assumed:g} assumed"
    if observed is None:
        return "none"
    taken = min(max(observed, LEAST_ORDER), formal)
    shown = fixed(observed, 1)
    return shown if taken == observed else f"{shown}, {taken:g} taken"
