"""Where an instance of a part is put: a translation, then a rotation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from study.mesh.kinds import FloatArray, MeshError
from study.mesh.text import NumberedLine, floats

_NO_TURN = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


class Placement(NamedTuple):
    """Translation [file units], then a rotation about the line from `a` to `b` by `angle` [rad]."""

    translation: tuple[float, ...] = (0.0, 0.0, 0.0)
    a: tuple[float, ...] = (0.0, 0.0, 0.0)
    b: tuple[float, ...] = (0.0, 0.0, 1.0)
    angle: float = 0.0

    def moved(self, points: FloatArray) -> FloatArray:
        """The points, shape (n, 3), where the instance is."""
        moved: FloatArray = points + np.array(self.translation)
        if self.angle == 0.0:
            return moved
        a = np.array(self.a)
        axis = (np.array(self.b) - a) / np.linalg.norm(np.array(self.b) - a)
        arm = moved - a
        along = np.outer(arm @ axis, axis)
        across = np.cos(self.angle) * (arm - along) + np.sin(self.angle) * np.cross(axis, arm)
        return np.asarray(a + along + across)


def placement(lines: Sequence[NumberedLine]) -> Placement:
    """Placement from the data lines of an instance: three numbers, then seven, both optional.

    Raises
    ------
    MeshError
        On other lines, and on an axis whose two points coincide.
    """
    if len(lines) > 2:
        raise MeshError(f"line {lines[2][0]}: an instance has a translation and a rotation")
    widths = (3, 7)[: len(lines)]
    for (number, words), width in zip(lines, widths, strict=True):
        if len(words) > width:
            raise MeshError(f"line {number}: {len(words)} numbers, expected {width}")
    rows = [
        floats([(number, [word or "0" for word in [*words, *[""] * width][:width]])], width)[0]
        for (number, words), width in zip(lines, widths, strict=True)
    ]
    shift, turn = [tuple(row.tolist()) for row in rows] + [(0.0,) * 3, _NO_TURN][len(rows) :]
    if turn[:3] == turn[3:6]:
        raise MeshError(f"line {lines[1][0]}: the two points of the axis of rotation coincide")
    return Placement(shift, turn[:3], turn[3:6], float(np.deg2rad(turn[6])))
