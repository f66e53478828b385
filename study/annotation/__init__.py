"""Annotations of the fields of a scene: a number with unit and range, a choice from a table."""
