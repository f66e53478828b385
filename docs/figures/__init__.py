"""The figures that README.md and the pages quote, computed from the committed tables.

In a page a figure stands between two comments, which are not displayed:

    springs alone leave <!-- figure: springs-10mm -->24 %<!-- --> of the field

`python -m docs.figures`, from the root of the repository, writes all of them anew;
tests/test_docs.py fails where one differs. Each module holds the figures of one subject, and each
function in `GROUPS` yields names and texts: to add a figure, yield it in one of them. A table of
several lines is a figure too.
"""

from collections.abc import Callable, Iterator

from docs.figures.corrected import corrected, under_gravity
from docs.figures.fuzzy import liver_run, virtual_patients
from docs.figures.graded import graded, graded_rest
from docs.figures.lattice import field_error, kernels, large_strain, peers, real_time
from docs.figures.planned import planned, planned_tools
from docs.figures.reference import certified, error_bar, error_bar_livers, verification
from docs.figures.studies import organ, ranking, run_stages, stability
from docs.figures.tradeoff import tradeoff
from docs.figures.travelling import travelling
from docs.figures.validation import validation

GROUPS: tuple[Callable[[], Iterator[tuple[str, str]]], ...] = (
    *(liver_run, virtual_patients),
    *(field_error, real_time, kernels, peers, large_strain),
    *(verification, error_bar, error_bar_livers, certified),
    *(tradeoff, corrected, under_gravity, travelling, graded, graded_rest),
    *(planned, planned_tools),
    *(validation, stability, ranking, organ, run_stages),
)


def figures() -> dict[str, str]:
    """Every figure by name, as it is printed."""
    return {name: text for group in GROUPS for name, text in group()}
