"""A stage is kept whole or not at all, under a key of all that it depends on.

What is computed side by side is what is computed one after another.
"""

import dataclasses
import io
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from types import NoneType
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
import pytest

from msm.laws import Hooke
from study.annotation.choice import Choice
from study.annotation.quantity import Quantity
from study.models.estimates import estimates
from study.models.model import SILENT, ModelRun
from study.models.tissue import of_modulus
from study.problem.trajectory import Trajectory
from study.results.records import Check, ModelRecord
from study.run.organ_stages import AT_REST, ORGAN, OrganStages
from study.run.stages import SERIAL, RunOptions, Stages
from study.run.study import FUZZY, SIMILARITY, fuzzy_stage, run_study
from study.scene import Scene
from study.scene.file import read_scene
from study.stages import fingerprint
from study.stages import store as stores
from study.stages.fingerprint import key
from study.stages.job_pool import Job, job_pool
from study.stages.serialisation import flattened, restored
from study.stages.store import Store, shown_size, user_store
from study.system.folders import FolderError
from study.system.progress import Silent

ROOT = Path(__file__).resolve().parent.parent
TINY = (
    'organ.size=["60 mm", "40 mm", "30 mm"]',
    "tool.radius=20 mm",
    "tool.force=0.05 N",
    "tool.history={kind='step'}",
    "reference.element_size=60 mm",
    "reference.element=p1",
    "reference.method=tr-bdf2",
    "lattice.spacing=15 mm",
    "time.samples=16",
    "time.duration=0.3 s",
    "fuzzy.sensitivity_readings=0",
    "superposition.count=3",
)
MODELS = 'models=["fem", "basafa", "msm", "reading", "tissue", "superposition"]'
FEWER = 'models=["fem", "basafa", "msm"]'
NAMES = ("fem", "basafa", "msm-sugeno", "reading", "tissue", "superposition")
BUDGETS = ("error budget against fem", "error budget against basafa")
KEY = "0" * 64


@cache
def tiny(*changes) -> Scene:
    return read_scene("block", (*TINY, MODELS, 'fuzzy.systems=["sugeno"]', *changes))


@pytest.fixture
def store(tmp_path):
    found = Store(tmp_path / "store")
    found.prepare()
    return found


def numbers(count=5):
    return {"array0": np.arange(count, dtype=float), "array1": np.array([[True], [False]])}


# What is kept


def test_what_is_put_into_the_store_comes_back_bit_by_bit(store):
    arrays = {"array0": np.array([0.1, np.nan, -0.0, np.inf]), "array1": np.zeros((0, 3), np.int32)}
    arrays |= {
        "array2": np.array("text"),
        "array3": np.asfortranarray(np.eye(3, 2)),
        "a": np.eye(3)[1],
    }
    store.put(KEY, {"a": [1, None, "text", 0.1]}, arrays, wall=2.5)
    found = store.get(KEY)
    assert (found.value, found.wall) == ({"a": [1, None, "text", 0.1]}, 2.5)
    assert abs(found.measured - time.time()) < 60
    for name, array in arrays.items():
        assert found.arrays[name].dtype == array.dtype
        assert found.arrays[name].shape == array.shape
        assert found.arrays[name].flags.f_contiguous == array.flags.f_contiguous
        assert found.arrays[name].tobytes() == array.tobytes()
    assert store.get("1" * 64) is None


def _rewritten(path, **changes):
    with np.load(path) as found:
        content = {name: found[name] for name in found.files}
    np.savez(path, **(content | changes))


def _flipped(path, at):
    content = bytearray(path.read_bytes())
    content[at] ^= 1
    path.write_bytes(content)


