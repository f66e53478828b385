"""How well scores are known: intervals that cover, paired differences, ranks that are shared."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from reports.ranking import Lead, leads, rank_table, times_first
from study.problem.response import Motion
from study.results.tables import ScoreDifference
from study.similarity import batch, uncertainty
from study.similarity.ranks import rank_ranges
from study.similarity.uncertainty import spread, variants
from tests.report_samples import results_of
from tests.test_similarity_verification import CASES, oscillator

RELATIVE_L2 = CASES.index(("displacement", "relative-l2"))
ISO = CASES.index(("displacement", "iso-18571"))


def pair(samples=201, stiffness=1.2):
    return oscillator(stiffness, damping=0.4, samples=samples), oscillator(
        damping=0.4, samples=samples
    )


# --- intervals ----------------------------------------------------------------------------------


def noisy(rng, samples=400, share=0.4):
    """A wave and the same with noise that lasts about five samples, stationary both."""
    t = np.arange(samples) / 10.0
    noise = np.empty(samples)
    noise[0] = rng.normal()
    for k, shock in enumerate(rng.normal(size=samples - 1), 1):
        noise[k] = 0.8 * noise[k - 1] + 0.6 * shock
    wave = np.sin(2.0 * np.pi * t / 4.0)
    return wave + share * noise, wave


def test_the_interval_covers_the_score_of_an_endless_motion():
    """Of a stationary error, with a known score: 1 - 0.4 / (1 / sqrt 2).

    Nominally in 95 % of motions. Of 200 a binomial share lies above 90 % in all but 0.1 % of cases,
    and an interval that covers every one of them would be idle.
    """
    true = 1.0 - 0.4 * np.sqrt(2.0)
    rng = np.random.default_rng(3)
    hits, halves, found = 0, [], []
    for _ in range(200):
        own, wave = noisy(rng)
        tables = [
            np.array(
                [
                    [batch.relative_l2(np.delete(own, block), np.delete(wave, block))]
                    for block in np.array_split(np.arange(len(own)), count)
                ]
            )
            for count in uncertainty.BLOCK_COUNTS
        ]
        half = max(uncertainty._half_interval(table)[0] for table in tables)
        score = batch.relative_l2(own, wave)
        hits += abs(score - true) <= half
        halves.append(half)
        found.append(score)
    assert 0.9 <= hits / 200 < 1.0
    # 95 % of normal scores lie within 1.96 deviations; t of 4 to 9 degrees is 2.3 to 2.8.
    assert 1.0 < np.mean(halves) / (1.96 * np.std(found)) < 2.0


@pytest.mark.parametrize("count", uncertainty.BLOCK_COUNTS)
def test_the_interval_of_a_mean_is_students(count):
    """Means without each value in turn: their jackknife is the standard error of the mean."""
    values = np.random.default_rng(count).normal(size=count)
    without = (values.sum() - values) / (count - 1)
    exact = stats.t.interval(0.95, count - 1, values.mean(), stats.sem(values))
    half = uncertainty._half_interval(without[:, None])
    assert half == pytest.approx(0.5 * np.ptp(exact), rel=1e-12)


def test_the_interval_narrows_with_the_length_of_the_motion():
    rng = np.random.default_rng(7)
    halves = []
    for samples in (100, 400):
        some = []
        for _ in range(15):
            u, wave = noisy(rng, samples)
            t = np.arange(samples) / 10.0
            found = variants(Motion(t, u, np.gradient(u, t)), Motion(t, wave, np.gradient(wave, t)))
            some.append(spread(found).interval[RELATIVE_L2])
        halves.append(np.mean(some))
    assert halves[0] / halves[1] == pytest.approx(2.0, rel=0.35)  # by the root of four


def test_a_motion_against_itself_depends_on_nothing():
    own, _ = pair()
    for part in spread(variants(own, own)):
        assert part == pytest.approx(np.zeros(7), abs=1e-12)


def test_a_constant_share_is_known_exactly_and_a_single_bump_is_not():
    """Scaled by 0.7 the relative L2 is 0.7 in every block; the error of a bump is in one."""
    _, true = pair()
    scaled = Motion(true.time, 0.7 * true.displacement, 0.7 * true.velocity)
    assert spread(variants(scaled, true)).interval[RELATIVE_L2] == pytest.approx(0.0, abs=1e-12)
    bump = 0.3 * np.exp(-(((true.time - 5.0) / 0.3) ** 2))
    bumped = Motion(true.time, true.displacement + bump, true.velocity)
    assert spread(variants(bumped, true)).interval[RELATIVE_L2] > 0.05


def test_a_motion_that_is_over_within_one_block_has_no_interval():
    t = np.linspace(0.0, 1.0, 101)
    step = np.where(t < 0.05, t, 0.05)
    true = Motion(t, step, np.where(t < 0.05, 1.0, 0.0))
    own = Motion(t, 0.8 * step, 0.8 * true.velocity)
    found = spread(variants(own, true))
    assert np.isinf(found.interval).all()
    assert found.window == pytest.approx(np.ones(7))


def test_the_error_of_a_difference_is_paired():
    """Two models that deviate alike differ by far less than either score is known to."""
    one, true = pair(stiffness=1.2)
    other, _ = pair(stiffness=1.21)
    first, second = variants(one, true), variants(other, true)
    apart = spread(first - second).interval
    alone = np.hypot(spread(first).interval, spread(second).interval)
    assert (apart < 0.25 * alone).all()
    for part in spread(first - first):
        assert part == pytest.approx(np.zeros(7))


# --- sampling, window, axes ---------------------------------------------------------------------

# By every second sample of n: L2 and ISO lose 1 / n, resampled loops its square; see the
# derivation in test_similarity_verification, of which these are the limits for n / 2 samples.
BY_SAMPLING = {
    "relative-l2": lambda n: 0.1 / n,
    "iso-18571": lambda n: 6.0 / n,
    "frechet": lambda n: 25.0 / n**2,
    "area": lambda n: 25.0 / n**2,
    "pcm": lambda n: 25.0 / n**2,
}


def test_scores_converge_with_the_sampling_and_the_change_says_so():
    found = {n: variants(*pair(n)) for n in (101, 201, 401)}
    for n, one in found.items():
        change = spread(one).resampled
        for column, (_, measure) in enumerate(CASES):
            assert change[column] < BY_SAMPLING[measure](n), (n, measure)
    for coarse, fine in pairwise(found):
        # Every second of 201 samples are the 101.
        assert found[fine].halved == pytest.approx(found[coarse].whole, abs=1e-12)
        wanted = np.abs(found[fine].whole - found[coarse].whole)
        assert spread(found[fine]).resampled == pytest.approx(wanted, abs=1e-12)
    # Fourfold samples, at most half the change, where it is no rounding; ISO's shift jumps.
    smooth = [k for k, (_, measure) in enumerate(CASES) if measure != "iso-18571"]
    assert (
        spread(found[401]).resampled[smooth] <= 0.5 * spread(found[101]).resampled[smooth]
    ).all()


def test_the_rating_of_iso_18571_depends_on_the_sampling_more_than_other_measures():
    """Its slopes are averaged over nine samples and its shift is a whole number of them."""
    changes = np.array([spread(variants(*pair(n))).resampled for n in (101, 201, 401)])
    assert 1e-3 < changes[:, ISO].max() < 5e-3
    assert changes[:, ISO].max() > 5.0 * changes[:, RELATIVE_L2].max()


def test_other_axes_move_the_phase_plane_alone():
    """A candidate of twice the reference: by its own reach every distance is half as large."""
    _, true = pair()
    twice = Motion(true.time, 2.0 * true.displacement, 2.0 * true.velocity)
    found = variants(twice, true)
    assert found.axes[:, :4] == pytest.approx(np.tile(found.whole[:4], (2, 1)))
    frechet = CASES.index(("phase-plane", "frechet"))
    distance = 1.0 / found.whole[frechet] - 1.0
    assert 1.0 / found.axes[0, frechet] - 1.0 == pytest.approx(0.5 * distance, rel=1e-9)
    assert spread(found).axes[frechet] == np.abs(found.axes - found.whole)[:, frechet].max()


def test_axes_that_lower_a_score_count_as_those_that_raise_it():
    """A root mean square is below the reach, by which half of the reference is no longer."""
    _, true = pair()
    half = Motion(true.time, 0.5 * true.displacement, 0.5 * true.velocity)
    found = variants(half, true)
    by_reach, by_mean_square = found.axes[:, 4:]
    assert by_reach == pytest.approx(found.whole[4:], abs=1e-12)
    assert (by_mean_square < found.whole[4:] - 0.01).all()
    assert spread(found).axes[4:] == pytest.approx(found.whole[4:] - by_mean_square)


def test_the_unit_of_both_motions_moves_no_variant():
    own, true = pair()
    found = variants(own, true)
    other = variants(*(Motion(m.time, 1e3 * m.displacement, 1e-2 * m.velocity) for m in pair()))
    for name in ("whole", "halved", "windows", "axes"):
        assert getattr(other, name) == pytest.approx(getattr(found, name), abs=1e-9), name


def test_a_window_that_leaves_out_the_error_is_seen():
    _, true = pair()
    late = np.where(true.time > 8.5, 0.5, 0.0)
    own = Motion(true.time, true.displacement + late, true.velocity)
    found = variants(own, true)
    seen = np.append(found.windows[:, RELATIVE_L2], found.whole[RELATIVE_L2])
    assert seen.max() == 1.0  # of the window that ends at 8
    assert found.whole[RELATIVE_L2] < 0.85
    assert spread(found).window[RELATIVE_L2] == pytest.approx(1.0 - seen.min(), abs=1e-12)


def test_long_curves_are_thinned():
    thick, thin = (variants(*pair(n)) for n in (4001, 401))
    assert thick.whole == pytest.approx(thin.whole, abs=1e-9)


# --- ranks --------------------------------------------------------------------------------------


def ranks_of(scores, error):
    better = np.subtract.outer(scores, scores) > error
    return rank_ranges(better)


def test_scores_closer_than_their_error_share_a_rank():
    assert ranks_of([0.9, 0.8, 0.7], 0.05) == [(1, 1), (2, 2), (3, 3)]
    assert ranks_of([0.9, 0.88, 0.7], 0.05) == [(1, 2), (1, 2), (3, 3)]
    assert ranks_of([0.5, 0.5], 0.0) == [(1, 2), (1, 2)]
    # A chain of near ties: the ends differ, and each shares a rank with the middle.
    assert ranks_of([0.90, 0.86, 0.82], 0.05) == [(1, 2), (1, 3), (2, 3)]


def test_what_is_better_than_the_better_is_better():
    """With errors of their own, two neighbours may differ where the ends are not known to."""
    better = np.zeros((4, 4), bool)
    better[0, 1] = better[1, 2] = better[2, 3] = True
    assert rank_ranges(better) == [(1, 1), (2, 2), (3, 3), (4, 4)]


@pytest.mark.parametrize("seed", range(20))
def test_any_two_that_are_not_known_to_differ_share_a_rank(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    values = np.round(rng.random(n), 1)
    errors = rng.random((n, n)) * 0.5
    better = np.subtract.outer(values, values) > np.maximum(errors, errors.T)
    ranks = rank_ranges(better)
    for i in range(n):
        for j in range(n):
            if better[i, j]:
                assert ranks[i][0] < ranks[j][0]
                assert ranks[i][1] < ranks[j][1]
    shared = [(a, b) for a in ranks for b in ranks if a[0] <= b[1] and b[0] <= a[1]]
    assert len(shared) >= n
    assert min(ranks)[0] == 1
    assert max(b for _, b in ranks) == n


def test_a_first_rank_is_alone_or_shared():
    ranks = {("a", "x"): (1, 1), ("a", "y"): (1, 3), ("b", "x"): (2, 2)}
    assert times_first(ranks) == (1, 1)


def test_ranks_are_of_their_reference_and_control_point():
    results = results_of()
    numbered = tuple(
        row._replace(first_rank=k, last_rank=k + 100) for k, row in enumerate(results.score_errors)
    )
    results = replace(results, score_errors=numbered)
    for reference, probe in (("fem", "tool"), ("fem", "far"), ("basafa", "tool")):
        own = [row for row in numbered if (row.reference, row.probe) == (reference, probe)]
        table = rank_table(results, reference, probe)
        assert sum(map(len, table.values())) == len(own) > 0
        for row in own:
            ranks = table[row.model][row.curve, row.measure]
            assert ranks == (row.first_rank, row.last_rank)


def difference(**changes):
    row = ScoreDifference("a", "b", "r", "p", "c", "m", 0.1, 0.05, 0.15, 0.01, 0.5, 0.5, 0.02)
    return row._replace(**changes)


def test_a_difference_is_resolved_beyond_each_of_its_errors():
    assert difference().is_resolved is True
    assert difference(difference=-0.1, low=-0.15, high=-0.05).is_resolved is True
    assert difference(low=-0.01).is_resolved is False
    assert difference(resampled=0.1).is_resolved is False
    assert difference(numerical=0.1).is_resolved is False
    assert difference(numerical=None).is_resolved is None
    assert difference(numerical=None, low=-0.01).is_resolved is False


LEAD = Lead("fem", ("c", "m"), "a", "b", 0.1, 0.05, 0.15, 0.01, 0.02, 0.03, True)


@pytest.mark.parametrize(
    ("changes", "resolved"),
    [
        ({}, True),
        ({"low": 0.0}, False),
        ({"resampled": 0.1}, False),
        ({"error": 0.1}, False),
        ({"is_whole": False}, None),
        ({"is_whole": False, "error": 0.1}, False),
        ({"is_whole": False, "error": None}, None),
        ({"is_whole": False, "error": None, "low": 0.0}, False),
        ({"error": None}, None),  # of curves of which none has an error to be known
    ],
)
def test_a_lead_is_resolved_beyond_each_of_its_errors(changes, resolved):
    assert replace(LEAD, **changes).is_resolved is resolved


def test_a_lead_no_larger_than_its_range_over_views_depends_on_them():
    assert not LEAD.hangs_on_view
    assert replace(LEAD, observed=0.1).hangs_on_view


@pytest.mark.parametrize("changes", [{"low": -0.2, "high": 0.2}, {"resampled": 0.3}])
def test_a_lead_within_its_sampling_error_is_not_resolved(changes):
    """Its numerical error alone would let it pass."""
    results = results_of()
    assert next(leads(results, "fem", "tool")).is_resolved is True
    rows = tuple(row._replace(**changes) for row in results.score_differences)
    results = replace(results, score_differences=rows)
    assert next(leads(results, "fem", "tool")).is_resolved is False


# --- a run --------------------------------------------------------------------------------------


def test_the_tables_of_a_run_go_together(paper_results):
    keys = [row[:5] for row in paper_results.scores]
    assert [row[:5] for row in paper_results.score_errors] == keys
    assert len(paper_results.score_differences) == 6 * 7  # of four models
    for row, score in zip(paper_results.score_errors, paper_results.scores, strict=True):
        assert 0.0 <= row.low <= score.score <= row.high <= 1.0
        assert 1 <= row.first_rank <= row.last_rank <= 4
    iso = [row.score for row in paper_results.scores if row.measure == "iso-18571"]
    assert [row.overall for row in paper_results.ratings] == pytest.approx(iso, abs=1e-12)
    assert {row.first_rank for row in paper_results.score_errors} >= {1, 2}


def test_ranks_of_a_run_are_those_of_its_differences(paper_results):
    """By hand: the first rank is one more than the number of models resolved to be better."""
    for row in paper_results.score_errors:
        place = row[1:5]
        ahead = [
            d
            for d in paper_results.score_differences
            if d[2:6] == place
            and d.is_resolved
            and (
                (d.other == row.model and d.difference > 0.0)
                or (d.model == row.model and d.difference < 0.0)
            )
        ]
        assert row.first_rank == 1 + len(ahead), row
