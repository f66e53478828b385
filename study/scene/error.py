"""The error of an unusable scene."""

from __future__ import annotations


class SceneError(ValueError):
    """An unusable scene; the message lists every problem with its key and remedy."""
