"""A lattice over an organ with its support and load, and what it is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from msm import lattice as cells
from msm import volume as volumes
from msm.calibration import SPRING_POISSON_RATIO, lame
from msm.damping import UNDAMPED, NodalDamping
from msm.lattice import CellLattice, LatticeMesh
from msm.laws import Law
from msm.network import Network, network
from msm.springs import Springs, connect
from msm.volume import VolumeTerm
from study.mesh.quadrature import SurfaceRule
from study.organ.occupancy import SolidShape
from study.problem.contact import Foundation, ToolPatch
from study.problem.tissue import Tissue
from study.problem.varied import Composition

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Assembly:
    """A lattice over an organ with its springs, support and load, whatever cells and springs' law.

    `mass` [kg] (n,); `foundation` [N/m] (n, n), acting alike along each axis; `load` [N] (n, 3).
    `composition`: what each cell is made of, None where all are of one tissue; `connect`: the
    springs for a stiffness (c,) of each cell relative to that of the law.
    """

    lattice: LatticeMesh
    springs: Springs
    mass: Floats
    foundation: csr_array
    load: Floats
    composition: Composition | None = None
    connect: Callable[[Floats], Springs] | None = None


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
    tissue: Tissue | None = None,
) -> Assembly:
    """Cubic lattice over the body. ValueError if empty, not held, or not touched by the tool.

    `tissue`: what differs from place to place, if anything; `density` is that around.
    """
    margin = 1e-9 * np.ptp(surface.points, axis=0).max()
    lower, upper = surface.points.min(axis=0) - margin, surface.points.max(axis=0) + margin
    lattice = cells.build(body, lower, upper, spacing)
    weights, _ = lattice.interpolation(surface.points)
    made = cells.composed(lattice, tissue)
    return Assembly(
        lattice,
        connect(lattice, flexion, body_diagonals),
        _mass(lattice, density, made),
        *contact(weights, surface, foundation, tool),
        made,
        partial(connect, lattice, flexion, body_diagonals),
    )


def _mass(lattice: CellLattice, density: float, made: Composition | None) -> Floats:
    """Of the nodes [kg] (n,)."""
    if made is None:
        return np.asarray(density * cells.node_volumes(lattice))
    return cells.at_nodes(lattice, lattice.fill * made.density(density))


def of_tissue(
    assembly: Assembly, material: Material, modulus: float, *, volume_term: bool
) -> tuple[Assembly, Material]:
    """The lattice with what its cells are made of, round which the material has a modulus [Pa].

    Springs are as stiff as the mean shear modulus of each cell, whatever their law, which all parts
    share. With a `volume_term` regions have their own Poisson ratio, without it 1/4 as all springs.
    The same lattice and material of one tissue. ValueError for a region with a ratio below 1/4.
    """
    made, nu = assembly.composition, material.poisson_ratio
    if made is None or assembly.connect is None:
        return assembly, material
    found = made.moduli(Tissue(youngs_modulus=modulus, poisson_ratio=nu), one_ratio=not volume_term)
    springs = assembly.connect(found.shear / lame(modulus, nu)[1])
    term = material.volume
    if volume_term and isinstance(assembly.lattice, CellLattice):
        term = volumes.of_cells(assembly.lattice, found.lame - found.shear, nu)
    return replace(assembly, springs=springs), replace(material, volume=term)


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
    )
