"""The unknowns of an organ under a tool, each with a range about its scene and a reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msm.calibration import SPRING_POISSON_RATIO
from study.robustness.unknowns import UNKNOWNS, Placed, Range, Sampled, Unknown
from study.scene import Scene

Floats = NDArray[np.float64]

TABLE_II, EVALUATION, PLACE = "table_ii", "evaluation", "tool_place"
"""Groups of unknowns that vary together: printed digits, evaluation of the systems, the tool."""
OF_PATIENT = ("stiffness", "disagreement", "aetiologies", "knowledge")
OF_SYSTEMS = (
    "placed",
    "consequent",
    "absent",
    "footprint",
    "footprint_factor",
    "sampled",
    "sugeno_aggregation",
    "reducer",
)
ABOUT = 0.2
"""Share by which the spacing of a draw is finer or coarser."""
NEARLY_INCOMPRESSIBLE = 0.49


class OrganDraw(NamedTuple):
    """A value of every unknown, in SI units; see `unknowns`.

    `force`, `radius`, `support` and `damping` are factors on the scene's values, and `k1` to
    `gamma_1` on Table II; `across` and `along` shift the tool by shares of its radius.
    """

    stiffness: float
    disagreement: float
    aetiologies: tuple[str, ...]
    knowledge: str
    placed: Placed
    consequent: str
    absent: str
    footprint: str
    footprint_factor: float
    sampled: Sampled
    sugeno_aggregation: str
    reducer: str
    reference_spacing: float
    spacing: float
    k1: float
    k2: float
    x_c: float
    gamma_0: float
    gamma_1: float
    damping: float
    poisson_ratio: float
    force: float
    across: float
    along: float
    radius: float
    support: float


def unknowns(spacing: float) -> tuple[Unknown, ...]:
    """All unknowns for lattices of about a spacing [m], in the order of OrganDraw."""
    shared = {one.name: one for one in UNKNOWNS}
    return (
        *(shared[name] for name in OF_PATIENT),
        *(replace(shared[name], group=EVALUATION) for name in OF_SYSTEMS),
        Range(
            "reference_spacing",
            3e-3,
            8e-3,
            "m",
            "where Table II holds: the benchmark's modulus is 2.5 K_1 / h_0^2",
        ),
        Range(
            "spacing",
            (1.0 - ABOUT) * spacing,
            (1.0 + ABOUT) * spacing,
            "m",
            "of the lattices: what a coarse one costs",
        ),
        *_table_ii(),
        Range("damping", 0.5, 2.0, "", "times the scene's, of the tuned lattices"),
        Range(
            "poisson_ratio",
            SPRING_POISSON_RATIO,
            NEARLY_INCOMPRESSIBLE,
            "",
            "of the tuned lattices, from the paper's springs to a liver's, by the volume term",
            log=False,
        ),
        Range("force", 0.25, 1.0, "", "times the scene's, which is near what small strain allows"),
        Range("across", -0.5, 0.5, "", "of the tool, in its radii", log=False, group=PLACE),
        Range("along", -0.5, 0.5, "", "of the tool, in its radii", log=False, group=PLACE),
        Range("radius", 0.7, 1.4, "", "of the tool, times the scene's"),
        Range("support", 0.1, 10.0, "", "stiffness of the support, times the scene's"),
    )


def _table_ii() -> tuple[Range, ...]:
    """The constants of Table II within the rounding of their printed digits."""
    rounding = {"k1": 0.1, "k2": 0.5, "x_c": 0.25, "gamma_0": 0.25, "gamma_1": 0.5}
    return tuple(
        Range(
            name,
            1.0 - share,
            1.0 + share,
            "",
            "times Table II's, within the rounding of its last digit that is not zero",
            log=False,
            group=TABLE_II,
        )
        for name, share in rounding.items()
    )


def draws(shares: Floats, of: Sequence[Unknown]) -> list[OrganDraw]:
    """Draws at shares (n, unknowns) of their ranges."""
    columns: Sequence[list[Any]] = [one.at(shares[:, i]) for i, one in enumerate(of)]
    return [OrganDraw(*values) for values in zip(*columns, strict=True)]


def as_drawn(scene: Scene, draw: OrganDraw) -> Scene:
    """The scene of a draw, except for the tool's place and what depends on the patient."""
    table, damping = scene.basafa, scene.damping
    return replace(
        scene,
        support=replace(scene.support, stiffness=draw.support * scene.support.stiffness),
        tool=replace(
            scene.tool,
            force=draw.force * scene.tool.force,
            radius=draw.radius * scene.tool.radius,
        ),
        tissue=replace(
            scene.tissue, youngs_modulus=draw.stiffness, poisson_ratio=draw.poisson_ratio
        ),
        lattice=replace(scene.lattice, spacing=draw.spacing),
        damping=replace(
            damping,
            ratio=draw.damping * damping.ratio,
            mass=draw.damping * damping.mass,
            stiffness=draw.damping * damping.stiffness,
            reference_spacing=draw.reference_spacing,
        ),
        basafa=replace(
            table,
            k1=draw.k1 * table.k1,
            k2=draw.k2 * table.k2,
            x_c=draw.x_c * table.x_c,
            gamma_0=draw.gamma_0 * table.gamma_0,
            gamma_1=draw.gamma_1 * table.gamma_1,
        ),
    )
