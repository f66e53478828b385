"""Closed forms of what acts beside a load of a given force: friction of tools, own weight."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.contact.motion import at_peak
from fem_reference.elasticity import discretise
from fem_reference.model import start_of
from fem_reference.observation import at_points, evaluation
from study.known.pressed import DOWN
from study.models.finite_elements import reference_of
from study.models.table import model
from study.organ.block import block_mesh
from study.problem.contact import Foundation, ToolPatch
from study.problem.rigid import PUNCH, SHAPES, SPHERE, RigidTool
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation
from study.scene.file import read_scene
from study.scene.place import OUTWARD
from study.scene.problem import problem_of

RADIUS, DEPTH = 0.02, 2e-3
ASIDE = np.array([1.0, 0.0, 0.0])


# --- Coulomb's friction of a tool that is pressed in and dragged aside ----------------------------


def on_elements(shape, friction, far):
    """Normal and tangential force [N] at the end on a block of quadratic elements."""
    top = np.array([0.03, 0.03, 0.03])

    def travel(times):
        down = np.interp(times, [0.0, 0.5], [0.0, DEPTH])
        return np.outer(down, DOWN) + np.outer(np.interp(times, [0.5, 1.0], [0.0, far]), ASIDE)

    body = discretise(
        block_mesh((0.06, 0.06, 0.03), 0.01),
        Tissue(poisson_ratio=0.3),
        Foundation(DOWN, 0.0, 1e-3, 1e7),
        ToolPatch(top, DOWN, 0.02, 0.0),
        "p2",
    )
    nothing = np.zeros((0, 3))
    seen = Observation(np.linspace(0.0, 1.0, 9), top[None], (8, 8), nothing, nothing)
    tool = RigidTool("tool", shape, RADIUS, top, DOWN, travel, friction=friction)
    force = at_peak(body, (tool,), seen).forces[0]
    return -force @ DOWN, np.hypot(force[0], force[1])


def moved(shape, friction, far, *overrides):
    """The motion of a lattice on which a tool is pressed in 0.2 s, and dragged up to the end."""
    name = next(name for name, number in SHAPES.items() if number == shape)
    path = (
        f'tool.path=[{{time="0 s", travel="0 mm"}}, {{time="0.2 s", travel="{1e3 * DEPTH} mm"}}, '
        f'{{time="1 s", offset=["{1e3 * far} mm", "0 mm", "{-1e3 * DEPTH} mm"]}}]'
    )
    scene = read_scene(
        "block",
        (
            'organ.size=["60 mm", "60 mm", "40 mm"]',
            'models=["tissue"]',
            "damping.ratio=0.5",
            "reference.element_size=20 mm",
            f"tool.shape={name}",
            f"tool.radius={1e3 * RADIUS} mm",
            'tool.place={side="superior", at=[0.5, 0.5]}',
            f"tool.friction={friction}",
            path,
            "time.duration=1 s",
            "time.samples=21",
            *overrides,
        ),
    )
    found = model(scene, "tissue").prepare(problem_of(scene)).moved().trajectory
    assert found.status == "finished"
    return found


def on_lattice(shape, friction, far):
    """Normal and tangential force [N] at the end on a lattice."""
    force = moved(shape, friction, far).tool_force[-1, 0]
    return -force @ DOWN, np.hypot(force[0], force[1])


BODIES = pytest.mark.parametrize("forces", [on_elements, on_lattice])


@BODIES
def test_a_punch_that_slides_is_dragged_by_its_friction_times_its_load(forces):
    """Exact: all that is touched has one normal."""
    normal, across = forces(PUNCH, 0.3, 6e-3)
    assert normal > 0.05
    assert across / normal == pytest.approx(0.3, rel=2e-3)
    assert across / normal != pytest.approx(0.3 * 1.01, rel=2e-3)  # a hundredth more is told apart


@BODIES
def test_a_punch_that_sticks_is_dragged_by_what_shears_the_body(forces):
    """Below the limit, and in proportion to the way, for nothing slips."""
    (normal, across), (_, half) = forces(PUNCH, 5.0, 4e-4), forces(PUNCH, 5.0, 2e-4)
    assert across < 0.5 * 5.0 * normal
    assert across == pytest.approx(2.0 * half, rel=0.05)


def test_a_sphere_that_slides_is_so_where_cells_are_small_to_it():
    """Of a quarter of its radius; of a half, facets under it lean by 0.20 to 0.40: docs/tools.md.

    Hertz's contact of a sphere 2 mm deep leans by less than (a / R)^2 = 0.1.
    """
    found = moved(
        SPHERE, 0.3, 6e-3, "lattice.spacing=5 mm", 'organ.size=["50 mm", "50 mm", "30 mm"]'
    )
    force, late = found.tool_force[:, 0], np.linspace(0.0, 1.0, len(found.tool_force)) > 0.5
    ratio = np.hypot(force[late, 0], force[late, 1]) / -(force[late] @ DOWN)
    assert ratio == pytest.approx(0.3, rel=0.5 * DEPTH / RADIUS)


# --- a cantilever under its own weight ------------------------------------------------------------

LENGTH, HEIGHT = 0.12, 0.02


def sag(size):
    """Sag [m] of the middle of the free end of a square bar that is clamped at the other."""
    scene = read_scene(
        "block",
        (
            f'organ.size=["{1e3 * LENGTH} mm", "{1e3 * HEIGHT} mm", "{1e3 * HEIGHT} mm"]',
            'models=["fem"]',
            'support={kind="clamped", side="right", depth="0.1 mm"}',
            "gravity.acceleration=1 m/s^2",
            "gravity.towards=inferior",
            "tissue.poisson_ratio=0",
            f"reference.element_size={size} mm",
            'reference.element="p2"',
            'tool.place={side="superior", at=[0.5, 0.5]}',
            "tool.radius=15 mm",
        ),
    )
    problem = problem_of(scene)
    points = problem.geometry.surface.points
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    end = middle - 0.5 * LENGTH * OUTWARD["right"]
    body = reference_of(scene).prepare(problem).body()
    return -at_points(evaluation(body, end[None]), start_of(body))[0, 2], scene.tissue


def test_a_cantilever_under_its_own_weight_sags_as_timoshenkos():
    """rho g A L^4 / (8 E I) by bending, and rho g L^2 / (2 kappa G) by shear, which is told apart.

    With nu = 0 the clamp holds nothing else but the warping of its section, which stiffens it.
    """
    coarse, tissue = sag(20.0)
    found, _ = sag(10.0)
    weight, modulus = tissue.density * 1.0, tissue.youngs_modulus
    bending = weight * LENGTH**4 / (8.0 * modulus * HEIGHT**2 / 12.0)
    shear = weight * LENGTH**2 / (2.0 * (5.0 / 6.0) * 0.5 * modulus)
    by_mesh = abs(found - coarse) / found
    assert by_mesh < 1e-3
    assert found == pytest.approx(bending + shear, rel=2e-3)
    assert found > 1.02 * bending
