"""The largest force of rigid tools and what is warned of, where a part of it is missing."""

from __future__ import annotations

import numpy as np
import pytest

from study.models.model import ModelRun
from study.problem.response import Response, ToolPath
from study.problem.trajectory import Trajectory
from study.results.records import ContactRecord, ElementsRecord, ModelRecord, ToolForceRecord
from study.run.tool_forces import largest_forces
from study.run.warnings import warnings
from study.scene.file import read_scene

TIMES = np.array([0.0, 0.1, 0.2])
TRAVEL = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-3], [0.0, 0.0, 2e-3]])
DOWN = np.array([0.0, 0.0, 1.0])


def response() -> Response:
    path = ToolPath("tool", DOWN, TRAVEL)
    return Response(TIMES, ("tool",), DOWN, np.ones(1), (path,))


def felt(*newtons: float) -> Trajectory:
    """A motion of which only the force on the body along the tool's axis matters."""
    still = np.zeros((3, 1, 3))
    force = -np.multiply.outer(np.array(newtons), DOWN)[:, None, :]
    return Trajectory(still, still, still, still, tool_force=force)


def elements(by_mesh: float | None, by_steps: float | None, by_subspace: float | None):
    force = ToolForceRecord(peak_n=1.0, by_mesh=by_mesh, by_steps=by_steps, by_subspace=by_subspace)
    contact = ContactRecord(vertices=1, penetration_m=0.0, forces={"tool": force})
    return ElementsRecord(element="p2", elements=1, unknowns=1, method="modal", contact=contact)


def record(**other) -> ModelRecord:
    plain = {"name": "fem", "label": "FEM", "simulated_s": 0.2, "status": "finished"}
    return ModelRecord(**(plain | {"time_step_errors": {}} | other))


@pytest.mark.parametrize(
    ("parts", "whole"),
    [
        ((0.01, 0.02, 0.04), 0.07),
        ((0.01, 0.02, None), 0.03),
        ((None, 0.02, 0.04), None),
        ((0.01, None, 0.04), None),
    ],
)
def test_a_force_that_lacks_the_error_of_mesh_or_steps_has_none(parts, whole):
    run = ModelRun(felt(0.0, 1.0, 2.0), record(elements=elements(*parts)))
    (found,) = largest_forces(response(), {"fem": run})
    assert found.relative_error == (None if whole is None else pytest.approx(whole))


def test_the_largest_force_and_its_work_are_of_what_was_felt_before_the_end():
    run = ModelRun(felt(0.0, 3.0, np.nan), record())
    (found,) = largest_forces(response(), {"fem": run})
    assert (found.peak_n, found.peak_at_s, found.peak_travel_m) == (3.0, 0.1, 1e-3)
    assert found.work_j == pytest.approx(1.5e-3)


def test_a_model_lost_at_its_first_sample_has_no_largest_force():
    lost = ModelRun(felt(np.nan, np.nan, np.nan), record())
    kept = ModelRun(felt(0.0, 1.0, 2.0), record(name="other"))
    assert [one.model for one in largest_forces(response(), {"fem": lost, "other": kept})] == [
        "other"
    ]


@pytest.mark.parametrize(
    ("way", "share"),
    [
        ("tool.displacement=10 mm", "10.0 %"),
        ('tool.path=[{time="0 s", travel="0 mm"}, {time="1 s", travel="20 mm"}]', "5.0 %"),
        (
            'tool.path=[{time="0 s", offset=["0 mm", "0 mm", "0 mm"]}, '
            '{time="1 s", offset=["30 mm", "0 mm", "-40 mm"]}]',
            "2.0 %",
        ),
    ],
)
def test_an_overlap_is_told_as_a_share_of_the_whole_way(way, share):
    scene = read_scene("block", ["tool.shape=sphere", "tool.radius=20 mm", way])
    told = warnings(scene, [record(tool_overlap_m=1e-3)], [])
    assert any("overlaps its tools" in text and f"{share} of the travel" in text for text in told)
