"""Draws summed up: who is nearest, by how much, whether Table III comes out, what moves scores."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from study.robustness.paper import TABLE_III
from study.robustness.patient import SYSTEMS
from study.robustness.rows import Difference, Index, Nearest, TableThree
from study.robustness.unknowns import UNKNOWNS, groups
from study.similarity.batch import COLUMNS

Floats = NDArray[np.float64]

ROUNDING = 0.5e-4
"""Largest rounding error of the four decimals that the paper prints."""
TIE = 1e-6
"""Scores closer than this are equal: a hundred times the accuracy of the motions."""
BOOTSTRAPS = 200


@dataclass(frozen=True)
class Draws:
    """Stiffness [Pa] (size, groups + 2, 3) and scores (.., systems, measures) over the design.

    A score is NaN where a motion diverged. `groups`, `systems` and `columns` name the axes.
    """

    estimates: Floats
    scores: Floats
    groups: tuple[str, ...] = tuple(groups(UNKNOWNS))
    systems: tuple[str, ...] = SYSTEMS
    columns: tuple[tuple[str, str], ...] = COLUMNS

    def independent(self) -> Floats:
        """Scores (draws, systems, measures) at points A and B, without those not finite."""
        scores = self.scores[:, :2].reshape(-1, *self.scores.shape[2:])
        return scores[np.isfinite(scores).all(axis=(1, 2))]

    @property
    def lost(self) -> float:
        """Share of the draws at points A and B in which a motion diverged."""
        return 1.0 - len(self.independent()) / (2 * len(self.scores))


def nearest(found: Draws) -> Iterator[Nearest]:
    """How often each system is nearest to the benchmark, by measure."""
    scores = found.independent()
    for m, column in enumerate(found.columns):
        ordered = np.sort(scores[:, :, m], axis=1)
        tied = ordered[:, -1] - ordered[:, -2] < TIE
        best = scores[:, :, m].argmax(axis=1)
        for s, system in enumerate(found.systems):
            count = int(((best == s) & ~tied).sum())
            low, high = wilson(count, len(scores))
            yield Nearest(
                *column, system, count / len(scores), low, high, float(tied.mean()), len(scores)
            )


def wilson(count: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share."""
    from scipy.stats import binomtest

    interval = binomtest(count, of).proportion_ci(0.95, "wilson")
    return float(interval.low), float(interval.high)


def differences(found: Draws) -> Iterator[Difference]:
    """Distribution of the score differences of every two systems, by measure.

    What has to do with the paper is NaN for one that it does not have.
    """
    scores, systems = found.independent(), found.systems
    for m, column in enumerate(found.columns):
        for a, b in combinations(range(len(systems)), 2):
            change = scores[:, a, m] - scores[:, b, m]
            printed = _printed(systems[a]) - _printed(systems[b])
            quantiles = np.percentile(change, (5, 25, 50, 75, 95))
            within, same = _as_printed(change, printed)
            p05, p25, p50, p75, p95 = map(float, quantiles)
            pair = (*column, systems[a], systems[b])
            yield Difference(*pair, p05, p25, p50, p75, p95, printed, within, same)


def _printed(system: str) -> float:
    return TABLE_III.get(system, np.nan)


def _as_printed(change: Floats, printed: float) -> tuple[float, float]:
    """Share of differences no larger than a printed one, and of those of its sign."""
    if np.isnan(printed):
        return np.nan, np.nan
    return (
        float((np.abs(change) <= abs(printed)).mean()),
        float((np.sign(change) == np.sign(printed)).mean()),
    )


def table_three(found: Draws) -> Iterator[TableThree]:
    """How near any draw comes to the paper's three scores, by measure."""
    printed = np.array([TABLE_III[system] for system in SYSTEMS])
    scores = found.scores.reshape(-1, *found.scores.shape[2:])
    order = list(np.argsort(printed))
    for m, column in enumerate(found.columns):
        away = np.abs(scores[:, :, m] - printed).max(axis=1)
        away = np.where(np.isfinite(away), away, np.inf)
        close = away <= 5e-3
        in_order = (np.diff(scores[close][:, order, m], axis=1) > 0.0).all(axis=1)
        yield TableThree(
            *column,
            float(away.min()),
            int(away.argmin()),
            int((away <= ROUNDING).sum()),
            int((away <= 5e-4).sum()),
            int(close.sum()),
            int(in_order.sum()),
            int(np.isfinite(away).sum()),
        )


def indices(found: Draws) -> Iterator[Index]:
    """Sobol's indices of each system's score, and of each lead, on every group, by measure.

    Rows of the design with a motion that did not finish are left out.
    """
    kept = found.scores[np.isfinite(found.scores).all(axis=(1, 2, 3))]
    for m, column in enumerate(found.columns):
        for name, values in _outputs(kept[..., m], found.systems):
            for unknown, numbers in zip(found.groups, sobol(values), strict=True):
                yield Index(*column, name, unknown, *map(float, numbers))


def sobol(values: Floats) -> Floats:
    """First-order and total index, each with the ends of its 95 % interval, (unknowns, 6).

    Of an output (size, unknowns + 2) over the design. Intervals are percentiles of seeded
    bootstraps over its rows, which SciPy's `sobol_indices` cannot seed; without, they are equal.
    """
    rows = np.random.default_rng(0).integers(len(values), size=(BOOTSTRAPS, len(values)))
    first, total = _estimated(values)
    again = np.stack([_estimated(values[chosen]) for chosen in rows], axis=-1)
    (f_low, t_low), (f_high, t_high) = np.percentile(again, (2.5, 97.5), axis=-1)
    return np.stack([first, f_low, f_high, total, t_low, t_high], axis=1)


def _estimated(values: Floats) -> tuple[Floats, Floats]:
    """Indices by Saltelli et al. 2010, doi 10.1016/j.cpc.2009.09.018, table 2 (b) and (f)."""
    centred = values - values[:, :2].mean()
    a, b, mixed = centred[:, :1], centred[:, 1:2], centred[:, 2:]
    variance = centred[:, :2].var() or 1.0  # an output that never changes
    first = (b * (mixed - a)).mean(axis=0) / variance
    return first, 0.5 * ((a - mixed) ** 2).mean(axis=0) / variance


def _outputs(scores: Floats, systems: tuple[str, ...]) -> Iterator[tuple[str, Floats]]:
    """Each system's score, then the lead of one system over another, (size, groups + 2) each."""
    for s, system in enumerate(systems):
        yield system, scores[..., s]
    for a, b in combinations(range(len(systems)), 2):
        yield f"{systems[a]} - {systems[b]}", scores[..., a] - scores[..., b]
