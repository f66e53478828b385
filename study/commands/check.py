"""`check`: what a scene or mesh would be, without running it."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import Overrides


def check(
    target: str,
    *,
    set_: Overrides = None,
    out: Path | None = None,
    unit: str | None = None,
) -> None:
    """Check a scene or a mesh file and say what would be run, without running it.

    What `run` refuses is refused here, in the same words.

    Parameters
    ----------
    target
        A built-in scene, a TOML file, or a mesh file.
    set_
        Override of a scene, table.key=value. May be repeated.
    out
        Results folder that `run` is to write a scene to; results/NAME by default.
    unit
        Unit of a mesh file, for example mm; guessed from the volume if it is not given.
    """
    from study.check import describe_mesh, describe_scene, is_scene

    if is_scene(target):
        if unit is not None:
            raise ValueError(f"--unit: {target} is a scene; give --set organ.unit={unit}")
        lines = describe_scene(target, set_ or (), out)
    else:
        for flag, given in (("--set", set_), ("--out", out)):
            if given:
                raise ValueError(f"{flag}: {target} is a mesh, not a scene; leave it out")
        lines = describe_mesh(Path(target), unit)
    print("\n".join(lines))
