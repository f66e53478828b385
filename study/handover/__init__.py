"""A scene's lattices for a program of one's own: arrays, a stepper in NumPy, scenes for SOFA."""
