"""The error that is stated of a reference: known sequences, whose error is known too."""

import numpy as np
import pytest

from fem_reference.elements import ELEMENTS
from fem_reference.error_estimate import (
    SAFETY,
    SAFETY_ASSUMED,
    discretisation_error,
    observed_order,
)

LIMIT = np.array([[1.0, 2.0, -1.0], [0.5, 0.0, 3.0]])
ERROR = np.array([[0.3, -0.1, 0.2], [0.0, 0.4, -0.2]])


def sequence(sizes, order):
    return [LIMIT + h**order * ERROR for h in sizes]


def true_error(results):
    return np.linalg.norm(results[-1] - LIMIT) / np.linalg.norm(results[-1])


@pytest.mark.parametrize("sizes", [(0.4, 0.2, 0.1), (0.3, 0.2, 0.15), (0.5, 0.3, 0.1)])
@pytest.mark.parametrize("order", [1.0, 2.0, 2.7])
def test_a_pure_power_is_seen_with_its_order_and_error(sizes, order):
    results = sequence(sizes, order)
    found = discretisation_error(results, sizes, formal=3.0)
    assert found.observed == pytest.approx(order, rel=1e-9)
    assert found.error == pytest.approx(SAFETY * true_error(results), rel=1e-9)


def test_an_order_above_the_formal_one_is_not_used():
    """Of a coarse start; the estimate then stays above the true error."""
    sizes = (0.4, 0.2, 0.1)
    results = sequence(sizes, 5.0)
    found = discretisation_error(results, sizes, ELEMENTS["p2"].formal_order)
    assert found.observed == pytest.approx(5.0)
    assert found.error == pytest.approx(SAFETY_ASSUMED * true_error(results) * 31 / 7)


def test_results_that_alternate_show_half_their_range():
    results = [LIMIT + s * ERROR for s in (0.03, -0.02, 0.01)]
    found = discretisation_error(results, (0.4, 0.3, 0.2), 3.0)
    assert found.observed is None
    half = 0.5 * 0.05 * np.linalg.norm(ERROR) / np.linalg.norm(results[-1])
    assert found.error == pytest.approx(SAFETY_ASSUMED * half)
    assert found.error > true_error(results)


def test_results_that_differ_more_and_more_have_no_order_and_show_half_their_range():
    results = [LIMIT, LIMIT + 0.01 * ERROR, LIMIT + 0.05 * ERROR]
    found = discretisation_error(results, (0.4, 0.3, 0.2), 3.0)
    assert found.observed is None
    half = 0.5 * 0.05 * np.linalg.norm(ERROR) / np.linalg.norm(results[-1])
    assert found.error == pytest.approx(SAFETY_ASSUMED * half)


def test_an_order_well_below_the_first_shows_half_the_range_too():
    sizes = (0.4, 0.3, 0.2)
    results = sequence(sizes, 0.3)
    found = discretisation_error(results, sizes, 3.0)
    assert found.observed == pytest.approx(0.3)
    half = 0.5 * (0.4**0.3 - 0.2**0.3) * np.linalg.norm(ERROR) / np.linalg.norm(results[-1])
    assert found.error == pytest.approx(SAFETY_ASSUMED * half)


def test_two_meshes_take_the_assumed_order_with_a_larger_factor():
    sizes = (0.3, 0.2)
    results = sequence(sizes, 2.0)
    found = discretisation_error(results, sizes, 3.0)
    assert found.observed is None
    assert found.error == pytest.approx(SAFETY_ASSUMED * true_error(results))


@pytest.mark.parametrize("factors", [(0.16, 0.04, 0.01), (0.03, -0.02, 0.01), (0.0, 0.01, 0.05)])
def test_meshes_before_the_last_three_do_not_count(factors):
    """Where an order is seen, where results alternate and where they diverge."""
    sizes = (0.4, 0.2, 0.1)
    results = [LIMIT + s * ERROR for s in factors]
    far = LIMIT + 7.0 * ERROR
    found = discretisation_error([far, *results], (0.7, *sizes), 3.0)
    assert found == discretisation_error(results, sizes, 3.0)


def test_weights_count():
    sizes, weights = (0.4, 0.2, 0.1), np.array([1.0, 0.0])
    results = sequence(sizes, 2.0)
    found = discretisation_error(results, sizes, 3.0, weights)
    first = np.linalg.norm(results[-1][0] - LIMIT[0]) / np.linalg.norm(results[-1][0])
    assert found.error == pytest.approx(SAFETY * first)


def test_equal_results_have_no_error():
    found = discretisation_error([LIMIT] * 3, (0.4, 0.2, 0.1), 3.0)
    assert (found.error, found.observed) == (0.0, None)
    still = discretisation_error([np.zeros((4, 3))] * 3, (0.4, 0.2, 0.1), 3.0)
    assert still.error == 0.0


def test_a_faster_fall_than_any_order_is_cut_off():
    assert observed_order(1.0, 1e-12, (0.4, 0.2, 0.1)) == 12.0
