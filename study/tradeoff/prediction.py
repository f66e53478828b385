"""Predicted errors of lattices: fitted over the spacing, or measured under moved tools."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.models.spacing_error import force_differences
from study.run.scene_problem import SceneProblem
from study.similarity.fields import relative_l2
from study.sweep.canonical import restored
from study.sweep.runner import Outcome
from study.tradeoff.comparison import Comparison
from study.tradeoff.contenders import Configuration
from study.tradeoff.errors import errors
from study.tradeoff.observation import Observed
from study.tradeoff.selection import SINGLE

LEVEL = 0.95
"""Share of fits whose spread includes the error, by Student's t for their number of points."""
FEWEST = 3


@dataclass(frozen=True)
class Prediction:
    """A predicted relative error, and how far the measured one may deviate either way."""

    error: float
    bar: float

    @property
    def upper(self) -> float:
        """The upper end of the prediction."""
        return self.error + self.bar

    def with_rounding(self, error: float) -> Prediction:
        """The prediction with an additional rounding error."""
        return replace(self, bar=self.bar + error)

    def contains(self, measured: float) -> bool:
        """Whether a measured error lies within the prediction."""
        return abs(measured - self.error) <= self.bar


@dataclass(frozen=True)
class Fit:
    """An error C h^p of the spacing h, its spread as a share, and the reference's own error."""

    constant: float
    order: float
    spread: float
    reference_error: float

    def prediction(self, spacing: float) -> Prediction:
        """The predicted error at a spacing [m]."""
        error = self.constant * spacing**self.order
        return Prediction(error, self.reference_error + self.spread * error)


def predictions(
    comparison: Comparison,
    tried: Sequence[Configuration],
    outcomes: Sequence[Outcome],
    every: Sequence[float],
) -> dict[float, Prediction]:
    """The prediction for each spacing [m], in double precision."""
    spacings = [float(one.settings["spacing"]) for one in tried]
    if comparison.reference is None:
        return dict(_measured_predictions(comparison, tried, outcomes))
    known = comparison.reference
    found = [errors(one, known, comparison.given) for one in outcomes[: len(tried)]]
    kept = [(h, e.judged) for h, e in zip(spacings, found, strict=True) if e.judged is not None]
    own = known.field_error if known.force_bar is None else known.force_bar
    curve = fitted([h for h, _ in kept], [error for _, error in kept], own)
    return {h: curve.prediction(h) for h in every}


def _measured_predictions(
    comparison: Comparison, tried: Sequence[Configuration], outcomes: Sequence[Outcome]
) -> Iterator[tuple[float, Prediction]]:
    """The measured error of each run, plus the own error of the finest lattice."""
    for one, outcome in zip(tried, outcomes, strict=False):
        known = comparison.truth(one)
        alike = replace(known, force_errors=np.zeros_like(known.force_errors))
        found = errors(outcome, alike, comparison.given)
        if found.status in {"resolved", "not resolved"}:
            prediction = Prediction(found.force or 0.0, known.force_bar or 0.0)
            yield float(one.settings["spacing"]), prediction


def fitted(spacings: Sequence[float], found: Sequence[float], reference_error: float) -> Fit:
    """Least squares in logarithms. ValueError if too few errors are resolved."""
    from scipy.special import stdtrit

    if len(found) < FEWEST:
        raise ValueError(
            f"only {len(found)} of the spacings have an error above the reference's own "
            f"{100 * reference_error:.2g} %; enlarge lattice.spacing or refine "
            "reference.element_size"
        )
    order, level = np.polyfit(np.log(spacings), np.log(found), 1)
    left, free = np.log(found) - np.polyval([order, level], np.log(spacings)), len(found) - 2
    deviation = np.sqrt((left**2).sum() / free)
    spread = np.expm1(stdtrit(free, 0.5 * (1.0 + LEVEL)) * deviation)
    return Fit(float(np.exp(level)), float(order), float(spread), reference_error)


def added_by_single(outcomes: Sequence[Outcome], given: SceneProblem) -> dict[str, float]:
    """Error that single precision adds to the field or the force, from runs in both precisions.

    Relative L2; empty where such a run is missing or did not finish.
    """
    seen = [restored(Observed, one.value) for one in outcomes[:2] if one.value is not None]
    whole = [one for one in seen if one.field is not None]
    if len(whole) < 2:
        return {}
    double, single = whole
    if given.problem.rigid_tools:
        shape = len(given.problem.observation.times), len(given.problem.rigid_tools), 3
        of = [np.reshape(one.force or [], shape) for one in (single, double)]
        return {SINGLE: float(force_differences(given.problem, *of)[0].max())}
    in_single, in_double = (np.reshape(one.field or [], (-1, 3)) for one in (single, double))
    return {SINGLE: relative_l2(in_single, in_double, given.problem.volume_rule.weights)}
