"""Small problems that other codes have solved too, and the files that keep their answers."""

from __future__ import annotations

import csv
import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fem_reference.elasticity import Body, discretise
from fem_reference.exchange.calculix import Transient
from fem_reference.exchange.nodal import NodalProblem, nodal_problem
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.scene.file import read_scene
from study.scene.problem import problem_of

GOLDENS = Path(__file__).parents[1] / "data" / "oracles"
BLOCK = ('organ.size=["60 mm", "40 mm", "30 mm"]', "tool.radius=15 mm", "tool.force=0.05 N")
KEPT_NODES = 150
"""About as many nodes of an answer are kept, spread over the body."""


@dataclass(frozen=True)
class Case:
    """A scene's name and overrides, element, and whether a block is made wavy."""

    scene: str
    overrides: tuple[str, ...]
    element: str
    wavy: bool = False


CASES = {
    "block-p1": Case("block", (*BLOCK, "reference.element_size=10 mm"), "p1"),
    "block-p2": Case("block", (*BLOCK, "reference.element_size=15 mm"), "p2"),
    "block-p2-wavy": Case("block", (*BLOCK, "reference.element_size=15 mm"), "p2", wavy=True),
    "liver-p2": Case("liver", ("reference.element_size=24 mm",), "p2"),
}


DYNAMIC = "block-p2"


@dataclass(frozen=True)
class Built:
    """A case as a body and as plain arrays."""

    body: Body
    problem: NodalProblem
    foundation: Foundation
    tool: ToolPatch

    def numbers(self) -> dict[str, Any]:
        """All that a program needs which assembles it anew."""
        tissue = self.problem.tissue
        return {
            "nodes": self.problem.nodes,
            "elements": self.problem.elements,
            "modulus": tissue.youngs_modulus,
            "poisson_ratio": tissue.poisson_ratio,
            "density": tissue.density,
            **vars(self.foundation),
            **vars(self.tool),
        }


def build(name: str, modulus_factor: float = 1.0) -> Built:
    """A case; `modulus_factor` plants an error in Young's modulus."""
    case = CASES[name]
    scene = read_scene(case.scene, case.overrides)
    posed = problem_of(scene)
    modulus = modulus_factor * scene.tissue.youngs_modulus
    tissue = replace(scene.tissue, youngs_modulus=modulus)
    project = wavy if case.wavy else posed.geometry.project
    mesh = posed.geometry.mesh
    body = discretise(mesh, tissue, posed.foundation, posed.tool, case.element, project)
    return Built(body, nodal_problem(body, tissue, posed.foundation), posed.foundation, posed.tool)


def wavy(points: np.ndarray) -> np.ndarray:
    """A surface that curves the facets of the block, by a twentieth of its elements."""
    return points + 7e-4 * np.sin(60.0 * points[:, [1, 2, 0]])


def ramp() -> Transient:
    """A load that rises over ten steps and stays: damped, with inertia that matters."""
    factors = np.minimum(np.arange(21) / 10.0, 1.0)
    return Transient(
        step=0.002, factors=factors, damping=RayleighDamping(3.0, 5e-4), alpha=-0.05, kept=10
    )


def fingerprint(found: NodalProblem) -> str:
    """Of the geometry, to the micrometre: answers kept for another mesh must not be compared."""
    places = np.round(found.nodes * 1e6).astype(np.int64)
    return hashlib.sha256(places.tobytes() + found.elements.tobytes()).hexdigest()[:16]


def keep(name: str, program: str, found: NodalProblem, frames: dict[str, np.ndarray]) -> None:
    """Write an answer: some nodes of each displacement [m] (n, 3) by its column's name."""
    chosen = np.arange(0, len(found.nodes), -(-len(found.nodes) // KEPT_NODES))
    GOLDENS.mkdir(exist_ok=True)
    with (GOLDENS / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        file.write(f"# {program}\n# geometry {fingerprint(found)}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["node", *(f"{f}_{axis}_m" for f in frames for axis in "xyz")])
        for node in chosen:
            row = np.concatenate([u[node] for u in frames.values()])
            writer.writerow([node, *(f"{value:.15g}" for value in row)])


def kept(name: str, found: NodalProblem) -> tuple[np.ndarray, np.ndarray]:
    """Node numbers and displacements [m] (frames, nodes, 3) of a kept answer.

    ValueError if it was made on another mesh.
    """
    path = GOLDENS / f"{name}.csv"
    _, geometry = (line[2:] for line in path.read_text(encoding="utf-8").splitlines()[:2])
    if geometry != f"geometry {fingerprint(found)}":
        raise ValueError(f"{path.name}: the mesh has changed; make it again, see tests/oracles")
    table = np.loadtxt(path, delimiter=",", skiprows=3)
    values = table[:, 1:].reshape(len(table), -1, 3)
    return table[:, 0].astype(int), np.moveaxis(values, 1, 0)


def difference(u: np.ndarray, v: np.ndarray) -> float:
    """Relative L2 difference over nodes."""
    return float(np.linalg.norm(u - v) / np.linalg.norm(v))
