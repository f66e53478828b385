"""Assembly of a lattice over an organ: springs, masses, support, loads and material."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from msm import graded
from msm import lattice as cells
from msm import volume as volumes
from msm.calibration import SPRING_POISSON_RATIO, lame
from msm.damping import UNDAMPED, NodalDamping
from msm.external_loads import ExternalLoads
from msm.graded import GradedLattice
from msm.lattice import CellLattice, LatticeMesh
from msm.laws import Law
from msm.network import Network, network
from msm.octree import Grading
from msm.springs import Springs, connect
from msm.volume import VolumeTerm
from study.mesh.quadrature import SurfaceRule
from study.organ.occupancy import SolidShape
from study.problem.contact import Load, ToolPatch, Weight
from study.problem.heterogeneous import Composition
from study.problem.rigid import RigidTool
from study.problem.supports import Support
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


@dataclass(frozen=True)
class Assembly:
    """A lattice with springs, support and load, for any type of cell and any spring law.

    `mass` [kg] (n,), attached weights included; `foundation` [N/m] (n, n), the same along each
    axis; `load` [N] (n, 3). `composition`: tissue of each cell, None for a homogeneous body;
    `connect`: makes the springs for a stiffness (c,) of each cell relative to that of the law;
    `fixed` (n, 3): constrained components of nodes, which carry no load, None without any.
    `masters` (n, n): interpolation of all nodes from those that do not hang, None without hanging
    nodes, which have no mass, foundation or load. `external_loads`: loads beside the first one.
    """

    lattice: LatticeMesh
    springs: Springs
    mass: Floats
    foundation: csr_array
    load: Floats
    composition: Composition | None = None
    connect: Callable[[Floats], Springs] | None = None
    fixed: Booleans | None = None
    masters: csr_array | None = None
    external_loads: ExternalLoads | None = None


@dataclass(frozen=True)
class Material:
    """Spring law, volume term if any, and damping of a lattice."""

    law: Law
    volume: VolumeTerm | None = None
    damping: NodalDamping = UNDAMPED

    @property
    def poisson_ratio(self) -> float:
        """Poisson ratio of a cubic lattice; that of springs on tetrahedra depends on the mesh."""
        return SPRING_POISSON_RATIO if self.volume is None else self.volume.poisson_ratio


def assemble(
    body: SolidShape,
    surface: SurfaceRule,
    density: float,
    spacing: float,
    foundation: Support,
    tool: ToolPatch,
    flexion: float = 0.0,
    body_diagonals: float = 0.0,
    tissue: Tissue | None = None,
) -> Assembly:
    """Cubic lattice over the body. ValueError if empty, not held, or not touched by the tool.

    `density` [kg/m^3] of the homogeneous tissue; `tissue` has its inclusions, if any.
    """
    lattice = cells.build(body, *_box(surface), spacing)
    weights, _ = lattice.interpolation(surface.points)
    made = cells.composed(lattice, tissue)
    whole = Assembly(
        lattice,
        connect(lattice, flexion, body_diagonals),
        _mass(lattice, density, made),
        *contact(weights, surface, foundation, tool),
        made,
        partial(connect, lattice, flexion, body_diagonals),
    )
    return held(whole, weights, surface, foundation)


def held(
    assembly: Assembly, weights: csr_array, surface: SurfaceRule, support: Support
) -> Assembly:
    """The assembly with the node nearest to each fixed point of the surface constrained.

    `weights` (q, n): interpolation at the surface points. A node may lie half a cell from its
    point.
    """
    fixed = support.fixed(surface.points, surface.normals)
    if not fixed.any():
        return assembly
    nearest = np.asarray(weights.argmax(axis=1)).ravel()
    nodes = np.zeros((weights.shape[1], 3), dtype=np.bool_)
    for d in range(3):
        nodes[nearest[fixed[:, d]], d] = True
    return replace(assembly, fixed=nodes, load=np.where(nodes, 0.0, assembly.load))


def _mass(lattice: CellLattice, density: float, made: Composition | None) -> Floats:
    """Lumped mass [kg] (n,)."""
    if made is None:
        return np.asarray(density * cells.node_volumes(lattice))
    return cells.at_nodes(lattice, lattice.fill * made.density(density))


def of_tissue(assembly: Assembly, material: Material, modulus: float) -> tuple[Assembly, Material]:
    """Lattice and material with inclusions in a tissue of Young's modulus `modulus` [Pa].

    The springs of a cell scale with its mean shear modulus; all cells share one spring law. With a
    volume term each inclusion has its own Poisson ratio, without it 1/4. A homogeneous lattice is
    returned unchanged. ValueError for an inclusion with a Poisson ratio below 1/4.
    """
    made, nu = assembly.composition, material.poisson_ratio
    term = material.volume
    if made is None or assembly.connect is None:
        return assembly, material
    found = made.moduli(Tissue(youngs_modulus=modulus, poisson_ratio=nu), one_ratio=term is None)
    springs = assembly.connect(found.shear / lame(modulus, nu)[1])
    if term is not None and isinstance(assembly.lattice, CellLattice | GradedLattice):
        term = volumes.of_cells(assembly.lattice, found.lame - found.shear, nu)
    return replace(assembly, springs=springs), replace(material, volume=term)


def assemble_graded(
    body: SolidShape,
    surface: SurfaceRule,
    density: float,
    grading: Grading,
    foundation: Support,
    tool: ToolPatch,
    flexion: float = 0.0,
    tissue: Tissue | None = None,
) -> Assembly:
    """Graded lattice over the body. ValueError if empty, not held, or not touched by the tool.

    `density` and `tissue` as in `assemble`.
    """
    lattice = graded.build(body, *_box(surface), grading)
    weights, _ = lattice.interpolation(surface.points)
    made = cells.composed(lattice, tissue)
    densities = np.full(len(lattice.fill), density) if made is None else made.density(density)
    whole = Assembly(
        lattice,
        graded.springs(lattice, flexion),
        graded.node_masses(lattice, densities),
        *contact(weights, surface, foundation, tool),
        made,
        partial(graded.springs, lattice, flexion),
        masters=lattice.masters if lattice.hanging else None,
    )
    return held(whole, weights, surface, foundation)


def _box(surface: SurfaceRule) -> tuple[Floats, Floats]:
    """Lower and upper corner [m] of the bounding box of a body, slightly enlarged."""
    margin = 1e-9 * np.ptp(surface.points, axis=0).max()
    return surface.points.min(axis=0) - margin, surface.points.max(axis=0) + margin


def contact(
    weights: csr_array, surface: SurfaceRule, foundation: Support, tool: ToolPatch
) -> tuple[csr_array, Floats]:
    """Foundation [N/m] (n, n) and load [N] (n, 3) of the nodes by interpolation weights (q, n).

    ValueError if the support holds no surface, or the tool touches none.
    """
    resting = foundation.density(surface.points, surface.normals) * surface.weights
    pushed = tool.profile(surface.points, surface.normals) * surface.weights
    if not (resting.any() or foundation.fixed(surface.points, surface.normals).any()):
        raise ValueError("the support holds no surface; enlarge support.depth")
    support = csr_array(weights.T @ diags_array(resting) @ weights)
    if tool.force == 0.0:  # a tool of prescribed motion, which is not a load
        return support, np.zeros((weights.shape[1], 3))
    if not pushed.any():
        raise ValueError("the tool touches no surface; move tool.place or enlarge tool.radius")
    nodal = weights.T @ (pushed * tool.force / pushed.sum())
    return support, np.outer(nodal, tool.direction)


def with_external_loads(
    assembly: Assembly,
    surface: SurfaceRule,
    gravity: Floats,
    loads: Sequence[Load] = (),
    weights: Sequence[Weight] = (),
    tools: Sequence[RigidTool] = (),
    *,
    touched: SurfaceRule | None = None,
    given_loaded: bool = False,
) -> Assembly:
    """The assembly with further loads, weights, rigid tools and gravity [m/s^2] (3,).

    Loads and weights are integrated by the rule `surface`; tools may touch the points of `touched`,
    by default those of `surface`. ValueError if a load or weight touches no surface.
    """
    at_points, _ = assembly.lattice.interpolation(surface.points)

    def nodal(patch: ToolPatch) -> Floats:
        """Nodal forces [N] (n,) of a patch."""
        pushed = patch.profile(surface.points, surface.normals) * surface.weights
        if not pushed.any():
            raise ValueError(f"{patch.name}: touches no surface that faces it; move or enlarge it")
        return np.asarray(at_points.T @ (pushed * patch.force / pushed.sum()))

    attached_mass = np.zeros_like(assembly.mass)
    for weight in weights:
        attached_mass += weight.mass * nodal(weight.patch)
    mass = assembly.mass + attached_mass
    nodal_loads = [np.outer(nodal(load.tool), load.tool.direction) for load in loads]
    free = 1.0 if assembly.fixed is None else ~assembly.fixed
    external_loads = ExternalLoads(
        np.outer(mass, gravity) * free,
        attached_mass,
        np.array(nodal_loads).reshape(-1, len(mass), 3) * free,
        tuple(load.factor for load in loads),
        tuple(tools),
        touched or surface,
        given_loaded,
    )
    return replace(assembly, mass=mass, external_loads=external_loads)


def arrays(assembly: Assembly, material: Material, *, linear: bool = False) -> Network:
    """The arrays of a lattice and its material for the kernels."""
    volume = material.volume or volumes.none(assembly.lattice.spacing)
    loads = assembly.external_loads
    return network(
        assembly.springs,
        assembly.mass,
        assembly.foundation,
        assembly.load,
        volume,
        material.damping,
        linear=linear,
        fixed=assembly.fixed,
        masters=assembly.masters,
        undamped=None if loads is None else loads.attached_mass,
    )
