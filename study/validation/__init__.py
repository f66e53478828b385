"""Validation: models beside measurements on silicone cylinders, a beam and a cube."""
