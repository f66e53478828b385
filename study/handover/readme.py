"""README.txt of exported finite elements: the files, what they are of, and how to compare."""

from __future__ import annotations

from fem_reference.exchange.calculix import Transient
from fem_reference.exchange.nodal import NodalProblem
from study.mesh.kinds import TetrahedralMesh
from study.problem.contact import Load
from study.problem.problem import Problem
from study.problem.tool_travel import StationFactor
from study.scene import Scene

VTU = "problem.vtu"
COMPARE = r"""same() {
  paste -d, <(awk 'NF == 4 {print $1","$2","$3","$4}' $1.dat) <(tail -n +2 $1.csv) |
  awk -F, '$1 != $5 {print "line " NR ": node " $1 " beside " $5; odd = 1; exit 1}
           {for (i = 2; i < 5; i++) {d += ($i - $(i+4))^2; r += $(i+4)^2}}
           END {if (!odd) print "relative L2 difference", sqrt(d / r)}'
}"""
INTEGRATED = {4: "C3D4, one integration point", 10: "C3D10, four integration points"}


def _files_at_rest(given: NodalProblem) -> str:
    return f"""\
mesh.inp        {len(given.nodes)} nodes, {len(given.elements)} elements, material
foundation.inp  the foundation's matrix as springs between nodes and to the ground; some constants
                are negative, which is meant: their sum is the matrix
load.inp        nodal forces [N] of the tool at full load
static.inp      at rest under full load
static.csv      what we get for it: displacement [m] of each node"""


def about_calculix(
    scene: Scene, given: NodalProblem, motion: Transient, differences: tuple[float, float]
) -> str:
    """Text on a problem at rest and in motion.

    `differences`: of the study's own displacement from the one written, relative L2 over the
    nodes, at rest and in motion.
    """
    at_rest, in_motion = differences
    alpha, beta = motion.damping.mass, motion.damping.stiffness
    return f"""\
{scene.title or "A scene"}
Its finite-element problem for CalculiX, SI units throughout.

{_files_at_rest(given)}
dynamic.inp     {motion.count} steps of {motion.step:g} s by HHT, alpha {motion.alpha:g}
dynamic.csv     what we get for it, after every {motion.kept} steps and at the end

Rayleigh damping: alpha {alpha:.6g} 1/s, beta {beta:.6g} s, the foundation's stiffness in it.
The load starts from zero: where the scene's history does not, it rises within the first step.

Run `ccx static` and `ccx dynamic` (which factors the matrix at every step: minutes for thousands of
nodes), then compare in bash:

{COMPARE}
same static; same dynamic

CalculiX prints seven digits: expect about 1.5e-7. The .csv files are solved by our own matrices
with the quadrature of {INTEGRATED[given.elements.shape[1]]}. It is exact for the
stiffness of straight elements, not for curved ones and not for the mass. With the quadrature of
the study, and in motion its consistent mass and TR-BDF2 steps of the same size, the displacement
differs by {at_rest:.1e} at rest and up to {in_motion:.1e} in motion, relative L2 over the nodes.
"""


def about_rest(scene: Scene, given: NodalProblem, at_rest: float) -> str:
    """Text on a problem at rest alone; `at_rest`: first of the differences of `about_calculix`."""
    return f"""\
{scene.title or "A scene"}
Its finite-element problem at rest for CalculiX, SI units throughout.

{_files_at_rest(given)}

There is no motion: how another code damps the masses of attached weights was not checked.

Run `ccx static`, then compare in bash:

{COMPARE}
same static

CalculiX prints seven digits: expect about 1.5e-7. The .csv file is solved by our own matrices with
the quadrature of {INTEGRATED[given.elements.shape[1]]}. With that of the study the
displacement differs by {at_rest:.1e}, relative L2 over the nodes.
"""


def external_loads_note(problem: Problem, given: NodalProblem, *, merged: bool = False) -> str:
    """What acts beside the first load, and in which files; empty if nothing does.

    `merged`: whether the files have all loads as one.
    """
    said = [
        f"load {n} (load.{n}.inp, load_{n}): {_of_load(load)}, with a history of its own"
        for n, load in enumerate(problem.loads, 2)
    ]
    if merged:
        said = [
            "loads that meet at nodes are one: histories.inp has the force [N] at each node over "
            "time, load.inp that at rest in full, of a tool that travels where it is at the peak"
        ]
    if given.gravity is not None:
        told = ", ".join(f"{part:g}" for part in given.gravity)
        said.append(f"gravity ({told}) m/s^2 acts on the tissue at rest (*DLOAD, GRAV)")
        said.append("a motion starts from rest under it, counts from there, and has it left out")
    elif problem.gravity.any():
        said.append("the given shape is that under gravity: displacements count from it")
    if given.weight_forces is not None:
        said.append("weights hang as nodal forces (weights.inp, weights)")
    elif problem.weights:
        said.append("weights have mass alone, which rest does not show")
    return (
        "".join(["\nBeside the first load:\n", *(f"- {line}\n" for line in said)]) if said else ""
    )


def _of_load(load: Load) -> str:
    """Name of the tool of a load, and whether the load is a station of its path."""
    travels = isinstance(load.factor, StationFactor)
    return f"of {load.tool.name}" + (" at a station of its path" if travels else "")


def about_vtu(scene: Scene, given: NodalProblem) -> str:
    """Text on the nodes and their fields for ParaView."""
    tissue = scene.tissue
    kind = "quadratic tetrahedra" if given.elements.shape[1] == 10 else "tetrahedra"
    return f"""\
{scene.title or "A scene"}
Its finite-element problem, SI units throughout.

{VTU}  {len(given.nodes)} nodes, {len(given.elements)} {kind}; on the nodes:
  displacement     [m] at rest under full load
  load             [N] nodal forces of the tool at full load
  support_density  [Pa/m] stiffness per area of the foundation, mean of the facets at a node

Material: Young's modulus {tissue.youngs_modulus:g} Pa, Poisson ratio {tissue.poisson_ratio:g},
density {tissue.density:g} kg/m^3.
"""


def about_mesh(scene: Scene, file: str, mesh: TetrahedralMesh) -> str:
    """Text on the tetrahedra alone."""
    return f"""\
{scene.title or "A scene"}
The mesh of its finite elements, in metres. A scene takes it as organ.mesh with organ.unit = "m",
and then has the same tetrahedra again, also where a mesher that is not reproducible made them.

{file}  {len(mesh.points)} nodes, {len(mesh.tetrahedra)} tetrahedra
"""


def organ_notes(scene: Scene, problem: Problem) -> str:
    """What was found, repaired or chosen for the organ, without repetition."""
    notes = dict.fromkeys((*scene.remarks, *problem.notes))
    return "".join(["\nNotes on the organ:\n", *(f"- {note}\n" for note in notes)]) if notes else ""
