"""The sweep runner loses nothing, runs nothing twice, believes nothing damaged, blames rightly."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from study.models.table import MODELS
from study.sweep import imports
from study.sweep import program as programs
from study.sweep.attempt import attempt
from study.sweep.imports import reached
from study.sweep.plan import plan
from study.sweep.program import ROOT, program
from study.sweep.runner import Backend, run
from study.sweep.status import StatusLines, SweepStatus, duration, on_stderr
from study.sweep.store import Store
from study.sweep.task import Task

FUNCTIONS = "tests.sweep_tasks"
DRIVER = """
import sys
from pathlib import Path
from study.sweep.runner import Backend, run
from study.sweep.store import Store
from study.sweep.task import Task

folder, log, workers = sys.argv[1:]
tasks = [
    Task("tests.sweep_tasks:square", {"x": x, "log": log, "seconds": 0.03}) for x in range(200)
]
if __name__ == "__main__":
    outcomes = run(tasks, Store(Path(folder)), Backend(int(workers)))
    print(sum(outcome.status == "done" for outcome in outcomes))
"""
"""A sweep of 200 runs, started as a program so that it can be killed."""


def task(name, **arguments):
    return Task(f"{FUNCTIONS}:{name}", arguments)


def squares(count, **arguments):
    return [task("square", x=x, **arguments) for x in range(count)]


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "store")


@pytest.fixture
def log(tmp_path):
    (tmp_path / "log").touch()
    return tmp_path / "log"


def begun(log):
    """The x of each run that was begun, and its process, in order."""
    return [(int(x), int(pid)) for x, pid in map(str.split, log.read_text().splitlines())]


def without_wall(outcomes):
    return [(o.task, o.status, o.value, o.message) for o in outcomes]


# In this process


def test_outcomes_come_in_the_order_of_the_tasks_also_where_some_are_stored(store):
    tasks = squares(6)
    run(tasks[3:], store)
    outcomes = run(tasks, store)
    assert [outcome.task for outcome in outcomes] == tasks
    assert [outcome.value["square"] for outcome in outcomes] == [0, 1, 4, 9, 16, 25]


def test_a_stored_run_is_not_run_again_and_answers_the_same(store, log):
    tasks = squares(5, log=str(log))
    first, again = run(tasks, store), run(tasks, store)
    assert first == again
    assert len(begun(log)) == 5


def test_equal_tasks_are_run_once(store, log):
    outcomes = run([task("square", x=3, log=str(log))] * 3, store)
    assert [outcome.value["square"] for outcome in outcomes] == [9, 9, 9]
    assert len(begun(log)) == 1


def test_a_run_that_raises_is_failed_with_its_message_and_tried_again_by_the_next_sweep(store):
    tasks = [task("fail", x=1), *squares(2)]
    for _ in range(2):
        failed, *others = run(tasks, store)
        assert (failed.status, failed.value) == ("failed", None)
        assert failed.message == "ValueError: 1 is odd"
        assert [outcome.status for outcome in others] == ["done", "done"]
    assert plan(tasks, store).left == 1


@pytest.mark.parametrize("kind", ["nan", "set", "number"])
def test_an_answer_that_is_not_plain_is_a_failure_and_is_not_stored(store, kind):
    (outcome,) = run([task("answer", kind=kind)], store)
    assert outcome.status == "failed"
    assert not list(store)
    assert run([task("answer", kind="plain")], store)[0].value == {"x": 3}


def test_a_function_that_is_not_there_fails_and_a_module_that_is_not_there_is_refused(store):
    (outcome,) = run([task("nonesuch")], store)
    assert "nonesuch" in outcome.message
    with pytest.raises(ValueError, match=r"tests\.nowhere: no such module"):
        run([Task("tests.nowhere:f", {})], store)


# What is stored


def damaged(path, how):
    text = path.read_text()
    path.write_text(
        {
            "truncated": text[: len(text) // 2],
            "empty": "",
            "altered": text.replace('"square":9', '"square":8'),
            "not an object": "[1]",
            "nested": 100_000 * "[",
            "not text": text.replace("{", "\x00"),
        }[how]
    )
    assert path.read_text() != text


@pytest.mark.parametrize(
    "how", ["truncated", "empty", "altered", "not an object", "nested", "not text"]
)
def test_a_damaged_result_is_run_again_and_mended(store, log, how):
    tasks = squares(5, log=str(log))
    sound = run(tasks, store)
    damaged(store.folder / f"{tasks[3].key}.json", how)
    assert plan(tasks, store).left == 1
    assert without_wall(run(tasks, store)) == without_wall(sound)
    assert [x for x, _ in begun(log)] == [0, 1, 2, 3, 4, 3]
    assert len(list(store)) == 5


def test_a_sound_result_under_the_name_of_another_is_not_believed(store):
    tasks = squares(2)
    run(tasks, store)
    one, other = (store.folder / f"{task.key}.json" for task in tasks)
    other.write_bytes(one.read_bytes())
    assert store.get(tasks[1]) is None
    assert run(tasks, store)[1].value["square"] == 1


def test_two_sweeps_that_store_the_same_run_leave_one_whole_file(store):
    store.prepare()
    (one,) = squares(1)
    for wall in (1.0, 2.0):
        store.put(one, {"square": 0}, wall)
    assert [path.name for path in store.folder.iterdir()] == [f"{one.key}.json"]
    assert store.get(one).wall == 2.0


def test_a_store_that_cannot_be_written_is_refused_before_anything_is_run(tmp_path, log):
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="choose another folder"):
        run(squares(1, log=str(log)), Store(tmp_path / "file"))
    assert not begun(log)


def test_a_result_that_cannot_be_written_ends_the_sweep_and_leaves_no_part(store, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left on device") as ended:
        run(squares(3), store)
    assert ended.value.filename == str(store.folder)
    assert "start again" in ended.value.__notes__[0]
    assert not store.folder.exists()


# Identity


def test_equal_arguments_give_equal_keys_whatever_their_order():
    one = Task(f"{FUNCTIONS}:square", {"x": 1, "seconds": 0.5})
    other = Task(f"{FUNCTIONS}:square", {"seconds": 0.5, "x": 1})
    keys = {one.key, other.key, task("square", x=2).key, task("square", x=1).key}
    assert len(keys) == 3
    assert task("fail", x=1).key not in keys


@pytest.mark.parametrize("arguments", [{"x": float("inf")}, {"x": {1}}, {"x": object()}])
def test_arguments_that_are_not_plain_are_refused_with_the_function(arguments):
    with pytest.raises(ValueError, match=r"arguments of tests\.sweep_tasks:square: .*give numbers"):
        Task(f"{FUNCTIONS}:square", arguments)


@pytest.mark.parametrize("name", ["square", "a.b:", ":square", "a:b.c"])
def test_a_function_is_named_by_module_and_name(name):
    with pytest.raises(ValueError, match=r"package\.module:function"):
        Task(name, {})


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """A user's own package, whose module imports one beside it and one of ours."""
    own = tmp_path / "own_sweep_cases"
    own.mkdir()
    (own / "__init__.py").touch()
    (own / "shape.py").write_text("SIDES = 3\n")
    (own / "case.py").write_text(
        "def sides():\n"
        "    from own_sweep_cases.shape import SIDES\n"
        "    from study.sweep import canonical\n"
        "    return {'sides': SIDES}\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    yield own
    for name in [name for name in sys.modules if name.startswith("own_sweep_cases")]:
        del sys.modules[name]


@pytest.mark.parametrize("edited", ["case.py", "shape.py", "__init__.py"])
def test_runs_of_a_program_that_was_edited_are_run_again(outside, store, edited):
    case = Task("own_sweep_cases.case:sides", {})
    run([case], store)
    assert plan([case], store).left == 0
    (outside / edited).write_text((outside / edited).read_text() + "# edited\n")
    assert plan([case], store).left == 0  # this process keeps to the program that it has loaded
    programs.program.cache_clear()
    programs._sha256_once.cache_clear()
    assert plan([case], store).left == 1
    assert run([case], store)[0].value == {"sides": 3}
    assert len(list(store)) == 2


def test_a_library_of_another_version_makes_another_program(monkeypatch):
    before = program(FUNCTIONS)
    monkeypatch.setattr(programs, "_versions", lambda: {"numpy": "0"})
    programs.program.cache_clear()
    assert program(FUNCTIONS) != before
    programs.program.cache_clear()


def test_the_program_holds_imports_within_functions_and_leaves_out_the_command_line():
    found = set(reached("study.run.study", (ROOT,)))
    assert {"study", "study.run", "study.scene", "msm.forces", "fuzzy.systems.kernel"} <= found
    assert "fem_reference.elasticity" in found
    assert "study.commands" not in found


def test_every_module_that_a_run_loads_is_part_of_its_program():
    """Held to what Python itself imports."""
    load = (
        "import sys, study.run.study\n"
        "print(*(n for n in sys.modules if n.split('.')[0] in "
        "{'study', 'fem_reference', 'msm', 'fuzzy'}))"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", load], capture_output=True, text=True, check=True, cwd=ROOT
    ).stdout.split()
    assert len(loaded) > 30
    assert set(loaded) <= set(reached("study.run.study", (ROOT,)))


def test_the_program_follows_tables_that_are_named_in_a_text(tmp_path):
    """As the models of `study.models.table`, and the choices of a scene, are."""
    (tmp_path / "one.py").write_text('TABLE = {"a": "two:THINGS"}\nTEXT = "three: not a name"\n')
    for name in ("two.py", "three.py"):
        (tmp_path / name).touch()
    assert set(reached("one", (tmp_path,))) == {"one", "two"}
    models = {text.partition(":")[0] for text in MODELS.values()}
    assert models <= set(reached("study.tradeoff.observation", (ROOT,)))
    assert "msm.integrators" in reached("study.scene.schema", (ROOT,))


def test_a_source_that_imports_by_name_takes_its_whole_package_with_it(tmp_path):
    package = tmp_path / "open_ended"
    (package / "within").mkdir(parents=True)
    for name in ("__init__.py", "within/__init__.py", "within/deep.py", "beside.py"):
        (package / name).touch()
    (package / "one.py").write_text("import importlib\nimportlib.import_module(name)\n")
    (package / "two.py").write_text("from . import beside\nfrom .within.deep import thing\n")
    members = {"open_ended", "open_ended.beside", "open_ended.within", "open_ended.within.deep"}
    assert set(reached("open_ended.one", (tmp_path,))) == {
        *members,
        "open_ended.one",
        "open_ended.two",
    }
    assert set(reached("open_ended.two", (tmp_path,))) == {*members, "open_ended.two"}
    assert set(reached("open_ended.beside", (tmp_path,))) == {"open_ended", "open_ended.beside"}


def test_a_worker_with_another_program_refuses_to_run():
    with pytest.raises(ValueError, match="sources or libraries differ"):
        attempt(f"{FUNCTIONS}:square", json.dumps({"x": 1}), "another")


# Plan and progress


def test_a_plan_counts_and_predicts_from_the_stored_runs_most_like_those_left(store):
    store.prepare()
    for x, seconds, wall in ((1, 0.1, 2.0), (2, 0.1, 4.0), (9, 0.2, 50.0)):
        store.put(task("square", x=x, seconds=seconds), {}, wall)
    tasks = [task("square", x=x, seconds=0.1) for x in range(5)]
    found = plan(tasks, store)
    assert found == (5, 2, 3, 3 * 3.0)  # those with 0.1 s took 2 and 4 seconds
    assert str(found) == "5 runs, 2 stored, 3 left: about 9 s of work"
    unknown = plan([*tasks, task("fail", x=1)], store)
    assert (unknown.left, unknown.seconds) == (4, None)


def test_a_plan_writes_nothing(tmp_path):
    assert plan(squares(2), Store(tmp_path / "store")) == (2, 0, 2, None)
    assert not list(tmp_path.iterdir())


def test_progress_counts_stored_done_and_failed_and_says_how_long_it_takes(store):
    run(squares(2), store)
    told = []
    run([*squares(4), task("fail", x=1)], store, progress=told.append)
    assert [status[:4] for status in told] == [
        (5, 2, 0, 0), (5, 2, 1, 0), (5, 2, 2, 0), (5, 2, 2, 1),
    ]  # fmt: skip
    assert told[0].seconds_left is None
    assert told[-1].seconds_left == 0.0
    assert (
        str(SweepStatus(100, 20, 38, 2, 120.0)) == "60 of 100, 20 from before, 2 failed, 2 min left"
    )
    assert [duration(s) for s in (8.4, 150, 9000)] == ["8 s", "2 min", "2.5 h"]


def test_lines_are_sparse_where_stderr_is_no_terminal(store, capsys):
    with on_stderr("squares") as tell:
        assert isinstance(tell, StatusLines)
        run(squares(50), store, progress=tell)
    assert capsys.readouterr().err.splitlines() == ["squares: 0 of 50", "squares: 50 of 50"]


# Workers


@pytest.mark.parametrize(
    ("how", "message"),
    [({"workers": -1}, "negative"), ({"workers": 2, "scheduler": "tcp://a:1"}, "give one")],
)
def test_a_place_that_cannot_be_meant_is_refused(how, message):
    with pytest.raises(ValueError, match=message):
        Backend(**how)


def test_without_the_package_for_workers_the_extra_to_install_is_named(store, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "study.sweep.workers", raising=False)
    with pytest.raises(ValueError, match=r'pip install -e "\.\[workers\]"'):
        run(squares(1), store, Backend(workers=1))
    assert run(squares(1), store)[0].status == "done"


def test_workers_answer_as_this_process_does_and_a_crash_stays_with_its_task(store, log, tmp_path):
    pytest.importorskip("distributed")
    harmless = [*squares(4), task("fail", x=1), task("answer", kind="nan"), *squares(6)[4:]]
    deadly = [task("die", x=7, log=str(log)), task("leave", x=0)]
    tasks = [*harmless[:3], deadly[0], *harmless[3:5], deadly[1], *harmless[5:], task("threads")]
    before = dict(os.environ)
    outcomes = {o.task.key: o for o in run(tasks, store, Backend(workers=2))}
    assert dict(os.environ) == before
    here = run(harmless, Store(tmp_path / "here"))
    assert without_wall(outcomes[t.key] for t in harmless) == without_wall(here)
    assert {outcomes[t.key].status for t in deadly} == {"crashed"}
    assert all("worker died" in outcomes[t.key].message for t in deadly)
    assert len(begun(log)) == 1  # one attempt
    assert outcomes[task("threads").key].value == {"OPENBLAS": "1", "NUMBA": "1"}
    assert plan(tasks, store).left == 4


def test_on_a_scheduler_that_would_retry_a_crash_there_is_one_attempt_too(store, log, monkeypatch):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        how = Backend(scheduler=cluster.scheduler_address)
        crashed, done = run([task("die", x=7, log=str(log)), *squares(1)], store, how)
        assert (crashed.status, done.status) == ("crashed", "done")
        assert len(begun(log)) == 1
        from study.sweep import workers

        monkeypatch.setattr(workers, "program", lambda _: "edited since")
        with pytest.raises(ValueError, match="start the workers from this checkout"):
            run(squares(3), store, how)
        cluster.scale(0)
        monkeypatch.setattr(workers, "NO_WORKER_TIMEOUT", 0.2)
        with pytest.raises(ValueError, match="no workers"):
            run(squares(3), store, how)


def test_a_scheduler_that_does_not_answer_is_told_with_how_to_start_one(store, monkeypatch):
    pytest.importorskip("distributed")
    from study.sweep import workers

    monkeypatch.setattr(workers, "CONNECT_TIMEOUT", 0.2)
    for address in ("tcp://127.0.0.1:9", "nonsense://host"):
        with pytest.raises(ValueError, match="start one with `dask scheduler`"):
            run(squares(1), store, Backend(scheduler=address))


# Interruptions


class Driver:
    """The sweep of 200 runs as a program."""

    def __init__(self, store, log, workers):
        self.log = log
        self.process = subprocess.Popen(
            [sys.executable, "-c", DRIVER, str(store.folder), str(log), str(workers)],
            cwd=ROOT,
            env=os.environ | {"TMPDIR": str(log.parent)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def until(self, count):
        """Wait until so many runs were begun in all."""
        limit = time.monotonic() + 60
        while len(begun(self.log)) < count:
            assert time.monotonic() < limit
            assert self.process.poll() is None, self.process.stderr.read()
            time.sleep(0.005)

    def ended(self):
        """Wait; what it printed."""
        out, _ = self.process.communicate(timeout=60)
        return out.strip()


def gone(pids, seconds=15):
    """Whether processes end by themselves."""
    limit = time.monotonic() + seconds
    while time.monotonic() < limit:
        if not any(Path(f"/proc/{pid}").exists() for pid in pids):
            return True
        time.sleep(0.05)
    return False


needs_proc = pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks into /proc")


@needs_proc
def test_a_killed_worker_and_a_killed_driver_cost_the_runs_in_flight_and_no_more(store, log):
    pytest.importorskip("distributed")
    driver = Driver(store, log, workers=2)
    driver.until(30)
    os.kill(begun(log)[-1][1], signal.SIGKILL)  # a worker
    driver.until(90)
    driver.process.kill()
    driver.ended()
    assert gone({pid for _, pid in begun(log)})
    assert Driver(store, log, workers=2).ended() == "200"
    counts = Counter(x for x, _ in begun(log))
    assert set(counts) == set(range(200))
    assert sum(counts.values()) - 200 <= 1 + 2  # one with the worker, two with the driver
    assert len(list(store)) == 200


@needs_proc
@pytest.mark.parametrize(
    ("number", "workers"),
    [
        (signal.SIGINT, 0),
        (signal.SIGTERM, 0),
        pytest.param(signal.SIGINT, 2, marks=pytest.mark.slow),
    ],
)
def test_an_interrupted_sweep_leaves_whole_results_and_no_process(store, log, number, workers):
    driver = Driver(store, log, workers)
    driver.until(20)
    os.killpg(driver.process.pid, number)  # as Ctrl-C does, which reaches the workers too
    driver.ended()
    assert driver.process.returncode not in {0, -signal.SIGKILL}
    assert gone({pid for _, pid in begun(log)})
    in_flight = max(workers, 1)
    assert len(begun(log)) - in_flight <= len(list(store)) <= len(begun(log)) < 200
    assert len(list(store)) == len(list(store.folder.glob("*.json")))


@pytest.fixture
def anew(tmp_path, monkeypatch):
    """Forgets what sources state, as another process does; what is kept is in a file here."""
    file = tmp_path / "kept" / "imports.json"
    monkeypatch.setattr(imports, "KEPT", file)

    def forget():
        for found in (imports._known, imports._named, imports._file):
            found.cache_clear()
        return file

    yield forget
    forget()


def test_what_sources_import_is_parsed_once_for_all_processes(anew, tmp_path, monkeypatch):
    for name, text in (("one", "import two"), ("two", ""), ("three", "")):
        (tmp_path / f"{name}.py").write_text(text)
    anew()
    assert set(reached("one", (tmp_path,))) == {"one", "two"}
    (tmp_path / "one.py").write_text("import three")
    anew()
    assert set(reached("one", (tmp_path,))) == {"one", "three"}, "a source that changed"
    anew()
    monkeypatch.setattr(imports, "_stated", None)
    assert set(reached("one", (tmp_path,))) == {"one", "three"}


@pytest.mark.parametrize("content", [b"", b"\xff", b"[1]", b'{"a": 1}', b"{" * 10**5])
def test_a_damaged_file_of_imports_is_made_again(content, anew, tmp_path):
    (tmp_path / "one.py").write_text("import two")
    (tmp_path / "two.py").touch()
    file = anew()
    file.parent.mkdir()
    file.write_bytes(content)
    assert set(reached("one", (tmp_path,))) == {"one", "two"}
    assert set(json.loads(file.read_bytes())) > set()
