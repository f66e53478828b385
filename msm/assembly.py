"""A lattice over an organ with its support and load, and what it is made of."""

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
from msm.graded import GradedLattice
from msm.lattice import CellLattice, LatticeMesh
from msm.laws import Law
from msm.network import Network, network
from msm.octree import Grading
from msm.outer import Burden
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
    """A lattice over an organ with its springs, support and load, whatever cells and springs' law.

    `mass` [kg] (n,), of weights too; `foundation` [N/m] (n, n), acting alike along each axis;
    `load` [N] (n, 3). `composition`: what each cell is made of, None where all are of one tissue;
    `connect`: the springs for a stiffness (c,) of each cell relative to that of the law; `fixed`
    (n, 3): which components of nodes do not move, None where all may. They are without load.
    `masters` (n, n): how hanging nodes, which have none of these, move with the others, if any.
    `burden`: what acts beside the load.
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
    burden: Burden | None = None


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
    foundation: Support,
    tool: ToolPatch,
    flexion: float = 0.0,
    body_diagonals: float = 0.0,
    tissue: Tissue | None = None,
) -> Assembly:
    """Cubic lattice over the body. ValueError if empty, not held, or not touched by the tool.

    `tissue`: what differs from place to place, if anything; `density` is that around.
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
    """With the nodes fixed that are nearest to a fixed point of the surface.

    By weights (q, n) at the points of the surface; a node may lie half a cell from it.
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
    """Of the nodes [kg] (n,)."""
    if made is None:
        return np.asarray(density * cells.node_volumes(lattice))
    return cells.at_nodes(lattice, lattice.fill * made.density(density))


def of_tissue(assembly: Assembly, material: Material, modulus: float) -> tuple[Assembly, Material]:
    """The lattice with what its cells are made of, round which the material has a modulus [Pa].

    Springs are as stiff as the mean shear modulus of each cell, whatever their law, which all parts
    share. With a volume term regions have their own Poisson ratio, without it 1/4 as all springs.
    The same lattice and material of one tissue. ValueError for a region with a ratio below 1/4.
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
    """Lower and upper corner [m] of the box of a body, a little larger."""
    margin = 1e-9 * np.ptp(surface.points, axis=0).max()
    return surface.points.min(axis=0) - margin, surface.points.max(axis=0) + margin


def contact(
    weights: csr_array, surface: SurfaceRule, foundation: Support, tool: ToolPatch
) -> tuple[csr_array, Floats]:
    """Foundation [N/m] (n, n) and load [N] (n, 3) that nodes take by weights (q, n).

    ValueError if nothing is held, or touched by the tool.
    """
    resting = foundation.density(surface.points, surface.normals) * surface.weights
    pushed = tool.profile(surface.points, surface.normals) * surface.weights
    if not (resting.any() or foundation.fixed(surface.points, surface.normals).any()):
        raise ValueError("the support holds no surface; enlarge support.depth")
    if tool.force == 0.0:  # moved, and not a load
        return csr_array(weights.T @ diags_array(resting) @ weights), np.zeros(
            (weights.shape[1], 3)
        )
    if not pushed.any():
        raise ValueError("the tool touches no surface; move tool.place or enlarge tool.radius")
    support = csr_array(weights.T @ diags_array(resting) @ weights)
    nodal = weights.T @ (pushed * tool.force / pushed.sum())
    return support, np.outer(nodal, tool.direction)


def burdened(
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
    """The assembly with what acts on it beside its first load, gravity [m/s^2] (3,) among it.

    Loads and weights act by the rule `surface`, tools meet the points of `touched`, or its own.
    ValueError if a load or weight touches no surface.
    """
    at_points, _ = assembly.lattice.interpolation(surface.points)

    def nodal(patch: ToolPatch) -> Floats:
        """The patch's force, shared out among the nodes (n,)."""
        pushed = patch.profile(surface.points, surface.normals) * surface.weights
        if not pushed.any():
            raise ValueError(f"{patch.name}: touches no surface that faces it; move or enlarge it")
        return np.asarray(at_points.T @ (pushed * patch.force / pushed.sum()))

    attached = np.zeros_like(assembly.mass)
    for one in weights:
        attached += one.mass * nodal(one.patch)
    mass = assembly.mass + attached
    pushes = [np.outer(nodal(one.tool), one.tool.direction) for one in loads]
    moves = 1.0 if assembly.fixed is None else ~assembly.fixed
    burden = Burden(
        np.outer(mass, gravity) * moves,
        attached,
        np.array(pushes).reshape(-1, len(mass), 3) * moves,
        tuple(one.factor for one in loads),
        tuple(tools),
        touched or surface,
        given_loaded,
    )
    return replace(assembly, mass=mass, burden=burden)


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
        fixed=assembly.fixed,
        masters=assembly.masters,
        undamped=None if assembly.burden is None else assembly.burden.attached,
    )
