"""Similarity of two motions of one control point; each measure is a score in [0, 1].

`study.similarity.score` holds the table of measures; every other module is one measure or a step of
one. The phase plane is scored by its shape and the time histories by their timing. No single number
expresses similarity: scores of different measures must not be compared with each other.
"""

from __future__ import annotations

from pathlib import Path

from study.system.compiled import drop_outdated

drop_outdated(Path(__file__).parent)  # before a kernel is loaded
