"""A results folder is read whole or not at all, whatever happened to its files."""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
import zipfile
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from reports import report
from study.results import ResultsError, manifest
from study.results.consistency import check
from study.results.folder import read, write
from study.results.tables import QUANTITIES
from study.run.study import run_study
from study.scene.file import read_scene
from tests.conftest import SMALL
from tests.report_samples import known, whole, with_model, with_record

TABLES = (
    *("curves.csv", "bands.csv", "similarity.csv", "errors.csv", "sensitivity.csv"),
    *("iso_18571.csv", "score_errors.csv", "score_differences.csv", "certified.csv"),
)
FILES = ("results.json", "scene.toml", *TABLES, "fields.npz", "fuzzy.npz", "SHA256SUMS")
DRAWS = 25
"""Damages of each kind of folder."""


@pytest.fixture(scope="module")
def point(paper_results, tmp_path_factory):
    """A folder with fuzzy systems and bands, without fields."""
    path = tmp_path_factory.mktemp("point") / "paper"
    path.mkdir()
    write(paper_results, path)
    return path


@pytest.fixture(scope="module")
def organ(tmp_path_factory):
    """A folder with fields, without fuzzy systems."""
    path = tmp_path_factory.mktemp("organ") / "octahedron"
    path.mkdir()
    write(whole(), path)
    return path


@pytest.fixture(params=["point", "organ"])
def folder(request, tmp_path):
    """A copy to damage."""
    return shutil.copytree(request.getfixturevalue(request.param), tmp_path / "results")


@pytest.fixture
def damaged_organ(organ, tmp_path):
    return shutil.copytree(organ, tmp_path / "results")


@pytest.fixture
def damaged_point(point, tmp_path):
    return shutil.copytree(point, tmp_path / "results")


def sign(path, *, both: bool = True):
    """Make the checksums again, those of results.json too, as somebody who hides a change may."""
    table = json.loads((path / "results.json").read_text())
    if both:
        sums = {n: s for n, s in manifest.digests(path).items() if n != "results.json"}
        text = json.dumps(table | {"sha256": sums}, indent=1)
        (path / "results.json").write_text(text + "\n")
    manifest.write(path, manifest.digests(path))


def refusal(path) -> str:
    with pytest.raises(ResultsError) as caught:
        read(path)
    said = str(caught.value)
    assert "\n" not in said
    assert any(name in said for name in (*FILES, ".vtkhdf")), said
    return said


def edit(path, change):
    """Rewrite a table by a function of its lines, the first of which names the columns."""
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(change(lines)))


def altered(lines, row, column, cell):
    """The same with one cell changed."""
    cells = lines[row].rstrip("\n").split(",")
    cells[column] = cell
    return [*lines[:row], ",".join(cells) + "\n", *lines[row + 1 :]]


# --- checksums ----------------------------------------------------------------------------------


def test_an_untouched_folder_is_read_with_or_without_its_report(folder):
    """Negative control of all refusals."""
    first = read(folder)
    (folder / "report.pdf").write_bytes(b"%PDF")
    assert read(folder).record == first.record
    (folder / "export").mkdir()
    (folder / "notes.txt").write_text("mine")
    assert read(folder).curves == first.curves


def test_coreutils_verify_the_checksums(folder):
    if shutil.which("sha256sum") is None:
        pytest.skip("no sha256sum here")
    command = ["sha256sum", "--check", "--strict", "SHA256SUMS"]
    assert subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode == 0
    (folder / "curves.csv").write_text("")
    assert subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode == 1


def test_checksums_cover_every_file_but_themselves(folder):
    present = {path.name for path in folder.iterdir()}
    assert set(manifest.read(folder)) == present - {"SHA256SUMS"}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_missing_is_named(name, folder):
    if not (folder / name).exists():
        pytest.skip("this kind of folder has none")
    (folder / name).unlink()
    assert name in refusal(folder)


