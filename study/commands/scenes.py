"""`scenes`: the built-in ones."""

from __future__ import annotations


def scenes() -> None:
    """List the built-in scenes."""
    from study.scene.file import BUILT_IN, built_in_title

    for name in BUILT_IN:
        print(f"{name:8s} {built_in_title(name)}")
