"""What is known of a motion under tools beside its trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_reference.superposition import CurveChange

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ContactOutcome:
    """Of a body and `vertices` under tools; reduced to a subspace of `vectors`, or None of all.

    `truncation`: of the curves by the last quarter of the `vectors`, and `force_truncation` of the
    tools' forces (tools,) alike; `penetration` [m]: how deep any point was inside a tool at a
    sample; `at_rest` [m] (n,): displacement where the tools are at the peak, without motion, and
    `pushes` [N] (tools, n): the nodal forces there; `unsettled` [s]: when forces were not found.
    """

    vertices: int
    vectors: int | None
    truncation: CurveChange | None
    force_truncation: Floats
    penetration: float
    at_rest: Floats
    pushes: Floats
    unsettled: float | None = None
