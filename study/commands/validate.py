"""`validate`: models beside measurements."""

from __future__ import annotations

import sys
from pathlib import Path

from study.commands.flags import EXIT_FAILED_CHECK, AsJson, Switch


def validate(
    name: str | None = None,
    *,
    models: list[str] | None = None,
    quick: Switch = False,
    out: Path | None = None,
    as_json: AsJson = False,
) -> None:
    """Hold models to measurements on bodies of silicone, each number beside its uncertainty.

    Exit code 1 if the finite elements gave no number for something that was measured.

    Parameters
    ----------
    name
        What was measured: cylinders, cantilever or cube. All by default.
    models
        Kinds of models: linear and neo-hookean finite elements, springs, volume (springs with the
        volume term), basafa. All by default.
    quick
        Two meshes or spacings of each model instead of three, a minute or two.
    out
        Table to write too (CSV).
    as_json
        Print JSON instead of a table.
    """
    from study.folders import check_file
    from study.progress import on_stderr
    from study.validation import request, table

    asked = request.ValidationRequest(
        names=() if name is None else (name,), kinds=tuple(models or ()), quick=quick
    )
    if out is not None:
        check_file(out)
    with on_stderr() as progress:
        found = list(asked.comparisons(progress))
    if out is not None:
        table.write(found, out)
    print(table.as_json(found) if as_json else "\n".join(table.lines(found)))
    if not request.all_answered(found):
        sys.exit(EXIT_FAILED_CHECK)
