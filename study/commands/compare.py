"""`compare`: what differs between two results folders."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.flags import EXIT_FAILED_CHECK

if TYPE_CHECKING:
    from study.compare import Difference


def compare(first: Path, second: Path, *, tolerance: float = 0.0) -> None:
    """Say which numbers differ between two results folders, and what made them otherwise.

    Exit code 1 if any number differs by more than the tolerance. Wall times are left out; what
    differs in scene, versions or platform is told and does not count.

    Parameters
    ----------
    first
        Results folder of a run.
    second
        Results folder of another run.
    tolerance
        Relative difference that counts as none, of the largest value of a curve or array, or of a
        single number. 0 by default: all numbers are the same.
    """
    from study.compare import differences, other_words
    from study.results.folder import read

    if not 0.0 <= tolerance < math.inf:
        raise ValueError(f"--tolerance {tolerance:g}: give a relative difference, 0 or more")
    results = read(first), read(second)
    found = differences(*results)
    beyond = [one for one in found if one.relative > tolerance]
    print("\n".join([*other_words(*results), *map(_line, beyond), _verdict(found, tolerance)]))
    if beyond:
        sys.exit(EXIT_FAILED_CHECK)


def _line(one: Difference) -> str:
    at = f" ({one.where})" if one.where else ""
    if math.isinf(one.relative):
        return f"{one.quantity}: not in both{at}; {one.count} of {one.total}"
    return (
        f"{one.quantity}: differs by up to {one.largest:.3g}, relative {one.relative:.3g}{at}; "
        f"{one.count} of {one.total}"
    )


def _verdict(found: list[Difference], tolerance: float) -> str:
    beyond = sum(one.relative > tolerance for one in found)
    if not found:
        return "all numbers are the same"
    largest = max(one.relative for one in found)
    if not beyond:
        return f"all numbers agree within {tolerance:g}: the largest difference is {largest:.3g}"
    return f"{beyond} quantities differ by more than {tolerance:g}"
