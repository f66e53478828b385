"""Lattices of awkward shapes: one cell, sheets, rods, slivers, necks, hinges, tiny and huge organs.

Each is compared with closed forms that do not depend on the shape: an affine motion stores the
strain energy of the volume that exists; two solvers find the same rest; the critical step is the
one at which motions grow; a scaled organ has a scaled motion.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from msm.assembly import Assembly, Material, arrays
from msm.calibration import lame
from msm.damping import NodalDamping
from msm.laws import initial_stiffness
from msm.model import critical_time_step, run
from msm.relaxation import relax
from msm.stability import DEFAULT
from msm.statics import static_displacement
from study.known.case import Case, Family
from study.known.finding import Finding, beside, value
from study.known.stability import energy
from study.known.stability.bodies import Boxes, Make, lattice_of, watch
from study.known.stability.growth import measured_limit

Floats = NDArray[np.float64]

Box = list[list[float]]

CUBE: Box = [[0, 0, 0], [3, 3, 3]]
SHAPES: dict[str, list[Box]] = {
    "a single cell": [[[0, 0, 0], [1, 1, 1]]],
    "a sheet one cell thick": [[[0, 0, 0], [6, 1, 6]]],
    "a rod one cell thick": [[[0, 0, 0], [1, 1, 12]]],
    "sliver cells filled to a sixth": [[[0, 0, 0], [3.1, 3, 3.1]]],
    "two cubes joined by one cell": [CUBE, [[3, 1, 1], [4, 2, 2]], [[4, 0, 0], [7, 3, 3]]],
}
"""Boxes in units of the spacing; the filled share of a cell is found from 6^3 points."""
PARTED: dict[str, tuple[list[Box], float]] = {
    "joined by an edge": ([CUBE, [[3, 3, 0], [5, 5, 3]]], 12 / 39),
    "joined by a corner": ([CUBE, [[3, 3, 3], [5, 5, 5]]], 8 / 35),
    "apart": ([CUBE, [[4, 0, 0], [6, 3, 3]]], 18 / 45),
    "slivers below a twentieth": ([[[0, 0, 0], [3.1, 3.1, 3]]], 3 / 36 / (27 + 3 + 3 / 36)),
}
"""Shapes of which parts are omitted: attached by less than a face, or nearly empty cells."""
ROUNDING, SOLVED, MEASURED = 1e-12, 1e-6, 5e-3
SIZES = (1e-3, 1.0, 10.0)
FAMILY = Family("lattice shapes", __name__)


def cases() -> Iterator[Case]:
    """Cases of every shape by every closed form, of omitted parts, and of scaled organs."""
    for shape in SHAPES:
        for nu in (0.25, 0.45, 0.4999):
            title = f"energy of an affine motion, nu {nu:g}: {shape}"
            yield FAMILY.case(
                title, "stores", {"shape": shape, "nu": nu}, ROUNDING, quick=nu > 0.49
            )
        yield FAMILY.case(f"rest: {shape}", "rests", {"shape": shape}, SOLVED, quick=True)
        yield FAMILY.case(f"critical step: {shape}", "steps", {"shape": shape}, MEASURED)
    for shape in PARTED:
        yield FAMILY.case(
            f"share left out: {shape}", "leaves_out", {"shape": shape}, ROUNDING, quick=True
        )
    for size in SIZES:
        title = f"motion of an organ of {size:g} m, scaled from 6 cm"
        yield FAMILY.case(title, "scales", {"size": size}, 1e-9, quick=size > 1.0)
    for spacing, says in ((1e-5, r"lattice\.spacing.*enlarge"), (0.4, "no lattice cell")):
        title, settings = f"spacing of {spacing:g} m over 6 cm", {"spacing": spacing}
        yield FAMILY.case(title, "fills", settings, says)


def stores(shape: str, nu: float) -> Finding:
    """Strain energy V (lambda tr(e)^2 / 2 + mu e : e) of an affine motion of strain e."""
    make = Make(poisson_ratio=nu, held=False)
    assembly, material = _shaped(shape, make)
    net = arrays(assembly, material, linear=True)
    gradient = 1e-3 * np.random.default_rng(3).standard_normal((3, 3))
    u = assembly.lattice.nodes @ gradient.T
    strain = 0.5 * (gradient + gradient.T)
    first, mu = lame(make.youngs_modulus, nu)
    density = 0.5 * first * np.trace(strain) ** 2 + mu * (strain**2).sum()
    volume = assembly.mass.sum() / make.density
    stored = energy.springs(initial_stiffness(material.law), net, u) + energy.cells(net, u)
    return value(float(volume * density), stored, "J")


def rests(shape: str) -> Finding:
    """Rest of a shape under its own weight, by conjugate gradients and by relaxation."""
    assembly, material = _shaped(shape, Make(poisson_ratio=0.45, gravity=0.5))
    found, ended = relax(material.law, arrays(assembly, material, linear=True), tolerance=1e-9)
    if ended.status != "at rest":
        return Finding("error", message=f"relaxation: {ended.status}")
    return beside(static_displacement(assembly, material), found)


def steps(shape: str) -> Finding:
    """The critical step of a shape, predicted and measured."""
    assembly, material = _shaped(shape, Make(poisson_ratio=0.45))
    predicted = critical_time_step(assembly, material)
    return value(predicted, measured_limit(assembly, material, DEFAULT, predicted, 1000))


def leaves_out(shape: str) -> Finding:
    """The share of the body's volume without a lattice."""
    boxes, share = PARTED[shape]
    assembly, _ = lattice_of(Make(), Boxes(Make().spacing * np.array(boxes)))
    return value(share, assembly.lattice.dropped)  # type: ignore[attr-defined] # a cubic lattice has it


def scales(size: float) -> Finding:
    """Displacements over the organ's size, with times and loads scaled by similarity."""
    return beside(_moved(0.06), _moved(size))


def _moved(size: float) -> Floats:
    """Displacement over the size, after a motion under a weight proportional to 1 / size."""
    make = Make(
        spacing=size / 3.0,
        poisson_ratio=0.45,
        gravity=0.5 / size,
        damping=NodalDamping(0.5 / size),
    )
    assembly, material = lattice_of(make)
    seen = watch(assembly, 5.0 * size, 11)
    found = run(assembly, material, np.ones_like, seen).trajectory
    return np.asarray(found.displacement[-1] / size)


def fills(spacing: float) -> Finding:
    """A cube of 6 cm in cells of a spacing [m]."""
    box = np.array([[np.zeros(3), np.full(3, 0.06)]])
    assembly, _ = lattice_of(Make(spacing=spacing), Boxes(box))
    return value(0.06**3, float(assembly.mass.sum()) / Make().density)


def _shaped(shape: str, make: Make) -> tuple[Assembly, Material]:
    return lattice_of(make, Boxes(make.spacing * np.array(SHAPES[shape])))
