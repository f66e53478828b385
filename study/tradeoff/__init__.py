"""Work-precision study: the error of each model on a scene, and the cost of a simulated second."""
