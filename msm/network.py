"""Arrays of a lattice for the compiled kernels: springs, cells, nodes, foundation, load."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.ties import tied

if TYPE_CHECKING:
    from msm.damping import NodalDamping
    from msm.external_loads import ExternalArrays
    from msm.springs import Springs
    from msm.volume import VolumeTerm

Floats = NDArray[np.float64]


class Network(NamedTuple):
    """Input of the force and integrator kernels.

    Springs: `ends` (s, 2) uint32; rest vector `rest` [m] (s, 3); rest length `length` [m] (s,);
    `scale` [m] (s,), weight times rest length. Cells: `cells` (c, 8) uint32; `bulk` [J] (c,), kappa
    times volume; `edges` [m] (c,); `swollen` (c,), J - 1 of the stress-free cell. `spacing` [m] of
    the lattice. Nodes (n,): `mass` [kg], `gamma_0` [N s/m], `gamma_1` [N s/m^2]. `beta` [s]:
    damping over stiffness of springs, cells and foundation. Foundation in compressed rows: `row`,
    `column`, `value` [N/m]. `load` [N] (n, 3). `linear`: forces of small displacements.

    Hanging nodes (`msm.hanging`): the displacement of node `hanging[k]` is the sum of those of
    `master[p]` times `part[p]`, p from `first_master[k]` to `first_master[k + 1]`. The masters
    carry its mass; its entry of `mass` only scales bounds of frequencies.

    `external`: loads beside the first one, None without any. `fixed` (f, 2) uint32: node and
    component of each constrained displacement, on which no force acts.
    """

    ends: NDArray[np.uint32]
    rest: Floats
    length: Floats
    scale: Floats
    cells: NDArray[np.uint32]
    bulk: Floats
    spacing: float
    mass: Floats
    gamma_0: Floats
    gamma_1: Floats
    beta: float
    row: NDArray[np.uint32]
    column: NDArray[np.uint32]
    value: Floats
    load: Floats
    linear: bool
    edges: Floats
    hanging: NDArray[np.uint32]
    first_master: NDArray[np.uint32]
    master: NDArray[np.uint32]
    part: Floats
    swollen: Floats
    external: ExternalArrays | None
    fixed: NDArray[np.uint32] = np.zeros((0, 2), dtype=np.uint32)

    @property
    def is_strained(self) -> bool:
        """Whether the given shape is under stress."""
        return bool(self.swollen.any() or (np.linalg.norm(self.rest, axis=1) != self.length).any())


def network(
    springs: Springs,
    mass: Floats,
    foundation: csr_array,
    load: Floats,
    volume: VolumeTerm,
    damping: NodalDamping,
    *,
    linear: bool = False,
    masters: csr_array | None = None,
    fixed: NDArray[np.bool_] | None = None,
    undamped: Floats | None = None,
) -> Network:
    """Arrays of a body with nodal mass [kg] (n,), foundation [N/m] (n, n) and load [N] (n, 3).

    `masters` (n, n): interpolation of all nodes from those that do not hang, None without hanging
    nodes; `fixed` (n, 3): constrained components; `undamped` [kg] (n,): part of the mass on which
    nodal damping does not act.
    """
    ties = tied(masters)
    mass = mass if masters is None else mass + (mass == 0.0) * (masters @ mass)
    damped = mass if undamped is None else mass - undamped
    length = springs.rest_length
    constrained = np.zeros_like(load, dtype=np.bool_) if fixed is None else fixed
    return Network(
        ends=np.ascontiguousarray(springs.ends, dtype=np.uint32),
        rest=np.ascontiguousarray(springs.rest),
        length=length,
        scale=springs.weight * length,
        cells=np.ascontiguousarray(volume.cells, dtype=np.uint32),
        bulk=np.ascontiguousarray(volume.bulk),
        spacing=float(volume.spacing),
        mass=np.ascontiguousarray(mass),
        gamma_0=damping.gamma_0 * damped,
        gamma_1=damping.gamma_1 * damped,
        beta=float(damping.beta),
        row=foundation.indptr.astype(np.uint32),
        column=foundation.indices.astype(np.uint32),
        value=foundation.data.astype(np.float64),
        load=np.where(constrained, 0.0, load),
        linear=linear,
        fixed=np.ascontiguousarray(np.argwhere(constrained), dtype=np.uint32),
        edges=np.ascontiguousarray(volume.edges),
        hanging=ties.hanging,
        first_master=ties.first,
        master=ties.master,
        part=ties.part,
        swollen=np.zeros(len(volume.bulk)),
        external=None,
    )
