"""The interpretations adopted where the paper is silent or ambiguous, as sentences."""

from __future__ import annotations

from study.models import table
from study.problem.supports import CLAMPED, FOUNDATION
from study.problem.tool_travel import APART, MEASURED
from study.results.records import ControlPoint
from study.scene import Scene, Support


def assumptions(scene: Scene, point: ControlPoint | None) -> tuple[str, ...]:
    """Every interpretation in force, one sentence each: of the scene, then of its models."""
    own = _organ(scene) if point is None else _point(scene, point.mass_kg)
    return (*own, *table.assumptions(scene), *_similarity())


def _point(scene: Scene, mass: float) -> list[str]:
    source = (
        "declared in the scene"
        if scene.organ.mass is not None
        else f"that for which eq. (2) at zeta = {scene.damping.ratio:g} with the benchmark's "
        "stiffness at rest equals gamma_0"
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
        *(_held(one) for one in scene.supports),
        *_tissue(scene),
        *_travelling(scene),
        _given(scene),
    ]


def _travelling(scene: Scene) -> list[str]:
    """On tools that travel, and the loads that represent them."""
    if not any(tool.travels for tool in scene.tools):
        return []
    return [
        "A blunt tool that travels keeps its direction and is represented by patches at stations "
        f"on its path, at most {APART:g} radii apart, whose shares follow it as cubic splines: its "
        "force and centre are exact, and the displacement under it is off by less than "
        f"{100 * MEASURED:g} % on the built-in liver. Control points are those of the tissue and "
        "stay where they are."
    ]


def _given(scene: Scene) -> str:
    """On the shape that a scene gives."""
    if not scene.gravity.acceleration:
        return "There is no gravity: the given shape is the shape at rest."
    weight = f"Gravity is {scene.gravity.acceleration:g} m/s^2 towards {scene.gravity.towards}"
    if scene.gravity.given == "loaded":
        return (
            f"{weight}: the given shape is that at rest under it. Small displacements from there "
            "are those of a weightless organ; models of large ones first find the shape without "
            "load."
        )
    return f"{weight}: the given shape is that without load, from which the organ sags first."


def _held(support: Support) -> str:
    """On what holds the organ, and how each model represents it."""
    where = (
        f"its {support.side} surface"
        if support.place is None
        else f"the surface within {1e3 * (support.radius or 0.0):.3g} mm of a place"
    )
    if support.kind == FOUNDATION:
        return (
            f"The organ rests on an elastic foundation of {1e-6 * support.stiffness:.3g} MPa/m "
            f"over {where}, the same field for every model and mesh, and so is the tool's traction."
        )
    how = "is clamped" if support.kind == CLAMPED else f"slides across the line to {support.side}"
    return (
        f"The organ {how} over {where}: finite elements hold the nodes of the facets there, a "
        "lattice the nodes nearest to it, which are up to half a spacing away, so that a clamped "
        "lattice is thinner or thicker by as much."
    )


def _tissue(scene: Scene) -> list[str]:
    """On heterogeneous tissue."""
    if "inclusions" not in scene.features:
        return []
    found = [
        "Inclusions and the map of stiffness have their given modulus in every model; an estimate "
        "and the benchmark's law are those of the surrounding tissue; all springs share one law "
        "in proportion. An element or cell that an interface cuts has the mean compliance of its "
        "parts by volume; results converge at first order in its size, and the elements' own "
        "error bar is found by meshes that do not follow the interface.",
    ]
    if not scene.lattice.volume_term and any(
        one.poisson_ratio is not None for one in scene.tissue.inclusion
    ):
        found.append(
            "Springs without a volume term have a Poisson ratio of 1/4 in inclusions too, whatever "
            "theirs."
        )
    given = scene.tissue.stiffness_map
    if given is not None and given.quantity == "shear-modulus":
        found.append(
            "Young's modulus follows from the map's shear modulus with the tissue's Poisson ratio "
            f"of {scene.tissue.poisson_ratio:g}."
        )
    return found


def _similarity() -> list[str]:
    return [
        "The paper's similarity measure is unknown, so its Table III cannot be reproduced as a "
        "number; the measures here are stated with their formulas.",
        "Curves are the components along the tool's push.",
    ]
