"""A blunt tool that travels over the surface: fixed patches at stations on its path, in turn.

The share of each station is a cardinal cubic spline in the arc length of a straight piece of the
path (de Boor 1978, A Practical Guide to Splines, chapter 4; not-a-knot ends), one at its own
station and zero at all others. Together they reproduce cubic polynomials. On a flat surface the
force, its centre and its second and third moment along the path are therefore those of the tool at
all times. The remaining error falls with the fourth power of the distance of stations, with hat
functions by the second. At its rim the pressure is slightly negative, by 0.6 % of the force at the
distance in use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Floats = NDArray[np.float64]

APART = 0.25
"""Largest distance of stations, in radii of the tool: `reports/data/travelling_stations.csv`."""
MEASURED = 0.002
"""Bound on the error of the displacement under the tool with such stations, same table."""
DEGREE = 3
MOST = 200
"""Largest number of stations: each is a load that every step of a lattice adds up."""
OUTLINE = 33
"""Number of places by which a path is drawn."""
SAME = 1e-6
"""Distance, in radii, below which two stations are one that the tool passes twice."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Share of one station along a straight piece between two marks [m] of the path."""

    first: float
    last: float
    share: BSpline


@dataclass(frozen=True, eq=False)
class StationFactor:
    """Load factor of a station: its share of the tool times the tool's history.

    `times` [s] and `marks` [m] (c,): arc length travelled over time, linear in between and constant
    before and after. `history`: share of the tool's force at times [s].
    """

    times: Floats
    marks: Floats
    pieces: tuple[Piece, ...]
    history: Callable[[Floats], Floats]

    def share(self, times: Floats) -> Floats:
        """Share of the tool's pressure at the station at times [s]; the shape of `times`."""
        at = np.asarray(np.interp(times, self.times, self.marks))
        found = np.zeros_like(at)
        for one in self.pieces:
            on = (one.first <= at) & (at <= one.last)  # adjacent pieces agree where they meet
            found[on] = one.share(at[on])
        return found

    def __call__(self, times: Floats) -> Floats:
        """Share of the tool's full force at times [s]."""
        return np.asarray(self.share(times) * self.history(times))


@dataclass(frozen=True)
class Stations:
    """Arc lengths [m] (k,) of stations on a path, and their places across the push [m] (k, 3).

    `pieces` (p, 2): numbers of the first and last station of each straight piece.
    """

    marks: Floats
    away: Floats
    pieces: tuple[tuple[int, int], ...]

    def shares(self) -> list[list[Piece]]:
        """For each station, its share on each of its pieces."""
        from scipy.interpolate import make_interp_spline

        found: list[list[Piece]] = [[] for _ in self.marks]
        for first, last in self.pieces:
            marks = self.marks[first : last + 1]
            for n, unit in enumerate(np.eye(len(marks))):
                spline = make_interp_spline(marks, unit, min(DEGREE, len(marks) - 1))
                found[first + n].append(Piece(marks[0], marks[-1], spline))
        return found


def stations(corners: Floats, distance: float) -> tuple[Stations, Floats]:
    """Stations at most `distance` [m] apart on straight pieces between corners [m] (c, 3).

    Also the arc lengths (c,) of the corners. ValueError for a path without length, or too many
    stations.
    """
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    marks, away, pieces = [0.0], [corners[0]], []
    if not lengths.any():
        raise ValueError("stays where it is; give offsets across the push, or leave it out")
    if lengths.sum() > distance * MOST:
        raise ValueError(
            f"{1e3 * lengths.sum():.4g} mm take more than {MOST} places of the tool, "
            f"{1e3 * distance:.3g} mm apart; shorten it or enlarge the radius"
        )
    for start, end, length in zip(corners, corners[1:], lengths, strict=False):
        if not length:
            continue
        shares = np.linspace(0.0, 1.0, int(np.ceil(length / distance * (1.0 - 1e-9))) + 1)[1:]
        pieces.append((len(marks) - 1, len(marks) - 1 + len(shares)))
        marks += (marks[-1] + length * shares).tolist()
        away += list(start + np.outer(shares, end - start))
    found = Stations(np.array(marks), np.array(away), tuple(pieces))
    return found, np.concatenate([[0.0], np.cumsum(lengths)])


def station_loads(
    found: Stations,
    places: Floats,
    times: Floats,
    marks: Floats,
    history: Callable[[Floats], Floats],
    same: float,
) -> Iterator[tuple[Floats, StationFactor]]:
    """Place [m] (3,) and load factor of each station, merging those closer than `same` [m]."""
    shares, left = found.shares(), list(range(len(places)))
    while left:
        here = places[left[0]]
        at = [n for n in left if np.linalg.norm(places[n] - here) < same]
        left = [n for n in left if n not in at]
        yield (
            here,
            StationFactor(times, marks, tuple(one for n in at for one in shares[n]), history),
        )


def travel_paths(loads: Sequence[tuple[str, Floats, Callable[[Floats], Floats]]]) -> Floats:
    """Places [m] (tools, OUTLINE, 3), equally spaced in time, of each tool that travels.

    `loads`: name of the tool, place [m] (3,) and factor of each load.
    """
    stations: dict[str, list[tuple[Floats, StationFactor]]] = {}
    for name, place, factor in loads:
        if isinstance(factor, StationFactor):
            stations.setdefault(name, []).append((place, factor))
    found = [_outline(one) for one in stations.values()]
    return np.stack(found) if found else np.zeros((0, OUTLINE, 3))


def _outline(stations: Sequence[tuple[Floats, StationFactor]]) -> Floats:
    times = stations[0][1].times
    at = np.linspace(times[0], times[-1], OUTLINE)
    shares = np.column_stack([factor.share(at) for _, factor in stations])
    return np.asarray(shares @ np.array([place for place, _ in stations]))


def full_share(history: Callable[[Floats], Floats], time: float) -> float:
    """Share of a load in the full load at rest.

    One, or for a station the share it has at `time` [s], when the tool is where its rest is
    evaluated.
    """
    return float(history.share(np.array([time]))[0]) if isinstance(history, StationFactor) else 1.0
