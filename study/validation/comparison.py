"""A model's prediction beside a measurement, each with its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fem_reference.error_estimate import discretisation_error

COVERAGE = 2.0
"""Coverage factor: standard uncertainties within which a difference counts as explained."""
ORDER = 2.0
"""Largest accepted order of convergence: edges of held faces are singular."""
Verdict = Literal["agrees", "differs", "not resolved", "fitted"]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A quantity in its `unit`: measured with its standard uncertainty, and predicted by a model.

    `numerical`: the model's own error by its meshes or spacings, nan for a single one. `coverage`:
    the coverage factor, 1 where the residual of many readings is compared with their noise.
    `modulus`: the Young's modulus [Pa] used, nan where it has no effect. `fitted`: what was fitted
    to the measurement, and `calibrated` whether this quantity is what it was fitted to, so that the
    difference is no prediction. `note`: why a number is missing, or a further remark.
    """

    problem: str
    case: str
    faces: str
    model: str
    quantity: str
    unit: str
    measured: float
    uncertainty: float
    found: float
    numerical: float
    coverage: float = COVERAGE
    modulus: float = math.nan
    fitted: str = ""
    calibrated: bool = False
    note: str = ""

    @property
    def difference(self) -> float:
        """Model minus measurement."""
        return self.found - self.measured

    @property
    def verdict(self) -> Verdict | None:
        """Whether the prediction agrees with the measurement; None without an uncertainty.

        It agrees if the difference is at most the expanded uncertainty plus the numerical error.
        Where it does and the numerical error is the larger of the two, nothing is resolved.
        """
        if not self.answered:
            return None
        if self.calibrated:
            return "fitted"
        if not math.isfinite(self.uncertainty):
            return None
        expanded = self.coverage * self.uncertainty
        own = 0.0 if math.isnan(self.numerical) else self.numerical
        if abs(self.difference) > expanded + own:
            return "differs"
        return "agrees" if own <= expanded else "not resolved"

    @property
    def answered(self) -> bool:
        """Whether there is a number at all."""
        return math.isfinite(self.found)


def own_error(values: Sequence[float], sizes: Sequence[float]) -> float:
    """Error of the last of values on meshes coarse to fine, in their unit; nan if unknown."""
    if len(values) < 2 or not np.isfinite(values).all() or values[-1] == 0.0:
        return math.nan
    used = slice(-3, None)
    fields = [np.array([[value, 0.0, 0.0]]) for value in values[used]]
    return abs(values[-1]) * discretisation_error(fields, sizes[used], ORDER).error
