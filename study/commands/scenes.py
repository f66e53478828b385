"""`scenes`: the built-in ones."""

from __future__ import annotations


def scenes(show: str | None = None) -> None:
    """List the built-in scenes, or print one of them.

    Parameters
    ----------
    show
        Name of a scene to print as TOML, with every value in use.
    """
    from study.scene.file import BUILT_IN, built_in_title, read_scene, write_scene

    if show is not None:
        print(write_scene(read_scene(show)), end="")
        return
    for name in BUILT_IN:
        print(f"{name:8s} {built_in_title(name)}")
