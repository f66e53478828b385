"""The error of a model that cannot finish its run: a result, like divergence."""

from __future__ import annotations


class UnfinishedError(ValueError):
    """Why a motion is not finished, and a remedy; both are parts of a sentence.

    Only for what the work of a run reveals. What can be seen from the scene is a plain ValueError.
    """

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(reason, remedy)
        self.reason, self.remedy = reason, remedy

    def __str__(self) -> str:
        return f"{self.reason}; {self.remedy}"
