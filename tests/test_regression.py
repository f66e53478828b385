"""Similarity scores and field errors held against tests/data/scores.json.

Each entry holds its value, its tolerance and `halved`, how far it moved when the lattice's time
step was halved on the day it was written: what is pinned is the program, and `halved` says how much
of the number is the time step's. Refresh with `pytest --update-scores` and review the difference.
"""

import dataclasses
import json
from pathlib import Path

import pytest

from study.run.study import run_study
from study.scene.file import read_scene

STORE = Path(__file__).parent / "data" / "scores.json"
# Library versions change sums in the last digits, and a factor of 1e4 covers how far solvers and
# warping paths carry them. The library's area reorders nearly degenerate quadrilaterals and then
# jumps by some 1e-6.
TOLERANCE, AREA_TOLERANCE = 1e-6, 2e-5


def entries(results):
    found = {"/".join(row[:-1]): row[-1] for row in results.scores}
    return found | {"/".join(row[:-1]): row[-1] for row in results.field_differences}


def halved(scene):
    if scene.organ.shape == "point":
        return scene  # its solver has a tolerance, not a step
    lattice = dataclasses.replace(scene.lattice, step_fraction=0.5 * scene.lattice.step_fraction)
    return dataclasses.replace(scene, lattice=lattice)


def record(values, finer):
    return {
        key: {
            "value": value,
            "tolerance": AREA_TOLERANCE if key.endswith("/area") else TOLERANCE,
            "halved": round(finer[key] - value, 7),
        }
        for key, value in values.items()
    }


@pytest.mark.parametrize("name", ["paper", "small block"])
def test_scores_are_those_on_record(name, request, small_scene, small_results, paper_results):
    results = paper_results if name == "paper" else small_results
    scene = read_scene("paper") if name == "paper" else small_scene
    values = entries(results)
    store = json.loads(STORE.read_text()) if STORE.exists() else {}
    if request.config.getoption("--update-scores"):
        store[name] = record(values, entries(run_study(halved(scene))))
        STORE.write_text(json.dumps(store, indent=1, sort_keys=True) + "\n")
        return
    assert values.keys() == store[name].keys(), "stale or missing entries: pytest --update-scores"
    moved = {
        key: (value, store[name][key]["value"])
        for key, value in values.items()
        if not abs(value - store[name][key]["value"]) <= store[name][key]["tolerance"]
    }
    assert not moved


def test_the_record_would_catch_a_stiffness_off_by_a_tenth_of_a_per_cent(small_scene):
    """Negative control: every score of a model must move by more than its tolerance."""
    softer = dataclasses.replace(
        small_scene,
        models=("basafa", "msm"),
        basafa=dataclasses.replace(small_scene.basafa, k1=1.001 * small_scene.basafa.k1),
    )
    store = json.loads(STORE.read_text())["small block"]
    for key, value in entries(run_study(softer)).items():
        if key.endswith("/relative-l2") and value > 0.0:
            assert abs(value - store[key]["value"]) > store[key]["tolerance"]