def test_one_digit_is_enough(damaged_organ):
    """In the last place of one number, which no other check can see."""
    text = (damaged_organ / "curves.csv").read_text()
    at = text.rindex("e") - 1
    text = text[:at] + str((int(text[at]) + 1) % 10) + text[at + 1 :]
    (damaged_organ / "curves.csv").write_text(text)
    said = refusal(damaged_organ)
    assert "curves.csv: is not as the run left it" in said
    assert said.endswith("or run the scene again")


def test_a_data_file_that_the_run_did_not_write_is_refused(damaged_point):
    (damaged_point / "fields.npz").write_bytes(b"")
    assert "fields.npz: is not of this run" in refusal(damaged_point)


@pytest.mark.parametrize(
    "text", ["", "[]", "x" * 64 + "  curves.csv\n", "0" * 64 + "  ../curves.csv\n", "\0"]
)
def test_checksums_that_are_none_are_refused(text, damaged_organ):
    (damaged_organ / "SHA256SUMS").write_text(text)
    assert "SHA256SUMS" in refusal(damaged_organ)


def test_fields_of_all_nodes_that_are_cut_are_refused(damaged_organ):
    pyvista = pytest.importorskip("pyvista")
    path = damaged_organ / "fem.vtkhdf"
    pyvista.Sphere().save(path)
    sign(damaged_organ)
    read(damaged_organ)
    data = path.read_bytes()
    for piece, said in ((data[:-1], "is cut"), (data[:500], "is cut"), (b"", "is no HDF5 file")):
        path.write_bytes(piece)
        assert f"fem.vtkhdf: {said}" in refusal(damaged_organ)
    path.unlink()
    assert "fem.vtkhdf: is missing" in refusal(damaged_organ)


def test_checksums_made_again_do_not_mix_two_runs(damaged_organ, tmp_path):
    """A table of the same rows with other numbers."""
    other = whole()
    rows = tuple(row._replace(value=0.5) for row in other.field_differences)
    other = replace(other, field_differences=rows)
    (tmp_path / "other").mkdir()
    write(other, tmp_path / "other")
    shutil.copy(tmp_path / "other" / "errors.csv", damaged_organ)
    sign(damaged_organ, both=False)
    assert "errors.csv: is of another run than results.json" in refusal(damaged_organ)


