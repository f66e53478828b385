"""What is raised for a scene that cannot be used."""

from __future__ import annotations


class SceneError(ValueError):
    """A scene that cannot be used; the message lists every problem with its key and remedy."""
