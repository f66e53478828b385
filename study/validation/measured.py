"""Figures that were measured, as they come with the program (`study/validation/data`).

silicone_cylinders.csv: force on a cylinder of 50 mm across and 30 mm high between plates, mean and
standard deviation of so many tests at each engineering strain. Dawood et al. (2026), a database of
tissue phantom materials, CC BY 4.0. Plates' friction not stated; load zero +-0.1 N.

silicone_beam.csv: places and displacements [mm] of markers on a beam of 100 x 30 x 30 mm clamped
at one end, x from the tip, y across, z up: from straight to rest under its weight, and with a
weight on the upper tip edge as well. Zhang et al., sim-to-real of diffPD, arXiv:2201.12560, MIT.

silicone_cube.csv: places [mm] of 343 beads in a cube of 80 mm, unloaded and under a plate at
nominal 5 and 18.25 %, by computed tomography. Kerdok et al. (2003), Med. Image Anal. 7:283.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FOLDER = resources.files("study.validation").joinpath("data")
MILLI = 1e-3


@dataclass(frozen=True)
class Compression:
    """Force [N] and its standard deviation at engineering strains, each (k,), of a material."""

    material: str
    strain: Floats
    force: Floats
    deviation: Floats

    def at(self, strain: float) -> tuple[float, float]:
        """Force [N] and its standard deviation at a strain; nan beyond the last."""
        found = [np.interp(strain, self.strain, of) for of in (self.force, self.deviation)]
        within = strain <= self.strain[-1] + 1e-9
        return (float(found[0]), float(found[1])) if within else (np.nan, np.nan)


@dataclass(frozen=True)
class Markers:
    """Places [m] (m, 3) and displacements [m] (repeats, m, 3) of markers, under a force [N].

    `base` [m] (repeats, b, 3): displacements of markers on the clamped end.
    """

    force: float
    names: tuple[str, ...]
    places: Floats
    moved: Floats
    base: Floats


@dataclass(frozen=True)
class Beads:
    """Places [m] (343, 3) of beads from the centre of the base, unloaded and in each state."""

    unloaded: Floats
    states: dict[str, Floats]


@cache
def compressions() -> tuple[Compression, ...]:
    """Compression tests of all materials."""
    lines = _lines("silicone_cylinders.csv")
    names = list(dict.fromkeys(line["material"] for line in lines))
    return tuple(
        Compression(name, *np.array(_numbers(own, "strain", "force_N", "sd_N")).T)
        for name in names
        for own in [[line for line in lines if line["material"] == name]]
    )


@cache
def beam_markers() -> tuple[Markers, ...]:
    """Under the beam's weight, then with a weight on its tip."""
    lines = _lines("silicone_beam.csv")
    return tuple(
        _markers(force, [line for line in lines if line["tip_force_N"] == force])
        for force in dict.fromkeys(line["tip_force_N"] for line in lines)
    )


def _markers(force: str, lines: list[dict[str, str]]) -> Markers:
    tips = tuple(dict.fromkeys(x["marker"] for x in lines if x["marker"].startswith("tip")))
    bases = tuple(dict.fromkeys(x["marker"] for x in lines if x["marker"].startswith("base")))

    def table(names: tuple[str, ...], *columns: str) -> Floats:
        found = [_numbers([x for x in lines if x["marker"] == name], *columns) for name in names]
        return MILLI * np.swapaxes(np.array(found), 0, 1)

    moved = ("ux_mm", "uy_mm", "uz_mm")
    places = table(tips, "x_mm", "y_mm", "z_mm").mean(axis=0)
    return Markers(float(force), tips, places, table(tips, *moved), table(bases, *moved))


@cache
def beads() -> Beads:
    """The beads of the cube."""
    lines = _lines("silicone_cube.csv")
    states = {
        state: MILLI * np.array(_numbers(own, "x_mm", "y_mm", "height_mm"))
        for state in dict.fromkeys(line["state"] for line in lines)
        for own in [[line for line in lines if line["state"] == state]]
    }
    return Beads(states.pop("0"), states)


def _lines(name: str) -> list[dict[str, str]]:
    text = FOLDER.joinpath(name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


def _numbers(lines: list[dict[str, str]], *columns: str) -> list[list[float]]:
    return [[float(line[column]) for column in columns] for line in lines]
