"""Scenes for SOFA: an exported lattice, and tetrahedra with its modulus.

Components and their fields are those that SOFA documents (its sources and generated pages, 2024).
The scenes were not run, since SOFA is not a package of PyPI. Each states in a comment how it
differs from the run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as Xml

import numpy as np
from numpy.typing import NDArray

from msm import tetrahedra
from study.handover.lattice import ExportedLattices, ExportedModel
from study.mesh.kinds import TetrahedralMesh
from study.problem.problem import Problem

Floats = NDArray[np.float64]

PLUGINS = {
    "CGLinearSolver": "LinearSolver.Iterative",
    "ConstantForceField": "MechanicalLoad",
    "DiagonalMass": "Mass",
    "DiagonalVelocityDampingForceField": "MechanicalLoad",
    "EulerExplicitSolver": "ODESolver.Forward",
    "EulerImplicitSolver": "ODESolver.Backward",
    "MechanicalObject": "StateContainer",
    "PointSetTopologyContainer": "Topology.Container.Dynamic",
    "RestShapeSpringsForceField": "SolidMechanics.Spring",
    "SpringForceField": "SolidMechanics.Spring",
    "TetrahedronFEMForceField": "SolidMechanics.FEM.Elastic",
    "TetrahedronSetTopologyContainer": "Topology.Container.Dynamic",
}
"""Module of SOFA, after Sofa.Component, that has each component used here."""
ALIKE = (
    "The load is that of the peak, from the start; a controller may scale its forces. The "
    "foundation is lumped: each node is held by the sum of its row of the run's matrix. Not run in "
    "SOFA here."
)
LATTICE = (
    "Springs as in the run, in nonlinear geometry, by symplectic Euler; damping is explicit here "
    "and implicit there. "
)
TETRAHEDRA = (
    "Corotational linear tetrahedra of the modulus that the lattice was given, on the scene's mesh "
    "of its finite elements; mass-proportional damping of the lattice's rate. Linear tetrahedra "
    "are too stiff where the mesh is coarse, the more so the nearer Poisson's ratio is to 1/2. "
)


def lattice_scene(found: ExportedLattices, model: ExportedModel) -> str:
    """The scene of a lattice as text."""
    shared, own = found.shared, model.arrays
    rest_length = np.linalg.norm(shared["rest"], axis=1)
    stiffness = model.initial_stiffness * shared["scale"] / rest_length
    springs = np.column_stack([shared["ends"], stiffness, np.zeros_like(stiffness), rest_length])
    held = np.zeros(len(shared["mass"]))
    np.add.at(held, shared["foundation_row"], shared["foundation"])
    damping = np.repeat((own["gamma_0"] * shared["mass"])[:, None], 3, axis=1)
    interval = float(shared["times"][1] - shared["times"][0])
    parts = [
        ("EulerExplicitSolver", {"symplectic": "true"}),
        ("PointSetTopologyContainer", {"position": _text(shared["nodes"])}),
        ("MechanicalObject", {"template": "Vec3", "position": _text(shared["nodes"])}),
        ("DiagonalMass", {"vertexMass": _text(shared["mass"])}),
        ("SpringForceField", {"template": "Vec3", "spring": _text(springs)}),
        *_held_and_pushed(held, shared["load"]),
        ("DiagonalVelocityDampingForceField", {"dampingCoefficient": _text(damping)}),
    ]
    step = interval / int(own["substeps"].max())
    return _scene(found.title, "lattice", step, parts, LATTICE + _left_out(model) + ALIKE)


def _left_out(model: ExportedModel) -> str:
    """Parts of the lattice for which SOFA's springs have no counterpart."""
    parts = []
    if model.law.name != "hooke":
        parts.append("Springs are linear, of the law's stiffness at rest. ")
    if len(model.arrays["cells"]):
        parts.append("The volume term is left out: the material has Poisson's ratio 1/4. ")
    if model.arrays["gamma_1"] != 0.0:
        parts.append("Damping that grows with displacement is left out. ")
    return "".join(parts)


def tetrahedra_scene(found: ExportedLattices, model: ExportedModel) -> str:
    """The scene of tetrahedra with the modulus of a lattice as text."""
    problem = found.problem
    mesh, held, load = _on_mesh(problem)
    interval = float(problem.observation.times[1])
    damping = {"rayleighMass": f"{float(model.arrays['gamma_0']):.9g}", "rayleighStiffness": "0"}
    parts = [
        ("EulerImplicitSolver", damping),
        ("CGLinearSolver", {"iterations": "200", "tolerance": "1e-9", "threshold": "1e-9"}),
        (
            "TetrahedronSetTopologyContainer",
            {"position": _text(mesh.points), "tetrahedra": _text(mesh.tetrahedra)},
        ),
        ("MechanicalObject", {"template": "Vec3"}),
        ("DiagonalMass", {"massDensity": f"{problem.tissue.density:.9g}"}),
        (
            "TetrahedronFEMForceField",
            {
                "youngModulus": f"{model.modulus:.9g}",
                "poissonRatio": f"{problem.tissue.poisson_ratio:.9g}",
                "method": "large",
            },
        ),
        *_held_and_pushed(held, load),
    ]
    return _scene(found.title, "tetrahedra", interval, parts, TETRAHEDRA + ALIKE)


def _on_mesh(problem: Problem) -> tuple[TetrahedralMesh, Floats, Floats]:
    """The mesh, stiffness [N/m] of the support at each vertex, and load [N] on it."""
    mesh = problem.geometry.mesh
    where = (problem.surface_rule, problem.tissue.density, problem.foundation, problem.tool)
    assembly = tetrahedra.assemble(mesh, *where)
    return mesh, np.asarray(assembly.foundation.sum(axis=1)), assembly.load


# --- XML -----------------------------------------------------------------------------------------

Part = tuple[str, Mapping[str, str]]


def _held_and_pushed(held: Floats, load: Floats) -> list[Part]:
    at, pushed = np.flatnonzero(held != 0.0), np.flatnonzero(load.any(axis=1))
    return [
        ("RestShapeSpringsForceField", {"points": _text(at), "stiffness": _text(held[at])}),
        ("ConstantForceField", {"indices": _text(pushed), "forces": _text(load[pushed])}),
    ]


def _scene(title: str, name: str, step: float, parts: Sequence[Part], about: str) -> str:
    root = Xml.Element("Node", {"name": "root", "dt": f"{step:.9g}", "gravity": "0 0 0"})
    root.append(Xml.Comment(f" {_plain(title)} {_plain(about)} SI units. "))
    for plugin in sorted({PLUGINS[component] for component, _ in parts}):
        Xml.SubElement(root, "RequiredPlugin", {"name": f"Sofa.Component.{plugin}"})
    Xml.SubElement(root, "DefaultAnimationLoop")
    inner = Xml.SubElement(root, "Node", {"name": name})
    for component, fields in parts:
        Xml.SubElement(inner, component, {"name": component, **fields})
    Xml.indent(root)
    return '<?xml version="1.0"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _plain(text: str) -> str:
    """Text that cannot end a comment."""
    return text.replace("--", "- -")


def _text(array: NDArray[np.generic]) -> str:
    """Numbers of an array, row by row; whole numbers without a point."""
    return " ".join(f"{value:.9g}" for value in np.ravel(array).tolist())
