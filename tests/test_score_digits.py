"""A score is printed to the digits that its error leaves, in every table."""

from __future__ import annotations

from dataclasses import replace

import pytest

from reports.page.data import page
from reports.ranking import leads
from reports.score_digits import decimals, printed_score, score_decimals
from reports.summary import printed_margin
from reports.tables import similarity_tables
from tests.report_samples import results_of


@pytest.mark.parametrize(
    ("error", "resampled", "places"),
    [
        (0.06, 0.0, 2),  # 0.66, not 0.6569
        (0.11, 0.0, 1),
        (0.003, 0.0, 3),
        (0.0, 0.02, 2),  # every second sample says otherwise
        (1e-9, 0.0, 4),
        (0.6, 0.0, 1),
        (None, 0.0, 2),  # not known: no more than two
        (None, 0.2, 1),
    ],
)
def test_decimals_end_at_the_first_digit_of_the_error(error, resampled, places):
    assert decimals(error, resampled) == places


def with_error(error):
    """Results whose scores all have one error."""
    results = results_of()
    rows = tuple(row._replace(numerical=error) for row in results.score_errors)
    return replace(results, score_errors=rows)


@pytest.mark.parametrize(("error", "cell"), [(0.06, "0.40"), (1e-6, "0.4000"), (0.7, "n. r.")])
def test_tables_of_the_document_and_of_the_page_print_the_same_digits(error, cell):
    results = with_error(error)
    row = results.scores[0]
    results = replace(results, scores=(row._replace(score=0.4), *results.scores[1:]))
    assert similarity_tables(results)[0]["groups"][0]["rows"][0][1].rstrip("*") == cell
    assert page(results).matrices[0].cells[0][0].printed == cell


def test_an_interval_has_no_more_digits_than_its_score():
    found = page(with_error(0.06)).matrices[0].cells[0][0]
    assert all(len(end.partition(".")[2]) == 2 for end in found.interval.split(" to "))
    assert page(with_error(0.7)).matrices[0].cells[0][0].interval == ""


def test_a_score_without_a_known_error_has_two_decimals():
    results = replace(results_of(), score_errors=())
    assert score_decimals(results) == {}
    assert printed_score(0.12345, {}, ("a", "b", "c", "d", "e")) == "0.12"


def test_a_lead_has_the_digits_of_its_own_errors():
    lead = next(leads(results_of(), "fem", "tool"))
    assert printed_margin(replace(lead, margin=0.0523, error=0.02, is_whole=True)) == "0.05"
    assert printed_margin(replace(lead, margin=0.0523, error=1e-6, is_whole=True)) == "0.0523"
    assert printed_margin(replace(lead, margin=0.0523, error=1e-6, is_whole=False)) == "0.05"
