"""The run of a scene: its stages, models, comparisons and results."""
