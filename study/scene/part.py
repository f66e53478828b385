"""A scene without the keys that something does not depend on."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from study.scene.schema import Scene

UNSEEN = ("title", "models", "renders", "remarks", "require")
"""Keys that no motion depends on."""


def without(scene: Scene, keys: Iterable[str]) -> Scene:
    """The scene with these tables and keys, and those of UNSEEN, at their defaults."""
    for key in (*UNSEEN, *keys):
        table, _, name = key.partition(".")
        value = _reset(getattr(scene, table), name) if name else _default(Scene, table)
        scene = dataclasses.replace(scene, **{table: value})
    return scene


def _reset(table: Any, name: str) -> Any:
    return dataclasses.replace(table, **{name: _default(type(table), name)})


def _default(kind: type, name: str) -> Any:
    (found,) = (one for one in dataclasses.fields(kind) if one.name == name)
    if found.default is not dataclasses.MISSING:
        return found.default
    assert found.default_factory is not dataclasses.MISSING  # noqa: S101 - every key has one
    return found.default_factory()
