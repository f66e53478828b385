"""Fuzzy systems of any subject: Mamdani, Sugeno and interval type-2 inference on one rule base."""
