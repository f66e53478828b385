"""General fuzzy systems: Mamdani, Sugeno and interval type-2 inference on one rule base."""
