"""A scene's lattices for the user's own program: arrays, a stepper in NumPy, scenes for SOFA."""
