"""The readings adopted where the paper is silent or cannot be taken literally, as sentences."""

from __future__ import annotations

from study.models import table
from study.results.records import ControlPoint
from study.scene import Scene


def assumptions(scene: Scene, point: ControlPoint | None) -> tuple[str, ...]:
    """Every reading in force in a scene, one sentence each: of the scene, then of its models."""
    own = _organ(scene) if point is None else _point(scene, point.mass_kg)
    return (*own, *table.assumptions(scene), *_similarity())


def _point(scene: Scene, mass: float) -> list[str]:
    source = (
        "declared in the scene"
        if scene.organ.mass is not None
        else f"that for which eq. (2) at zeta = {scene.damping.ratio:g} with the benchmark's "
        "stiffness at rest meets gamma_0"
    )
    return [
        f"The control mass point weighs {mass:.4g} kg, {source}; the paper gives no mass.",
        f"Its one spring is as long as the reference spacing, "
        f"{1e3 * scene.damping.reference_spacing:.3g} mm.",
        f"Load ({scene.tool.force:g} N, {scene.tool.history.kind}) and time span are scene "
        "parameters; the paper gives none.",
    ]


def _organ(scene: Scene) -> list[str]:
    return [
        "Organ, support, tool, load history and time span are scene parameters; the paper gives "
        "none.",
        f"The organ rests on an elastic foundation of {scene.support.stiffness:.3g} Pa/m over its "
        f"{scene.support.side} surface, the same field for every model and mesh, and so is the "
        "tool's traction.",
        "There is no gravity: the shape given is the shape at rest.",
    ]


def _similarity() -> list[str]:
    return [
        "The paper's similarity measure is unknown, so its Table III cannot be reproduced as a "
        "number; the measures here are stated with their formulas.",
        "Curves are the components along the tool's push.",
    ]
