"""Fuzzy estimation of liver stiffness: Mamdani, Sugeno and interval type-2 on one rule base."""
