"""Predicted errors of a model by what it neglects, from coarse solutions at rest.

Everything here is an estimate, not a bound. Errors that coarse solutions at rest do not show, such
as the time-step error of a motion, are stated by the run itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fem_reference.error_estimate import ASSUMED_ORDER
from study.plan.look import GradedLook, LatticeLook, Look, Rest
from study.similarity.fields import norm

Floats = NDArray[np.float64]

GEOMETRY, MESH, SPACING, COMPARED, REMAINDER, TRUNCATION, STEPS = (
    "large displacements left out",
    "elements' mesh",
    "lattice spacing",
    "elements compared with",
    "large displacements on a coarse lattice",
    "subspace",
    "time steps",
)
NONLINEAR_ORDER = 1.5
"""Order of the nonlinear part of a lattice, observed at 20, 10 and 5 mm on the liver."""
CAUTION = 2.0
"""Factor of safety on estimates from two coarse meshes or lattices, as in a run's own errors."""
SUBSPACE = 1e-3
"""Displacement error of this number of Ritz vectors, which the run estimates itself."""


@dataclass(frozen=True)
class Part:
    """A relative error by a cause."""

    cause: str
    error: float


@dataclass(frozen=True)
class Prediction:
    """The neglected effects; their errors are added, since they may have the same sign."""

    parts: tuple[Part, ...]

    @property
    def error(self) -> float:
        """Sum of all parts."""
        return math.fsum(part.error for part in self.parts)


@dataclass(frozen=True)
class Measure:
    """Where an error is evaluated: at control points (p,), and over the organ if `volumes`."""

    probes: tuple[int, ...]
    volumes: Floats | None

    def __call__(self, apart: Rest, whole: Rest) -> float:
        """The largest relative norm of a difference."""
        chosen = list(self.probes)
        size = np.linalg.norm(whole.probes[chosen], axis=1)
        found = (np.linalg.norm(apart.probes[chosen], axis=1) / size).tolist()
        if self.volumes is not None:
            found.append(norm(apart.field, self.volumes) / norm(whole.field, self.volumes))
        return float(max(found))


@dataclass(frozen=True)
class Foresight:
    """Predicted errors of models on meshes and lattices that were not solved."""

    look: Look
    measure: Measure

    @cached_property
    def whole(self) -> Rest:
        """The best known displacement: the finest elements plus the nonlinear effect.

        The latter from the graded lattice with the largest fine region, else from the finest
        uniform one.
        """
        linear, lattices = self.look.elements[-1].rest, [self.look.lattices[-1]]
        if self.look.graded:
            lattices.insert(0, self.look.graded[-1].lattice)
        known = [part for part in map(_nonlinear, lattices) if part is not None]
        return linear.plus(known[0]) if known else linear

    @cached_property
    def geometry(self) -> float:
        """Error of a linear model; infinite where a lattice has no rest.

        The nonlinear effect on the finest lattice, plus its change from the one before, as it still
        grows.
        """
        parts = [_nonlinear(one) for one in self.look.lattices[-2:]]
        if any(part is None for part in parts):
            return math.inf
        before, last = (part for part in parts if part is not None)
        return self._size(last) + self._size(last.plus(before, -1.0))

    def remainder(self, spacing: float) -> float:
        """Error of the nonlinear effect on a lattice of a spacing [m].

        From the coarsest and the finest lattice, with the observed order.
        """
        first, last = self.look.lattices[0], self.look.lattices[-1]
        parts = _nonlinear(first), _nonlinear(last)
        if parts[0] is None or parts[1] is None:
            return math.inf
        gain = (first.spacing**NONLINEAR_ORDER - last.spacing**NONLINEAR_ORDER) ** -1.0
        change = self._size(parts[1].plus(parts[0], -1.0))
        return float(CAUTION * change * gain * spacing**NONLINEAR_ORDER)

    def graded_remainder(self, one: GradedLook) -> float:
        """Error of the nonlinear effect on a graded lattice.

        Due to its cells, against the lattice with the finest and widest region, and to the finest
        cells of the latter.
        """
        own, far = map(_nonlinear, (one.lattice, self.look.graded[-1].lattice))
        if own is None or far is None:
            return math.inf
        return CAUTION * (self._size(own.plus(far, -1.0)) + self._by_finest_cells)

    def graded(self, one: GradedLook) -> float:
        """Error of a graded lattice, against the best known displacement, plus its own error."""
        apart = self._size(self._of(one.lattice).plus(self.whole, -1.0))
        return apart + self._by_finest_cells

    @cached_property
    def _by_finest_cells(self) -> float:
        """Error of the nonlinear effect due to the size of the finest cells.

        From the graded lattice with the largest fine region and the finest uniform one, with the
        observed order.
        """
        fine, coarse = self.look.graded[-1].lattice, self.look.lattices[-1]
        parts = _nonlinear(fine), _nonlinear(coarse)
        if parts[0] is None or parts[1] is None:
            return math.inf
        gain = (coarse.spacing / fine.spacing) ** NONLINEAR_ORDER - 1.0
        return float(self._size(parts[0].plus(parts[1], -1.0)) / gain)

    def mesh(self, size: float) -> float:
        """Discretisation error of elements of a size [m]; infinite with a single mesh.

        By Richardson extrapolation from the two finest meshes, with the order of curved organs and
        edges of supports.
        """
        if len(self.look.elements) < 2:
            return math.inf
        before, last = self.look.elements[-2:]
        gain = (before.size / last.size) ** ASSUMED_ORDER - 1.0
        change = self._size(last.rest.plus(before.rest, -1.0))
        return float(CAUTION * change / gain * (size / last.size) ** ASSUMED_ORDER)

    def spacing(self, spacing: float) -> float:
        """Error of a lattice of a spacing [m], by a fit of C h^p to those solved."""
        seen = self.look.lattices
        errors = [self._size(self._of(one).plus(self.whole, -1.0)) for one in seen]
        sizes = np.log([one.spacing for one in seen])
        order, level = np.polyfit(sizes, np.log(errors), 1)
        return float(np.exp(level + order * np.log(spacing)))

    def _of(self, one: LatticeLook) -> Rest:
        return one.linear if one.nonlinear is None else one.nonlinear

    def _size(self, apart: Rest) -> float:
        return self.measure(apart, self.whole)


def _nonlinear(one: LatticeLook) -> Rest | None:
    """The effect of large displacements on a lattice."""
    return None if one.nonlinear is None else one.nonlinear.plus(one.linear, -1.0)
