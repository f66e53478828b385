"""How much the scores of a pair of motions depend on how the motion was observed.

Scores are computed again without each block of the motion, from every second sample, over shorter
windows, and on other axes of the phase plane. The same variations are applied to every pair, so
that two models can be compared block by block: the difference of their scores is then known far
better than either score.

Interval. It is the delete-block jackknife (Kuensch 1989, doi 10.1214/aos/1176347265): the motion is
cut into equal blocks and a score computed without each in turn; half the interval is Student's t
times the resulting standard error. Five and ten blocks are tried and the wider interval kept,
because the correlation length of deviations is unknown. A bootstrap would join blocks in random
order, and a loop, slope or time warping across those joints is meaningless; deleting a block leaves
one joint. The interval shows how evenly the score is spread over the motion: how far it would move
had another stretch of the same kind been recorded. A push and its release are not a stationary
process, so it is a 95 % yardstick and not a probability, and it does not include the errors of the
models. Scores that are clipped at 0 or 1 have none.

Curves of more than LONGEST samples are thinned first, to limit the cost.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.problem.response import Motion
from study.similarity import batch
from study.similarity.score import MEASURES, curve

Floats = NDArray[np.float64]
Pair = tuple[Motion, Motion]
"""Candidate and reference."""

BLOCK_COUNTS = (5, 10)
LEVEL = 0.95
LONGEST = 401
CUTS = ((0.1, 0.0), (0.0, 0.1), (0.2, 0.0), (0.1, 0.1), (0.0, 0.2))
"""Shares of the samples that the windows omit at the start and at the end."""
WHOLE_RANGE = 1.0
"""Stated where a score is not defined on part of the motion: the full range of a score."""


@dataclass(frozen=True)
class Variants:
    """Scores of a pair computed in other ways, or differences of such scores, for m measures.

    `whole` (m,); `blocks` (k, m) without each of k blocks, for every entry of BLOCK_COUNTS;
    `halved` (m,) from every second sample; `windows` (5, m) over those of CUTS; `axes` (2, m) with
    the phase plane scaled by the larger range of both curves, and by the reference's root mean
    square. NaN where the reference does not move in the part that is used.
    """

    whole: Floats
    blocks: tuple[Floats, ...]
    halved: Floats
    windows: Floats
    axes: Floats

    def __sub__(self, other: Variants) -> Variants:
        """Differences, each with the same blocks, samples, window and axes for both."""
        return Variants(
            self.whole - other.whole,
            tuple(a - b for a, b in zip(self.blocks, other.blocks, strict=True)),
            self.halved - other.halved,
            self.windows - other.windows,
            self.axes - other.axes,
        )


class Spread(NamedTuple):
    """The uncertainty of scores, or of differences of two, (m,) each, in units of the score.

    `interval`: half the 95 % block interval; `resampled`: change with every second sample;
    `window`: range over windows of at least 80 % of the samples; `axes`: largest change with other
    axes of the phase plane. Where a part is not defined, an interval is infinite and another part
    1.
    """

    interval: Floats
    resampled: Floats
    window: Floats
    axes: Floats


def variants(candidate: Motion, reference: Motion) -> Variants:
    """All variants of the scores of a pair that `study.similarity.motion.check_pair` accepts."""
    every = -(-(len(reference.time) - 1) // (LONGEST - 1))
    pair = _of((candidate, reference), slice(None, None, every))
    n, whole = len(pair[0].time), _scores(pair)
    return Variants(
        whole,
        tuple(_table(pair, _without_block(n, count)) for count in BLOCK_COUNTS),
        _scores(_of(pair, slice(None, None, 2))),
        _table(pair, (slice(round(a * n), n - round(b * n)) for a, b in CUTS)),
        _on_other_axes(pair, whole),
    )


def spread(found: Variants) -> Spread:
    """The parts of the uncertainty of scores or of their differences."""
    windows = np.vstack([found.whole, found.windows])
    return Spread(
        np.max([_half_interval(table) for table in found.blocks], axis=0),
        _known(np.abs(found.halved - found.whole)),
        _known(np.ptp(windows, axis=0)),
        _known(np.abs(found.axes - found.whole).max(axis=0)),
    )


def _half_interval(without: Floats) -> Floats:
    """Student's t times the jackknife's standard error, of scores (k, m) without each block."""
    from scipy.special import stdtrit

    count = len(without)
    apart = without - without.mean(axis=0)
    error = np.sqrt((count - 1) / count * (apart**2).sum(axis=0))
    half = stdtrit(count - 1, 0.5 * (1.0 + LEVEL)) * error
    return np.where(np.isfinite(half), half, np.inf)


def _known(change: Floats) -> Floats:
    return np.where(np.isfinite(change), change, WHOLE_RANGE)


def _without_block(n: int, count: int) -> Iterable[NDArray[np.int64]]:
    """Indices of the remaining samples without each block."""
    index = np.arange(n)
    return (np.setdiff1d(index, block) for block in np.array_split(index, min(count, n)))


def _of(pair: Pair, part: NDArray[np.int64] | slice) -> Pair:
    """A pair of motions at some of its samples."""
    own, true = (
        Motion(*(np.ascontiguousarray(x[part]) for x in (m.time, m.displacement, m.velocity)))
        for m in pair
    )
    return own, true


def _table(pair: Pair, parts: Iterable[NDArray[np.int64] | slice]) -> Floats:
    return np.array([_scores(_of(pair, part)) for part in parts])


def _scores(pair: Pair) -> Floats:
    """Scores (m,) in the order of MEASURES; NaN where the reference is at rest."""
    own, true = pair
    if min(np.ptp(true.displacement), np.ptp(true.velocity)) <= 0.0:
        return np.full(sum(map(len, MEASURES.values())), np.nan)
    compiled = batch.scores(own.displacement, own.velocity, true.displacement, true.velocity)
    known = dict(zip(batch.COLUMNS, compiled, strict=True))
    found = (
        known[column]
        if (column := (kind, measure.name)) in known
        else measure.score(curve(own, kind), curve(true, kind))
        for kind, measures in MEASURES.items()
        for measure in measures
    )
    return np.array(list(found))


def _on_other_axes(pair: Pair, whole: Floats) -> Floats:
    """Scores (2, m) on other axes; those of other curves than the phase plane are unchanged."""
    own, true = pair
    both = ((own.displacement, true.displacement), (own.velocity, true.velocity))
    reach = [max(np.abs(a).max(), np.abs(b).max()) for a, b in both]
    root_mean_square = [np.sqrt((b**2).mean()) for _, b in both]
    names = [(kind, measure.name) for kind, some in MEASURES.items() for measure in some]
    found = np.tile(whole, (2, 1))
    for row, (x, y) in zip(found, (reach, root_mean_square), strict=True):
        arrays = (own.displacement, own.velocity, true.displacement, true.velocity)
        scores = batch.plane_scores(*arrays, float(x), float(y))
        row[[names.index(column) for column in batch.COLUMNS[-3:]]] = scores
    return found
