"""Similarity scores and field errors held against tests/data/scores.json.

Each entry holds its value, its tolerance and `halved`, how far it moved when the lattice's time
step was halved on the day it was written: what is pinned is the program, and `halved` says how much
of the number is the time step's. Refresh with `pytest --update-scores` and review the difference.
"""

import dataclasses
import inspect
import json
import math
import os
from pathlib import Path

import pytest

from study.results import manifest
from study.results.folder import MARK, read, write
from study.run.study import run_study
from tests import kept_results
from tests.kept_results import as_good_as_now, origin, trusted

STORE = Path(__file__).parent / "data" / "scores.json"
# Library versions change sums in the last digits, and a factor of 1e4 covers how far solvers and
# warping paths carry them. The library's area reorders nearly degenerate quadrilaterals and then
# jumps by some 1e-6.
TOLERANCE, AREA_TOLERANCE = 1e-6, 2e-5
# The liver's reference is solved by multigrid and superposed from vectors solved to 1e-2. Between
# processors (OPENBLAS_CORETYPE of SkylakeX, Haswell and Zen) its areas spread by up to 7.7e-8, its
# other scores by 7.5e-8 and its field errors by 9.3e-10; a factor of 100 is left to libraries.
LIVER_TOLERANCE = 1e-5
SCENES = {"paper": "paper", "small block": "small", "liver": "liver"}
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


def tolerance(name, key):
    if key.endswith("/area"):
        return AREA_TOLERANCE
    return LIVER_TOLERANCE if name == "liver" else TOLERANCE


def record(name, values, finer):
    return {
        key: {
            "value": value,
            "tolerance": tolerance(name, key),
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
    store = on_record() | {name: record(name, values, finer)}
    STORE.write_text(json.dumps(store, indent=1, sort_keys=True) + "\n")


@pytest.mark.parametrize(
    "name", ["paper", "small block", pytest.param("liver", marks=pytest.mark.slow)]
)
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


@pytest.mark.parametrize("name", ["small block", pytest.param("liver", marks=pytest.mark.slow)])
def test_the_record_would_catch_a_stiffness_off_by_a_tenth_of_a_per_cent(name, request):
    """Negative control: every difference between models must move by more than its tolerance.

    By 14 tolerances of the liver's at least, as measured.
    """
    scene = request.getfixturevalue(f"{SCENES[name]}_scene")
    softer = dataclasses.replace(
        scene,
        models=("basafa", "msm"),
        fuzzy=dataclasses.replace(scene.fuzzy, sensitivity_readings=0),
        basafa=dataclasses.replace(scene.basafa, k1=1.001 * scene.basafa.k1),
    )
    values = {
        key: value
        for key, value in entries(run_study(softer)).items()
        if key.endswith("/relative-l2") and value > 0.0
    }
    found = moves(values, on_record()[name])
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


# Results that the program left


@pytest.fixture
def left(paper_results, tmp_path):
    """A folder as `liver-study run` leaves it, what made it from a clean checkout, and when."""
    record = paper_results.record
    made_by = dataclasses.replace(record.provenance, commit=40 * "a")
    record = dataclasses.replace(record, provenance=made_by)
    write(dataclasses.replace(paper_results, record=record), tmp_path)
    return tmp_path, made_by, (tmp_path / MARK).stat().st_mtime - record.study_wall_s - 60.0


def test_results_of_this_very_program_stand_for_a_run_of_now(left, paper_results):
    folder, made_by, before = left
    kept = entries(trusted(folder, made_by, before))
    assert kept == pytest.approx(entries(paper_results), rel=1e-11)  # a table has twelve digits


@pytest.mark.parametrize(
    "other",
    [
        {"commit": 40 * "b"},
        {"versions": {"numpy": "0"}},
        {"scene_sha256": "another"},
        {"processor": "another"},
    ],
    ids=lambda other: next(iter(other)),
)
def test_results_of_another_program_scene_or_machine_are_not_believed(left, other):
    folder, made_by, before = left
    assert trusted(folder, dataclasses.replace(made_by, **other), before) is None


@pytest.mark.parametrize("commit", [None, 40 * "a" + "-dirty"])
def test_results_of_a_checkout_with_changes_are_not_believed(left, commit):
    folder, made_by, before = left
    path = folder / MARK
    path.write_text(path.read_text().replace(json.dumps(made_by.commit), json.dumps(commit)))
    manifest.write(folder, manifest.digests(folder))
    os.utime(path, (before + 1e3, before + 1e3))
    now = dataclasses.replace(made_by, commit=commit)
    assert origin(read(folder))[0] == now
    assert trusted(folder, now, before) is None


def test_results_begun_before_a_source_was_written_are_not_believed(left):
    """Their commit, noted at the end, may be one that they did not run."""
    folder, made_by, before = left
    assert trusted(folder, made_by, before + 61.0) is None


def test_where_nothing_was_left_a_scene_is_run(tmp_path, paper_scene):
    assert as_good_as_now(tmp_path, paper_scene) is None


def test_every_kind_of_source_has_an_age(left, monkeypatch):
    folder, _, _ = left
    monkeypatch.setattr(kept_results, "ROOT", folder.parent)
    monkeypatch.setattr(kept_results, "PACKAGES", (folder.name,))
    os.utime(folder / "scene.toml", (4e9, 4e9))
    assert kept_results.youngest_source() == 4e9
