"""Commands on what is damaged, cut, closed, full or gone: they end by a message and a code.

Seeded, so the cases are always the same. Most run in this process; those that are about the
process itself are in test_exits.py.
"""

import contextlib
import errno
import functools
import io
import os
import random
import resource
import shutil
import signal
import sys
import tomllib
import warnings
from dataclasses import dataclass
from pathlib import Path

import pytest

from reports import report
from study.commands.application import main
from study.results.folder import write
from study.scene.file import read_scene, write_scene
from study.system import progress, signals
from tests import mesh_samples
from tests.report_samples import results_of

CODES = {0, 1, 2, 3}
PAPER = ("run", "paper", "--no-report", "--out", "out", "--set", "fuzzy.sensitivity_readings=0")


TIMES = int(os.environ.get("LIVER_STUDY_FUZZ", "1"))
"""For a longer search by hand."""


def share(count, quick):
    """Seeds of a kind of case, all but the first ones marked slow."""
    return [
        pytest.param(n, marks=[pytest.mark.slow] if n >= quick else [])
        for n in range(TIMES * count)
    ]


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str


@pytest.fixture
def typed(monkeypatch, tmp_path):
    """The program on words typed in an empty folder; how it ended, which must be as documented."""
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    monkeypatch.chdir(tmp_path)
    handlers = {number: signal.getsignal(number) for number in signals.numbers()}

    def enter(*words, out=None, err=None):
        out, err = out or io.StringIO(), err or io.StringIO()
        monkeypatch.setattr(sys, "argv", ["liver-study", *map(str, words)])
        monkeypatch.setattr(signals, "_asked", [])
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")  # as outside of tests
            code = main()
        found = Ended(code, *(s.getvalue() if not s.closed else "" for s in (out, err)))
        judge(found, words, spoken=not err.closed)
        return found

    yield enter
    for number, handler in handlers.items():
        signal.signal(number, handler)


def judge(ended, words, *, spoken=True):
    said = f"{words}: {ended.code}\n{ended.err}"
    assert ended.code in CODES, said
    assert "Traceback" not in ended.err, said
    assert "a defect of the program" not in ended.err, said
    if ended.code in {2, 3} and spoken:
        told = [line for line in ended.err.splitlines() if line and not line.startswith("  ")]
        last = told[-1]  # each of several problems of a scene has a line of its own, set in
        assert last.startswith("liver-study: "), said
        assert len(last) > len("liver-study: "), said


def assert_nothing_half_written():
    left = [path for path in Path().rglob(".*") if path.name != ".out.state"]
    assert not left, left


def damaged(data, dice):
    """Bytes cut, flipped, doubled, emptied, or with a piece of something else in them."""
    data = bytearray(data)
    at = dice.randrange(len(data) + 1)
    match dice.randrange(7):
        case 0:
            del data[at:]
        case 1:
            for _ in range(dice.randint(1, 20)):
                data[dice.randrange(len(data))] = dice.randrange(256)
        case 2:
            data[at:at] = data[: dice.randint(1, 200)]
        case 3:
            data.clear()
        case 4:
            data[at : at + dice.randint(1, 40)] = dice.choice(
                [
                    b"nan",
                    b"-1",
                    b"1e999",
                    b"[]",
                    b"null",
                    b"\xff\xfe",
                    b"\n\n",
                    b'"',
                    b"99999999",
                ]
            )
        case 5:
            del data[at : at + dice.randint(1, 300)]
        case _:
            lines = bytes(data).split(b"\n")
            dice.shuffle(lines)
            data = bytearray(b"\n".join(lines))
    return bytes(data)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    write(results_of(), folder)
    return folder


@pytest.mark.parametrize("seed", share(80, 20))
def test_reports_of_damaged_results(typed, results, seed, monkeypatch):
    """The pictures are not drawn: it is what is read that is damaged."""
    monkeypatch.setattr(report, "draw", lambda _: ({}, None))
    monkeypatch.setattr(report, "compile_pdf", lambda *_: b"%PDF")
    dice = random.Random(seed)
    shutil.copytree(results, "out")
    path = dice.choice(sorted(Path("out").iterdir()))
    if dice.random() < 0.15:
        path.unlink()
        if dice.random() < 0.5:
            path.mkdir()
    else:
        path.write_bytes(damaged(path.read_bytes(), dice))
    ended = typed("report", "out")
    assert ended.code in {0, 2}
    assert_nothing_half_written()


