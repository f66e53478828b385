"""Keys that have no effect in a scene, because of its other keys: they are not written back."""

from __future__ import annotations

from collections.abc import Iterator

from study.scene.graded import has_graded
from study.scene.schema import Organ, Scene, Support, Tool

LIVER_ONLY = (
    *("knowledge", "reading", "consequent", "placement", "footprint", "footprint_factor"),
    *("absent", "surface", "sensitivity_readings"),
)
"""Keys of the table fuzzy that only the liver's knowledge bases have."""
SHAPED = {"size": "block", "volume": "liver"}
"""Keys of the organ that only one of its shapes has."""


def unused(scene: Scene) -> Iterator[tuple[str | int, ...]]:
    """Keys without effect for the shape, tools, supports, springs and damping in use."""
    yield from _unused_of_organ(scene.organ)
    if not scene.remarks:
        yield ("remarks",)
    own = ("rule_base", "inputs", "unit")
    for key in own if scene.fuzzy.rule_base is None else LIVER_ONLY:
        yield "fuzzy", key
    yield from _unused_of_load(scene)
    yield from _unused_of_supports(scene)
    yield from _unused_of_tissue(scene)
    if scene.lattice.springs == "tetrahedra":
        for key in ("spacing", "flexion", "body_diagonals"):
            yield "lattice", key
    for key in ("mass", "stiffness") if scene.damping.kind == "eq-2" else ("ratio",):
        yield "damping", key
    if scene.reference.method != "modal":
        yield "reference", "modes"
    for name in ("superposition", "corrected"):
        if name not in scene.models:
            yield (name,)
    if not has_graded(scene):
        yield ("region",)


def _unused_of_load(scene: Scene) -> Iterator[tuple[str | int, ...]]:
    for one in _unused_of_tool(scene.tool):
        yield "tool", *one
    for n, tool in enumerate(scene.further_tools):
        for one in _unused_of_tool(tool):
            yield "further_tools", n, *one
    if not scene.further_tools:
        yield ("further_tools",)
    if not scene.weight:
        yield ("weight",)
    if not scene.gravity.acceleration:
        yield ("gravity",)


def _unused_of_tissue(scene: Scene) -> Iterator[tuple[str | int, ...]]:
    if not scene.tissue.inclusion:
        yield "tissue", "inclusion"


def _unused_of_supports(scene: Scene) -> Iterator[tuple[str | int, ...]]:
    for one in _unused_of_support(scene.support):
        yield "support", one
    for n, support in enumerate(scene.further_supports):
        for one in _unused_of_support(support):
            yield "further_supports", n, one
    if not scene.further_supports:
        yield ("further_supports",)


def _unused_of_support(support: Support) -> Iterator[str]:
    """Keys of the other kinds, and of a side where it is at a place."""
    if support.kind == "foundation":
        yield "kind"
    else:
        yield "stiffness"
    if support.place is not None:
        yield "depth"
        if support.kind != "sliding":
            yield "side"


def _unused_of_tool(tool: Tool) -> Iterator[tuple[str | int, ...]]:
    """Keys of the other kinds of tool and history."""
    unused = ["force"] if tool.is_moved else ["shape", "clearance", "contact", "friction"]
    unused += [] if tool.path else ["path"]
    timed = tool.path and tool.is_moved  # its path says when
    unused += ["history"] if timed else []
    for key in unused:
        yield (key,)
    if timed:
        return
    for key, kind in (
        ("ramp", "ramp-hold-release"),
        ("hold", "ramp-hold-release"),
        ("release", "ramp-hold-release"),
        ("frequency", "sinusoid"),
    ):
        if tool.history.kind != kind:
            yield "history", key


def _unused_of_organ(organ: Organ) -> Iterator[tuple[str, ...]]:
    if organ.mesh is not None:
        yield "organ", "shape"
    else:
        yield "organ", "pieces"
    if not organ.suit:
        yield "organ", "suit"
    for key, shape in SHAPED.items():
        if organ.mesh is not None or organ.shape != shape:
            yield "organ", key


def has_effect(scene: Scene, key: str) -> bool:
    """Whether a key `table.name` means anything for the tool, support and springs in use."""
    table, name = key.split(".")
    return getattr(getattr(scene, table), name) is not None and (table, name) not in unused(scene)
