"""The tissue of the organ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from study.annotation.quantity import Quantity


@dataclass(frozen=True, kw_only=True)
class Tissue:
    """Isotropic elastic tissue, that of the reference; default values are those of a liver.

    Fuzzy estimates of stiffness are compared with its modulus.
    """

    youngs_modulus: Annotated[float, Quantity("Pa", 100.0, 1e6)] = 9.5e3
    poisson_ratio: Annotated[float, Quantity("", 0.0, 0.49999)] = 0.45
    density: Annotated[float, Quantity("kg/m^3", 500.0, 2000.0)] = 1054.0

    @property
    def highest_poisson_ratio(self) -> float:
        """Largest Poisson ratio in the organ; homogeneous tissue has only one."""
        return self.poisson_ratio
