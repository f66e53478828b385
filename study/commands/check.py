"""`check`: what a scene or mesh would be, without running it."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from study.commands.flags import Overrides


def check(
    target: str,
    *,
    set_: Overrides = None,
    out: Path | None = None,
    unit: str | None = None,
    axes: str | None = None,
    pieces: Literal["one", "largest"] = "one",
) -> None:
    """Check a scene or a mesh file and show what would be run, without running it.

    What `run` refuses is refused here, with the same message.

    Parameters
    ----------
    target
        A built-in scene, a TOML file, or a mesh file.
    set_
        Override of a scene value, table.key=value. May be repeated.
    out
        Results folder that `run` is to write a scene to; results/NAME by default.
    unit
        Unit of a mesh file, for example mm; guessed from the volume if it is not given.
    axes
        Sides of the patient to which x, y and z of a mesh file point, for example RAS; LPS if they
        are not given.
    pieces
        Of a mesh file in several pieces: largest keeps that one, one (the default) refuses them.
    """
    from study.run.check import describe_mesh, describe_scene, is_scene

    if is_scene(target):
        for name, value in (("unit", unit), ("axes", axes)):
            if value is not None:
                raise ValueError(f"--{name}: {target} is a scene; give --set organ.{name}={value}")
        if pieces != "one":
            raise ValueError(f"--pieces: {target} is a scene; give --set organ.pieces={pieces}")
        lines = describe_scene(target, set_ or (), out)
    else:
        for flag, given in (("--set", set_), ("--out", out)):
            if given:
                raise ValueError(
                    f"{flag}: {target} is a mesh, not a scene; leave it out, or give --unit, "
                    "--axes or --pieces"
                )
        lines = describe_mesh(Path(target), unit, axes, pieces)
    print("\n".join(lines))
