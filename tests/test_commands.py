"""The command line, as a person uses it."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from study.commands import EXIT_MACHINE
from study.results import tables
from study.scene.file import read_scene
from study.system import progress, signals

ROOT = Path(__file__).resolve().parent.parent
TABLES = {
    "curves": tables.CurveSample,
    "bands": tables.BandSample,
    "certified": tables.CertifiedSample,
    "similarity": tables.SimilarityScore,
    "iso_18571": tables.Iso18571Rating,
    "score_errors": tables.ScoreError,
    "score_differences": tables.ScoreDifference,
    "errors": tables.FieldDifference,
    "sensitivity": tables.SensitivityEntry,
}


def study(*arguments, cwd=None, **options):
    return subprocess.run(
        [sys.executable, "-m", "study", *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        **options,
    )


@pytest.fixture(scope="module")
def paper_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "paper"
    done = study("run", "paper", "--out", str(folder))
    assert done.returncode == 0, done.stderr
    return folder


def test_a_run_writes_every_file_of_the_interface(paper_folder):
    names = {path.name for path in paper_folder.iterdir()}
    assert names >= {"scene.toml", "results.json", "report.pdf"} | {f"{t}.csv" for t in TABLES}
    for table, kind in TABLES.items():
        with (paper_folder / f"{table}.csv").open(newline="") as file:
            assert tuple(next(csv.reader(file))) == kind._fields
    assert (paper_folder / "report.pdf").read_bytes().startswith(b"%PDF")


def test_a_run_of_the_resolved_scene_gives_the_same_scores(paper_folder, tmp_path):
    done = study(
        "run", str(paper_folder / "scene.toml"), "--out", str(tmp_path / "again"), "--no-report"
    )
    assert done.returncode == 0, done.stderr
    for table in ("similarity", "curves"):
        first = (paper_folder / f"{table}.csv").read_text()
        assert (tmp_path / "again" / f"{table}.csv").read_text() == first
    assert not (tmp_path / "again" / "report.pdf").exists()


def test_an_unchanged_run_has_nothing_to_compute(paper_folder):
    files = [paper_folder / name for name in ("results.json", "curves.csv", "report.pdf")]
    before = [(file.read_bytes(), file.stat().st_mtime_ns) for file in files]
    run = ("run", "paper", "--out", str(paper_folder))
    done = study(*run)
    assert done.returncode == 0, done.stderr
    assert f"nothing to compute: {paper_folder} holds this run" in done.stderr
    assert "mamdani: " in done.stdout
    assert [(file.read_bytes(), file.stat().st_mtime_ns) for file in files] == before
    files[2].unlink()
    done = study(*run)
    assert "nothing to compute" in done.stderr
    assert "similarity" not in done.stderr
    assert files[2].read_bytes() == before[2][0]


QUICK = ("--no-report", "--set", "models=['basafa']", "--set", "time.samples=16")


def test_a_folder_that_was_touched_is_written_again_from_what_is_kept(tmp_path):
    run = ("run", "block", *QUICK, "--out", str(tmp_path / "out"))
    for words in (run, run):
        done = study(*words)
        assert done.returncode == 0, done.stderr
    assert "nothing to compute" in done.stderr
    curves = tmp_path / "out" / "curves.csv"
    before = curves.read_text()
    curves.write_text(before + "\n")
    done = study(*run)
    assert done.returncode == 0, done.stderr
    assert "kept from earlier runs" in done.stderr
    assert curves.read_text() == before
    code = (
        f"import sys; sys.argv[1:] = {run}; from study.commands.application import main; main();"
        "print('LOADED', *sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert "nothing to compute" in done.stderr
    loaded = done.stdout.rpartition("LOADED")[2].split()
    heavy = ("numba", "skfem", "pyamg", "vtk", "matplotlib", "typst", "rich", "study.run.study")
    assert not set(heavy) & set(loaded)


def test_flags_that_contradict_each_other_are_refused(typed):
    for words, said in (
        (("--resume", "--fresh"), "--resume and --fresh: give one"),
        (("--workers", "0"), "--workers 0: give 1 or more"),
    ):
        done = typed("run", "paper", *words)
        assert done.returncode == 2
        assert said in done.stderr


def test_the_report_is_made_again_byte_for_byte(paper_folder):
    before = (paper_folder / "report.pdf").read_bytes()
    done = study("report", str(paper_folder))
    assert done.returncode == 0, done.stderr
    assert (paper_folder / "report.pdf").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "livr"], "did you mean 'liver'"),
        (["run", "paper", "--set", "tool.froce=1 N"], "did you mean 'force'"),
        (["run", "paper", "--set", "tool.force=1 kg"], "not a unit like N"),
        (["run", "block", "--set", "organ.mesh=nowhere.stl"], "nowhere.stl"),
        (["run", "block", "--set", "reference.element_size=1 mm"], "reference.element_size"),
        (["report", "nowhere"], "liver-study run"),
        (["check", "nowhere.toml"], "neither a file nor a built-in"),
        (["run", "paper", "--set", "fuzzy.reading=R9"], "fuzzy.reading = 'R9': use one of R1,"),
        (["run", "paper", "--set", "fuzzy.reading=R7"], "no data describe"),
        (["run", "paper", "--set", "fuzzy.out_of_range=ignore"], "fuzzy.out_of_range"),
        (["estimate", "--hcv", "nan"], "hcv"),
        (["estimate", "--hcv", "9500"], "hcv"),
        (["estimate", "--hcv", "9", "--system", "type-3"], "use one of mamdani"),
        (["estimate", "--hcv", "80", "--out-of-range", "raise"], "outside 2-75 kPa"),
        (["estimate", "--hcv", "9", "--samples", "3"], "samples = 3"),
        (["estimate", "--hcv", "9", "--samples", "2000000"], "from 11 to 1000000"),
        (["estimate", "--hcv", "9", "--samples", "101.4"], "'101.4' is no whole number"),
        (["estimate", "--hcv", "1_0"], "--hcv: '1_0' is no plain number"),
        (["estimate", "--hcv", "9,5"], "'9,5' is no plain number; write for example 9.5"),
        (["run", "paper", "--workers", "1.5"], "--workers: '1.5' is no whole number"),
        (["tradeoff", "block", "--workers", "1.5", "--dry-run"], "'1.5' is no whole number"),
        (["cohort", "--patients", "500.2"], "--patients: '500.2' is no whole number"),
        (["robustness", "--size", "8.4", "--dry-run"], "--size: '8.4' is no whole number"),
        (["robustness", "--size", "8", "--seed", "-1", "--dry-run"], "seed: -1 is negative"),
        (["robustness", "block", "--size", "8", "--seed", "-1", "--dry-run"], "seed: -1 is neg"),
        (["report", __file__], "is a file; name the results folder"),
        (["estimate", "--rule-base", "own.fis"], "own.fis: cannot be read"),
        (["estimate", "--hcv", "9", "--system", "sugeno", "--system", "sugeno"], "named twice"),
        (["cohort", "--patients", "10000000001"], "give 500 to 10000000"),
        (["validate", "cylinders", "--set", "tool.force=1 N"], "--set: only with --data"),
        (["validate", "cylinders", "--probe", "tool"], "--probe: only with --data"),
        (["validate", "cube", "--models", "linear", "--models", "linear"], "is named twice"),
        (["check", "nowhere.stl"], "nowhere.stl: no such file"),
        (["robustness", "block", "--spacing", "1 m", "--dry-run"], "spacing: 1e+03 mm does not"),
        (["robustness", "block", "--spacing", "0.2 mm", "--dry-run"], "give 1.6 to 31 mm"),
        (["validate", "block", "--data", ".", "--quick"], "--quick: only without --data"),
        (["validate", "block", "--data", ".", "--models", "linear"], "--models: only without"),
        (["compare", "a", "b", "--errors", "--tolerance", "0.1"], "--tolerance: a table is by the"),
        (["compare", "a", "b", "c", "--tolerance", "0"], "--tolerance: a table is by the errors"),
        (["report", "--reference", "--no-html"], "--no-html: has no effect with --reference"),
        (["report", "--reference", "--fresh"], "--fresh: has no effect with --reference"),
        (["bundle", "folder", "--out", "run.tar"], "run.tar: end it with .zip"),
        (["bundle", "folder", "--out", "folder/run.zip"], "a results folder holds nothing else"),
        (["estimate", "--hcv", "9", "--out", "out.csv"], "--inputs"),
        (["estimate", "--inputs", "in.csv", "--system", "mamdani"], "--out"),
        (["estimate", "--inputs", "in.csv", "--out", "out.csv"], "--system"),
        (["estimate", "--inputs", "in.csv", "--out", "o.csv", "--system", "sugeno"], "in.csv"),
        (["rules", "--rule-base", "nowhere.fis"], "nowhere.fis"),
        (["rules", "--out", "liver.txt"], ".fis or a .json"),
    ],
)
def test_bad_input_ends_with_code_2_one_message_and_nothing_written(
    arguments, words, typed, tmp_path
):
    done = typed(*arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_message_and_its_code_leave_the_process(tmp_path):
    done = study("run", "livr", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("liver-study: ")
    assert "Traceback" not in done.stderr


def test_an_unknown_option_ends_with_code_2(typed):
    assert typed("run", "paper", "--ouch").returncode == 2


def test_a_mesh_file_that_is_broken_is_refused_by_name(typed, tmp_path):
    (tmp_path / "broken.stl").write_text("solid nothing")
    done = typed("check", "broken.stl")
    assert done.returncode == 2
    assert "broken.stl" in done.stderr


def test_check_lists_what_would_be_run(typed, tmp_path):
    done = typed("check", "block")
    assert done.returncode == 0, done.stderr
    assert "msm-mamdani" in done.stdout
    assert "critical step" in done.stdout
    assert not list(tmp_path.iterdir())


def test_scenes_are_listed_with_their_titles(typed):
    done = typed("scenes")
    assert [line.split()[0] for line in done.stdout.splitlines()] == [
        "liver",
        "press",
        "block",
        "paper",
    ]


def test_estimate_prints_kpa_for_readers_and_si_for_programs(typed):
    shown = typed("estimate", "--hcv", "9.5").stdout
    numbers = json.loads(typed("estimate", "--hcv", "9.5", "--json").stdout)
    assert "kPa" in shown
    value = numbers["mamdani"]["estimate_pa"]
    assert f"{value / 1e3:.2f}" in shown
    assert len(numbers["interval-type-2"]["interval_pa"]) == 2


@pytest.mark.parametrize(
    ("arguments", "forbidden"),
    [
        (["--help"], ["numpy", "scipy", "pint", "pydantic", "matplotlib", "pyvista", "skfem"]),
        (["estimate", "--hcv", "9"], ["vtk", "skfem", "matplotlib", "pint", "numba", "scipy"]),
    ],
)
def test_quick_commands_import_nothing_heavy(arguments, forbidden):
    code = (
        "import sys\nfrom study.commands import app\n"
        f"try:\n    app({arguments!r})\nexcept SystemExit:\n    pass\n"
        "print('LOADED', *sorted({m.split('.')[0] for m in sys.modules}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    loaded = done.stdout.rpartition("LOADED")[2].split()
    assert not set(forbidden) & set(loaded)


def begun(*arguments, until):
    """A run that has ended a stage; in a group of its own, as a terminal would start it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "study", "run", *arguments],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        start_new_session=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith(until):
            break
    return process


