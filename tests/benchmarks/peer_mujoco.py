"""The block as MuJoCo's flex: tetrahedra, hexahedra of the lattice's cells, and few hexahedra."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.spatial import KDTree

from msm.lattice import CellLattice
from tests.benchmarks.contender import Block, Contender

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Full = Literal["full"]

RECOMMENDED = 0.004
"""Longest step [s] that MuJoCo's manual calls typical of its integrator `discrete`."""
COARSE = 0.04
"""Edge [m] of hexahedra where there are few: 40 of them."""
MODEL = """
<mujoco>
  <option gravity="0 0 0" integrator="{integrator}" solver="CG" tolerance="1e-6">
    <flag autoreset="disable"/>
  </option>
  <size memory="2G"/>
  <worldbody>
    <flexcomp name="block" type="grid" dim="3" count="{nodes}" spacing="{h} {h} {h}"
              radius="{radius}" dof="{dof}" {cells}>
      <contact selfcollide="none" contype="0" conaffinity="0"/>
      <edge equality="false"/>
      <elasticity young="{young}" poisson="{nu}"/>
      <pin gridrange="0 0 0 {x} {y} 0"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""
COMMON = "made for robots in contact: constraints, contact and float64 are paid for and not used"
FULL = f"{COMMON}; linear tetrahedra lock at high Poisson ratios in any code"
FINE = f"{COMMON}; trilinear is meant for few cells under many vertices, not for one a cell"
FEW = f"{COMMON}; few cells are meant for motion that looks right, not for the field under a tool"


def contenders(springs: Block, solid: Block, coarse: CellLattice) -> Iterator[Contender]:
    """Tetrahedra at both Poisson ratios; hexahedra, one a cell and few, at that of the solid."""
    yield flex(springs, "Euler", "full", FULL)
    yield flex(solid, "Euler", "full", FULL)
    yield flex(solid, "discrete", "full", FULL, RECOMMENDED)
    for cells, objection in ((solid.lattice, FINE), (coarse, FEW)):
        yield flex(solid, "Euler", cells, objection)
        yield flex(solid, "discrete", cells, objection, RECOMMENDED)


def flex_model(body: Block, integrator: str, cells: CellLattice | Full) -> Any:
    """The block as a grid of flex: tetrahedra, or the hexahedra of a lattice."""
    import mujoco

    h, own = body.lattice.spacing, counts(body.lattice)
    made_of = own if cells == "full" else counts(cells)
    text = MODEL.format(
        **{"integrator": integrator, "young": body.modulus, "nu": body.nu, "h": h},
        **{"x": made_of[0], "y": made_of[1], "radius": 0.01 * h},
        dof="full" if cells == "full" else "trilinear",
        nodes="{} {} {}".format(*(own + 1)),
        cells="" if cells == "full" else 'cellcount="{} {} {}"'.format(*made_of),
    )
    mujoco.set_mju_user_warning(lambda _: None)  # divergence is looked for by the benchmark
    return mujoco.MjModel.from_xml_string(text)


def counts(lattice: CellLattice) -> Ints:
    """How many cells the block has along each axis."""
    return np.asarray(np.ptp(lattice.index, axis=0) + 1)


def flex(
    body: Block, integrator: str, cells: CellLattice | Full, objection: str, step: float = 0.0
) -> Contender:
    """An elastic solid of the same E and nu under the lattice's loads, with its masses.

    Those of the lattice's nodes go to the nodes of hexahedra by their shape functions.
    """
    import mujoco

    model = flex_model(body, integrator, cells)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    vertex = _nearest(body.lattice.nodes, data.flexvert_xpos, body.lattice.spacing)
    moves_with = shares(body, body.lattice if cells == "full" else cells, data)
    model.body_mass[1:] = moves_with.T @ np.where(body.held, 0.0, body.net.mass)
    damping = moves_with.T @ np.where(body.held, 0.0, body.net.gamma_0)
    model.dof_damping[:] = np.repeat(damping, 3)
    mujoco.mj_setConst(model, data)
    mujoco.mj_forward(model, data)
    rest, push = data.flexvert_xpos.copy(), (moves_with.T @ body.net.load).ravel()

    def run(dt: float, count: int) -> Floats:
        mujoco.mj_resetData(model, data)
        data.qfrc_applied[:] = push
        model.opt.timestep = dt
        mujoco.mj_step(model, data, nstep=count)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_flex(model, data)
        return np.asarray((data.flexvert_xpos - rest)[vertex])

    kind, elements = words(body, cells)
    return Contender(
        *(f"MuJoCo flex {kind}, {integrator}", mujoco.__version__, "float64", body.nu),
        run,
        f"Saint Venant-Kirchhoff, {elements}; damping implicit",
        objection,
        step,
        body.limit,
    )


def words(body: Block, cells: CellLattice | Full) -> tuple[str, str]:
    """What the kind of solid is called, and its elements."""
    if cells == "full":
        return "full", "linear tetrahedra"
    kind = "trilinear" if cells is body.lattice else "trilinear coarse"
    return kind, f"{len(cells.cells)} trilinear hexahedra"


def shares(body: Block, cells: CellLattice, data: Any) -> csr_array:
    """How far each node of the lattice moves with each of flex's bodies, nodes of cells; (n, b)."""
    where, bodies = cells.nodes - _centre(cells.nodes), data.xpos[1:]
    # Hexahedra stand in a box that is smaller by some ten-thousandths.
    size = np.abs(bodies[:, 0]).max() / np.abs(where[:, 0]).max()
    away, node = KDTree(size * where).query(bodies)
    if away.max() > 1e-6 * cells.spacing or len(np.unique(node)) != len(node):
        raise ValueError("MuJoCo's bodies are not the nodes of the cells; its layout has changed")
    return csr_array(csc_array(cells.interpolation(body.lattice.nodes)[0])[:, node])


def _nearest(nodes: Floats, points: Floats, spacing: float) -> Ints:
    """Which of as many points, about another centre, stands at each node."""
    away, which = KDTree(points - _centre(points)).query(nodes - _centre(nodes))
    if away.max() > 1e-6 * spacing or len(points) != len(nodes):
        raise ValueError("MuJoCo's grid is not the lattice; its layout has changed")
    return np.asarray(which)


def _centre(points: Floats) -> Floats:
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))
