"""`check`: what a scene or mesh would be, without running it."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import Overrides


def check(
    target: str,
    *,
    set_: Overrides = None,
    unit: str | None = None,
) -> None:
    """Check a scene or a mesh file and say what would be run, without running it.

    Parameters
    ----------
    target
        A built-in scene, a TOML file, or a mesh file.
    set_
        Override of a scene, table.key=value. May be repeated.
    unit
        Unit of a mesh file, for example mm; guessed from the volume if it is not given.
    """
    from study.check import describe_mesh, describe_scene
    from study.scene.file import BUILT_IN

    if target in BUILT_IN or target.endswith(".toml") or not Path(target).exists():
        lines = describe_scene(target, set_ or ())
    else:
        lines = describe_mesh(Path(target), unit)
    print("\n".join(lines))