# --- rows ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        (
            "curves.csv",
            lambda lines: lines[:21],
            "curves.csv, line 22: sample 1 of 20 of fem at far",
        ),
        ("curves.csv", lambda lines: lines[:-1], "line 81: sample 20 of 20 of basafa at far is mi"),
        ("curves.csv", lambda lines: [*lines[:5], *lines[6:]], "curves.csv, line 6: time"),
        ("curves.csv", lambda lines: [*lines, lines[-1]], "line 82: basafa at far, 1 s: is no"),
        (
            "curves.csv",
            lambda lines: [*lines[:4], lines[3], *lines[4:]],
            "curves.csv, line 5: time",
        ),
        ("curves.csv", lambda lines: [lines[0], lines[2], lines[1], *lines[3:]], "line 2: time"),
        ("curves.csv", lambda lines: lines[:1], "curves.csv, line 2: sample 1 of 20 of fem"),
        ("curves.csv", lambda _: [], "curves.csv, line 1: columns none"),
        ("curves.csv", lambda lines: [lines[0].replace("_m_", "_mm_"), *lines[1:]], "line 1: col"),
        ("curves.csv", lambda lines: [*lines[:-1], lines[-1][:-1]], "line 81: is cut"),
        ("curves.csv", lambda lines: [*lines[:-1], lines[-1][:9]], "line 81: 2 cells, not 5"),
        (
            "curves.csv",
            lambda lines: [*lines[:9], "fem,tool,nan,0,0\n", *lines[10:]],
            "line 10: ti",
        ),
        (
            "curves.csv",
            lambda lines: [*lines[:9], "fem,tool,1,x,0\n", *lines[10:]],
            "placement_m is",
        ),
        ("curves.csv", lambda lines: [*lines[:9], "fem,tool,1,1e999,0\n"], "'1e999', no finite"),
        ("curves.csv", lambda lines: [line.replace("basafa", "msm") for line in lines], "line 42:"),
        ("bands.csv", lambda lines: [*lines, "fem,tool,0,0,0,0,0\n"], "bands.csv, line 2: fem at"),
        (
            "similarity.csv",
            lambda lines: lines[:-1],
            "line 15: basafa fem far phase-plane pcm is m",
        ),
        (
            "similarity.csv",
            lambda lines: [lines[0], *lines[2:]],
            "similarity.csv, line 2: basafa fem",
        ),
        (
            "similarity.csv",
            lambda lines: [*lines[:-1], lines[-1].rpartition(",")[0] + ",2\n"],
            "15: sc",
        ),
        (
            "errors.csv",
            lambda lines: lines[:1],
            "errors.csv, line 2: basafa fem field-relative-l2-pe",
        ),
        ("errors.csv", lambda lines: [*lines, lines[1]], "errors.csv, line 7: "),
        ("iso_18571.csv", lambda lines: lines[:-1], "iso_18571.csv, line 5: basafa fem far velo"),
        ("iso_18571.csv", lambda lines: altered(lines, 2, 4, "0.9"), "iso_18571.csv, line 3: par"),
        ("iso_18571.csv", lambda lines: altered(lines, 2, 4, "1.1"), "a part is not in [0"),
        ("score_errors.csv", lambda lines: [lines[0], *lines[2:]], "errors.csv, line 2: ba"),
        ("score_errors.csv", lambda lines: altered(lines, 1, 5, "0.5"), "line 2: low 0.5 is not"),
        ("score_errors.csv", lambda lines: altered(lines, 1, 6, "-1"), "line 2: high -1 is not"),
        ("score_errors.csv", lambda lines: altered(lines, 1, 7, "-1"), "line 2: resampled -1 is"),
        (
            "score_errors.csv",
            lambda lines: altered(lines, 1, 10, "x"),
            "numerical is 'x', no",
        ),
        ("score_errors.csv", lambda lines: altered(lines, 1, 9, ""), "normalised is '', no"),
        (
            "score_errors.csv",
            lambda lines: altered(lines, 3, 11, "2"),
            "line 4: 2 to 1 are no",
        ),
        (
            "score_differences.csv",
            lambda lines: [*lines, "a,b,c,d,e,f,0,0,0,0,0,0,\n"],
            "line 2: a b",
        ),
        ("sensitivity.csv", lambda lines: [*lines, "a,b,c,d,0,0,0,1\n"], "sensitivity.csv: 1 rows"),
    ],
)
def test_a_row_that_does_not_belong_is_named_by_its_line(name, change, said, signed, damaged_organ):
    """By its checksum a file is refused anyway; the line is told with checksums that are right."""
    edit(damaged_organ / name, change)
    if signed:
        sign(damaged_organ)
    assert said in refusal(damaged_organ)


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("bands.csv", lambda lines: lines[:-1], "bands.csv, line 302: sample 301 of 301"),
        ("bands.csv", lambda lines: lines[:1], "bands.csv, line 2: sample 1"),
        ("sensitivity.csv", lambda lines: lines[:1], "sensitivity.csv: 0 rows"),
        ("sensitivity.csv", lambda lines: [*lines, lines[-1]], "appears twice"),
        ("errors.csv", lambda lines: [*lines, "msm-sugeno,basafa,a,1\n"], "errors.csv, line 2"),
        ("score_differences.csv", lambda lines: lines[:-1], "line 43: msm-interval-type-2"),
        (
            "score_differences.csv",
            lambda lines: altered(lines, 5, 6, "0.5"),
            "line 6: differ",
        ),
        (
            "score_differences.csv",
            lambda lines: altered(lines, 5, 7, "0.5"),
            "line 6: the difference is not between low and high",
        ),
        (
            "score_differences.csv",
            lambda lines: altered(lines, 5, 10, "-1"),
            "line 6: window -1 is",
        ),
        ("scene.toml", lambda lines: [*lines[:-1], "[tissue]\n"], "scene.toml"),
        (
            "scene.toml",
            lambda lines: [re.sub(r"samples = 301", "samples = 151", line) for line in lines],
            "curves.csv, line 3: time 0.01 s, not 0.02 s of sample 2 of basafa at control-point",
        ),
        (
            "scene.toml",
            lambda lines: [re.sub(r"ratio = 0.9", "ratio = 0.8", line) for line in lines],
            "provenance.scene_sha256 differs",
        ),
    ],
)
def test_a_row_of_a_folder_with_fuzzy_systems_too(name, change, said, damaged_point):
    before = (damaged_point / name).read_text()
    edit(damaged_point / name, change)
    assert (damaged_point / name).read_text() != before
    sign(damaged_point)
    assert said in refusal(damaged_point)


