"""A lattice over an organ with its support and load, and what it is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from msm import graded
from msm import lattice as cells
from msm import volume as volumes
from msm.calibration import SPRING_POISSON_RATIO
from msm.damping import UNDAMPED, NodalDamping
from msm.lattice import LatticeMesh
from msm.laws import Law
from msm.network import Network, network
from msm.octree import Grading
from msm.springs import Springs, connect
from msm.volume import VolumeTerm
from study.mesh.quadrature import SurfaceRule
from study.organ.occupancy import SolidShape
from study.problem.contact import Foundation, ToolPatch

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Assembly:
    """A lattice over an organ with its springs, support and load, whatever cells and springs' law.

    `mass` [kg] (n,); `foundation` [N/m] (n, n), acting alike along each axis; `load` [N] (n, 3).
    `masters` (n, n): how hanging nodes, which have none of these, move with the others, if any.
    """

    lattice: LatticeMesh
    springs: Springs
    mass: Floats
    foundation: csr_array
    load: Floats
    masters: csr_array | None = None


@dataclass(frozen=True)
class Material:
    """What a lattice is made of: spring law, volume term if any, damping."""

    law: Law
    volume: VolumeTerm | None = None
    damping: NodalDamping = UNDAMPED

    @property
    def poisson_ratio(self) -> float:
        """Of a cubic lattice of it; springs on tetrahedra have that of the mesh."""
        return SPRING_POISSON_RATIO if self.volume is None else self.volume.poisson_ratio


def assemble(
    body: SolidShape,
    surface: SurfaceRule,
    density: float,
    spacing: float,
    foundation: Foundation,
    tool: ToolPatch,
    flexion: float = 0.0,
    body_diagonals: float = 0.0,
) -> Assembly:
    """Cubic lattice over the body. ValueError if empty, not held, or not touched by the tool."""
    lattice = cells.build(body, *_box(surface), spacing)
    weights, _ = lattice.interpolation(surface.points)
    return Assembly(
        lattice,
        connect(lattice, flexion, body_diagonals),
        density * cells.node_volumes(lattice),
        *contact(weights, surface, foundation, tool),
    )


def assemble_graded(
    body: SolidShape,
    surface: SurfaceRule,
    density: float,
    grading: Grading,
    foundation: Foundation,
    tool: ToolPatch,
    flexion: float = 0.0,
) -> Assembly:
    """Graded lattice over the body. ValueError if empty, not held, or not touched by the tool."""
    lattice = graded.build(body, *_box(surface), grading)
    weights, _ = lattice.interpolation(surface.points)
    return Assembly(
        lattice,
        graded.springs(lattice, flexion),
        graded.node_masses(lattice, density),
        *contact(weights, surface, foundation, tool),
        masters=lattice.masters if lattice.hanging else None,
    )


def _box(surface: SurfaceRule) -> tuple[Floats, Floats]:
    """Lower and upper corner [m] of the box of a body, a little larger."""
    margin = 1e-9 * np.ptp(surface.points, axis=0).max()
    return surface.points.min(axis=0) - margin, surface.points.max(axis=0) + margin


def contact(
    weights: csr_array, surface: SurfaceRule, foundation: Foundation, tool: ToolPatch
) -> tuple[csr_array, Floats]:
    """Foundation [N/m] (n, n) and load [N] (n, 3) that nodes take by weights (q, n).

    ValueError if nothing is held, or touched by the tool.
    """
    held = foundation.density(surface.points, surface.normals) * surface.weights
    pushed = tool.profile(surface.points, surface.normals) * surface.weights
    if not held.any():
        raise ValueError("the support holds no surface; enlarge support.depth")
    if not pushed.any():
        raise ValueError("the tool touches no surface; move tool.place or enlarge tool.radius")
    support = csr_array(weights.T @ diags_array(held) @ weights)
    nodal = weights.T @ (pushed * tool.force / pushed.sum())
    return support, np.outer(nodal, tool.direction)


def arrays(assembly: Assembly, material: Material, *, linear: bool = False) -> Network:
    """The lattice and its material as the kernels read them."""
    volume = material.volume or volumes.none(assembly.lattice.spacing)
    return network(
        assembly.springs,
        assembly.mass,
        assembly.foundation,
        assembly.load,
        volume,
        material.damping,
        linear=linear,
        masters=assembly.masters,
    )