BARE = io.BytesIO()
np.save(BARE, np.arange(3))
DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:-30]),
    "no zip": lambda path: path.write_text("{}"),
    "bare array": lambda path: path.write_bytes(BARE.getvalue()),
    "array": lambda path: _rewritten(path, array0=np.arange(5, dtype=float) + 1e-300),
    "type": lambda path: _rewritten(path, array0=np.arange(5, dtype=np.float32)),
    "one more": lambda path: _rewritten(path, array2=np.arange(2)),
    "record": lambda path: _rewritten(path, record=np.array('{"key": "0"}')),
    "text": lambda path: _rewritten(path, record=np.array("[[[")),
    "pickle": lambda path: _rewritten(path, array0=np.array([{"a": 1}], dtype=object)),
    "folder": lambda path: (path.unlink(), path.mkdir()),
}


@pytest.mark.parametrize("how", DAMAGE)
def test_a_damaged_entry_is_as_good_as_none_and_can_be_written_again(store, how):
    store.put(KEY, {}, numbers(), wall=1.0)
    path = store.folder / f"{KEY}.npz"
    DAMAGE[how](path)
    assert store.get(KEY) is None
    if how != "folder":
        store.put(KEY, {}, numbers(), wall=1.0)
        assert store.get(KEY) is not None


def test_no_bit_of_an_entry_can_change_unseen(store, rng):
    """A changed bit costs the entry, unless it is one of the archive's that nothing reads."""
    store.put(KEY, {"a": 1}, numbers(), wall=1.0)
    path = store.folder / f"{KEY}.npz"
    whole = path.read_bytes()
    for at in rng.integers(0, len(whole), 150):
        path.write_bytes(whole)
        _flipped(path, int(at))
        found = store.get(KEY)
        if found is not None:
            assert found.value == {"a": 1}
            assert all(found.arrays[n].tobytes() == a.tobytes() for n, a in numbers().items())


def test_an_entry_under_another_key_is_not_believed(store):
    store.put(KEY, {}, numbers(), wall=1.0)
    other = "1" * 64
    (store.folder / f"{KEY}.npz").rename(store.folder / f"{other}.npz")
    assert store.get(other) is None


def test_nothing_is_unpickled(store, tmp_path):
    class Trap:
        def __reduce__(self):
            return Path.touch, (tmp_path / "sprung",)

    store.put(KEY, {}, numbers(), wall=1.0)
    _rewritten(store.folder / f"{KEY}.npz", array0=np.array([Trap()], dtype=object))
    assert store.get(KEY) is None
    assert not (tmp_path / "sprung").exists()


def test_the_stage_not_used_for_longest_goes_first(store):
    store.put(KEY, {}, numbers(1000), wall=1.0)
    small = dataclasses.replace(store, limit=4 * store.size() + 100)  # a time may be longer
    (store.folder / f"{KEY}.npz").unlink()
    names = [str(k) * 64 for k in range(6)]
    for k, name in enumerate(names[:3]):
        small.put(name, {}, numbers(1000), wall=1.0)
        os.utime(small.folder / f"{name}.npz", (k, k))
    assert small.get(names[0]) is not None  # used now
    for name in names[3:]:
        small.put(name, {}, numbers(1000), wall=1.0)
    kept = {path.stem for path in small.folder.iterdir()}
    assert kept == {names[0], *names[3:]}
    assert small.size() <= small.limit


def test_a_stage_larger_than_the_limit_is_kept_alone(store):
    tight = dataclasses.replace(store, limit=10)
    for name in ("a" * 64, "b" * 64):
        tight.put(name, {}, numbers(), wall=1.0)
    assert [path.stem for path in tight.folder.iterdir()] == ["b" * 64]


def test_what_a_killed_run_was_writing_is_removed_in_the_end(store):
    left, young = store.folder / ".left.npz", store.folder / ".young.npz"
    left.write_bytes(b"half")
    young.write_bytes(b"half")
    os.utime(left, (0, 0))
    store.put(KEY, {}, numbers(), wall=1.0)
    assert not left.exists()
    assert young.exists()


