"""What the paper prints and a report sets beside its own numbers."""

from __future__ import annotations

TABLE_III = {"interval-type-2": 0.8598, "mamdani": 0.8580, "sugeno": 0.8549}
"""Similarity of each fuzzy model to the benchmark, by a measure that the paper does not define."""

TABLE_III_SPREAD = max(TABLE_III.values()) - min(TABLE_III.values())