# --- results.json -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", "null", '"x"', "3", "{", '{"schema_version": 3}', "[" * 100_000, "\ufeff{}"],
)
def test_numbers_that_are_none_are_refused(text, folder):
    (folder / "results.json").write_text(text)
    assert "results.json" in refusal(folder) or "schema" in refusal(folder)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("schema_version",), 2, "results of schema 2"),
        (("title",), "Another", "title is 'Another'"),
        (("probes",), ["tool"], "probes is"),
        (("models", 0, "name"), "other", "references: fem is none of its models"),
        (("models", 1, "name"), "fem", "two of one name"),
        (("models",), [], "models: are none"),
        (("models", 0, "status"), "done", "none of finished, diverged, not finished"),
        (("models", 0, "status"), "diverged", "ended_at_s"),
        (("models", 0, "system"), "mamdani", "none of the fuzzy systems"),
        (("models", 0, "simulated_s"), "long", "models.0.simulated_s"),
        (
            ("models", 0, "time_step_errors"),
            {"tool": {"displacement": 0, "velocity": 0}},
            "errors at",
        ),
        (("references",), ["msm"], "references: msm"),
        (("references",), ["basafa"], "similarity.csv, line 2"),
        (("provenance", "scene_sha256"), "0", "scene_sha256"),
        (("study_wall_s",), float("inf"), "results.json: not JSON (Infinity is no finite number)"),
        (("sha256",), {}, "is of another run"),
    ],
)
def test_numbers_that_do_not_fit_the_scene_are_refused(path, value, said, damaged_organ):
    table = json.loads((damaged_organ / "results.json").read_text())
    *keys, last = path
    place = table
    for key in keys:
        place = place[key]
    place[last] = value
    (damaged_organ / "results.json").write_text(json.dumps(table))
    manifest.write(damaged_organ, manifest.digests(damaged_organ))
    with pytest.raises(ResultsError, match=re.escape(said)):
        read(damaged_organ)


def test_a_model_that_diverged_has_rows_up_to_then_and_no_others():
    found = with_model(whole(), "basafa", status="diverged", ended_at_s=0.5)
    notes = tuple(f"No score of basafa against fem at {probe}: lost." for probe in ("tool", "far"))
    found = with_record(found, notes=notes)
    rows = tuple(row for row in found.curves if row.model == "fem" or row.time_s < 0.5)
    found = replace(found, curves=rows, scores=(), **known(()), field_differences=())
    check(found)
    field = found.fields["basafa"].copy()
    field[1] = np.nan
    check(replace(found, fields=found.fields | {"basafa": field}))
    with pytest.raises(ValueError, match=r"curves.csv, line 61: sample 10 of 10 of basafa at far"):
        check(replace(found, curves=rows[:-1]))


