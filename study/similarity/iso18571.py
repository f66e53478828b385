r"""Overall rating of ISO/TS 18571 for two time histories on the same uniform time axis.

With reference r, candidate c, N samples and every part in [0, 1]:

    R   = 0.4 Z + 0.2 (E_P + E_M + E_S)
    Z   : mean over samples of clip((b - |c - r|) / (b - a), 0, 1)^2,
          corridors a = 0.05 max|r| and b = 0.5 max|r|
    E_P = 1 - |m| / (0.2 N), held at 0; the shift m, |m| <= 0.2 N, of c against r maximises
          their Pearson correlation over the samples that overlap; of equals the smallest, late
          before early
    E_M = 1 - e / 0.5, held at 0; e = sum|c_w - r_w| / sum|r_w| after that shift
          and a time warping with squared differences in a window of 10 % of the length
    E_S = 1 - e / 2.0, held at 0; e = sum|c' - r'| / sum|r'| of the shifted curves' slopes,
          averaged over nine samples (seven, five, three, one towards the ends)

The exponents are those of the specification's defaults: 2 for the corridor, 1 elsewhere. The
formulas were taken from objective_rating_metrics 1.3 (TU Graz), which the tests use as the oracle;
the specification itself was not read.

Limits. It is meant for non-ambiguous signals, hence never for a phase-plane loop. It is made for
10 kHz signals: the slope window counts samples and the shift is a whole number of them, so the
rating itself moves with the sampling: of a damped oscillator's displacement with every second
sample by 0.025 from 51 samples and by 6e-4 to 3e-3 from 101 to 401, of its velocity by 0.061 and by
3e-3 to 0.013. `study.similarity.uncertainty` measures it for every score and every difference; one
below it ranks nothing. It orders good matches, not bad ones: a candidate that never moves keeps its
phase and half its slope, and so rates 0.3 to 0.45 rather than 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.similarity.time_warping import warping_path

Floats = NDArray[np.float64]

INNER_CORRIDOR, OUTER_CORRIDOR = 0.05, 0.5  # of max|r|
SHIFT_LIMIT = 0.2  # of the length
WARPING_WINDOW = 0.1  # of the length
MAGNITUDE_LIMIT, SLOPE_LIMIT = 0.5, 2.0
# Correlations closer than this count as equal, or rounding would shift a ramp against itself.
CORRELATION_TIE = 1e-9


@dataclass(frozen=True)
class Rating:
    """The four parts of the rating, each in [0, 1]."""

    corridor: float
    phase: float
    magnitude: float
    slope: float

    @property
    def overall(self) -> float:
        """R, the weighted sum, in [0, 1]."""
        return 0.4 * self.corridor + 0.2 * (self.phase + self.magnitude + self.slope)


def rate(candidate: Floats, reference: Floats) -> Rating:
    """Rating of a time history, shape (samples,), against a reference that is not constant."""
    shift = best_shift(candidate, reference)
    c, r = _overlap(candidate, reference, shift)
    return Rating(
        corridor=_corridor(candidate, reference),
        phase=_part(abs(shift), len(reference), SHIFT_LIMIT),
        magnitude=_magnitude(c, r),
        slope=_part(*_sums(_smoothed_slope(c), _smoothed_slope(r)), SLOPE_LIMIT),
    )


def overall_rating(candidate: Floats, reference: Floats) -> float:
    """R of `rate`, the score of this measure."""
    return rate(candidate, reference).overall


def best_shift(candidate: Floats, reference: Floats) -> int:
    """Samples by which the candidate lags (positive) or leads the reference."""
    best, best_correlation = 0, _correlation(candidate, reference)
    for m in range(1, math.floor(SHIFT_LIMIT * len(reference)) + 1):
        for shift in (m, -m):
            correlation = _correlation(*_overlap(candidate, reference, shift))
            if correlation > best_correlation + CORRELATION_TIE:
                best, best_correlation = shift, correlation
    return best


def _overlap(candidate: Floats, reference: Floats, shift: int) -> tuple[Floats, Floats]:
    count = len(reference) - abs(shift)
    late, early = max(shift, 0), max(-shift, 0)
    return candidate[late : late + count], reference[early : early + count]


def _correlation(x: Floats, y: Floats) -> float:
    """Pearson's coefficient; -inf, so never the best, where either curve is constant."""
    dx, dy = x - x.mean(), y - y.mean()
    xx, yy = dx @ dx, dy @ dy
    # The mean of a constant is exact to 1e-15 of its size.
    if xx <= 1e-24 * (x @ x) or yy <= 1e-24 * (y @ y):
        return -math.inf
    return float(dx @ dy / math.sqrt(xx * yy))


def _corridor(candidate: Floats, reference: Floats) -> float:
    error = np.abs(candidate - reference) / np.max(np.abs(reference))
    inside = (OUTER_CORRIDOR - error) / (OUTER_CORRIDOR - INNER_CORRIDOR)
    return float(np.mean(np.clip(inside, 0.0, 1.0) ** 2))


def _magnitude(candidate: Floats, reference: Floats) -> float:
    half_width = math.ceil(WARPING_WINDOW * len(reference)) - 1
    i, j = warping_path(candidate, reference, half_width)
    return _part(*_sums(candidate[i], reference[j]), MAGNITUDE_LIMIT)


def _smoothed_slope(signal: Floats) -> Floats:
    """Difference per sample, averaged over nine neighbours or as many as fit symmetrically."""
    slope = np.gradient(signal)
    index = np.arange(len(slope))
    half = np.minimum(4, np.minimum(index, index[::-1]))
    total = np.concatenate(([0.0], np.cumsum(slope)))
    return np.asarray((total[index + half + 1] - total[index - half]) / (2 * half + 1))


def _sums(candidate: Floats, reference: Floats) -> tuple[float, float]:
    return float(np.abs(candidate - reference).sum()), float(np.abs(reference).sum())


def _part(error: float, size: float, limit: float) -> float:
    """1 - (error / size) / limit, held at 0; also defined for a size of zero."""
    if error == 0.0:
        return 1.0
    return 0.0 if error >= limit * size else 1.0 - error / (limit * size)
