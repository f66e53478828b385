"""ISO/TS 18571 rating against objective_rating_metrics 1.3 (TU Graz)."""

from __future__ import annotations

import time

import numpy as np
import pytest
from objective_rating_metrics.rating import ISO18571

from study.similarity.iso18571 import Rating, best_shift, rate

# Both evaluate the same formulas in double precision; the worst difference measured is 2e-15.
AGREEMENT = 1e-12


def families(samples):
    """Name -> candidate and reference."""
    t = np.linspace(0.0, 10.0, samples)
    rng = np.random.default_rng(samples)
    step = 1.0 - np.exp(-0.9 * t) * np.cos(0.5 * t)
    ramp_hold = np.interp(t, [0.0, 1.3, 5.0, 8.0], [0.0, 1.0, 1.0, 0.0])
    return {
        "step": (0.85 * (1.0 - np.exp(-0.9 * t) * np.cos(0.7 * t)), step),
        "sine, late": (1.1 * np.sin(2.0 * t - 0.5), np.sin(2.0 * t)),
        "sine, early": (0.9 * np.sin(2.0 * t + 0.5), np.sin(2.0 * t)),
        "pulse": (np.exp(-((t - 4.3) ** 2)), np.exp(-((t - 4.0) ** 2))),
        "ramp and hold": (np.interp(t, [0.0, 1.0, 5.0, 8.0], [0.0, 1.1, 1.1, 0.0]), ramp_hold),
        "saw": (t % 2.3, t % 2.0),
        "chirp": (np.sin(t**2 / 3.0), np.sin((t + 0.1) ** 2 / 3.0)),
        "noise on the candidate": (step + 0.1 * rng.normal(size=samples), step),
        "random walks": tuple(np.cumsum(rng.normal(size=(2, samples)), axis=1)),
        "thousandfold": (1e3 * step, step),
        "thousandth": (1e-3 * step, step),
        "offset": (step + 0.3, step),
        "micrometres": (1.1e-6 * step, 1e-6 * step),
    }


def oracle(candidate, reference):
    t = np.arange(len(reference), dtype=float)
    return ISO18571(np.column_stack([t, reference]), np.column_stack([t, candidate]))


def parts(judge):
    """Unrounded parts and total of the oracle."""
    methods = ("corridor", "phase", "magnitude", "slope", "overall")
    return [getattr(judge, f"{name}_rating")(ndigits=-1) for name in methods]


def as_list(rating: Rating):
    return [rating.corridor, rating.phase, rating.magnitude, rating.slope, rating.overall]


@pytest.mark.parametrize("samples", [50, 101, 200, 333])
@pytest.mark.parametrize("family", list(families(8)))
def test_every_part_agrees_with_the_oracle(family, samples):
    candidate, reference = families(samples)[family]
    found = as_list(rate(candidate, reference))
    assert found == pytest.approx(parts(oracle(candidate, reference)), abs=AGREEMENT)


@pytest.mark.parametrize("family", ["step", "saw"])
def test_parts_agree_at_full_length(family):
    candidate, reference = families(1001)[family]
    found = as_list(rate(candidate, reference))
    assert found == pytest.approx(parts(oracle(candidate, reference)), abs=AGREEMENT)


def test_a_constant_candidate_agrees_with_the_oracle():
    _, reference = families(101)["step"]
    candidate = np.full(101, 0.5)
    # The oracle divides by the zero variance of a constant; it then keeps the shift of zero.
    with pytest.warns(RuntimeWarning, match="invalid value"):
        expected = parts(oracle(candidate, reference))
    assert as_list(rate(candidate, reference)) == pytest.approx(expected, abs=AGREEMENT)


TIES = {
    "ramp against itself": lambda t: (t, t),
    "steeper ramp": lambda t: (1.1 * t, t),
    "opposite sign": lambda t: (-np.sin(t), np.sin(t)),
}


@pytest.mark.parametrize("samples", [50, 101, 200])
@pytest.mark.parametrize("tie", list(TIES))
def test_equally_good_shifts(tie, samples):
    """The smallest shift wins, the candidate being late first; the oracle lets rounding decide.

    So the oracle is given our shift; its own must not correlate better than a tie.
    """
    candidate, reference = TIES[tie](np.linspace(0.0, 10.0, samples))
    shift = best_shift(candidate, reference)
    judge = oracle(candidate, reference)
    pair = np.column_stack([candidate, reference])
    late, early = max(shift, 0), max(-shift, 0)
    c, r = pair[late : samples - early, 0], pair[early : samples - late, 1]
    assert np.corrcoef(c, r)[0, 1] == pytest.approx(judge._rho_e, abs=1e-9)
    judge._n_eps = abs(shift)
    judge._cae_ts, judge._t_ts = (np.column_stack([np.arange(len(s)), s]) for s in (c, r))
    assert as_list(rate(candidate, reference)) == pytest.approx(parts(judge), abs=AGREEMENT)


def test_a_ramp_is_not_shifted_against_itself():
    t = np.linspace(0.0, 10.0, 50)
    assert best_shift(1.1 * t, t) == 0
    assert as_list(rate(t, t)) == [1.0, 1.0, 1.0, 1.0, pytest.approx(1.0, abs=1e-15)]


def test_of_two_opposite_shifts_the_late_candidate_wins():
    # Around the turning point of an even curve both directions are mirror images.
    even = np.cos(np.linspace(-1.0, 1.0, 101))
    assert best_shift(-even, even) > 0


@pytest.mark.parametrize("lag", [7, -7])
def test_the_shift_has_the_sign_of_the_lag(lag):
    t = np.linspace(0.0, 10.0, 200)
    reference = np.exp(-((t - 5.0) ** 2))
    assert best_shift(np.roll(reference, lag), reference) == lag


@pytest.mark.parametrize(
    ("part", "spoil"),
    [
        ("corridor", lambda c: c + 0.2),
        ("phase", lambda c: np.roll(c, 5)),
        ("magnitude", lambda c: 1.2 * c),
        ("slope", lambda c: c + 0.05 * np.sin(2.0 * np.arange(c.size))),
    ],
)
def test_each_part_sees_the_error_it_is_meant_for(part, spoil):
    """Negative control: were a part constant or swapped, the agreement would show it here too."""
    t = np.linspace(0.0, 10.0, 200)
    reference = np.exp(-((t - 5.0) ** 2))
    assert getattr(rate(reference, reference), part) == 1.0
    assert getattr(rate(spoil(reference), reference), part) < 0.97


def test_a_thousand_samples_rate_within_a_tenth_of_a_second():
    candidate, reference = families(1000)["step"]
    durations = []
    for _ in range(5):
        start = time.perf_counter()
        rate(candidate, reference)
        durations.append(time.perf_counter() - start)
    # About 0.02 s on two shared cores; a loop over all cells in Python takes 0.3 s or more.
    assert min(durations) < 0.1