@pytest.mark.parametrize(
    "overrides",
    [
        ("models=['basafa','msm']", "lattice.time_step=20 ms", "fuzzy.systems=['interval-type-2']"),
        (
            "models=['msm','basafa']",
            "fuzzy.systems=['sugeno']",
            'control_points={"a,\\"b\\" c"={side="superior",at=[0.5,0.5]}}',
        ),
    ],
    ids=["some of it diverged", "names with commas and quotes"],
)
def test_whatever_a_run_leaves_is_whole(overrides, tmp_path):
    """Also a model that diverged, whose band ends, and one with inverted cells."""
    quick = ("time.duration=0.5 s", "time.samples=26", "fuzzy.sensitivity_readings=0")
    results = run_study(read_scene("block", (*SMALL, *quick, *overrides)))
    assert {model.status for model in results.record.models} <= {"finished", "diverged"}
    write(results, tmp_path)
    assert read(tmp_path).record == results.record


# --- arrays -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("fem", lambda a: a[:1], "array fem has shape (1, 6, 3), not (2, 6, 3)"),
        ("fem", lambda a: a.reshape(2, 3, 6), "array fem has shape"),
        ("basafa", lambda a: a[:, :-1], "array basafa has shape (2, 5, 3), not (2, 6, 3)"),
        ("basafa", lambda a: a * np.nan, "array basafa holds what is no finite number"),
        ("basafa", lambda a: a.astype("U8"), "array basafa is of <U8"),
        ("basafa", lambda a: a * 1j, "array basafa is of complex128"),
        ("points", lambda a: a[:-1], "array fem has shape (2, 6, 3), not (2, 5, 3)"),
        ("points", lambda a: a.ravel(), "array points has shape (18,), not ('n', 3)"),
        ("triangles", lambda a: a + 1, "array triangles names points that are not there"),
        ("triangles", lambda a: a.astype(float), "array triangles names points"),
        ("tool", lambda a: a[0], "array tool has shape (3,), not (2, 3)"),
        ("probes", lambda a: a[:1], "array probes has shape (1, 3), not (2, 3)"),
        ("probes", None, "array probes is missing"),
        ("fem", None, "array fem is missing"),
        ("toy", lambda _: np.zeros(3), "array toy is of no model"),
    ],
)
def test_arrays_that_do_not_fit_are_named(name, change, said, damaged_organ):
    arrays = dict(whole().fields)
    if change is None:
        del arrays[name]
    else:
        arrays[name] = change(arrays.get(name))
    np.savez_compressed(damaged_organ / "fields.npz", **arrays)
    sign(damaged_organ)
    assert f"fields.npz: {said}" in refusal(damaged_organ)


def test_arrays_of_fuzzy_systems_that_do_not_fit_are_named(damaged_point, rng):
    with np.load(damaged_point / "fuzzy.npz") as file:
        arrays = dict(file)
    names = sorted(arrays)
    for name in rng.choice(names, 12, replace=False):
        left = {key: array for key, array in arrays.items() if key != name}
        np.savez(damaged_point / "fuzzy.npz", **left)
        sign(damaged_point)
        assert "fuzzy.npz: array" in refusal(damaged_point)
    for name in rng.choice([n for n in names if arrays[n].ndim == 2 and arrays[n].size], 8):
        if arrays[name].shape[0] == arrays[name].shape[1]:
            continue
        np.savez(damaged_point / "fuzzy.npz", **(arrays | {name: arrays[name].T}))
        sign(damaged_point)
        assert "fuzzy.npz: array" in refusal(damaged_point)


# --- anything at all ----------------------------------------------------------------------------


def cut(data, rng, _):
    return data[: rng.integers(0, len(data))]


def emptied(*_):
    return b""


def replaced(_, rng, __):
    return [b"[]", b"{}", b"\0" * 100, b"\xff\xfe\xfd", b"PK\x03\x04junk", b"\x93NUMPY\x01\x00"][
        rng.integers(6)
    ]


