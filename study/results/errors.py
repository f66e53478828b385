"""The error of an incomplete or unusable results folder."""

from __future__ import annotations


class ResultsError(ValueError):
    """A folder that cannot be read or written; the message states the remedy."""
