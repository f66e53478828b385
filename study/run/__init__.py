"""Wiring: from a scene through every model it names to results."""