def is_gone(group):
    """Whether no process of a group is left."""
    with suppress(ProcessLookupError):
        os.killpg(group, 0)
        return False
    return True


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupted_run_leaves_nothing_behind(number, workers, tmp_path):
    out = ("--out", str(tmp_path / "out"))
    process = begun("block", *out, "--fresh", "--workers", str(workers), until="fem: set up")
    time.sleep(0.3)
    if number == signal.SIGINT:
        os.killpg(process.pid, number)  # as Ctrl-C
    else:
        process.send_signal(number)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == EXIT_MACHINE
    assert next(line for line in said.splitlines() if "liver-study" in line).startswith(
        f"liver-study: {signals.message_for(number)}"
    )
    assert is_gone(process.pid)
    assert not [path for path in tmp_path.iterdir() if path.name != ".out.state"]


def test_an_interrupted_run_goes_on_to_the_same_results(tmp_path):
    changes = (
        "models=['msm']",
        "fuzzy.systems=['mamdani', 'sugeno']",
        "fuzzy.sensitivity_readings=0",
    )
    arguments = ["block", "--no-report", *(w for c in changes for w in ("--set", c))]
    whole = study("run", *arguments, "--out", str(tmp_path / "whole"), "--fresh")
    assert whole.returncode == 0, whole.stderr
    out, alone = ("--out", str(tmp_path / "out")), ("--workers", "1")
    process = begun(*arguments, *out, *alone, "--fresh", until="msm-mamdani: halved")
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert (tmp_path / ".out.state" / "msm-mamdani.npz").exists()
    done = study("run", *arguments, *out, "--resume", "--set", "tool.force=0.1 N")
    assert done.returncode == 2
    assert "another scene (it differs in tool); run without --resume" in done.stderr
    done = study("run", *arguments, *out, "--resume", "--fields")
    assert done.returncode == 2  # no fields were kept before the interruption
    assert "run without --resume" in done.stderr
    done = study("run", *arguments, *out, "--resume")
    assert done.returncode == 0, done.stderr
    assert "kept from earlier runs" in done.stderr
    assert not (tmp_path / ".out.state").exists()
    curves = [(tmp_path / name / "curves.csv").read_text() for name in ("whole", "out")]
    assert curves[0] == curves[1]


