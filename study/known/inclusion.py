"""A ball in an infinite body under uniform remote strain, in closed form.

The strain inside is uniform, and the body around moves as if the ball had expanded by a uniform
eigenstrain: Eshelby (1957), Proc. R. Soc. A 241:376. For a ball, the spherical part of the remote
strain is divided by 1 + a (K'/K - 1), the deviator by 1 + b (mu'/mu - 1), with a = (1 + nu) / (3 (1
- nu)), b = 2 (4 - 5 nu) / (15 (1 - nu)), and K' and mu' those of the ball. The displacement around
follows from the harmonic and the biharmonic potential of the ball: Mura (1987), Micromechanics of
Defects in Solids, section 11.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.problem.heterogeneous import Ellipsoid, HeterogeneousTissue, Region
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

IDENTITY = np.eye(3)
STRAIN = np.array([[0.01, 0.004, 0.0], [0.004, -0.006, 0.002], [0.0, 0.002, 0.003]])
"""A remote strain with all components."""


@dataclass(frozen=True, eq=False)
class BallInclusion:
    """A ball of a `radius` [m] about the origin, of tissue `inside` another, `around` it.

    `strain` (3, 3): the remote strain.
    """

    radius: float
    inside: Tissue
    around: Tissue
    strain: Floats

    @classmethod
    def stiffer(cls, radius: float, times: float, around: Tissue, strain: Floats) -> BallInclusion:
        """A ball with `times` the modulus of the surrounding tissue, and its Poisson ratio."""
        inside = replace(around, youngs_modulus=times * around.youngs_modulus)
        return cls(radius, inside, around, strain)

    @property
    def tissue(self) -> HeterogeneousTissue:
        """The body with the ball in it."""
        distance = Ellipsoid(np.zeros(3), np.full(3, self.radius))
        ball = Region(
            name="ball",
            distance=distance,
            youngs_modulus=self.inside.youngs_modulus,
            poisson_ratio=self.inside.poisson_ratio,
        )
        around = self.around
        return HeterogeneousTissue(
            youngs_modulus=around.youngs_modulus,
            poisson_ratio=around.poisson_ratio,
            density=around.density,
            regions=(ball,),
        )

    def off(self, found: Floats, points: Floats) -> float:
        """Error of a displacement [m] (n, 3) at points, over the displacement that the ball adds.

        Over the whole displacement if the ball adds none.
        """
        exact = self.displacement(points)
        added = exact - points @ self.strain
        whole = exact if self.inside == self.around else added
        return float(np.linalg.norm(found - exact) / np.linalg.norm(whole))

    @property
    def inner_strain(self) -> Floats:
        """Strain (3, 3) of the ball."""
        nu = self.around.poisson_ratio
        of_volume = (1.0 + nu) / (3.0 * (1.0 - nu))
        of_shape = 2.0 * (4.0 - 5.0 * nu) / (15.0 * (1.0 - nu))
        bulk, shear = self._contrast
        mean = np.trace(self.strain) / 3.0 * IDENTITY
        shape = self.strain - mean
        return np.asarray(
            mean / (1.0 + of_volume * (bulk - 1.0)) + shape / (1.0 + of_shape * (shear - 1.0))
        )

    def displacement(self, points: Floats) -> Floats:
        """Displacement [m] (n, 3) at points [m] (n, 3), with the ball's centre at rest."""
        r = np.linalg.norm(points, axis=1)
        inside = r <= self.radius
        outside = np.where(inside, self.radius, r)[:, None]
        around = points @ self.strain + self._beyond(points, outside)
        return np.asarray(np.where(inside[:, None], points @ self.inner_strain, around))

    def _beyond(self, x: Floats, r: Floats) -> Floats:
        """Displacement that the ball adds around it, from the eigenstrain e of the ball.

        8 pi (1 - nu) u_i = psi,ijk e_jk - 2 nu e_kk phi,i - 4 (1 - nu) e_ik phi,k.
        """
        nu, e, a = self.around.poisson_ratio, self._eigenstrain, self.radius
        ex, trace = x @ e, np.trace(e)
        along = (x * ex).sum(axis=1, keepdims=True)
        # phi = V / r and psi = V (r + a^2 / (5 r)), of the volume V.
        of_r = -(trace * x + 2.0 * ex) / r**3 + 3.0 * along * x / r**5
        of_inverse = 3.0 * (trace * x + 2.0 * ex) / r**5 - 15.0 * along * x / r**7
        potential = of_r + a**2 / 5.0 * of_inverse
        found = potential + 2.0 * nu * trace * x / r**3 + 4.0 * (1.0 - nu) * ex / r**3
        return np.asarray(4.0 / 3.0 * np.pi * a**3 / (8.0 * np.pi * (1.0 - nu)) * found)

    @property
    def _eigenstrain(self) -> Floats:
        """Eigenstrain (3, 3) of the equivalent homogeneous inclusion."""
        inner = self.inner_strain
        bulk, shear = (1.0 - one for one in self._contrast)
        mean = np.trace(inner) / 3.0 * IDENTITY
        return np.asarray(bulk * mean + shear * (inner - mean))

    @property
    def _contrast(self) -> tuple[float, float]:
        """Bulk and shear modulus of the ball over those of the surrounding tissue."""
        inside, around = _moduli(self.inside), _moduli(self.around)
        return inside[0] / around[0], inside[1] / around[1]


def _moduli(tissue: Tissue) -> tuple[float, float]:
    """Bulk and shear modulus [Pa]."""
    E, nu = tissue.youngs_modulus, tissue.poisson_ratio
    return E / (3.0 * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
