"""Heterogeneous tissue with contrasts of up to a million."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material, of_tissue
from msm.calibration import lame
from msm.lattice import CellLattice, composed
from msm.model import critical_time_step
from msm.springs import connect
from msm.statics import static_displacement
from study.known import pressed
from study.known.case import Case, Family
from study.known.finding import Finding, beside, value
from study.known.pressed import COLUMN, FOUNDATION, PRESSURE
from study.known.stability.bodies import Make, lattice_of
from study.known.stability.growth import measured_limit
from study.known.verification.moduli import oedometric
from study.organ.block import block_mesh
from study.problem.heterogeneous import Ellipsoid, HeterogeneousTissue, Region
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

CELL, SOLVED, AGREEMENT = 0.02, 1e-8, 5e-3
STEPS = 1000
"""Number of steps that shows growth just above the limit."""
CONTRASTS = (1e-3, 1e-1, 1e1, 1e3, 1e6)
FAMILY = Family("inclusions", __name__, quick=True)


def cases() -> Iterator[Case]:
    """Layers in series in closed form, the critical step beside a stiff or soft ball, a refusal."""
    for contrast in CONTRASTS:
        for element in ("p1", "p2"):
            settings = {"element": element, "contrast": contrast}
            title = f"a layer of {contrast:g} times the modulus: {element}"
            yield FAMILY.case(title, "layer", settings, SOLVED)
        title = f"a layer of {contrast:g} times the modulus: lattice"
        yield FAMILY.case(title, "lattice_layer", {"contrast": contrast}, SOLVED)
    for contrast in (1e-3, 1e3):
        for nu in (None, 0.45):
            term = "springs" if nu is None else f"nu {nu:g}"
            title = f"critical step beside a ball of {contrast:g} times the modulus, {term}"
            yield FAMILY.case(title, "step", {"contrast": contrast, "nu": nu}, AGREEMENT)
    yield FAMILY.case("a ball below nu 1/4 beside a volume term", "too_low", {}, "poisson_ratio")


@dataclass(frozen=True)
class Layer:
    """The region between two heights [m]."""

    lower: float
    upper: float

    def __call__(self, points: Floats) -> Floats:
        """Distance [m], negative inside."""
        middle, half = 0.5 * (self.lower + self.upper), 0.5 * (self.upper - self.lower)
        return np.asarray(np.abs(points[..., 2] - middle) - half)

    def shortened(self, heights: Floats, around: float, contrast: float) -> Floats:
        """Settlement of points at heights [m] above the base, under `PRESSURE`.

        `around` [Pa]: oedometric modulus of the surrounding tissue.
        """
        within = np.clip(heights, self.lower, self.upper) - self.lower
        return np.asarray(PRESSURE / around * (heights - within + within / contrast))


MIDDLE = Layer(CELL, 2.0 * CELL)


def varied(contrast: float, tissue: Tissue) -> HeterogeneousTissue:
    """A layer in the middle of the column, with `contrast` times the modulus."""
    modulus = contrast * tissue.youngs_modulus
    layer = Region(name="layer", distance=MIDDLE, youngs_modulus=modulus)
    return HeterogeneousTissue(
        youngs_modulus=tissue.youngs_modulus,
        poisson_ratio=tissue.poisson_ratio,
        regions=(layer,),
    )


def layer(element: str, contrast: float) -> Finding:
    """A column of finite elements between smooth walls: each layer strains by its own modulus."""
    tissue = Tissue(poisson_ratio=0.3)
    body = pressed.column(block_mesh(COLUMN, CELL), varied(contrast, tissue), element)
    sunk = MIDDLE.shortened(body.points[:, 2], oedometric(tissue), contrast)
    exact = np.zeros_like(body.points)
    exact[:, 2] = -PRESSURE / FOUNDATION - sunk
    return beside(exact, pressed.between_walls(body))


def lattice_layer(contrast: float) -> Finding:
    """Displacement of a layered lattice of springs with nu 1/4, on a fixed base."""
    make = Make(counts=(2, 2, 3), spacing=CELL)
    body, material = _lattice(make, varied(contrast, Tissue(youngs_modulus=make.youngs_modulus)))
    nodes = body.lattice.nodes
    fixed = np.zeros(nodes.shape, dtype=np.bool_)
    fixed[:, :2], fixed[nodes[:, 2] < 1e-9, 2] = True, True
    top = nodes[:, 2] > 3.0 * CELL - 1e-9
    area = np.bincount(body.lattice.cells[:, [1, 3, 5, 7]].ravel(), minlength=len(nodes)) / 4.0
    load = np.zeros_like(nodes)
    load[top, 2] = -PRESSURE * CELL**2 * area[top]
    held = replace(body, load=load, fixed=fixed)
    first, mu = lame(make.youngs_modulus, 0.25)
    exact = np.zeros_like(nodes)
    exact[:, 2] = -MIDDLE.shortened(nodes[:, 2], first + 2.0 * mu, contrast)
    return beside(exact, static_displacement(held, material))


def step(contrast: float, nu: float | None) -> Finding:
    """The critical step at rest, predicted, and measured by the onset of growth."""
    make = Make(poisson_ratio=nu)
    body, material = _lattice(make, _with_ball(make, contrast, nu))
    predicted = critical_time_step(body, material, "velocity-verlet")
    found = measured_limit(body, material, "velocity-verlet", predicted, STEPS)
    return value(predicted, found)


def too_low() -> Finding:
    """A Poisson ratio for which the volume term would be negative."""
    make = Make(poisson_ratio=0.45)
    _lattice(make, _with_ball(make, 10.0, 0.1))
    return Finding("value")


def _with_ball(make: Make, contrast: float, nu: float | None) -> HeterogeneousTissue:
    middle = 0.5 * make.spacing * np.array(make.counts)
    shape = Ellipsoid(middle, np.full(3, 0.9 * make.spacing))
    modulus = contrast * make.youngs_modulus
    ball = Region(name="ball", distance=shape, youngs_modulus=modulus, poisson_ratio=nu)
    return HeterogeneousTissue(youngs_modulus=make.youngs_modulus, regions=(ball,))


def _lattice(make: Make, tissue: HeterogeneousTissue) -> tuple[Assembly, Material]:
    """A block of whole cells of the tissue; `make` gives the springs of the surrounding tissue."""
    plain, material = lattice_of(make)
    assert isinstance(plain.lattice, CellLattice)  # noqa: S101 - as it is made of whole cells
    body = replace(
        plain,
        composition=composed(plain.lattice, tissue),
        connect=partial(connect, plain.lattice, 0.0, 0.0),
    )
    return of_tissue(body, material, make.youngs_modulus)
