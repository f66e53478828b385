"""The silicone cube with embedded beads under a plate: internal displacements, without a force.

The nominal displacement of the plate is smaller than that of the beads below it, so it is fitted,
together with the rigid motion between the scans. The modulus has no effect.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from study.system.progress import Progress
from study.validation.bodies import CUBE, FACES, cube
from study.validation.comparison import Comparison, own_error
from study.validation.measured import Beads, beads
from study.validation.predictions import KINDS, Kind, Prediction
from study.validation.registration import registered
from study.validation.specimen import Specimen

Floats = NDArray[np.float64]

NAME = "cube"
WAYS = {"5": (3.5e-3, 7.5e-3), "18.25": (13e-3, 23e-3)}
"""[m], interval in which the plate's displacement is sought, by the nominal state in %."""
SOLVED = (0.003, 0.0045, 0.006, 0.0075, 0.013, 0.0155, 0.018, 0.0205, 0.023)
MODULUS = 15.3e3
FITTED = "displacement of the plate, rigid motion"
SLICE = 1.25e-3
RESOLUTION = 0.2e-3
"""[m]: of the scanner within slices, 0.1 to 0.3 mm."""
NOISE = np.sqrt(2.0) * np.array([RESOLUTION, SLICE / np.sqrt(12.0), RESOLUTION])
"""Standard deviation of the difference of two readings along x, y and z [m]."""
AXES = ("x", "y, across the slices", "height")


@dataclass(frozen=True)
class _Fit:
    """Residuals of the beads at the best displacement of the plate [m]."""

    way: float
    by_axis: Floats
    rms: float


def comparisons(kinds: tuple[str, ...], levels: int, progress: Progress) -> Iterator[Comparison]:
    """Residual of the beads at both states, for both conditions of the faces and each model."""
    known = beads()
    folded, sign = _folded(known.unloaded)
    for faces in FACES:
        specimen = cube(faces, folded)
        for name in kinds:
            kind = KINDS[name]
            with progress.stage(f"{NAME}, {faces}: {kind.label}"):
                answers, sizes = _answers(specimen, kind, levels)
            for state in known.states:
                fits = [_fit(known, sign, answer, state) for answer in answers]
                yield from _rows(state, faces, kind, fits, sizes, answers[-1].failure)


def _folded(points: Floats) -> tuple[Floats, Floats]:
    """Points mirrored into the computed quarter, and the signs that map displacements back."""
    sign = np.where(points < 0.0, -1.0, 1.0)
    sign[:, 2] = 1.0
    return sign * points, sign


def _answers(specimen: Specimen, kind: Kind, levels: int) -> tuple[list[Prediction], list[float]]:
    sizes = [mesh.size for mesh in specimen.meshes] if kind.elements else list(specimen.spacings)
    count = min(levels, len(sizes))
    factors = tuple(way / CUBE for way in SOLVED)
    return [kind.solve(specimen, n, MODULUS, factors) for n in range(count)], sizes[:count]


def _fit(known: Beads, sign: Floats, answer: Prediction, state: str) -> _Fit:
    """The plate's displacement with the least residual of the beads after a rigid motion."""
    ways = CUBE * np.concatenate([[0.0], answer.factors])
    low, high = WAYS[state]
    high = min(high, ways[-1])
    if high <= low:
        return _Fit(np.nan, np.full(3, np.nan), np.nan)
    moved = sign * np.concatenate([np.zeros((1, *sign.shape)), answer.displacement])
    path, target = CubicSpline(ways, moved), known.states[state]

    def left(way: float) -> float:
        return registered(known.unloaded + path(way), target).rms

    best = minimize_scalar(left, bounds=(low, high), method="bounded", options={"xatol": 1e-6})
    found = registered(known.unloaded + path(best.x), target)
    return _Fit(float(best.x), found.by_axis, found.rms)


def _rows(
    state: str, faces: str, kind: Kind, fits: list[_Fit], sizes: list[float], failure: str
) -> Iterator[Comparison]:
    best = fits[-1]
    parts = [("all", [fit.rms for fit in fits], float(np.linalg.norm(NOISE)))]
    parts += [(axis, [fit.by_axis[i] for fit in fits], NOISE[i]) for i, axis in enumerate(AXES)]
    for part, values, noise in parts:
        yield Comparison(
            problem=NAME,
            case=f"{state} %",
            faces=faces,
            model=kind.label,
            quantity="rms residual of the beads" if part == "all" else f"rms residual along {part}",
            unit="mm",
            measured=0.0,
            uncertainty=1e3 * float(noise),
            coverage=1.0,
            found=1e3 * float(values[-1]),
            numerical=1e3 * own_error(values, sizes),
            fitted=FITTED,
            note=failure or f"plate {1e3 * best.way:.2f} mm",
        )
