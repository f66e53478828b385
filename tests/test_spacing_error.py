"""The error of a lattice by its spacing, from a coarser one: exact curves, and a body pressed."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.models.lattice import requested_step
from study.models.spacing_error import INDEX, SAFETY, force_differences, spacing_errors
from study.models.table import model
from study.scene.file import read_scene
from study.scene.problem import problem_of

TABLE = Path(__file__).parents[1] / "reports" / "data" / "planned_tools.csv"
PRESSED = (
    'organ.size=["60 mm", "60 mm", "40 mm"]',
    'models=["tissue"]',
    "reference.element_size=20 mm",
    "tool.shape=punch",
    "tool.radius=20 mm",
    "tool.displacement=4 mm",
    "tool.history.ramp=0.2 s",
    "tool.history.hold=0.1 s",
    "tool.history.release=0.1 s",
    "time.duration=0.4 s",
    "time.samples=41",
)


@pytest.fixture(scope="module")
def problem():
    return problem_of(read_scene("block", PRESSED))


@pytest.fixture(scope="module")
def moved(problem):
    """Trajectories by spacing [mm]."""

    def at(spacing):
        scene = read_scene("block", (*PRESSED, f"lattice.spacing={spacing} mm"))
        prepared = model(scene, "tissue").prepare(problem)
        return prepared._integrate(requested_step(scene.lattice)).trajectory

    return {spacing: at(spacing) for spacing in (20, 10, 5)}


def test_an_error_of_first_order_is_given_back(problem, moved):
    """Three times that of planted forces and displacements, 1 + 3 h times those of the limit."""
    limit = moved[10]

    def at(h):
        times = 1.0 + 3.0 * h
        return replace(
            limit, tool_force=times * limit.tool_force, displacement=times * limit.displacement
        )

    found = spacing_errors(problem, 0.01, at(0.02), at(0.01))
    exact = pytest.approx(SAFETY * 0.03 / 1.03)
    assert (found.tool_force["tool"], found.peak_force["tool"]) == (exact, exact)
    assert found.displacement == dict.fromkeys(problem.probes, exact)


def test_a_lattice_that_diverged_tells_no_error(problem, moved):
    lost = replace(moved[20], status="diverged")
    assert spacing_errors(problem, 0.01, lost, moved[10]) is None


def test_the_estimate_covers_the_error(problem, moved):
    """Against a lattice of half the spacing, whose own error is about half of it: docs/tools.md."""
    found = spacing_errors(problem, 0.01, moved[20], moved[10])
    over_time, peak = force_differences(problem, moved[10].tool_force, moved[5].tool_force)[:, 0]
    assert 1.0 < found.tool_force["tool"] / (2.0 * over_time) < 14.0
    assert 1.0 < found.peak_force["tool"] / (2.0 * peak) < 14.0


def test_the_index_covers_most_errors_of_lattices_under_moved_tools():
    """Two lattices of a plan stand for those of a run; a bonded tool holds what does not err."""
    rows = list(csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines()))
    shares = {
        quantity: np.mean(
            [
                float(one["found"]) <= INDEX * float(one["by_two"])
                for one in rows
                if one["quantity"] == quantity and float(one["found"]) > 1e-3
            ]
        )
        for quantity in ("force", "at the tool")
    }
    assert shares["force"] > 0.95
    assert shares["at the tool"] > 0.8