WRITER = """
import sys, numpy as np
from pathlib import Path
from study.stages.store import Store
store = Store(Path(sys.argv[1]), limit=int(sys.argv[2]))
print("begun", flush=True)
for k in range(int(sys.argv[3])):
    array = np.full(20_000, k % 7, dtype=float)
    store.put(f"{k % 7:064d}", {"k": k % 7}, {"a": array}, 1.0)
    found = store.get(f"{(k + 3) % 7:064d}")
    assert found is None or (found.arrays["a"] == found.value["k"]).all()
"""


def writer(folder, count, limit=10**9):
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(folder), str(limit), str(count)],
        stdout=subprocess.PIPE,
        cwd=ROOT,
        text=True,
    )
    assert process.stdout.readline() == "begun\n"
    return process


def test_a_kill_amid_a_write_leaves_whole_entries(store):
    for delay in (0.01, 0.05, 0.12):
        process = writer(store.folder, 10**6)
        time.sleep(delay)
        process.kill()
        process.communicate()
        for path in store.folder.glob("[!.]*.npz"):
            found = store.get(path.stem)
            assert found is not None
            assert (found.arrays["a"] == found.value["k"]).all()


def test_two_runs_share_a_store_that_is_too_small_for_both(store):
    both = [writer(store.folder, 40, limit=500_000) for _ in range(2)]
    assert [process.communicate() and process.returncode for process in both] == [0, 0]
    assert store.size() <= 500_000


# Where it is kept


def test_the_store_is_where_the_environment_says(monkeypatch, tmp_path):
    monkeypatch.setenv(stores.FOLDER, str(tmp_path / "here"))
    monkeypatch.setenv(stores.LIMIT, "1.5 MB")
    found = user_store()
    assert (found.folder, found.limit) == (tmp_path / "here", 1_500_000)
    assert found.folder.stat().st_mode & 0o777 == 0o700
    monkeypatch.delenv(stores.FOLDER)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert user_store().folder == tmp_path / "cache" / "liver-study"


@pytest.mark.parametrize("text", ["much", "4", "4 GiB", "-", "1e999 GB"])
def test_a_limit_that_is_no_size_is_refused(monkeypatch, text):
    monkeypatch.setenv(stores.LIMIT, text)
    with pytest.raises(ValueError, match=r"LIVER_STUDY_STORE_LIMIT: .* give a number and one of"):
        user_store()


def test_a_folder_that_others_may_write_is_not_believed(monkeypatch, tmp_path, capsys):
    folder = tmp_path / "cache" / "liver-study"
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    monkeypatch.setenv(stores.FOLDER, str(folder))
    with pytest.raises(FolderError, match=r"others may write there.*chmod 700"):
        user_store()
    monkeypatch.delenv(stores.FOLDER)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert user_store() is None
    assert "stages are not kept" in capsys.readouterr().err


def test_sizes_are_shown_for_a_person():
    assert [shown_size(n) for n in (0, 999, 1500, 2 * 10**9)] == ["0 B", "999 B", "1.5 KB", "2 GB"]


# Values as they are kept


def a_run(status="finished"):
    rng = np.random.default_rng(3)
    fields = (rng.random((4, 1, 3)), rng.random((4, 1, 3)), rng.random((2, 5, 3)), np.zeros((2, 0)))
    lost = dataclasses.replace(
        Trajectory(*fields),
        status=status,
        ended_at=0.5,
        ended_near=np.array([1.0, np.nan, 3]),
    )
    record = ModelRecord(name="m", label="M", simulated_s=1.0, status=status, time_step_errors={})
    check = Check(name="c", value=float("inf"), limit=1.0, meaning="m")
    return ModelRun(lost, record, (check,), ("note",), (lost, Trajectory(*fields)), None)


def test_a_run_is_restored_as_it_was():
    run = a_run("diverged")
    plain, arrays = flattened(run)
    again = restored(ModelRun, json.loads(json.dumps(plain, allow_nan=False)), arrays)
    assert same(run, again)
    assert isinstance(again.bounds, tuple)
    assert again.checks[0].value == float("inf")


