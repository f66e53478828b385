"""`verify`: problems with known answers by the reference."""

from __future__ import annotations

import sys
from pathlib import Path

from study.commands.flags import EXIT_FAILED_CHECK, AsJson, Switch


def verify(
    *,
    quick: Switch = False,
    out: Path | None = None,
    as_json: AsJson = False,
) -> None:
    """Verify the finite-element reference on problems with exact solutions.

    Parameters
    ----------
    quick
        Only the problems that take about a second each.
    out
        Table to write as well (CSV).
    as_json
        Print JSON instead of a table.
    """
    from study.known import request, table
    from study.system.folders import check_file
    from study.system.progress import on_stderr

    if out is not None:
        check_file(out)
    with on_stderr() as progress:
        verdicts = request.verify(progress, quick=quick)
    if out is not None:
        table.write_verification(verdicts, out)
    lines = [table.verification_json(verdicts)] if as_json else table.verification_lines(verdicts)
    print("\n".join(lines))
    if not request.all_passed(verdicts):
        sys.exit(EXIT_FAILED_CHECK)
