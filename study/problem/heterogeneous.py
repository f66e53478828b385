"""Heterogeneous tissue, and the composition of the cells of any mesh.

A model of an organ has one surrounding tissue, whose stiffness may be an estimate, and regions with
a stiffness of their own. The composition of a cell is given by volume fractions, so that no volume
of a region is lost or gained beyond the sampling error of cells that its surface cuts. A cut cell
has the mean compliance of its parts, bulk and shear (Reuss's mean): tissue and region are in series
across the cut. Compared with the mean stiffness (Voigt's), which enlarges a stiff region by half a
cell, this leaves a fifth of the error of a ball; soft regions gain nothing by it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import volumes
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Points = Callable[[slice], Floats]
"""Points [m] (c, k, 3) of a range of cells, equally many in each, with equal weights."""

CHUNK = 2048
"""Number of cells that are sampled at once: 512 points of each take 25 MB."""
SAMPLES = 512
"""Points per tetrahedron: the volume of a cut is found to 1 % of the cell on average."""
OUTLINE = 200
"""Points on a region's surface that figures have."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Region:
    """A part of the organ with a Young's modulus [Pa] of its own.

    `distance`: function of points [m] (..., 3) that is negative inside, and whose magnitude never
    exceeds the distance from the surface. Poisson ratio and density are those of the surrounding
    tissue unless given. `outline` [m] (OUTLINE, 3): points of its surface, for figures.
    """

    name: str
    distance: Callable[[Floats], Floats]
    youngs_modulus: float
    poisson_ratio: float | None = None
    density: float | None = None
    outline: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def ratio(self, around: float) -> float:
        """Poisson ratio of the region: its own, or that of the tissue around if it has none."""
        return around if self.poisson_ratio is None else self.poisson_ratio


@dataclass(frozen=True, kw_only=True, eq=False)
class HeterogeneousTissue(Tissue):
    """Tissue with regions; where several overlap, the last of them counts.

    `mapped`: Young's modulus [Pa] (...) at points (..., 3) outside all regions, NaN where the map
    has no value and the surrounding tissue applies.
    """

    regions: tuple[Region, ...] = ()
    mapped: Callable[[Floats], Floats] | None = None

    @property
    def highest_poisson_ratio(self) -> float:
        """The largest of all its parts."""
        return max(self.poisson_ratio, *(r.ratio(self.poisson_ratio) for r in self.regions), 0.0)


class Moduli(NamedTuple):
    """Lame's lambda and mu [Pa] of cells, each (c,)."""

    lame: Floats
    shear: Floats


@dataclass(frozen=True, eq=False)
class Composition:
    """Volume fractions of cells: `share` (c, regions) of each region of a tissue.

    `mapped_share` (c,): fraction where a map gives the modulus, and `mapped` (c,): mean of its
    inverse there times that fraction [1/Pa]. The remainder is the surrounding tissue.
    """

    tissue: HeterogeneousTissue
    share: Floats
    mapped_share: Floats
    mapped: Floats

    @property
    def around(self) -> Floats:
        """Volume fraction (c,) of the surrounding tissue."""
        return np.asarray(1.0 - self.share.sum(axis=1) - self.mapped_share)

    def moduli(self, around: Tissue, *, one_ratio: bool = False) -> Moduli:
        """Moduli of the mean compliance of each cell, for a surrounding tissue.

        `one_ratio`: all regions have the Poisson ratio of the surrounding tissue.
        """
        nu = around.poisson_ratio
        own = self.around / around.youngs_modulus + self.mapped
        of_volume, of_shape = own * (3.0 - 6.0 * nu), own * (2.0 + 2.0 * nu)
        for share, region in zip(self.share.T, self.tissue.regions, strict=True):
            ratio, part = nu if one_ratio else region.ratio(nu), share / region.youngs_modulus
            of_volume += part * (3.0 - 6.0 * ratio)
            of_shape += part * (2.0 + 2.0 * ratio)
        return Moduli(1.0 / of_volume - 2.0 / 3.0 / of_shape, 1.0 / of_shape)

    def density(self, around: float) -> Floats:
        """Mean density [kg/m^3] (c,) of each cell, for that of the surrounding tissue."""
        found = np.full(len(self.share), around)
        for share, region in zip(self.share.T, self.tissue.regions, strict=True):
            if region.density is not None:
                found += (region.density - around) * share
        return found


