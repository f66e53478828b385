"""`validate`: models beside measurements."""

from __future__ import annotations

import sys
from pathlib import Path

from study.commands.flags import EXIT_FAILED_CHECK, AsJson, Overrides, Switch


def validate(
    name: str | None = None,
    *,
    models: list[str] | None = None,
    data: Path | None = None,
    probe: str | None = None,
    overrides: Overrides = None,
    quick: Switch = False,
    out: Path | None = None,
    as_json: AsJson = False,
) -> None:
    """Compare models with measurements on silicone bodies, each with its uncertainty.

    Exit code 1 if the finite elements have no result for a measured quantity.

    Parameters
    ----------
    name
        Body: cylinders, cantilever or cube, all by default; with --data a scene, by name or TOML
        file.
    models
        Models: linear, neo-hookean (finite elements), springs, volume (springs with the volume
        term), basafa. All by default. Not with --data, where the scene names them.
    data
        Folder with your own measurements of the scene (CSV): curves with the columns time_s and
        displacement_m or force_N; markers.csv with x_m, y_m, z_m, ux_m, uy_m, uz_m; with a column
        uncertainty if it is known.
    probe
        With --data: control point of displacement curves; by default the one nearest to the tool.
    overrides
        With --data: override of a scene value, for example tissue.youngs_modulus="4 kPa". May be
        repeated.
    quick
        Two meshes or spacings of each model instead of three, less than a minute. Not with --data.
    out
        Table to write as well (CSV).
    as_json
        Print JSON instead of a table.
    """
    from study.system.folders import check_file
    from study.system.progress import on_stderr
    from study.validation import request, table

    own, bodies = {"--probe": probe, "--set": overrides}, {"--models": models, "--quick": quick}
    for flag, value in (own if data is None else bodies).items():
        if value:
            needed = "only with --data" if data is None else "only without --data"
            raise ValueError(f"{flag}: {needed}; leave it out")
    if out is not None:
        check_file(out)
    with on_stderr() as progress:
        if data is not None:
            given = (name, data, overrides or (), probe, progress, _tell)
            found = list(request.own_comparisons(*given))
        else:
            names = () if name is None else (name,)
            asked = request.ValidationRequest(names=names, kinds=tuple(models or ()), quick=quick)
            found = list(asked.comparisons(progress))
    if out is not None:
        table.write(found, out)
    print(table.as_json(found) if as_json else "\n".join(table.lines(found)))
    if not request.all_answered(found):
        sys.exit(EXIT_FAILED_CHECK)


def _tell(note: str) -> None:
    print(f"note: {note}", file=sys.stderr)
