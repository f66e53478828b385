"""Rigid tools that are moved against a linear elastic body, and may leave it again."""
