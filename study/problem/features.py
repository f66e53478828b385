"""What a scene may ask beyond one load on a homogeneous, weightless body."""

FEATURES = {
    "moved-tools": "rigid tools that are moved",
    "several-loads": "several loads",
    "gravity": "gravity",
    "weights": "attached weights",
    "inclusions": "tissue that differs from place to place",
    "fixed-surfaces": "clamped or sliding supports",
}
"""Names of what a model must be able to follow, in the words of a message."""
