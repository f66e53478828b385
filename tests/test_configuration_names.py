"""Settings of a trade-off in words."""

import pytest

from reports.configuration_names import mark_of, name_of

SETTINGS = "element=p1 level=-2 rate=60.0"


def test_a_mesh_is_named_by_its_elements_or_relative_to_that_of_the_scene():
    assert name_of("finite-elements", SETTINGS, 0.0135) == (
        "finite elements in steps, linear, elements of 24 mm, 60.0 Hz steps"
    )
    assert name_of("finite-elements", SETTINGS) == (
        "finite elements in steps, linear, mesh 2 steps coarser, 60.0 Hz steps"
    )


@pytest.mark.parametrize(
    ("level", "said"),
    [(0, "the scene's mesh"), (-1, "mesh a step coarser"), (3, "mesh 3 steps finer")],
)
def test_levels_are_steps_from_the_scenes_mesh(level, said):
    assert mark_of(f"level={level}") == said
