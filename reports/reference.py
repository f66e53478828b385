"""What the finite-element reference is made of, and how large its own error is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from reports.digits import DASH, count, fixed, percent, significant, words
from reports.summary import printed_peak
from study.results.folder import Results

ELEMENTS = {
    "p1": "linear tetrahedra",
    "p2": "quadratic tetrahedra",
    "taylor-hood": "Taylor-Hood tetrahedra, quadratic in displacement and linear in pressure",
}
STEPPING = {"tr-bdf2": "TR-BDF2", "hht-alpha": "HHT-α"}
# What the estimate rests on; the run makes it, and a test holds these to those of the run.
SAFETY = 1.25
SAFETY_ASSUMED = 3.0
ASSUMED_ORDER = 2.0
LEAST_ORDER = 1.0
BEYOND = 0.5
FORMAL_ORDER = {"p1": 2.0, "p2": 3.0, "taylor-hood": 3.0}

Record = dict[str, Any]


def reference(results: Results) -> dict[str, Any] | None:
    """How the reference was found, its meshes and its errors; None where no meshes are known.

    `formal_order` is empty where two meshes had to do with an assumed order.
    """
    record: Record = next((m for m in results.numbers["models"] if m["name"] == "fem"), {})
    levels = record.get("mesh_levels")
    if not levels:
        return None
    by_three = len(levels) > 2
    return {
        "how": _how(results, record),
        "levels": [_level_row(level) for level in levels],
        "errors": list(_error_rows(results, record)) if record.get("mesh_error") else [],
        "formal_order": f"{FORMAL_ORDER[record['element']]:g}" if by_three else "",
        "least_order": f"{LEAST_ORDER:g}",
        "assumed_order": f"{ASSUMED_ORDER:g}",
        "safety": f"{SAFETY:g}",
        "safety_assumed": f"{SAFETY_ASSUMED:g}",
        "beyond": f"{BEYOND:g}",
    }


def is_built_in_liver(scene: dict[str, Any]) -> bool:
    """Whether the organ is the built-in shape, whose surface is known and curved."""
    organ = scene.get("organ", {})
    return organ.get("shape") == "liver" and organ.get("mesh") is None


def _how(results: Results, record: Record) -> str:
    """Element and method in a sentence."""
    curved = record["element"] != "p1" and is_built_in_liver(results.numbers["scene"])
    surface = ", curved along the organ's surface" if curved else ""
    return f"Linear elasticity on {ELEMENTS[record['element']]}{surface}; {_motion(record)}."


def _motion(record: Record) -> str:
    method, vectors = record["method"], record.get("subspace_vectors")
    if vectors is None:
        step = significant(1e3 * record["time_step_s"])
        return f"motion by {count(record['steps'])} implicit steps of {STEPPING[method]}, {step} ms"
    kind = (
        f"{vectors} load-dependent Ritz vectors"
        if method == "ritz-vectors"
        else f"the displacement at rest and {vectors - 1} modes of vibration"
    )
    return (
        f"motion by superposition of {kind}, the last quarter of which changes the curve of no "
        f"control point by more than {percent(record['truncation_error'])} in relative L2"
    )


def _level_row(level: Record) -> list[str]:
    return [
        fixed(level["size"], 2),
        count(level["elements"]),
        count(level["unknowns"]),
        significant(level["wall_s"], 2),
    ]


def _error_rows(results: Results, record: Record) -> Iterator[list[str]]:
    """Control point, peak, error and order of displacement and velocity; the whole field last."""
    for probe, errors in record["mesh_error_by_probe"].items():
        orders = record["mesh_order_by_probe"][probe]
        cells = [(percent(error), _order(record, orders[kind])) for kind, error in errors.items()]
        yield [
            words(probe),
            printed_peak(results, record, probe),
            *(c for pair in cells for c in pair),
        ]
    field = record["mesh_error"]["field_peak"], record["mesh_order"]["field_peak"]
    yield ["whole field at the peak", DASH, percent(field[0]), _order(record, field[1]), DASH, DASH]


def _order(record: Record, observed: float | None) -> str:
    """Observed order, and what was taken in its place where it was not fit to be used."""
    if len(record["mesh_levels"]) < 3:
        return f"{ASSUMED_ORDER:g} assumed"
    if observed is None:
        return "none"
    taken = min(max(observed, LEAST_ORDER), FORMAL_ORDER[record["element"]])
    shown = fixed(observed, 1)
    return shown if taken == observed else f"{shown}, {taken:g} taken"
