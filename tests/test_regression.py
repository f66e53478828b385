"""Similarity scores and field errors held against tests/data/scores.json.

Each entry holds its value, its tolerance and `halved`, how far it moved when the lattice's time
step was halved on the day it was written: what is pinned is the program, and `halved` says how much
of the number is the time step's. Refresh with `pytest --update-scores` and review the difference.
"""

import dataclasses
import inspect
import json
import math
from pathlib import Path

import pytest

from study.run.study import run_study

STORE = Path(__file__).parent / "data" / "scores.json"
# Library versions change sums in the last digits, and a factor of 1e4 covers how far solvers and
# warping paths carry them. The library's area reorders nearly degenerate quadrilaterals and then
# jumps by some 1e-6.
TOLERANCE, AREA_TOLERANCE = 1e-6, 2e-5
SCENES = {"paper": "paper", "small block": "small"}
"""Scene on record, and how the names of its fixtures begin."""
REMEDY = "If that is meant: pytest --update-scores, and review the difference."


def entries(results):
    rows = [*results.scores, *results.field_differences]
    return {"/".join(row[:-1]): row[-1] for row in rows}


def halved(scene):
    if scene.organ.shape == "point":
        return scene  # its solver has a tolerance, not a step
    lattice = dataclasses.replace(scene.lattice, step_fraction=0.5 * scene.lattice.step_fraction)
    return dataclasses.replace(scene, lattice=lattice)


def tolerance(key):
    return AREA_TOLERANCE if key.endswith("/area") else TOLERANCE


def record(values, finer):
    return {
        key: {
            "value": value,
            "tolerance": tolerance(key),
            "halved": round(finer[key] - value, 7),
        }
        for key, value in values.items()
    }


def moves(values, stored):
    """Key, old, new and difference over tolerance of what is in both, the farthest move first."""
    both = [
        (key, old["value"], values[key], (values[key] - old["value"]) / old["tolerance"])
        for key, old in stored.items()
        if key in values
    ]
    return sorted(
        both, key=lambda row: math.inf if math.isnan(row[3]) else abs(row[3]), reverse=True
    )


def has_moved(row):
    return not abs(row[3]) <= 1.0  # a score that is not a number has moved


def table(rows):
    lines = [f"{'old':>12} {'new':>12} {'/ tolerance':>12}  entry"]
    return lines + [
        f"{old:12.8g} {new:12.8g} {times:+12.3g}  {key}" for key, old, new, times in rows
    ]


def complaint(name, values, stored):
    """What differs from the record, as a table with the remedy; empty if nothing does."""
    moved = [row for row in moves(values, stored) if has_moved(row)]
    missing, stale = sorted(values.keys() - stored.keys()), sorted(stored.keys() - values.keys())
    if not (moved or missing or stale):
        return ""
    lines = [f"{name}: {len(moved)} of {len(stored)} entries moved."]
    lines += table(moved) if moved else []
    lines += [f"missing from the record: {key}" for key in missing]
    lines += [f"stale, no longer found: {key}" for key in stale]
    return "\n".join([*lines, REMEDY])


def on_record():
    return json.loads(STORE.read_text()) if STORE.exists() else {}


def update(name, values, finer):
    store = on_record() | {name: record(values, finer)}
    STORE.write_text(json.dumps(store, indent=1, sort_keys=True) + "\n")


@pytest.mark.parametrize("name", SCENES)
def test_scores_are_those_on_record(name, request):
    values = entries(request.getfixturevalue(f"{SCENES[name]}_results"))
    if request.config.getoption("--update-scores"):
        scene = request.getfixturevalue(f"{SCENES[name]}_scene")
        update(name, values, entries(run_study(halved(scene))))
    found = complaint(name, values, on_record().get(name, {}))
    if found:
        pytest.fail(found, pytrace=False)


def test_one_scene_is_held_without_running_the_others():
    """`-k paper` builds what it asks for by name; an argument would be built for every scene."""
    assert set(inspect.signature(test_scores_are_those_on_record).parameters) == {"name", "request"}


def test_the_record_would_catch_a_stiffness_off_by_a_tenth_of_a_per_cent(small_scene):
    """Negative control: every difference between models must move by more than its tolerance."""
    softer = dataclasses.replace(
        small_scene,
        models=("basafa", "msm"),
        basafa=dataclasses.replace(small_scene.basafa, k1=1.001 * small_scene.basafa.k1),
    )
    values = {
        key: value
        for key, value in entries(run_study(softer)).items()
        if key.endswith("/relative-l2") and value > 0.0
    }
    found = moves(values, on_record()["small block"])
    assert len(found) == len(values) > 0
    blind = [row for row in found if not has_moved(row)]
    if blind:
        lines = [f"{len(blind)} of {len(found)} entries do not see it:", *table(blind)]
        pytest.fail("\n".join(lines), pytrace=False)


# What a failure says


def stored(**values):
    return {key: {"value": value, "tolerance": 1e-6} for key, value in values.items()}


def test_what_is_within_its_tolerance_is_no_complaint():
    assert complaint("s", {"a": 0.5 + 0.9e-6, "b": 1.0}, stored(a=0.5, b=1.0)) == ""


def test_entries_that_moved_are_a_table_with_the_farthest_first():
    values = {"steady": 0.1, "near": 0.5 - 2e-6, "far": 0.26, "none": float("nan")}
    lines = complaint(
        "scene", values, stored(steady=0.1, near=0.5, far=0.25, none=1.0)
    ).splitlines()
    assert lines[0] == "scene: 3 of 4 entries moved."
    assert [line.split() for line in lines[2:-1]] == [
        ["1", "nan", "+nan", "none"],
        ["0.25", "0.26", "+1e+04", "far"],
        ["0.5", "0.499998", "-2", "near"],
    ]
    assert "--update-scores" in lines[-1]


def test_a_score_that_is_changed_on_record_is_the_one_row_of_the_table(paper_results):
    values = entries(paper_results)
    store = on_record()["paper"]
    key = "msm-mamdani/basafa/control-point/velocity/iso-18571"
    store[key]["value"] -= 1e-3
    first, _, row, _ = complaint("paper", values, store).splitlines()
    assert first == f"paper: 1 of {len(store)} entries moved."
    assert row.split()[2:] == ["+1e+03", key]


def test_missing_and_stale_entries_are_named():
    found = complaint("scene", {"a": 1.0, "new": 2.0}, stored(a=1.0, old=3.0)).splitlines()
    assert found == [
        "scene: 0 of 2 entries moved.",
        "missing from the record: new",
        "stale, no longer found: old",
        REMEDY,
    ]


def test_a_scene_that_is_not_on_record_misses_every_entry():
    assert complaint("scene", {"a": 1.0}, {}).splitlines()[1] == "missing from the record: a"
