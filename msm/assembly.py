"""A lattice over an organ with its support and load, and what it is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from msm import lattice as cells
from msm import volume as volumes
from msm.calibration import SPRING_POISSON_RATIO
from msm.damping import UNDAMPED, NodalDamping
from msm.lattice import LatticeMesh
from msm.laws import Law
from msm.network import Network, network
from msm.outer import Burden
from msm.springs import Springs, connect
from msm.volume import VolumeTerm
from study.mesh.quadrature import SurfaceRule
from study.organ.occupancy import SolidShape
from study.problem.contact import Foundation, Load, ToolPatch, Weight
from study.problem.rigid import RigidTool

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Assembly:
    """A lattice over an organ with its springs, support and load, whatever cells and springs' law.

    `mass` [kg] (n,), of weights too; `foundation` [N/m] (n, n), acting alike along each axis;
    `load` [N] (n, 3); `burden`: what acts beside it.
    """

    lattice: LatticeMesh
    springs: Springs
    mass: Floats
    foundation: csr_array
    load: Floats
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
    foundation: Foundation,
    tool: ToolPatch,
    flexion: float = 0.0,
    body_diagonals: float = 0.0,
) -> Assembly:
    """Cubic lattice over the body. ValueError if empty, not held, or not touched by the tool."""
    margin = 1e-9 * np.ptp(surface.points, axis=0).max()
    lower, upper = surface.points.min(axis=0) - margin, surface.points.max(axis=0) + margin
    lattice = cells.build(body, lower, upper, spacing)
    weights, _ = lattice.interpolation(surface.points)
    return Assembly(
        lattice,
        connect(lattice, flexion, body_diagonals),
        density * cells.node_volumes(lattice),
        *contact(weights, surface, foundation, tool),
    )


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
    if tool.force == 0.0:  # moved, and not a load
        return csr_array(weights.T @ diags_array(held) @ weights), np.zeros((weights.shape[1], 3))
    if not pushed.any():
        raise ValueError("the tool touches no surface; move tool.place or enlarge tool.radius")
    support = csr_array(weights.T @ diags_array(held) @ weights)
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

    def nodal(patch: ToolPatch, what: str) -> Floats:
        """The patch's force, shared out among the nodes (n,)."""
        pushed = patch.profile(surface.points, surface.normals) * surface.weights
        if not pushed.any():
            raise ValueError(f"{what} touches no surface that faces it; move or enlarge it")
        return np.asarray(at_points.T @ (pushed * patch.force / pushed.sum()))

    attached = np.zeros_like(assembly.mass)
    for number, one in enumerate(weights, 1):
        attached += one.mass * nodal(one.patch, f"weight.{number}")
    mass = assembly.mass + attached
    pushes = [np.outer(nodal(one.tool, "tool: a further one"), one.tool.direction) for one in loads]
    burden = Burden(
        np.outer(mass, gravity),
        attached,
        np.array(pushes).reshape(-1, len(mass), 3),
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
        undamped=None if assembly.burden is None else assembly.burden.attached,
    )