@pytest.mark.parametrize("kind", ["stl", "ply", "off", "vtk", "vtu", "msh", "inp", "obj"])
@pytest.mark.parametrize("seed", share(12, 2))
def test_checks_of_damaged_meshes(typed, kind, seed):
    import meshio

    dice = random.Random(f"{kind}{seed}")
    points, elements = (
        mesh_samples.cube(2) if kind in {"msh", "inp", "vtu"} else (mesh_samples.cube_surface())
    )
    path = Path(f"mesh.{kind}")
    cells = "tetra" if elements.shape[1] == 4 else "triangle"
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        meshio.Mesh(points, [(cells, elements)]).write(path)
    path.write_bytes(damaged(path.read_bytes(), dice))
    ended = typed("check", path)
    assert ended.code in {0, 2}


VALUES = (
    *("0", "-1", "nan", "inf", "1e300", "1e-300", "true", "''", "'x'", "[]", "{}", "[1, 2", "\x00"),
    *("'1 mm'", "'-1 N'", "'1 kg'", "'0 s'", "'nan Pa'", "'1e400 m'", "['1 mm', '2 mm', '3 mm']"),
    *("3", "0.3", "0.499999", "'liver'", "1999-01-01", "['msm']", "[[1]]", "'5 %'", "1_000", "٣"),
)


@functools.cache
def scene_keys():
    found = []
    for name in ("paper", "block"):
        for table, content in tomllib.loads(write_scene(read_scene(name))).items():
            keys = content if isinstance(content, dict) else {}
            found += [table, *(f"{table}.{key}" for key in keys)]
    odd = ["", ".", "organ.", "organ..size", "organ.size.deep", "no.such", "="]
    return [*sorted(set(found)), *odd]


@pytest.mark.parametrize("seed", share(100, 25))
def test_checks_of_scenes_with_odd_values(typed, seed):
    dice = random.Random(seed)
    name = dice.choice(["paper", "block", "liver"])
    changes = [f"{dice.choice(scene_keys())}={dice.choice(VALUES)}" for _ in range(1 + seed % 2)]
    ended = typed("check", name, *(word for change in changes for word in ("--set", change)))
    assert ended.code in {0, 2}
    assert not list(Path().iterdir())


@pytest.mark.parametrize("seed", share(40, 8))
def test_checks_of_damaged_scene_files(typed, seed):
    dice = random.Random(seed)
    text = write_scene(read_scene(dice.choice(["paper", "block"])))
    Path("own.toml").write_bytes(damaged(text.encode(), dice))
    assert typed("check", "own.toml").code in {0, 2}


@pytest.mark.parametrize("seed", share(20, 4))
def test_runs_of_scenes_with_odd_values(typed, seed):
    dice = random.Random(1000 + seed)
    keys = [key for key in scene_keys() if key.partition(".")[0] in {"tissue", "tool", "patient"}]
    ended = typed(*PAPER, "--set", f"{dice.choice(keys)}={dice.choice(VALUES)}")
    if ended.code in {2, 3}:
        assert not list(Path().iterdir())
    assert_nothing_half_written()


FLAGS = (
    *("--hcv", "--hbv", "--ald", "--samples", "--footprint-factor", "--row"),
    *("--system", "--reading", "--consequent", "--placement", "--footprint", "--absent"),
    *("--sampling", "--reducer", "--out-of-range", "--sugeno-aggregation", "--inputs", "--out"),
)
WORDS = (
    *("9", "0", "-1", "nan", "inf", "1e300", "", "x", "mamdani", "sugeno", "interval-type-2"),
    *("R1", "R4-pair", "R7", "max", "mean", "cut-off", "scaled", "silent", "octave", "exact"),
    *("eiasc", "nie-tan", "raise", "matlab", "in.csv", "out.csv", ".", "/", "no/such/out.csv"),
)


