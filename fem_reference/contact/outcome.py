"""Results of a motion with contact beside its trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_reference.superposition import CurveChange

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ContactOutcome:
    """Contact of a body at `vertices` vertices, in a subspace of `vectors`, None for all unknowns.

    `truncation`: relative change of the curves by the last quarter of the `vectors`;
    `force_truncation` (tools,): that of the tool forces. `penetration` [m]: largest penetration at
    a sample. `at_rest` [m] (n,): static displacement with the tools at the peak, and `nodal_forces`
    [N] (tools, n): their nodal forces there. `not_converged_at` [s]: time at which the contact
    iteration did not converge, None if it always did.
    """

    vertices: int
    vectors: int | None
    truncation: CurveChange | None
    force_truncation: Floats
    penetration: float
    at_rest: Floats
    nodal_forces: Floats
    not_converged_at: float | None = None