def test_fields_of_all_nodes_are_kept_when_asked_for(tmp_path):
    done = study(
        *("run", "block", "--no-report", "--fields", "--out", str(tmp_path / "out")),
        *("--set", "models=['msm']", "--set", "fuzzy.systems=['sugeno']"),
        *("--set", "fuzzy.sensitivity_readings=0", "--set", "time.samples=26"),
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "msm-sugeno.vtkhdf").stat().st_size > 1e5
    assert not (tmp_path / ".out.state").exists()


def test_an_exit_that_was_swallowed_is_made_up_for_at_the_next_stage(monkeypatch):
    monkeypatch.setattr(signals, "_asked", [])
    with progress.Lines().stage("one"):
        signals.ask_to_stop(15)
    with pytest.raises(signals.Stopped, match="SIGTERM"), progress.Lines().stage("two"):
        pass


def test_a_scene_is_shown_as_a_file_that_can_be_run(typed, tmp_path):
    done = typed("scenes", "--show", "block")
    assert done.returncode == 0
    assert typed("scenes", "block").stdout == done.stdout
    (tmp_path / "mine.toml").write_text(done.stdout)
    assert read_scene(str(tmp_path / "mine.toml")) == read_scene("block")


def test_a_word_too_many_is_named(typed):
    done = typed("scenes", "block", "paper")
    assert done.returncode == 2
    assert done.stderr.startswith("liver-study: paper: the command takes no more")


def test_a_page_is_not_opened_that_is_not_made(typed):
    done = typed("run", "paper", "--open", "--no-html")
    assert done.returncode == 2
    assert "--open: opens report.html" in done.stderr


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["recommend", "press", "--error", "1 mm"], "that of their force; give a share"),
        (["robustness", "press", "--size", "16"], "place and force of a blunt tool"),
        (["export", "press", "--to", "vtu"], "holds no rigid tools that are moved and tissue"),
        (["run", "press", "--set", 'require.quantities=["rest"]'], "rest: is of a single load"),
    ],
)
def test_a_study_of_a_single_load_refuses_more(typed, command, said):
    """What cannot follow a scene says so at once, and writes nothing."""
    ended = typed(*command)
    assert ended.returncode == 2
    assert said in " ".join(ended.stderr.split())
    assert not list(Path().iterdir())


def test_help_wraps_its_paragraphs_to_the_terminal():
    done = subprocess.run(
        [sys.executable, "-m", "study", "fit", "--help"],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"COLUMNS": "300"},
    )
    text = "Exit code 2 if the curve does not determine a parameter."
    assert any(line.endswith(text) for line in done.stdout.splitlines())
