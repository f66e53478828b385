"""How the reference spacing of the benchmark decides which system is nearest, in a sentence.

The paper does not print the reference spacing h_0 at which its Table II holds, and the ranking
depends on it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib.resources.abc import Traversable
from itertools import groupby, pairwise

from reports.appearance import system_name
from reports.benchmarks import Line, read
from reports.digits import fixed
from reports.paper import TABLE_III
from reports.ranking_study import SPACING, is_ranked, winners_over_spacing
from study.results import Results

MILLI = 1e3


def reference_spacing(results: Results, folder: Traversable | None = None) -> str | None:
    """The sentence; None for a run without the benchmark, or where the table is missing."""
    lines = read(SPACING, folder)
    if not lines or not is_ranked(results):
        return None
    own = results.scene.damping.reference_spacing
    modulus = 2.5 * results.scene.basafa.k1 / own**2
    return (
        "Reference spacing of the benchmark: the paper does not print the spacing h₀ at which its "
        "Table II holds, and the benchmark's modulus is proportional to 1/h₀². This scene sets h₀ "
        f"to {fixed(MILLI * own, 1)} mm, which gives a modulus of {fixed(modulus / 1e3, 1)} kPa. "
        f"In the paper's scene with other spacings, computed beforehand, {_spans(lines)}. The "
        f"margins of the paper's ranking are {_margins()}."
    )


def _spans(lines: Sequence[Line]) -> str:
    """Ranges of the spacing, and the system that is nearest by the most measures in each."""
    wins = winners_over_spacing(lines)
    spacings = sorted({spacing for spacing, _ in wins})
    count = len({measure for _, measure in wins})
    parts = []
    for system, group in groupby(spacings, lambda spacing: _leader(wins, spacing)[0]):
        found = list(group)
        votes = [_leader(wins, spacing)[1] for spacing in found]
        span = f"h₀ of {fixed(MILLI * found[0], 1)} to {fixed(MILLI * found[-1], 1)} mm"
        times = str(max(votes)) if min(votes) == max(votes) else f"{min(votes)} to {max(votes)}"
        parts.append(f"{system_name(system)} is nearest by {times} of {count} measures at {span}")
    return ", ".join(parts)


def _leader(wins: dict[tuple[float, str], str], spacing: float) -> tuple[str, int]:
    """The system that is nearest by the most measures at a spacing, and by how many."""
    counts = Counter(system for (at, _), system in wins.items() if at == spacing)
    return max(counts.items(), key=lambda one: (one[1], one[0]))


def _margins() -> str:
    ordered = sorted(TABLE_III.values(), reverse=True)
    gaps = [fixed(a - b, 4) for a, b in pairwise(ordered)]
    return " and ".join(gaps)