@pytest.mark.parametrize(
    "plain",
    [[], {}, {"name": 1}, {"name": "c", "value": "1", "limit": 1.0, "meaning": "m"}, None, "c"],
)
def test_what_is_of_another_kind_is_refused(plain):
    with pytest.raises(ValueError, match="holds no Check"):
        restored(Check, plain, {})


def test_a_value_that_cannot_be_kept_is_refused():
    with pytest.raises(TypeError, match="cannot keep a function"):
        flattened({"a": lambda: None})


# Keys


def test_a_key_depends_on_value_type_program_and_stage(monkeypatch):
    things = (
        *(1, 1.0, "1", True, None, (1,), [1], (1, (2,)), ((1, 2),)),
        *(np.ones(2), np.ones((2, 1)), np.ones(2, np.float32), Hooke(1.0), {"a": 1}, {"b": 1}),
        *(partial(of_modulus, modulus=1.0), partial(of_modulus, modulus=2.0), of_modulus),
    )
    found = [key("stage", thing) for thing in things]
    assert len(set(found)) == len(things)
    assert None not in found
    assert key("stage", 1) != key("other", 1)
    assert key("stage", 1) != key("stage", 1, modules=("msm.laws",))
    before = key("stage", Hooke(1.0))
    monkeypatch.setattr(fingerprint, "program", lambda _: "another")
    assert key("stage", Hooke(1.0)) != before
    monkeypatch.undo()
    monkeypatch.setattr(fingerprint, "machine", lambda: ["another"])
    assert key("stage", Hooke(1.0)) != before


def test_what_has_no_text_has_no_key():
    class Within:
        pass

    for thing in (lambda: 1, Within(), object(), np.array([None]), {"a": (lambda: 1,)}):
        assert key("stage", thing) is None


THINGS = "key('a', {'b': (1, 0.1)}, Hooke(1.0), modules=('study.stages.store',))"


def test_another_process_finds_the_same_keys():
    code = f"from msm.laws import Hooke; from study.stages.fingerprint import key; print({THINGS})"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env=os.environ | {"PYTHONHASHSEED": "7"},
    )
    assert done.stdout.strip() == eval(THINGS)  # noqa: S307 - our own


def organ_stages(scene, options=SERIAL):
    side = job_pool(1, Silent()).__enter__()
    stages = Stages(options, side, Silent())
    return OrganStages(scene, estimates(scene), None, stages, SILENT)


def all_stages(scene, found=None):
    """Every stage of a scene on a mesh of one name, so that only the scene makes a difference."""
    found = found or organ_stages(scene)
    wanted = (one.stage for one in found.all_stages("mesh"))
    return {one.name: one for one in (found.problem_record(), fuzzy_stage(scene, None), *wanted)}


def keys(scene):
    return {name: stage.key for name, stage in all_stages(scene).items()}


def missed(*changes):
    """Stages that a change of the scene makes miss, by names."""
    before, after = keys(tiny()), keys(tiny(*changes))
    return {name for name in after if before.get(name) != after[name]}


