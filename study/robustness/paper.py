"""What the paper prints of its ranking."""

TABLE_III = {"interval-type-2": 0.8598, "mamdani": 0.8580, "sugeno": 0.8549}
"""Similarity of each fuzzy model to the benchmark, by a measure that the paper does not define."""
