"""A selected configuration, described in words and as a scene to run."""

from __future__ import annotations

from dataclasses import replace

from study.models.lattice import LatticeModel
from study.models.tissue import FRACTION
from study.scene import Scene
from study.tradeoff.contenders import Configuration, is_moved

DOUBLE, SINGLE = "double", "single"


def described(one: Configuration) -> str:
    """The configuration in words."""
    given = one.settings
    if one.contender == "superposition":
        return f"superposition of {given['count']} Ritz vectors of finite elements"
    edge = f"{1e3 * float(given['spacing']):.3g} mm"
    if "radius" in given:
        reach = f"within {1e3 * float(given['radius']):.3g} mm of the tool and more beyond"
        kind = "corrected graded" if one.contender == "corrected-graded" else "graded"
        found = f"{kind} lattice of {edge} {reach}"
    else:
        found = f"{'corrected ' * (one.contender == 'corrected')}lattice of {edge}"
    precision = given.get("precision", DOUBLE)
    fraction = float(given.get("step_fraction", FRACTION))
    return f"{found}, explicit, in {precision} precision, {fraction:g} of the critical step"


def scene_with(scene: Scene, one: Configuration) -> Scene:
    """The scene with the reference and this configuration; elements are those of the reference."""
    given = dict(one.settings)
    if one.contender == "superposition":
        own = replace(scene.superposition, vectors="ritz", count=int(given["count"]))
        return _naming(replace(scene, superposition=own), "superposition")
    if one.contender in {"corrected", "corrected-graded"}:
        return _naming(_corrected(scene, one), "corrected")
    chosen = one.model(scene)
    assert isinstance(chosen, LatticeModel)  # noqa: S101 - what is none of these is a lattice
    name = "region" if chosen.graded else "tissue"
    region = chosen.scene.region
    return _naming(replace(scene, lattice=chosen.lattice, region=region), name)


def _corrected(scene: Scene, one: Configuration) -> Scene:
    """The scene with the configuration's coarse lattice, uniform or graded."""
    lattice = replace(scene.lattice, step_fraction=FRACTION, time_step=None, step_rate=None)
    spacing = float(one.settings["spacing"])
    if "radius" not in one.settings:
        own = replace(scene.corrected, spacing=spacing, coarse="uniform")
        return replace(scene, lattice=lattice, corrected=own)
    return replace(
        scene,
        lattice=lattice,
        corrected=replace(scene.corrected, spacing=None, coarse="graded"),
        region=replace(scene.region, spacing=spacing, radius=float(one.settings["radius"])),
    )


def _naming(scene: Scene, name: str) -> Scene:
    """The scene naming the measured model, and the reference where it was compared with it."""
    reference = ("fem",) if not is_moved(scene) else ()
    return replace(scene, models=tuple(dict.fromkeys((*reference, *scene.models, name))))
