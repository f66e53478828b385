"""Work and precision: how accurate each model is on a scene, and what a simulated second costs."""
