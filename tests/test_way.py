"""Tools on their way: what cannot make way for them is refused, what they never meet is told."""

import numpy as np
import pytest

from study.scene.file import read_scene
from study.scene.problem import problem_of

SPHERE = (
    'organ.size=["60 mm", "50 mm", "40 mm"]',
    'models=["tissue"]',
    "tool.shape=sphere",
    "tool.radius=20 mm",
    "tool.displacement=3 mm",
)
TOP = 'support={kind="%s", side="superior", depth="1 mm"}'
BOTH = 'support=[{kind="sliding", side="%s", depth="1 mm"}, {side="inferior", depth="1 mm"}]'
ON_TOP = 'place={side="superior", at=[0.5, 0.5]}'


def posed(*overrides):
    return problem_of(read_scene("block", (*SPHERE, *overrides)))


@pytest.mark.parametrize(
    "overrides",
    [
        (TOP % "clamped",),
        # Along its own line a sliding surface does not make way either.
        (BOTH % "superior",),
        ('support={kind="clamped", place={side="superior", at=[0.3, 0.5]}, radius="10 mm"}',),
        ("tool.shape=punch", "tool.contact=bonded", "tool.displacement=-1 mm", TOP % "clamped"),
    ],
)
def test_a_tool_moved_into_what_cannot_move_is_refused(overrides):
    with pytest.raises(ValueError, match=r"^tool: is moved against a surface that a clamped or"):
        posed(*overrides)


@pytest.mark.parametrize(
    "overrides",
    [
        ('support={kind="clamped", side="inferior", depth="1 mm"}',),
        (TOP % "foundation",),
        ("tool.displacement=-1 mm", TOP % "clamped"),
        ("tool.clearance=4 mm", "gravity.acceleration=9.81 m/s^2", TOP % "clamped"),
        # Beside a plane of symmetry the surface slides down with the tool.
        (
            "tool.shape=plate",
            BOTH % "left",
        ),
    ],
)
def test_one_that_meets_what_can_move_is_not(overrides):
    assert len(posed(*overrides).rigid_tools) == 1


def test_a_tool_that_never_comes_to_the_organ_is_told():
    assert posed().of_tools == ()
    off = "tool.clearance=5 mm", "gravity.acceleration=9.81 m/s^2"
    (said,) = posed(*off).notes[-1:]
    assert said.startswith("tool: stays off the organ as it is given by 2 mm")
    assert np.isclose(posed(*off).rigid_tools[0].tip[2], 0.045)
    assert len(posed("tool.displacement=-1 mm").of_tools) == 1


def test_a_scene_in_which_no_tool_comes_to_the_organ_is_refused():
    """Its motion would be rounding, and scores of that."""
    with pytest.raises(ValueError, match=r"tool\.clearance: 3 mm is no less than the 3 mm"):
        posed("tool.clearance=3 mm")
    assert posed("tool.clearance=2.9 mm").of_tools == ()
