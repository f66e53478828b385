"""Linear springs, eq. (1) of the fuzzy-tuned model."""

from __future__ import annotations

from typing import NamedTuple

from msm.laws.force_law import ForceLaw


class Hooke(NamedTuple):
    """Linear spring: `k` [N/m] is k_ref."""

    k: float


def _tension(law: Hooke, strain: float) -> float:
    return law.k * strain


def _stiffness(law: Hooke, strain: float) -> float:  # noqa: ARG001 - the same at any strain
    return law.k


def _largest_stiffness(law: Hooke) -> float:
    return law.k


HOOKE = ForceLaw(
    Hooke, _tension, _stiffness, _largest_stiffness, Hooke, linear=True, branchless=True
)