def composition(tissue: Tissue | None, count: int, points: Points) -> Composition | None:
    """Composition of `count` cells; None for homogeneous tissue."""
    if not isinstance(tissue, HeterogeneousTissue):
        return None
    share = np.zeros((count, len(tissue.regions)))
    mapped_share, mapped = np.zeros(count), np.zeros(count)
    for cells in _chunks(count):
        places = points(cells)
        part = _parts(tissue.regions, places)
        for number in range(len(tissue.regions)):
            share[cells, number] = (part == number).mean(axis=1)
        if tissue.mapped is not None:
            modulus = tissue.mapped(places)
            known = np.isfinite(modulus) & (part < 0)
            mapped_share[cells] = known.mean(axis=1)
            mapped[cells] = np.where(known, 1.0 / modulus, 0.0).mean(axis=1)
    return Composition(tissue, share, mapped_share, mapped)


def _chunks(count: int) -> Iterator[slice]:
    return (slice(start, min(start + CHUNK, count)) for start in range(0, count, CHUNK))


def _parts(regions: tuple[Region, ...], points: Floats) -> NDArray[np.int16]:
    """Number of the region that each point (c, k, 3) lies in, -1 outside all."""
    centre = points.mean(axis=1)
    reach = np.linalg.norm(points - centre[:, None], axis=2).max(axis=1)
    part = np.full(points.shape[:2], -1, dtype=np.int16)
    for number, region in enumerate(regions):
        distance = region.distance(centre)
        part[distance < -reach] = number
        cut = np.flatnonzero(np.abs(distance) <= reach)
        inside = np.zeros(points.shape[:2], dtype=np.bool_)
        inside[cut] = region.distance(points[cut]) < 0.0
        part[inside] = number
    return part


def of_tetrahedra(mesh: TetrahedralMesh, tissue: Tissue | None) -> Composition | None:
    """Composition of each tetrahedron; None for homogeneous tissue."""
    if not isinstance(tissue, HeterogeneousTissue):  # avoids loading SciPy's statistics
        return None
    corners, inside = mesh.points[mesh.tetrahedra], barycentric_samples()
    return composition(tissue, len(corners), lambda cells: inside @ corners[cells])


def mapped_mean(size: Floats, made: Composition) -> float:
    """Harmonic mean of Young's modulus [Pa] where a map gives it, by the volumes (m,) of cells."""
    return float(size @ made.mapped_share) / max(float(size @ made.mapped), 1e-300)


def notes_of(mesh: TetrahedralMesh, tissue: Tissue) -> tuple[str, ...]:
    """Notes on the volume share of heterogeneous tissue."""
    made = of_tetrahedra(mesh, tissue)
    if made is None or not isinstance(tissue, HeterogeneousTissue):
        return ()
    size = volumes(mesh)
    found = [
        f"{region.name}: {1e6 * float(size @ share):.3g} ml of "
        f"{region.youngs_modulus / 1e3:.3g} kPa"
        for region, share in zip(tissue.regions, made.share.T, strict=True)
    ]
    if tissue.mapped is not None:
        part = float(size @ made.mapped_share) / float(size.sum())
        found.append(
            f"tissue.stiffness_map: {100 * part:.0f} % of the organ, Young's modulus "
            f"{mapped_mean(size, made) / 1e3:.3g} kPa in the mean (harmonic); the rest is as around"
        )
    return tuple(found)


@cache
def barycentric_samples() -> Floats:
    """Barycentric coordinates (k, 4) of points that fill a tetrahedron evenly.

    The gaps between three sorted coordinates of a Sobol sequence, which fill the tetrahedron as the
    sequence fills a cube.
    """
    from scipy.stats import qmc

    sobol = np.sort(qmc.Sobol(3, scramble=False).random(SAMPLES) + 0.5 / SAMPLES, axis=1)
    return np.diff(np.concatenate([np.zeros((SAMPLES, 1)), sobol, np.ones((SAMPLES, 1))], 1))


# Shapes ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """A lower bound on the distance from an ellipsoid of semi-axes [m] (3,) along x, y and z."""

    centre: Floats
    semi_axes: Floats

    def __call__(self, points: Floats) -> Floats:
        """Exact for a ball: the scaled radius has no gradient above 1 over the least semi-axis."""
        scaled = np.linalg.norm((points - self.centre) / self.semi_axes, axis=-1)
        return np.asarray((scaled - 1.0) * self.semi_axes.min())

    @property
    def outline(self) -> Floats:
        """Points [m] (OUTLINE, 3) of its surface, spread by the golden angle."""
        height = np.linspace(-1.0, 1.0, OUTLINE)
        turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(OUTLINE)
        across = np.sqrt(1.0 - height**2)
        ball = np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)
        return np.asarray(self.centre + self.semi_axes * ball)
