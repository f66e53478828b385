"""Finite elements at rest: limiting Poisson ratios, awkward meshes, supports, tools and sizes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.dynamics import Oscillator, hht, march
from fem_reference.elasticity import Body, discretise
from fem_reference.solvers import solve_static
from study.known import pressed
from study.known.case import Case, Family
from study.known.finding import Finding, beside, value
from study.known.pressed import COLUMN, DOWN
from study.known.verification.moduli import oedometric
from study.mesh.check import repair_tetrahedra
from study.mesh.draft import Draft, start_draft
from study.mesh.kinds import TetrahedralMesh
from study.mesh.tetrahedra import volumes
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.tissue import Tissue

Floats = NDArray[np.float64]

CELL = 0.02
ROUNDING, SOLVED = 1e-12, 1e-8
FAMILY = Family("elements", __name__, quick=True)


def cases() -> Iterator[Case]:
    """Cases of finite elements at each kind of extreme in turn."""
    for element in ("p1", "p2", "taylor-hood"):
        for nu in (0.0, 0.25, 0.49, 0.4999, 0.49999):
            settings = {"element": element, "nu": nu}
            tolerance = ROUNDING / (1.0 - 2.0 * nu)
            yield FAMILY.case(f"column, nu {nu:g}: {element}", "column", settings, tolerance)
    for height in (1e-1, 1e-3, 1e-6):
        settings = {"height": height}
        title = f"column with slivers of {height:g} of an edge"
        yield FAMILY.case(title, "slivers", settings, ROUNDING / height)
    for stiffness in (1.0, 1e3, 1e6, 1e12):
        title = f"column on a support of {stiffness:g} Pa/m"
        yield FAMILY.case(title, "supported", {"stiffness": stiffness}, SOLVED)
    for size in (1e-3, 1.0, 10.0):
        title = f"an organ of {size:g} m, scaled from 4 cm"
        yield FAMILY.case(title, "scales", {"size": size}, SOLVED)
    for radius in (2e-2, 5e-3, 2e-3):
        title = f"reaction to a tool of {1e3 * radius:g} mm on facets of 20 mm"
        yield FAMILY.case(title, "reacts", {"radius": radius}, SOLVED)
    for method in ("tr-bdf2", "hht-alpha"):
        yield FAMILY.case(f"steps of 1e4 s to rest: {method}", "leaps", {"method": method}, SOLVED)
    yield FAMILY.case("inverted tetrahedra turned round", "turned", {}, ROUNDING)
    yield from _refusals()


def _refusals() -> Iterator[Case]:
    for title, function, settings, says in (
        ("nu 0.5", "column", {"element": "p2", "nu": 0.5}, "[Pp]oisson"),
        ("nu 0.5, with a pressure", "column", {"element": "taylor-hood", "nu": 0.5}, "[Pp]oisson"),
        ("nu 0.7", "column", {"element": "p2", "nu": 0.7}, "[Pp]oisson"),
        ("nu -1", "column", {"element": "p2", "nu": -1.0}, "[Pp]oisson"),
        ("nu not a number", "column", {"element": "p2", "nu": None}, "[Pp]oisson"),
        ("an unknown element", "column", {"element": "p3", "nu": 0.3}, r"reference\.element"),
        ("a flat tetrahedron in a file", "flat_in_file", {}, "have no volume"),
        ("a flat tetrahedron in the mesh", "slivers", {"height": 0.0}, "flat tetrahedra"),
        ("a support beside the organ", "beside_organ", {"support": True}, r"support\.depth"),
        ("a tool beside the organ", "beside_organ", {"support": False}, r"tool\.place"),
        ("a tool between integration points", "reacts", {"radius": 1e-6}, r"tool\.radius"),
    ):
        yield FAMILY.case(title, function, settings, says)


def column(element: str, nu: float | None) -> Finding:
    """A column between smooth walls under pressure: strain is pressure over lambda + 2 mu."""
    tissue = Tissue(poisson_ratio=float("nan") if nu is None else nu)
    return _pressed(pressed.column(block_mesh(COLUMN, CELL), tissue, element), tissue)


def slivers(height: float) -> Finding:
    """A column between walls with one node moved very close to an edge of its neighbour."""
    mesh = block_mesh(COLUMN, CELL)
    points = mesh.points.copy()
    node = int(np.linalg.norm(points - [0.02, 0.02, 0.02], axis=1).argmin())
    points[node, 2] = 0.04 - height * CELL
    tissue = Tissue(poisson_ratio=0.3)
    moved = TetrahedralMesh(points, mesh.tetrahedra)
    return _pressed(pressed.column(moved, tissue, "p2"), tissue)


def supported(stiffness: float) -> Finding:
    """A column with nu 0 and free sides sinks by p / k and shortens by p / E."""
    tissue = Tissue(poisson_ratio=0.0)
    body = pressed.column(block_mesh(COLUMN, CELL), tissue, "p2", stiffness)
    exact = pressed.exact_column(body.points, tissue.youngs_modulus, stiffness)
    return beside(exact, solve_static(body).reshape(-1, 3))


def scales(size: float) -> Finding:
    """Displacement over the size, under a force proportional to its square."""
    return beside(_indented(0.04), _indented(size))


def reacts(radius: float) -> Finding:
    """The reaction of the support equals the force of the tool."""
    tool = _tool(COLUMN, radius, 0.1)
    body = pressed.on_base(block_mesh(COLUMN, CELL), Tissue(), "p2", pressed.FOUNDATION, tool)
    taken = (body.support @ solve_static(body)).reshape(-1, 3).sum(axis=0)
    return value(0.1, float(taken @ DOWN), "N")


def leaps(method: str) -> Finding:
    """Steps far longer than any period, under a constant load with damping."""
    body = pressed.column(block_mesh(COLUMN, CELL), Tissue(), "p2")
    system = Oscillator(body.mass, body.stiffness, body.load, RayleighDamping(10.0))
    # HHT's first step overshoots by (omega dt)^2, of which each step leaves nine tenths.
    scheme, count = {"tr-bdf2": (march, 100), "hht-alpha": (hht, 800)}[method]
    *_, (u, _) = scheme(system, np.ones_like, 1e4, count)
    return beside(solve_static(body), u)


def turned() -> Finding:
    """Volume of a block with a quarter of its elements inverted in the input."""
    mesh = block_mesh(COLUMN, CELL)
    tetrahedra = mesh.tetrahedra.copy()
    tetrahedra[::4, 2:] = tetrahedra[::4, :1:-1]
    repaired = repair_tetrahedra(_draft(mesh.points, tetrahedra))
    found = volumes(TetrahedralMesh(repaired.points, repaired.elements))
    return value(float(np.prod(COLUMN)), float(found.sum()), "m^3")


def flat_in_file() -> Finding:
    """A block with one node moved into a face of its tetrahedra."""
    mesh = block_mesh(COLUMN, CELL)
    points = np.vstack([mesh.points, mesh.points[mesh.tetrahedra[0, :3]].mean(axis=0)])
    extra = np.append(mesh.tetrahedra[0, :3], len(mesh.points))
    repaired = repair_tetrahedra(_draft(points, np.vstack([mesh.tetrahedra, extra])))
    return value(float(np.prod(COLUMN)), float(len(repaired.elements)))


def beside_organ(*, support: bool) -> Finding:
    """A support far above its level, or a tool one metre away."""
    level = 1.0 if support else 0.0
    tool = _tool(COLUMN, 0.02, 0.1) if support else _tool((3.0, 3.0, 0.06), 0.02, 0.1)
    foundation = Foundation(DOWN, level, 1e-3, pressed.FOUNDATION)
    body = discretise(block_mesh(COLUMN, CELL), Tissue(), foundation, tool, "p2")
    return value(0.0, float(np.abs(solve_static(body)).max()))


def _pressed(body: Body, tissue: Tissue) -> Finding:
    exact = pressed.exact_column(body.points, oedometric(tissue))
    return beside(exact, pressed.between_walls(body))


def _indented(size: float) -> Floats:
    """Displacement over the size of a cube under a tool, on a support proportional to 1 / size."""
    tool = _tool((size, size, size), 0.4 * size, 100.0 * size**2)
    foundation = Foundation(DOWN, 0.0, 1e-3 * size, 2e4 / size)
    mesh = block_mesh((size, size, size), size / 2.0)
    return solve_static(discretise(mesh, Tissue(), foundation, tool, "p2")) / size


def _tool(size: tuple[float, float, float], radius: float, force: float) -> ToolPatch:
    """A tool on the top, away from the middle of its facets."""
    return ToolPatch(np.array([0.4 * size[0], 0.3 * size[1], size[2]]), DOWN, radius, force)


def _draft(points: Floats, tetrahedra: NDArray[np.int64]) -> Draft:
    """A mesh as read from a file in metres."""
    return start_draft(points, tetrahedra, 1e3)
