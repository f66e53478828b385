"""The arrays that the compiled loops read: springs, cells, nodes, foundation, load."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.hanging import tied

if TYPE_CHECKING:
    from msm.damping import NodalDamping
    from msm.outer import Outer
    from msm.springs import Springs
    from msm.volume import VolumeTerm

Floats = NDArray[np.float64]


class Network(NamedTuple):
    """What the force and integrator kernels are given.

    Springs: `ends` (s, 2) uint32; `rest` [m] (s, 3); `length` [m] (s,); `scale` [m] (s,), weight
    times rest length. Cells: `cells` (c, 8) uint32, `bulk` [J] and `edges` [m], each (c,);
    `spacing` [m]: that of the lattice. Nodes: `mass`
    [kg], `gamma_0` [N s/m], `gamma_1` [N s/m^2], each (n,). `beta` [s]: damping over stiffness of
    springs, cells and foundation. Foundation: `row`, `column`, `value` [N/m], compressed rows.
    `load` [N] (n, 3). `linear`: forces of small displacements. Hanging nodes, see `msm.hanging`:
    the node `hanging[k]` moves as its masters `master[p]` by the shares `part[p]`, p from
    `first_master[k]` to `first_master[k + 1]`; its mass is theirs, and a scale only. `swollen`
    (c,): J - 1 at which a cell is unstressed. `outer`: what acts beside the load, None for nothing.
    `fixed` (f, 2) uint32: node and component of each displacement that does not change, on which no
    force acts.
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
    outer: Outer | None
    fixed: NDArray[np.uint32] = np.zeros((0, 2), dtype=np.uint32)

    @property
    def is_strained(self) -> bool:
        """Whether the given shape is not the unstressed one."""
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
    """Arrays of a body of the given nodal mass [kg] (n,), foundation (n, n), load [N] (n, 3).

    `masters` (n, n): how all nodes move with those that are free, None if all are; `fixed` (n, 3):
    components of the nodes that do not move; `undamped` [kg] (n,): of the mass, what nodal damping
    does not act on.
    """
    ties = tied(masters)
    mass = mass if masters is None else mass + (mass == 0.0) * (masters @ mass)
    damped = mass if undamped is None else mass - undamped
    length = springs.rest_length
    held = np.zeros_like(load, dtype=np.bool_) if fixed is None else fixed
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
        load=np.where(held, 0.0, load),
        linear=linear,
        fixed=np.ascontiguousarray(np.argwhere(held), dtype=np.uint32),
        edges=np.ascontiguousarray(volume.edges),
        hanging=ties.hanging,
        first_master=ties.first,
        master=ties.master,
        part=ties.part,
        swollen=np.zeros(len(volume.bulk)),
        outer=None,
    )
