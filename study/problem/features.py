"""What a scene may require beyond one load on a homogeneous, weightless body."""

from __future__ import annotations

from collections.abc import Iterable

FEATURES = {
    "moved-tools": "rigid tools that are moved",
    "several-loads": "several loads",
    "travelling-loads": "a blunt tool that travels",
    "gravity": "gravity",
    "weights": "attached weights",
    "inclusions": "tissue that differs from place to place",
    "fixed-surfaces": "clamped or sliding supports",
}
"""Names of features that a model must support, with their words in messages."""

BESIDE_ONE_LOAD = ("moved-tools", "several-loads", "travelling-loads", "gravity", "weights")
"""Names of the features that act beside a single load of given force."""


def refuse_beside_one_load(features: Iterable[str], what: str) -> None:
    """Raise ValueError where a study of a single load is given further loads."""
    present = set(features)
    found = [FEATURES[name] for name in BESIDE_ONE_LOAD if name in present]
    if found:
        raise ValueError(
            f"{what}: is of a single load of a given force, and the scene has "
            f"{' and '.join(found)}; leave these out, or use run"
        )
