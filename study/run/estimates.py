"""Fuzzy estimates of the scene's stiffness, and what the report draws of the systems."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fuzzy import stiffness
from fuzzy.stiffness import Estimate, Settings
from study.scene import Scene

SURFACE_POINTS = 41
CURVE_POINTS = 401
SURFACE_INPUTS = ("hcv", "hbv")


def settings(scene: Scene) -> Settings:
    """Settings of the fuzzy systems from the scene."""
    f = scene.fuzzy
    return Settings(
        samples=f.samples,
        footprint=f.footprint,
        sugeno_aggregation=f.sugeno_aggregation,
        consequent=f.consequent,
    )


def readings(scene: Scene) -> dict[str, float]:
    """Elastography readings [Pa] that the scene gives."""
    return {name: value for name, value in asdict(scene.patient).items() if value is not None}


def estimates(scene: Scene) -> dict[str, Estimate]:
    """Estimate of each fuzzy system that the scene names."""
    return {
        name: stiffness.estimate(readings(scene), name, settings(scene))
        for name in scene.fuzzy.systems
    }


def as_numbers(found: dict[str, Estimate], youngs_modulus: float) -> dict[str, Any]:
    """The estimates as plain numbers, judged against the reference modulus [Pa]."""
    return {name: _numbers(estimate, youngs_modulus) for name, estimate in found.items()}


def _numbers(estimate: Estimate, youngs_modulus: float) -> dict[str, Any]:
    numbers: dict[str, Any] = {
        "estimate_pa": estimate.estimate,
        "relative_to_reference": estimate.estimate / youngs_modulus,
        "quadrature_error_pa": estimate.quadrature_error,
        "notes": list(estimate.notes),
    }
    if estimate.interval is not None:
        numbers["interval_pa"] = list(estimate.interval)
    return numbers


def drawings(scene: Scene) -> dict[str, NDArray[Any]]:
    """Membership curves and output surfaces to draw, lengths of axes in Pa."""
    chosen = settings(scene)
    arrays: dict[str, NDArray[Any]] = {}
    for variable, curves in stiffness.membership_curves(chosen, CURVE_POINTS).items():
        arrays[f"{variable}.sets"] = np.array(curves.sets)
        for part in ("x", "principal", "lower", "upper"):
            arrays[f"{variable}.{part}"] = getattr(curves, part)
    for name in scene.fuzzy.systems:
        x, y, z = stiffness.surface(
            name, *SURFACE_INPUTS, points=SURFACE_POINTS, settings=chosen, base=readings(scene)
        )
        arrays |= {"surface.x": x, "surface.y": y, f"surface.{name}": z}
    return arrays