LATTICES = {"msm-sugeno", "reading", "tissue", "basafa"}
SPRINGS = {*LATTICES, AT_REST, *BUDGETS}
MOTIONS = {*NAMES, AT_REST, *BUDGETS}
DEPENDENT = {
    "title=Another": set(),
    "renders=false": set(),
    'remarks=["a"]': set(),
    "fuzzy.surface=['hbv', 'nafld']": {FUZZY},
    "fuzzy.sensitivity_readings=16": {FUZZY},
    "patient.hcv=14 kPa": {FUZZY, "msm-sugeno", "reading"},
    "fuzzy.samples=201": {FUZZY, "msm-sugeno"},
    "fuzzy.knowledge=severity": {FUZZY, "msm-sugeno"},
    "basafa.k1=0.06 N": {"basafa", "error budget against basafa"},
    "reference.accuracy=2 %": {"fem"},
    "reference.steps_per_sample=3": {"fem"},
    "superposition.count=4": {"superposition"},
    "lattice.spacing=14 mm": {ORGAN, *SPRINGS},
    "lattice.step_fraction=0.7": SPRINGS,
    "damping.ratio=0.8": {*MOTIONS},
    "tool.force=0.06 N": {ORGAN, *MOTIONS},
    "tool.radius=21 mm": {ORGAN, *MOTIONS},
    "support.depth=31 mm": {ORGAN, *MOTIONS},
    "time.samples=17": {ORGAN, *MOTIONS},
    "reference.element_size=50 mm": {ORGAN, *MOTIONS},
    "tissue.density=1000 kg/m^3": {FUZZY, ORGAN, *MOTIONS},
}


@pytest.mark.parametrize("change", DEPENDENT)
def test_a_change_of_the_scene_misses_what_depends_on_it_alone(change):
    assert missed(change) == DEPENDENT[change]


def leaves(kind=Scene, value=None, before=""):
    """Each key of a scene with a value that it does not have, as its annotation allows."""
    value = tiny() if value is None else value
    for name, hint in get_type_hints(kind, include_extras=True).items():
        now, path = getattr(value, name, None), f"{before}{name}"
        if dataclasses.is_dataclass(now):
            yield from leaves(type(now), now, f"{path}.")
        else:
            other = another(now, hint)
            if other is not None:
                yield path, other


def another(now, hint):
    is_optional = NoneType in get_args(hint)
    inner = next(one for one in get_args(hint) if one is not NoneType) if is_optional else hint
    for mark in getattr(inner, "__metadata__", ()):
        if isinstance(mark, Choice):
            return next((name for name in mark.names() if name != now), None)
        if isinstance(mark, Quantity):
            return within(mark, now)
    if get_origin(inner) is Literal:
        return next(one for one in get_args(inner) if one != now)
    if isinstance(now, bool):
        return not now
    return f"{now} " if isinstance(now, str) else None


def within(mark, now):
    if now is None:
        return (mark.low * mark.high) ** 0.5 if mark.low > 0.0 else 0.5 * (mark.low + mark.high)
    if isinstance(now, int):
        return now + 1 if now < mark.high else now - 1
    return now * 1.07 if 0.0 < now * 1.07 <= mark.high else mark.low + 0.5 * (now or mark.high)


def changed(scene, values):
    """The scene with the keys of these names set."""
    for path, value in values.items():
        scene = _set(scene, path.split("."), value)
    return scene


def _set(table, names, value):
    if len(names) > 1:
        value = _set(getattr(table, names[0]), names[1:], value)
    return dataclasses.replace(table, **{names[0]: value})


def variants(only=""):
    """Values that keys of the scene do not have, each with the keys of the stages it gives."""
    found = {}
    for path, value in leaves():
        if path.endswith(only):
            with suppress(ValueError):  # no scene
                found[path] = value, keys(changed(tiny(), {path: value}))
    return found


def same(one, other):
    """Whether two values are the same bit by bit, but for times on the clock."""
    return bits(one) == bits(other)


NOT_FOUND = {"stages", "workers"}
"""Of a record: how it was found, and not what."""


def bits(thing):
    if dataclasses.is_dataclass(thing):
        names = (f.name for f in dataclasses.fields(thing) if not f.name.endswith("wall_s"))
        return [[name, bits(getattr(thing, name))] for name in names if name not in NOT_FOUND]
    if isinstance(thing, dict):
        return [[k, bits(v)] for k, v in thing.items()]
    if isinstance(thing, tuple | list):
        return [bits(one) for one in thing]
    if isinstance(thing, np.ndarray):
        return thing.dtype.str, thing.shape, thing.tobytes()
    return repr(thing)


