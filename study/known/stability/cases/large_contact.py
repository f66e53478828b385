"""Rigid tools on neo-Hookean elements at the extremes: impacts, full penetration, friction.

A tool is pressed into a small block, dragged aside if there is friction or an edge, and lifted. A
motion that finishes must never pull at the tool, and must not return more work than it received.
One that cannot continue states when.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fem_reference.contact.large_motion import LargeSolution, contact_problem, run
from fem_reference.elasticity import discretise
from study.known.case import Case, Family
from study.known.finding import Ending, Finding, at_most
from study.known.pressed import DOWN
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.damping import RayleighDamping
from study.problem.heterogeneous import Ellipsoid, HeterogeneousTissue, Region
from study.problem.rigid import SHAPES, RigidTool
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation

Floats = NDArray[np.float64]

SIZE, CELL, FOUNDATION = (0.06, 0.06, 0.03), 0.015, 1e7
TOP, ALONG = np.array([0.03, 0.03, 0.03]), np.array([1.0, 0.0, 0.0])
RADIUS, DEPTH, DAMPING = 0.015, 4e-3, 30.0
SAMPLES = 61
PULLED, GIVEN_BACK = 1e-9, 0.02
"""Admissible tension over the largest force, and returned over largest work, with step error."""
BALL = 0.008
FAMILY = Family("large strain in contact", __name__)


def cases() -> Iterator[Case]:
    """Cases by what is extreme."""
    # The last speed exceeds the wave speed: the material piles up within one element.
    for speed in (0.1, 1.0, 10.0):
        yield _case(f"impact at {speed:g} m/s", {"speed": speed})
    yield _case("sphere sunk by more than its radius", {"depth": 0.02})
    yield _case("sphere through the body", {"speed": 1.0, "depth": 0.06}, lost=True)
    yield _case("zero gap, nothing pressed", {"depth": 1e-9}, quick=True)
    for contrast in (1e-3, 1e3):
        yield _case(f"a ball of {contrast:g} times the modulus", {"contrast": contrast})
    for friction in (0.5, 2.0, 1e6):
        name = f"a sphere that is dragged, friction {friction:g}"
        yield _case(name, {"friction": friction, "aside": 6e-3})
    for shape in ("punch", "plate"):
        name = f"a {shape} that is dragged, friction 1"
        yield _case(name, {"shape": shape, "friction": 1.0, "aside": 3e-3})
    yield _case("a smooth punch that is dragged", {"shape": "punch", "aside": 6e-3})
    yield _case("a smooth punch 0.6 of its radius deep", {"shape": "punch", "depth": 0.6 * RADIUS})
    # Elements are as wide as the punch here. While it is held, vertices at its edge take and lose
    # their force from iteration to iteration, and steps of any length end without a balance.
    yield _case(
        "a smooth punch as deep as its radius", {"shape": "punch", "depth": RADIUS}, lost=True
    )
    yield _case("a punch through the body", {"shape": "punch", "depth": 0.06}, lost=True)
    yield _case(
        "a punch with friction that only touches",
        {"shape": "punch", "friction": 0.5, "depth": 1e-9},
    )
    yield _case(
        "a punch that hits at 1 m/s, friction 0.5",
        {"shape": "punch", "friction": 0.5, "speed": 1.0},
    )
    yield _case("nu 0.4999", {"nu": 0.4999})
    yield _case("under 10 g, given loaded", {"times_g": 10.0})


def _case(
    name: str, settings: dict[str, float | str], *, lost: bool = False, quick: bool = False
) -> Case:
    expected: Ending = "diverged" if lost else "bounded"
    return FAMILY.case(name, "pressed", settings, 0.0, expected=expected, quick=quick)


def pressed(
    speed: float = 0.04,
    depth: float = DEPTH,
    contrast: float = 1.0,
    nu: float = 0.45,
    times_g: float = 0.0,
    friction: float = 0.0,
    aside: float = 0.0,
    shape: str = "sphere",
) -> Finding:
    """The worse of tension and returned work, over their limits; how the run ended."""
    ramp = depth / speed

    def travel(times: Floats) -> Floats:
        corners = np.array([0.0, 1.0, 1.5, 2.5, 3.0]) * ramp
        down = np.interp(times, corners, [0.0, depth, depth, 0.0, -depth])
        along = np.interp(times, corners[1:3], [0.0, aside])
        return np.outer(down, DOWN) + np.outer(along, ALONG)

    times = np.linspace(0.0, 3.0 * max(ramp, 1e-3), SAMPLES)
    tool = RigidTool("tool", SHAPES[shape], RADIUS, TOP, DOWN, travel, friction=friction)
    distance = Ellipsoid(TOP - [0.0, 0.0, 0.014], np.full(3, BALL))
    tissue = HeterogeneousTissue(
        poisson_ratio=nu,
        regions=(Region(name="ball", distance=distance, youngs_modulus=contrast * 9.5e3),),
    )
    found = _moved(tissue if contrast != 1.0 else Tissue(poisson_ratio=nu), tool, times, times_g)
    ending: Ending = "bounded" if found.trajectory.status == "finished" else "diverged"
    share = _share(-found.trajectory.tool_force[:, 0], travel(times))
    return at_most(1.0, share, "pull or work given back, over its limit", ending)


def _moved(tissue: Tissue, tool: RigidTool, times: Floats, times_g: float) -> LargeSolution:
    blunt = ToolPatch(TOP, DOWN, 0.02, 0.0)
    base = Foundation(DOWN, 0.0, 1e-3, FOUNDATION)
    body = discretise(block_mesh(SIZE, CELL), tissue, base, blunt, "taylor-hood")
    borne = None
    if times_g > 0.0:
        borne = body.nodal_mass * np.tile(-9.81 * times_g * DOWN, body.node_count)
    damping, nothing = RayleighDamping(DAMPING), np.zeros((0, 3))
    given = contact_problem(body, tissue, (tool,), damping, np.zeros_like, times, borne)
    seen = Observation(times, TOP[None], (len(times) // 3, len(times) - 1), nothing, nothing)
    return run(body, given, seen, 2)


def _share(force: Floats, travel: Floats) -> float:
    """The larger of tension and returned work, each over its limit."""
    kept = np.isfinite(force).all(axis=1)
    force, travel = force[kept], travel[kept]
    work = np.cumsum((0.5 * (force[1:] + force[:-1]) * np.diff(travel, axis=0)).sum(axis=1))
    pull = max(0.0, -float((force @ DOWN).min()))
    back, most = max(0.0, -float(work.min())), max(float(work.max()), 1e-300)
    largest = max(float(np.abs(force).max()), 1e-300)
    return max(pull / (PULLED * largest), back / (GIVEN_BACK * most))
