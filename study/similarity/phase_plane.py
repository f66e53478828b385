"""Distances between phase-plane curves: velocity over displacement, shape (samples, 2).

Axes. Each is divided by the largest absolute value the reference reaches on it, so metres and
metres per second become comparable and a distance of 1 is the reference's own reach.

Resampling. Both curves become 200 points at equal steps of arc length on those axes. Equal steps of
time would pile the points up where the organ rests and leave gaps where it moves, where discrete
distances are then wrong; and timing is already scored by the time histories, whereas the phase
plane is about shape. The price: noise adds length, so measured curves must be smoothed first.

Why not those of similaritymeasures 1.5. Its Frechet distance is the same number, bit by bit, which
the tests hold this one to, but it takes ten times as long and scores NaN as a perfect match. Its
area joins points of equal rank by quadrilaterals, which where the curves cross is not the area
between them. Its PCM weights each gap by the arc length reached so far instead of the segment's
own, so the result is proportional to the number of points, and it divides by zero for a curve that
does not move.

The area is blind to how far along a shared path two curves get.

The scores keep a floor: a candidate that never moves is about one reach away, hence near 1/2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from study.similarity.enclosed_area import area_between

Floats = NDArray[np.float64]

POINT_COUNT = 200
OFFSET_COUNT = 101


def frechet_distance(candidate: Floats, reference: Floats) -> float:
    """Discrete Frechet distance: the shortest leash for two walkers who never turn back."""
    from scipy.spatial.distance import cdist

    return leash(cdist(*comparable(candidate, reference)))


def leash(gaps: Floats) -> float:
    """The least longest gap on a walk from the first to the last of both curves.

    `gaps` (n, m): between point i of one and point j of the other. Each step goes on along one
    curve or both. After Eiter and Mannila 1994 (TR CD-TR 94/64, TU Wien), all pairs of equal i + j
    at once, as none of them needs another.
    """
    n, m = gaps.shape
    at = np.full((n + m - 1, n), np.inf)  # indexed by i + j and i; infinite where j is out of range
    at[np.add.outer(np.arange(n), np.arange(m)), np.arange(n)[:, None]] = gaps
    before, last = np.full((2, n + 1), np.inf)  # the two previous diagonals, indexed by i + 1
    before[0] = -np.inf  # the walk starts without a gap
    for gap in at:
        here = np.full(n + 1, np.inf)
        here[1:] = np.maximum(gap, np.minimum(np.minimum(last[:-1], last[1:]), before[:-1]))
        before, last = last, here
    return float(last[-1])


def area_distance(candidate: Floats, reference: Floats) -> float:
    """Area between the curves on normalised axes, their starts and their ends joined."""
    return area_between(*comparable(candidate, reference))


def pcm_distance(candidate: Floats, reference: Floats) -> float:
    """Partial curve mapping: mean gap after sliding the shorter curve along the longer one.

    The shorter curve is laid on a stretch of the longer of the same arc length; its ends are held
    over the rest, and the best offset counts. Plain partial mapping leaves the rest out, which
    scores a point that never moves as perfect. Hysteresis loops are the measure's origin (Witowski
    and Stander 2012, doi 10.2514/6.2012-5580; the form here is our own, the paper was not read).
    """
    shorter, longer = sorted(comparable(candidate, reference), key=lambda c: arc_length(c)[-1])
    own, other = arc_length(shorter), arc_length(longer)
    offsets = np.linspace(0.0, other[-1] - own[-1], OFFSET_COUNT)
    position = other - offsets[:, None]  # along the shorter curve; np.interp extends its ends
    gaps = np.hypot(*(np.interp(position, own, shorter[:, k]) - longer[:, k] for k in (0, 1)))
    return float(np.trapezoid(gaps, other, axis=1).min() / other[-1])


def frechet_score(candidate: Floats, reference: Floats) -> float:
    """1 / (1 + d): 1 for no distance, 1/2 for a gap of one reach of the reference."""
    return 1.0 / (1.0 + frechet_distance(candidate, reference))


def area_score(candidate: Floats, reference: Floats) -> float:
    """1 / (1 + d): 1 for no area between, 1/2 for the area of one reach by one reach."""
    return 1.0 / (1.0 + area_distance(candidate, reference))


def pcm_score(candidate: Floats, reference: Floats) -> float:
    """1 / (1 + d): 1 for no distance, 1/2 for a mean gap of one reach of the reference."""
    return 1.0 / (1.0 + pcm_distance(candidate, reference))


def comparable(candidate: Floats, reference: Floats) -> tuple[Floats, Floats]:
    """Both curves on normalised axes and resampled, shape (200, 2) each."""
    reach = np.max(np.abs(reference), axis=0)
    return resample(candidate / reach), resample(reference / reach)


def resample(curve: Floats) -> Floats:
    """Points at equal steps of arc length, shape (200, 2), ends included."""
    length = arc_length(curve)
    steps = np.linspace(0.0, length[-1], POINT_COUNT)
    return np.column_stack([np.interp(steps, length, axis) for axis in curve.T])


def arc_length(curve: Floats) -> Floats:
    """Length travelled up to each point, shape (samples,), starting at 0."""
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))))
