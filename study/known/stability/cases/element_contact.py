"""Finite elements under moved tools and gravity at their extremes: impacts, depths, friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference import model as fem
from fem_reference.contact.motion import PeakEquilibrium, at_peak, run
from fem_reference.elasticity import Body
from fem_reference.external_loads import ExternalLoads, with_external_loads
from study.known import pressed
from study.known.case import Case, Family
from study.known.finding import Finding, at_most, value
from study.known.pressed import DOWN
from study.organ.block import block_mesh
from study.problem.contact import ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.rigid import SHAPES, RigidTool
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation

Floats = NDArray[np.float64]

SIZE = (0.06, 0.06, 0.03)
TOP = np.array([0.03, 0.03, 0.03])
RADIUS = 0.015
FOUNDATION = 1e7
ROUNDING, SOLVED = 1e-9, 1e-6
FAMILY = Family("elements in contact", __name__)


def cases() -> Iterator[Case]:
    """Cases of each extreme in turn."""
    for friction in (0.0, 0.5, 2.0):
        yield FAMILY.case(f"friction of {friction:g}", "rubs", {"friction": friction}, SOLVED)
    for shape in SHAPES:
        yield FAMILY.case(f"a {shape} that only touches", "touches", {"shape": shape}, ROUNDING)
        yield FAMILY.case(f"a {shape} pressed by 3 mm", "reacts", {"shape": shape}, SOLVED)
    for speed in (0.1, 10.0):
        title = f"a sphere that hits at {speed:g} m/s and leaves"
        yield FAMILY.case(title, "hits", {"speed": speed}, ROUNDING, expected="bounded")
    yield FAMILY.case("a sphere through the block", "through", {}, r"tool\.displacement")
    for times in (0.0, 1.0, 10.0):
        yield FAMILY.case(f"gravity of {times:g} g", "hangs", {"times": times}, ROUNDING)
    yield FAMILY.case("a tool beside the organ", "beside_organ", {}, r"tool\.place")


def rubs(friction: float) -> Finding:
    """The reaction of the support equals the force of a sphere that is pressed in and dragged."""
    aside = np.array([1.0, 0.0, 0.0])

    def travel(times: Floats) -> Floats:
        down = np.interp(times, [0.0, 0.5], [0.0, 3e-3])
        along = np.interp(times, [0.5, 1.0], [0.0, 1e-3])
        return np.outer(down, DOWN) + np.outer(along, aside)

    tool = RigidTool("tool", SHAPES["sphere"], RADIUS, TOP, DOWN, travel, friction=friction)
    return _balanced(tool)


def touches(shape: str) -> Finding:
    """A tool without a gap that stays in place has no force."""
    found = _rest(_tool(shape, 0.0))
    return value(0.0, float(np.abs(found.forces).max()), "N")


def reacts(shape: str) -> Finding:
    """The reaction of the support equals the force of the tool."""
    return _balanced(_tool(shape, 3e-3))


def hits(speed: float) -> Finding:
    """A sphere that enters by 3 mm and withdraws is never pulled."""
    duration = 4 * 3e-3 / speed

    def travel(times: Floats) -> Floats:
        corners = [0.0, 0.25 * duration, 0.5 * duration]
        return np.outer(np.interp(times, corners, [0.0, 3e-3, -3e-3]), DOWN)

    tool = RigidTool("tool", SHAPES["sphere"], RADIUS, TOP, DOWN, travel)
    seen = _seen(duration, 41, 10)
    found = run(_block(), (tool,), RayleighDamping(30.0), np.zeros_like, seen, fem.Method(), _quiet)
    force = found.trajectory.tool_force[:, 0] @ DOWN
    pressing = float(-force.min())
    message = f"{pressing:.3g} N at most, {found.trajectory.status}"
    return at_most(1e-9 * max(pressing, 1e-9), float(force.max()), message)


def through() -> Finding:
    """A sphere pushed deeper than the thickness of the block, where there is no equilibrium."""
    return value(0.0, float(np.abs(_rest(_tool("sphere", 0.04)).displacement).max()))


def hangs(times: float) -> Finding:
    """End displacement of a hanging column with nu 0: rho g L^2 / 2 E + rho g L / k."""
    tissue, length, g = Tissue(poisson_ratio=0.0), 0.06, 9.81 * times
    body = pressed.column(block_mesh((0.04, 0.04, length), 0.02), tissue, "p2", 1e6, 0.0)
    start = fem.start_of(with_external_loads(body, ExternalLoads(gravity=-g * DOWN)))
    found = 0.0 if start is None else float(start[2::3].max())
    weight = tissue.density * g
    exact = weight * length / 1e6 + 0.5 * weight * length**2 / tissue.youngs_modulus
    return value(exact, found, "m")


def beside_organ() -> Finding:
    """A tool one metre away."""
    away = RigidTool("tool", SHAPES["sphere"], RADIUS, TOP + 1.0, DOWN, lambda t: np.outer(t, DOWN))
    return value(0.0, float(_rest(away).forces.max()))


def _quiet(_: float) -> None:
    """Report no progress."""


def _block() -> Body:
    blunt = ToolPatch(TOP, DOWN, RADIUS, 0.0)
    tissue = Tissue(poisson_ratio=0.45)
    return pressed.on_base(block_mesh(SIZE, 0.015), tissue, "p2", FOUNDATION, blunt)


def _tool(shape: str, depth: float) -> RigidTool:
    def travel(times: Floats) -> Floats:
        return np.outer(depth * np.minimum(times, 1.0), DOWN)

    return RigidTool("tool", SHAPES[shape], RADIUS, TOP, DOWN, travel)


def _seen(duration: float, samples: int, peak: int) -> Observation:
    nothing = np.zeros((0, 3))
    times = np.linspace(0.0, duration, samples)
    return Observation(times, TOP[None], (peak, samples - 1), nothing, nothing)


def _rest(tool: RigidTool) -> PeakEquilibrium:
    return at_peak(_block(), (tool,), _seen(1.0, 9, 8))


def _balanced(tool: RigidTool) -> Finding:
    """The support's reaction along the tool beside the tool's force."""
    body = _block()
    found = at_peak(body, (tool,), _seen(1.0, 9, 8))
    taken = (body.support @ found.displacement).reshape(-1, 3).sum(axis=0)
    return value(-float(found.forces[0] @ DOWN), float(taken @ DOWN), "N")
