"""The axes of a mesh file, which the file itself does not state."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from study.mesh.kinds import FloatArray, IndexArray, MeshError

SCENE = "LPS"
"""Axes of a scene: x to the patient's left, y to the posterior, z to the superior (DICOM's)."""

_TOWARDS = {
    "L": (1.0, 0.0, 0.0),
    "R": (-1.0, 0.0, 0.0),
    "P": (0.0, 1.0, 0.0),
    "A": (0.0, -1.0, 0.0),
    "S": (0.0, 0.0, 1.0),
    "I": (0.0, 0.0, -1.0),
}
_SIDES = {
    "L": "left",
    "R": "right",
    "P": "posterior",
    "A": "anterior",
    "S": "superior",
    "I": "inferior",
}
MODELLING = {"y-up": "LSA", "z-up": "LPS"}
"""Axes of modelling tools by name, for an upright patient who faces the viewer."""
AXES = tuple(
    "".join(letters) for order in permutations(("LR", "PA", "SI")) for letters in product(*order)
)
"""The 48 assignments of three axes to the sides of a patient."""


def letters_of(axes: str) -> str:
    """Three letters, the sides to which x, y and z point; MeshError for an invalid name."""
    found = MODELLING.get(axes.strip().lower(), axes.strip().upper())
    if found not in AXES:
        raise MeshError(
            f"`organ.axes` = {axes!r}: give the sides to which x, y and z point as three letters, "
            f"one of each of L/R, P/A and S/I, for example LPS or RAS, or {' or '.join(MODELLING)}"
        )
    return found


def to_scene(axes: str) -> FloatArray:
    """Matrix (3, 3) that takes coordinates along the axes to those of a scene."""
    return np.array([_TOWARDS[letter] for letter in letters_of(axes)]).T


def is_mirrored(axes: str) -> bool:
    """Whether the axes are left-handed."""
    return bool(np.linalg.det(to_scene(axes)) < 0.0)


def along_scene(
    points: FloatArray, elements: IndexArray, axes: str
) -> tuple[FloatArray, IndexArray]:
    """Points and elements in the axes of a scene; mirrored elements are reoriented."""
    moved = points @ to_scene(axes).T
    if is_mirrored(axes):
        elements = elements[:, [*range(elements.shape[1] - 2), -1, -2]]
    return moved, elements


def axes_note(axes: str | None) -> str:
    """How the axes were interpreted, or that none were stated."""
    if axes is None:
        return (
            f"axes not stated, taken as {SCENE} (x to the patient's left, y to the posterior, z to "
            "the superior): state `organ.axes` if they are others"
        )
    letters = letters_of(axes)
    said = ", ".join(
        f"{name} to the {_SIDES[letter]}" for name, letter in zip("xyz", letters, strict=True)
    )
    if letters == SCENE:
        return f"axes {letters} ({said}), those of the scene"
    hand = ", left-handed ones: the coordinates are mirrored back" if is_mirrored(axes) else ""
    return f"axes {letters} ({said}{hand}) turned to the scene's, {SCENE}"