@pytest.mark.parametrize("seed", share(60, 15))
def test_estimates_by_odd_flags(typed, seed):
    dice = random.Random(seed)
    Path("in.csv").write_text("hcv,hbv,ald,cld,nafld\n9,4,5,6,7\n12,4,5,6,7\n")
    flags = dice.sample(FLAGS, dice.randint(1, 3))
    switches = dice.sample(["--explain", "--json"], dice.randint(0, 1))
    typed("estimate", *(w for flag in flags for w in (flag, dice.choice(WORDS))), *switches)
    assert_nothing_half_written()


@pytest.mark.parametrize("seed", share(30, 8))
def test_tables_and_rule_bases_that_are_damaged(typed, seed):
    dice = random.Random(seed)
    end = dice.choice(["fis", "json"])
    assert typed("rules", "--knowledge", "paper-count", "--out", f"own.{end}").code == 0
    table = b"hcv,hbv,ald,cld,nafld\n9,4,5,6,7\n12,4,5,6,7\n3,4,,6,7\n"
    Path("in.csv").write_bytes(damaged(table, dice) if seed % 2 else table)
    if seed % 3:
        path = Path(f"own.{end}")
        path.write_bytes(damaged(path.read_bytes(), dice))
    words = ("--rule-base", f"own.{end}")
    assert typed("rules", *words).code in {0, 2}
    given = ("--inputs", "in.csv", "--out", "out.csv", "--system", "mamdani")
    ended = typed("estimate", *words, *given)
    assert ended.code in {0, 2}
    assert Path("out.csv").exists() == (ended.code == 0)
    assert_nothing_half_written()


# --- the machine -------------------------------------------------------------------------------


