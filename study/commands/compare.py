"""`compare`: what differs between results folders."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.flags import EXIT_FAILED_CHECK, Switch

if TYPE_CHECKING:
    from study.results.comparison import Difference


CSV, PDF, HTML = ".csv", ".pdf", ".html"
"""Kinds of file that a comparison is written to."""


def compare(
    first: Path,
    second: Path,
    *others: Path,
    tolerance: float | None = None,
    errors: Switch = False,
    out: Path | None = None,
) -> None:
    """List which numbers differ between results folders, and what may explain it.

    Exit code 1 if any number differs by more than the tolerance. Wall times are
    ignored; differences in scene, versions or platform are listed and do not count. With more than
    two folders, or with --errors, one table lists which displacements, differences and estimates
    differ by more than their numerical errors; exit code 0.

    Parameters
    ----------
    first
        Results folder of a run.
    second
        Results folder of another run.
    others
        Results folders of further runs.
    tolerance
        Tolerated difference, relative to the largest value of a curve or array, or to a single
        number; 0 by default, so that all numbers must be equal.
    errors
        Compare by the errors of the numbers instead of a tolerance.
    out
        File to write as well: the whole table (.csv), or the table with overlaid curves (.pdf,
        .html).
    """
    if others or errors:
        if tolerance is not None:
            raise ValueError(
                "--tolerance: a table is by the errors of the numbers; leave it out, or compare "
                "two folders without --errors"
            )
        _by_errors([first, second, *others], out)
        return
    if out is not None:
        raise ValueError("--out: is for the table of --errors; give both")
    _two(first, second, tolerance or 0.0)


def _by_errors(folders: list[Path], out: Path | None) -> None:
    from reports import several
    from study.results.folder import read
    from study.system.folders import check_file, write_bytes, write_text

    if out is not None:
        if out.suffix.lower() not in (CSV, PDF, HTML):
            raise ValueError(
                f"--out {out}: end it with {CSV} for the table, {PDF} or {HTML} for both"
            )
        check_file(out)
    names = several.short_names([str(folder) for folder in folders])
    runs = [read(folder) for folder in folders]
    rows = several.compared(runs)
    print("\n".join(several.lines(names, runs, rows)))
    if out is None:
        return
    if out.suffix.lower() == PDF:
        from reports.several_pdf import several_pdf

        write_bytes(out, several_pdf(names, runs, rows))
        print(f"report in {out}")
    elif out.suffix.lower() == HTML:
        from reports.page.several import several_page
        from reports.page.write import MISSING, is_drawable

        if not is_drawable():
            raise ValueError(MISSING)
        write_bytes(out, several_page(names, runs, rows))
        print(f"page in {out}")
    else:
        write_text(out, several.text(names, rows))
        print(f"table in {out}")


def _two(first: Path, second: Path, tolerance: float) -> None:
    from study.results.comparison import differences, other_words
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
