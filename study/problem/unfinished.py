"""A model that finds in its run that it cannot: a result of that model, as divergence is."""

from __future__ import annotations


class UnfinishedError(ValueError):
    """Why a motion is not finished, and what would help; both parts of a sentence.

    For what only the work of a run can tell. What a scene shows beforehand is a plain ValueError.
    """

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(reason, remedy)
        self.reason, self.remedy = reason, remedy

    def __str__(self) -> str:
        return f"{self.reason}; {self.remedy}"