@contextlib.contextmanager
def disk_of(size):
    """No file can become larger than so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


WRITING = (
    PAPER,
    ("rules", "--out", "own.json"),
    ("rules", "--out", "own.fis"),
    ("estimate", "--inputs", "in.csv", "--out", "out.csv", "--system", "sugeno"),
)


@pytest.mark.parametrize("seed", share(32, 8))
def test_a_disk_that_is_full_at_any_byte(typed, seed):
    dice = random.Random(seed)
    Path("in.csv").write_text("hcv,hbv,ald,cld,nafld\n" + "9,4,5,6,7\n" * 200)
    with disk_of(dice.choice([0, 1, 10, 100, 1000, 3000, 10_000, 40_000])):
        ended = typed(*WRITING[seed % len(WRITING)])
    assert ended.code in {0, 3}
    left = [path.name for path in Path().iterdir() if path.name != "in.csv"]
    assert bool(left) == (ended.code == 0)
    assert_nothing_half_written()


class Tripping(progress.Lines):
    """Lets something happen at the end of a stage."""

    count = 0

    def __init__(self, at, happen):
        self.at, self.happen = at, happen

    @contextlib.contextmanager
    def stage(self, name):
        with super().stage(name) as advance:
            yield advance
            Tripping.count += 1
            if Tripping.count == self.at:
                self.happen()


def happen(what):
    match what:
        case "interrupt":
            signal.raise_signal(signal.SIGINT)
        case "terminate":
            signal.raise_signal(signal.SIGTERM)
        case "hang up":
            signal.raise_signal(signal.SIGHUP)
        case "no memory":
            raise MemoryError("Unable to allocate 3.00 TiB")
        case "disk full":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        case "input/output":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        case "vanish":
            shutil.rmtree("above")


FAULTS = ("interrupt", "terminate", "hang up", "no memory", "disk full", "input/output", "vanish")


@pytest.mark.parametrize("what", FAULTS)
@pytest.mark.parametrize("stage", share(5, 1))
def test_a_fault_at_each_stage_of_a_run(typed, what, stage, monkeypatch):
    """The stages of `paper`: fuzzy systems, models, similarity, results."""
    tripping = Tripping(stage + 2, lambda: happen(what))
    monkeypatch.setattr(Tripping, "count", 0)
    monkeypatch.setattr(progress, "on_stderr", lambda: contextlib.nullcontext(tripping))
    Path("above/out").mkdir(parents=True)
    ended = typed(*PAPER[:3], "--out", "above/out", *PAPER[5:])
    assert ended.code == 3, ended.err
    assert "--resume" in ended.err
    assert not (what == "vanish" and Path("above").exists())
    if what != "vanish":
        assert [path.name for path in Path("above").iterdir()] == ["out"]
        assert not list(Path("above/out").iterdir())


@pytest.mark.parametrize("error", [signals.Stopped("interrupted"), OSError(28, "no space")])
def test_a_report_that_is_not_made_costs_no_results(typed, error, monkeypatch):
    def fail(_):
        raise error

    monkeypatch.setattr(report, "make_report", fail)
    ended = typed(*(word for word in PAPER if word != "--no-report"))
    assert ended.code == 3
    assert "results kept, but no report" in ended.err
    assert "liver-study report out" in ended.err
    assert {"results.json", "curves.csv"} <= {path.name for path in Path("out").iterdir()}
    assert [path.name for path in Path().iterdir()] == ["out"]


@pytest.mark.parametrize(
    "words",
    [
        ("verify", "--out", "no/such.csv"),
        ("verify", "--out", "folder"),
        ("validate", "--out", "no/such.csv"),
        ("validate", "--out", "folder"),
        ("validate", "block", "--data", "no/such"),
        ("fit", "block", "--curve", "no/such.csv", "--free", "tissue.youngs_modulus"),
        ("fit", "block", "--curve", "c.csv", "--free", "tissue.density", "--out", "file"),
        ("tradeoff", "block", "--out", "file"),
        ("tradeoff", "block", "--out", "file/deep"),
        ("tradeoff", "block", "--out", "folder"),
        ("stability", "block", "--out", "file"),
        ("recommend", "block", "--rate", "60 Hz", "--out", "no/such.toml"),
        ("recommend", "block", "--rate", "60 Hz", "--out", "folder"),
        ("estimate", "--hcv", "9", "--figures", "file"),
        ("estimate", "--inputs", "file", "--system", "sugeno", "--out", "no/such.csv"),
        ("rules", "--out", "no/such.json"),
        ("export", "block", "--to", "vtu", "--out", "file"),
        ("export", "block", "--to", "vtu", "--out", "folder"),
        ("run", "block", "--out", "file"),
        ("run", "block", "--out", "folder"),
        ("run", "block", "--out", "."),
        ("run", "block", "--out", "x" * 300),
        ("run", "block", "--out", "nul\x00"),
    ],
)
def test_places_are_refused_before_any_work(typed, words):
    Path("file").touch()
    Path("folder").mkdir()
    Path("folder/thesis.tex").touch()
    ended = typed(*words)
    assert ended.code == 2
    assert len(ended.err.splitlines()) == 1, ended.err
    assert sorted(path.name for path in Path().iterdir()) == ["file", "folder"]


def test_a_current_folder_that_is_gone_is_named(typed, tmp_path):
    (tmp_path / "gone").mkdir()
    os.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert "the current folder: No such file" in typed(*PAPER).err


# --- streams -----------------------------------------------------------------------------------


class Broken(io.StringIO):
    """A stream that takes so many characters, and then fails."""

    def __init__(self, room, number):
        super().__init__()
        self.room, self.number = room, number

    def write(self, text):
        self.room -= len(text)
        if self.room < 0:
            raise OSError(self.number, os.strerror(self.number), "standard output")
        return super().write(text)


@pytest.mark.parametrize("seed", share(20, 6))
def test_an_output_that_fails_at_any_character(typed, seed):
    dice = random.Random(seed)
    out = Broken(dice.randrange(60), dice.choice([errno.ENOSPC, errno.EIO]))
    words = dice.choice([("estimate", "--hcv", "9"), ("scenes",), ("rules",), ("--help",)])
    assert typed(*words, out=out).code == 3


@pytest.mark.parametrize("command", [("scenes",), ("run", "livr"), ("estimate", "--hcv", "900")])
def test_a_message_that_nobody_can_hear_does_not_change_the_code(typed, command):
    err = io.StringIO()
    err.close()
    heard = typed(*command)
    assert typed(*command, err=err).code == heard.code


def test_the_judge_sees_a_defect(typed, monkeypatch):
    """Negative control: an exception that nobody expects is a traceback, and is noticed."""
    monkeypatch.setattr("study.scene.file.built_in_title", lambda _: {}["no such"])
    with pytest.raises(AssertionError, match="Traceback"):
        typed("scenes")


def test_there_are_enough_cases():
    counts = (80, 8 * 12, 100, 40, 20, 60, 2 * 30, 32, 5 * len(FAULTS), 20)
    assert sum(counts) >= 300