# What is kept is what would be computed


def test_a_stage_does_not_depend_on_what_its_key_leaves_out():
    """All keys that a stage's key does not tell are changed at once: it gives the same value."""
    every = variants()
    assert len(every) > 60
    for name in keys(tiny()):
        check_sound(name, every)


def check_sound(name, every):
    stage = all_stages(tiny())[name]
    alike = {path: value for path, (value, found) in every.items() if found.get(name) == stage.key}
    other = all_stages(changed(tiny(), alike))[name]
    assert other.key == stage.key, name
    assert same(other.work(Silent()), stage.work(Silent())), name


@pytest.mark.parametrize(
    ("name", "field"),
    [("msm-sugeno", "step_fraction"), ("fem", "force"), ("basafa", "k1"), (FUZZY, "hcv")],
)
def test_a_key_that_leaves_out_what_a_stage_depends_on_is_caught(monkeypatch, name, field):
    store_summary = fingerprint._fields
    monkeypatch.setattr(
        fingerprint,
        "_fields",
        lambda thing, modules: (one for one in store_summary(thing, modules) if one[0] != field),
    )
    with pytest.raises(AssertionError, match=name):
        check_sound(name, variants(field))


def results_of(scene, options=SERIAL):
    return run_study(scene, SILENT, options)


def test_kept_and_computed_results_are_the_same_bit_by_bit(store):
    options = RunOptions(store)
    scene = tiny(FEWER)
    alone, first, again = (results_of(scene, one) for one in (SERIAL, options, options))
    assert same(alone, first)
    assert same(alone, again)
    assert {one.name for one in again.record.stages} == {*keys(scene), SIMILARITY}
    assert all(one.kept for one in again.record.stages)
    walls = [{one.name: one.wall_s for one in run.record.stages} for run in (first, again)]
    assert walls[0] == walls[1]
    other = tiny(FEWER, "patient.hcv=14 kPa", "title=Other")
    mixed = results_of(other, options)
    assert same(mixed, results_of(other))
    computed = {one.name for one in mixed.record.stages if not one.kept}
    assert computed == {FUZZY, "msm-sugeno", SIMILARITY}
    afresh = results_of(scene, RunOptions(store, fresh=True))
    assert not any(one.kept for one in afresh.record.stages)


def test_a_store_that_cannot_be_written_costs_no_results(store, monkeypatch, capsys):
    def full(*_):
        raise OSError(28, "No space left on device")

    scene = tiny('models=["basafa"]')
    monkeypatch.setattr(stores, "_write", full)
    assert same(results_of(scene, RunOptions(store)), results_of(scene))
    assert "basafa: not kept for the next run" in capsys.readouterr().err
    assert not list(store.folder.iterdir())


# Side by side


def test_side_by_side_is_the_same_bit_by_bit(store):
    scene = tiny(FEWER)
    both = results_of(scene, RunOptions(store, workers=2))
    again = results_of(scene, RunOptions(store))
    assert same(both, results_of(scene))
    assert same(both, again)
    assert all(one.kept for one in again.record.stages)


def run_jobs(count, *jobs, progress=None):
    with job_pool(count, progress or Silent()) as side:
        for job in jobs:
            side.start(job)
        return side.results()


def job(name, work):
    return Job(name, lambda _: work())


def no_children():
    """Whether none of this process's children is left, also no dead one."""
    try:
        os.waitpid(-1, os.WNOHANG)
    except ChildProcessError:
        return True
    return False


def raising(error):
    def work():
        raise error

    return work


@pytest.mark.parametrize("count", [1, 2, 4])
def test_results_come_in_the_order_of_the_jobs(count):
    jobs = [job(str(k), lambda k=k: (time.sleep(0.02 * (k % 3)), k)[1]) for k in range(7)]
    assert list(run_jobs(count, *jobs).items()) == [(str(k), k) for k in range(7)]
    assert no_children()


