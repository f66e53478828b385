"""Tools, gravity and weights as a scene file has them, and as the problem poses them."""

import numpy as np
import pytest

from study.problem.rigid import PLATE, PUNCH, SPHERE, RigidTool
from study.scene import Tool
from study.scene.error import SceneError
from study.scene.file import read_scene, validate, write_scene
from study.scene.problem import problem_of

BLOCK = '[organ]\nshape = "block"\n[reference]\nelement_size = "30 mm"\n'
SPHERE_DOWN = """
[[tool]]
shape = "sphere"
radius = "10 mm"
clearance = "2 mm"
place = { side = "superior", at = [0.5, 0.5] }
path = [{ time = "0 s", travel = "0 mm" }, { time = "0.5 s", travel = "15 mm" }]
"""
PRESSED = """
[[tool]]
place = { side = "superior", at = [0.2, 0.5] }
force = "0.2 N"
"""
GRAVITY = '[gravity]\nacceleration = "9.81 m/s^2"\ntowards = "inferior"\n'
WEIGHT = '[[weight]]\nmass = "20 g"\nplace = { side = "superior", at = [0.8, 0.5] }\n'


@pytest.fixture
def read(tmp_path, monkeypatch):
    """A scene of a text, of models that follow whatever it asks."""
    monkeypatch.setattr("study.scene.consistency._feature_contradictions", lambda _: iter(()))

    def reads(text, *overrides):
        path = tmp_path / "own.toml"
        path.write_text(BLOCK + text)
        return read_scene(str(path), overrides)

    return reads


def refusal(read, text, *overrides):
    with pytest.raises(SceneError) as found:
        read(text, *overrides)
    return str(found.value)


def test_one_tool_in_a_list_is_the_same_scene_as_one_in_a_table(read):
    table = '[tool]\nforce = "1 N"\n'
    assert read(table) == read(table.replace("[tool]", "[[tool]]"))


def test_several_tools_gravity_and_weights_are_written_and_read_back(read):
    scene = read(SPHERE_DOWN + PRESSED + GRAVITY + WEIGHT)
    assert [tool.shape for tool in scene.tools] == ["sphere", "blunt"]
    text = write_scene(scene)
    assert text.count("[[tool]]") == 2
    assert "further_tools" not in text
    again = validate(__import__("tomllib").loads(text), "again")
    assert again == scene
    assert scene.features == ("moved-tools", "several-loads", "gravity", "weights")


def test_a_scene_of_before_says_nothing_of_what_it_does_not_have():
    text = write_scene(read_scene("liver"))
    for word in ("gravity", "weight", 'shape = "blunt"', "friction", "path", "clearance"):
        assert word not in text


def test_a_model_that_cannot_follow_is_refused_with_those_that_can(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text('models = ["corrected"]\n' + BLOCK + SPHERE_DOWN)
    with pytest.raises(SceneError, match="corrected cannot follow rigid tools that are moved"):
        read_scene(str(path))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[tool]]\nshape = "sphere"\n', "tool.displacement: give either it or tool.path"),
        ('[[tool]]\ndisplacement = "1 mm"\n', "tool.displacement: moves a rigid tool"),
        ("[[tool]]\nfriction = 0.3\n", "tool.contact: a blunt tool is a pressure"),
        (SPHERE_DOWN + '[[tool]]\nshape = "punch"\n', "tool.2.displacement: give either"),
        (
            SPHERE_DOWN + '[[tool]]\nforse = "1 N"\n',
            "tool.2.forse: unknown key, did you mean 'force'",
        ),
        (SPHERE_DOWN + '[[tool]]\nforce = "-1 N"\n', "tool.2.force: must lie between"),
        (SPHERE_DOWN.replace('"0 s"', '"0.1 s"'), "tool.path: give two points or more"),
        (SPHERE_DOWN.replace('"0.5 s"', '"0 s"'), "tool.path: give two points or more"),
        (SPHERE_DOWN.replace('travel = "0 mm"', 'travel = "1 mm"'), "tool.path: starts elsewhere"),
        (SPHERE_DOWN.replace(', travel = "0 mm"', ""), "give each point either travel or offset"),
        (SPHERE_DOWN + 'contact = "bonded"\n', "tool.clearance: a bonded tool touches"),
        (WEIGHT.replace(", at = [0.8, 0.5]", ""), "weight.1.place: give either side and at"),
    ],
)
def test_what_drives_a_tool_is_given_once_and_wholly(read, text, said):
    assert said in refusal(read, text)


def test_an_override_names_one_of_several_tools_by_its_number(read):
    both = SPHERE_DOWN + PRESSED
    assert read(both, "tool.2.force=1 N").further_tools[0].force == 1.0
    assert read(both, "tool.radius=5 mm").tool.radius == 0.005
    assert "there is no such tool; the scene has 2" in refusal(read, both, "tool.3.force=1 N")


def test_a_moved_tool_starts_off_the_surface_and_goes_along_its_path(read):
    problem = problem_of(read(SPHERE_DOWN + PRESSED + GRAVITY + WEIGHT))
    (tool,) = problem.rigid_tools
    top = problem.geometry.surface.points[:, 2].max()
    assert tool.tip[2] == pytest.approx(top + 0.002)
    assert np.allclose(tool.travel(np.array([0.0, 0.25, 9.0]))[:, 2], [0.0, -0.0075, -0.015])
    assert problem.tool.force == 0.0
    assert problem.loads[0].tool.force == 0.2
    assert np.allclose(problem.gravity, [0.0, 0.0, -9.81])
    assert problem.weights[0].mass == pytest.approx(0.02)
    times = problem.observation.times
    assert times[problem.observation.frames[0]] == times[-1]  # where the tool is deepest


def test_a_displacement_follows_the_history(read):
    scene = read('[[tool]]\nshape = "punch"\ndisplacement = "3 mm"\n')
    assert scene.tool == Tool(shape="punch", displacement=0.003)
    (tool,) = problem_of(scene).rigid_tools
    assert np.linalg.norm(tool.travel(np.array([0.5])), axis=1) == pytest.approx(0.0015)


@pytest.mark.parametrize("shape", [SPHERE, PUNCH, PLATE])
def test_the_gradient_of_a_gap_is_that_of_its_differences(shape):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    travel = lambda times: np.outer(times, 0.01 * axis)  # noqa: E731 - a formula
    tool = RigidTool("tool", shape, 0.01, np.array([0.1, 0.0, 0.2]), axis, travel)
    points = tool.tip + np.random.default_rng(5).uniform(-0.006, 0.006, (40, 3))
    gap, normal = tool.gap(points, 0.3)
    for along in np.eye(3):
        moved = tool.gap(points + 1e-7 * along, 0.3)[0] - tool.gap(points - 1e-7 * along, 0.3)[0]
        assert np.allclose(moved / 2e-7, normal @ along, atol=1e-5)
    assert (gap < 0.0).any()
    assert (gap > 0.0).any()


def test_what_lies_beside_a_punch_is_never_touched():
    tool = RigidTool(
        "tool",
        PUNCH,
        0.01,
        np.zeros(3),
        np.array([0.0, 0.0, -1.0]),
        lambda t: 0 * np.outer(t, np.ones(3)),
    )
    gap, _ = tool.gap(np.array([[0.0, 0.0, -0.001], [0.011, 0.0, 0.005]]), 0.0)
    assert gap[0] == pytest.approx(0.001)
    assert np.isinf(gap[1])