def flipped(data, rng, _):
    at = int(rng.integers(len(data)))
    return data[:at] + bytes([data[at] ^ (1 << int(rng.integers(8)))]) + data[at + 1 :]


def dropped(data, rng, _):
    lines = data.splitlines(keepends=True)
    del lines[rng.integers(len(lines))]
    return b"".join(lines)


def doubled(data, rng, _):
    lines = data.splitlines(keepends=True)
    at = rng.integers(len(lines))
    return b"".join([*lines[:at], lines[at], *lines[at:]])


def exchanged(data, rng, _):
    lines = data.splitlines(keepends=True)
    i, j = rng.integers(len(lines), size=2)
    lines[i], lines[j] = lines[j], lines[i]
    return b"".join(lines)


def swapped(_, rng, others):
    return others[rng.integers(len(others))]


DAMAGES = (cut, emptied, replaced, flipped, dropped, doubled, exchanged, swapped)


def damage(folder, rng, others):
    """Change one file in one of many ways; its name, or None where nothing came of it."""
    names = sorted(path.name for path in folder.iterdir())
    name = names[rng.integers(len(names))]
    before = (folder / name).read_bytes()
    kinds = DAMAGES if name.endswith((".csv", ".json", ".toml", "SUMS")) else DAMAGES[:4]
    after = kinds[rng.integers(len(kinds))](before, rng, others)
    (folder / name).write_bytes(after)
    return None if after == before else name


@pytest.mark.parametrize("seed", range(DRAWS))
def test_whatever_is_done_to_a_file_the_folder_is_refused_by_its_name(
    seed, folder, organ, point, monkeypatch
):
    rng = np.random.default_rng(seed)
    others = [path.read_bytes() for one in (organ, point) for path in sorted(one.iterdir())]
    if damage(folder, rng, others) is None:
        return
    monkeypatch.setattr(report, "pdf", lambda _: pytest.fail("a report was made"))
    with pytest.raises(ResultsError):
        report.make_report(folder)


@pytest.mark.parametrize("seed", range(DRAWS))
def test_so_it_is_where_the_checksums_were_made_again(seed, folder, organ, point):
    """Or what is read is as whole as what a run writes: a digit that no check can know of."""
    rng = np.random.default_rng(1000 + seed)
    others = [path.read_bytes() for one in (organ, point) for path in sorted(one.iterdir())]
    name = damage(folder, rng, others)
    try:
        sign(folder)
    except (ValueError, TypeError):
        manifest.write(folder, manifest.digests(folder))
    if name is None:
        check(read(folder))
    else:
        with suppress(ResultsError):
            check(read(folder))


def test_a_zip_with_an_unknown_compression_is_refused(damaged_organ):
    data = (damaged_organ / "fields.npz").read_bytes()
    file = zipfile.ZipFile(io.BytesIO(data))
    at = file.infolist()[0].header_offset
    for start in (at + 8, data.index(b"PK\x01\x02") + 10):
        data = data[:start] + b"\x63\x00" + data[start + 2 :]
    (damaged_organ / "fields.npz").write_bytes(data)
    sign(damaged_organ)
    assert "fields.npz: cannot be read" in refusal(damaged_organ)


def test_a_report_is_made_of_what_is_whole(organ, tmp_path, monkeypatch):
    """Negative control: `pdf` is reached."""
    monkeypatch.setattr(report, "pdf", lambda results: results.record.title.encode())
    target = shutil.copytree(organ, tmp_path / "results")
    report.make_report(target)
    assert (target / "report.pdf").read_bytes() == whole().record.title.encode()
    read(target)


def test_the_quantities_of_the_table_are_those_of_a_run(small_results):
    rows = [row.quantity for row in small_results.field_differences]
    assert rows[: len(QUANTITIES)] == list(QUANTITIES)
    check(small_results)