def test_what_was_built_after_a_process_was_forked_is_known_to_the_next():
    with job_pool(2, Silent()) as side:
        side.start(job("a", os.getpid))
        built = [1]
        side.start(job("b", lambda: (os.getpid(), *built)))
        built.append(2)
        side.start(job("c", lambda: tuple(built)))
        found = side.results()
    assert os.getpid() not in {found["a"], found["b"][0]}
    assert found["c"] in {(1, 2)}


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize(
    "error", [ValueError("tool.force: no"), MemoryError("of it"), OSError(28, "full", "there")]
)
def test_a_failure_is_raised_as_it_is_and_ends_the_others(count, error):
    started = time.monotonic()
    with pytest.raises(type(error)) as ended:
        run_jobs(count, job("fails", raising(error)), job("a", partial(time.sleep, 0.1 * count**5)))
    assert ended.value.args == error.args
    assert str(ended.value) == str(error)
    assert time.monotonic() - started < 2.5
    assert no_children()


def test_an_error_below_a_value_error_is_the_one_that_is_told():
    def work():
        try:
            os.write(os.open("/dev/full", os.O_WRONLY), b"a")
        except OSError:
            raise ValueError("I/O operation on closed file")  # noqa: B904 - as zipfile does

    with pytest.raises(OSError, match="No space left"):
        run_jobs(2, job("a", work))


def test_an_error_that_cannot_be_sent_is_told_by_its_text():
    class OwnError(Exception):
        def __init__(self, one, two):
            super().__init__(f"{one} and {two}")

    with pytest.raises(RuntimeError, match="OwnError: 1 and 2"):
        run_jobs(2, job("a", raising(OwnError(1, 2))))


@pytest.mark.parametrize(
    ("number", "kind", "said"),
    [
        (signal.SIGKILL, MemoryError, "the process of a was killed"),
        (signal.SIGTERM, OSError, "ended by SIGTERM; run with --workers 1"),
    ],
)
def test_a_process_that_is_killed_is_told_and_ends_the_others(number, kind, said):
    with pytest.raises(kind, match=said):
        run_jobs(
            2, job("a", lambda: os.kill(os.getpid(), number)), job("b", partial(time.sleep, 60))
        )
    assert no_children()


class Told:
    """Notes the stages that it is told of."""

    def __init__(self):
        self.notes = []

    @contextmanager
    def stage(self, name):
        self.notes.append(("begin", name))
        yield lambda share: self.notes.append(("share", name, share))
        self.notes.append(("end", name))


def test_stages_of_several_processes_are_told_to_one(monkeypatch):
    monkeypatch.setattr("study.stages.job_pool.PROGRESS_INTERVAL", 0.0)

    def work(progress):
        with progress.stage("within") as advance:
            time.sleep(0.01)
            advance(0.5)

    store_summary = Told()
    run_jobs(2, Job("a", work), Job("b", work), progress=store_summary)
    for note in (("begin", "within"), ("share", "within", 0.5), ("end", "within")):
        assert store_summary.notes.count(note) == 2


PARENT = """
import os, sys, time
from study.system.progress import Silent
from study.stages.job_pool import Job, job_pool
def work(_):
    print(os.getpid(), flush=True)
    time.sleep(60)
with job_pool(2, Silent()) as side:
    side.start(Job("a", work))
    side.start(Job("b", work))
    side.results()
"""


def alive(pid):
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc to look into")
def test_no_process_outlives_a_run_that_was_killed():
    process = subprocess.Popen(
        [sys.executable, "-c", PARENT], stdout=subprocess.PIPE, cwd=ROOT, text=True
    )
    children = [int(process.stdout.readline()) for _ in range(2)]
    assert all(map(alive, children))
    process.kill()
    process.communicate()
    deadline = time.monotonic() + 10
    while any(map(alive, children)) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not any(map(alive, children))
