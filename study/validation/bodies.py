"""The measured specimens, with the data of their makers or experimenters."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import TetrahedralMesh
from study.organ.block import block_of_cells
from study.organ.cylinder import onto_side, quarter_cylinder
from study.organ.occupancy import ImplicitBody
from study.validation.specimen import Meshed, Specimen, free, on_plane

Floats = NDArray[np.float64]

BONDED, SLIDING = "bonded", "sliding"
FACES = (BONDED, SLIDING)
"""Tangential condition between plates and faces: bonded, or frictionless."""
GRAVITY = 9.81
"""[m/s^2]"""
SILICONE = 0.499
"""Poisson's ratio of silicone rubber, as stated by the makers of the beam and the cube."""
EVERYWHERE = ImplicitBody(lambda x: np.full(x.shape[:-1], -1.0))

RADIUS, HEIGHT = 0.025, 0.030
"""Radius and height of the cylinders [m]."""
BEAM = (0.1, 0.03, 0.03)
"""Length, width and height of the beam [m]."""
BEAM_DENSITY = 1070.0
BEAM_CELLS, BEAM_SPACINGS = (1, 2, 3), (7.5e-3, 5e-3, 3.75e-3)
"""Elements across half the width, and spacings [m] of lattices, coarse to fine."""
CUBE = 0.08
"""Edge of the cube [m]."""
CUBE_DENSITY = 980.0
CUBE_CELLS, CUBE_SPACED = (2, 3, 4), (3, 4, 6)
"""Cells of elements and of lattices along half an edge, coarse to fine."""
CYLINDER_PARTS = (3, 4, 6)
"""Rings and layers of elements, and cells of lattices, in half the height, coarse to fine."""


def cylinder(faces: str) -> Specimen:
    """An eighth of a silicone cylinder compressed by plates; factor 1 is its whole height."""
    half = 0.5 * HEIGHT
    shape = ImplicitBody(lambda x: np.hypot(x[..., 0], x[..., 1]) - RADIUS)
    meshes = tuple(
        Meshed(partial(quarter_cylinder, RADIUS, half, n, n), half / n, onto_side(RADIUS, n))
        for n in CYLINDER_PARTS
    )

    def prescribed(points: Floats) -> Floats:
        found = free(points)
        for axis in range(3):
            found[on_plane(points, axis, 0.0), axis] = 0.0
        top = on_plane(points, 2, half)
        if faces == BONDED:
            found[top, :2] = 0.0
        found[top, 2] = -half
        return found

    upper = np.array([RADIUS, RADIUS, half])
    return Specimen(
        meshes,
        tuple(half / n for n in CYLINDER_PARTS),
        shape,
        np.zeros(3),
        upper,
        prescribed,
        SILICONE,
        parts=4,
        along=(2, half),
    )


def cube(faces: str, watched: Floats) -> Specimen:
    """A quarter of the cube, held at its base z = 0, under a plate; factor 1 is its whole edge.

    `watched` [m] (q, 3), mirrored into the quarter.
    """
    half = 0.5 * CUBE
    size = (half, half, CUBE)

    def prescribed(points: Floats) -> Floats:
        found = free(points)
        base, top = on_plane(points, 2, 0.0), on_plane(points, 2, CUBE)
        found[base] = 0.0
        if faces == BONDED:
            found[top] = 0.0
        for axis in range(2):
            found[on_plane(points, axis, 0.0), axis] = 0.0
        found[top, 2] = -CUBE
        return found

    return Specimen(
        tuple(_boxes(size, n) for n in CUBE_CELLS),
        tuple(half / n for n in CUBE_SPACED),
        EVERYWHERE,
        np.zeros(3),
        np.array(size),
        prescribed,
        SILICONE,
        parts=4,
        density=CUBE_DENSITY,
        watched=watched,
        along=(2, CUBE),
    )


def beam(tip_force: float, watched: Floats) -> Specimen:
    """Half of the beam, clamped at x = -0.1 m, under its weight and a force on the upper tip edge.

    `tip_force` [N] downwards, on the whole beam. x is from the tip, y from the plane of symmetry,
    z from the lower side.
    """
    length, width, height = BEAM
    half = 0.5 * width
    ends = np.linspace(0.0, half, 31)
    middle = 0.5 * (ends[1:] + ends[:-1])
    edge = np.stack([0.0 * middle, middle, np.full_like(middle, height)], axis=1)
    forces = np.zeros_like(edge)
    forces[:, 2] = -0.5 * tip_force / len(edge)

    def prescribed(points: Floats) -> Floats:
        found = free(points)
        found[on_plane(points, 1, 0.0), 1] = 0.0
        found[on_plane(points, 0, -length)] = 0.0
        return found

    lower = np.array([-length, 0.0, 0.0])
    return Specimen(
        tuple(_beam_level(n) for n in BEAM_CELLS),
        BEAM_SPACINGS,
        EVERYWHERE,
        lower,
        np.array([0.0, half, height]),
        prescribed,
        SILICONE,
        parts=2,
        density=BEAM_DENSITY,
        acceleration=np.array([0.0, 0.0, -GRAVITY]),
        at=edge,
        forces=forces,
        watched=watched,
        along=(0, -length),
    )


def _beam_level(cells: int) -> Meshed:
    length, width, height = BEAM
    half = 0.5 * width
    counts = np.array([round(length / half) * cells, cells, 2 * cells])

    def mesh() -> TetrahedralMesh:
        found = block_of_cells((length, half, height), counts)
        return TetrahedralMesh(found.points - [length, 0.0, 0.0], found.tetrahedra)

    return Meshed(mesh, 1.0 / cells)


def _boxes(size: tuple[float, float, float], cells: int) -> Meshed:
    counts = np.array([cells, cells, 2 * cells])
    return Meshed(partial(block_of_cells, size, counts), 1.0 / cells)
