"""What is said of a results folder that is not whole."""

from __future__ import annotations


class ResultsError(ValueError):
    """A folder that cannot be read or written; the message says what to do."""
