"""Places to write: checked beforehand, claimed while they are written, whole afterwards."""

import dataclasses
import errno
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from study.results import ResultsError
from study.results.folder import continuing
from study.scene import Scene
from study.system import folders, lock
from study.system.folders import FolderError, claimed, replacing, write_text

SCENE = Scene()
ROOT = Path(__file__).resolve().parent.parent


def nothing_foreign(_):
    return None


def place(folder):
    return replacing(folder, nothing_foreign, "test")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_folder_that_is_being_written_is_refused_with_the_process(tmp_path):
    with (
        place(tmp_path / "out"),
        pytest.raises(FolderError, match=rf"another run \(process {os.getpid()}\)"),
        place(tmp_path / "out"),
    ):
        pass
    assert names(tmp_path) == ["out"]


def test_of_many_at_once_one_gets_the_folder_at_a_time(tmp_path):
    inside, most, refused = [0], [0], [0]

    def work():
        for _ in range(40):
            try:
                with claimed(tmp_path / "out"):
                    inside[0] += 1
                    most[0] = max(most[0], inside[0])
                    inside[0] -= 1
            except FolderError:
                refused[0] += 1

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most[0] == 1
    assert refused[0] < 160
    assert not names(tmp_path)


def test_a_killed_program_leaves_no_lock_and_the_next_removes_the_rest(tmp_path, capsys):
    code = (
        "import os, signal\nfrom pathlib import Path\nfrom tests.test_folders import place\n"
        f"with place(Path({str(tmp_path / 'out')!r})) as partial:\n"
        "    (partial / 'half').touch()\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False)
    assert done.returncode < 0
    left = names(tmp_path)
    assert ".out.lock" in left
    assert len(left) == 2
    with place(tmp_path / "out") as partial:
        (partial / "whole").touch()
    assert (
        f"{next(name for name in left if name != '.out.lock')}: left by" in capsys.readouterr().err
    )
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["whole"]


def test_what_a_person_keeps_beside_a_folder_is_not_taken_for_a_leftover(tmp_path):
    for name in (".out.abcdefgh", ".out.toml", ".other.abcdefgh"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "notes").touch()
    with place(tmp_path / "out"):
        pass
    assert names(tmp_path) == [".other.abcdefgh", ".out.abcdefgh", ".out.toml", "out"]


def test_a_kill_amid_the_move_into_place_loses_neither_folder(tmp_path):
    """The old one is aside already and the new one not yet in its place."""
    aside = tmp_path / ".out.abcdefgh"
    for inner in (folders.OLD, folders.NEW):
        (aside / inner).mkdir(parents=True)
        (aside / inner / inner).touch()
    with claimed(tmp_path / "out"):
        assert names(tmp_path / "out") == [folders.NEW]


def test_an_interruption_amid_the_move_does_not_either(tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    genuine = Path.replace

    def interrupted(path, target):
        genuine(path, target)
        if path.name == "out":
            raise KeyboardInterrupt

    def run():
        with place(tmp_path / "out") as partial:
            (partial / "found").touch()
            monkeypatch.setattr(Path, "replace", interrupted)

    with pytest.raises(KeyboardInterrupt):
        run()
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["found"]


def test_a_refusal_leaves_no_folder_above(tmp_path):
    target = tmp_path / "results" / "deep" / "out"
    with pytest.raises(ValueError, match="bad scene"), place(target):
        raise ValueError("bad scene")
    assert not names(tmp_path)


def test_a_full_disk_is_an_error_of_the_machine_that_names_the_folder(tmp_path):
    with pytest.raises(OSError, match="No space") as ended, place(tmp_path / "out"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert ended.value.filename == str(tmp_path / "out")
    assert not names(tmp_path)


@pytest.mark.parametrize(("number", "kind"), [("EACCES", FolderError), ("ENOSPC", OSError)])
def test_what_cannot_be_begun_is_bad_input_or_the_machine(tmp_path, monkeypatch, number, kind):
    def refuse(**_):
        raise OSError(getattr(errno, number), "refused")

    monkeypatch.setattr(folders.tempfile, "mkdtemp", refuse)
    with pytest.raises(kind, match="refused"), place(tmp_path / "new" / "out"):
        pass
    assert not names(tmp_path)


def test_a_file_system_without_locks_grants_all(tmp_path, monkeypatch):
    def unknown(*_):
        raise OSError(errno.ENOLCK, "no locks")

    monkeypatch.setattr(lock.fcntl, "flock", unknown)
    with place(tmp_path / "out"):
        pass
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("name", ["file/out.csv", "none/out.csv", "folder", f"{'x' * 300}.csv"])
def test_a_file_that_could_not_be_written_is_refused_beforehand(tmp_path, name):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(FolderError, match="--out"):
        folders.check_file(tmp_path / name)


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "out.csv"
    write_text(path, "before\n")
    path.chmod(0o640)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", full)
        with pytest.raises(OSError, match="No space") as ended:
            write_text(path, "after\n")
    assert ended.value.filename == str(path)
    assert path.read_text() == "before\n"
    assert names(tmp_path) == ["out.csv"]
    write_text(path, "after\n")
    assert path.read_text() == "after\n"
    assert path.stat().st_mode & 0o777 == 0o640


def test_what_is_no_file_is_written_as_it_is():
    write_text(Path(os.devnull), "for nobody")
    assert not Path(os.devnull).is_file()


def test_an_interruption_says_what_is_kept_and_how_to_go_on(tmp_path, capsys):
    def interrupted(kept):
        with continuing(tmp_path / "out", SCENE, resume=False) as state:
            if kept:
                (state / "msm-mamdani.npz").touch()
            (state / "msm-sugeno.frames").touch()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as ended:
        interrupted(kept=False)
    assert "start again" in ended.value.__notes__[0]
    assert not names(tmp_path)
    with pytest.raises(KeyboardInterrupt) as ended:
        interrupted(kept=True)
    assert "kept msm-mamdani" in ended.value.__notes__[0]
    assert "--resume goes on" in ended.value.__notes__[0]
    with continuing(tmp_path / "out", SCENE, resume=True) as state:
        assert (state / "msm-mamdani.npz").exists()
        (state / "msm-mamdani.npz").rename(tmp_path / "kept")
    (tmp_path / ".out.state").mkdir()
    with continuing(tmp_path / "out", SCENE, resume=False):
        pass
    assert ".out.state: left by an interrupted run" in capsys.readouterr().err
    assert names(tmp_path) == ["kept"]


def test_a_run_of_another_scene_is_not_resumed(tmp_path):
    def go_on(scene, resume):
        with continuing(tmp_path / "out", scene, resume=resume) as state:
            (state / "msm-mamdani.npz").touch()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        go_on(SCENE, resume=False)
    other = dataclasses.replace(SCENE, title="Other", models=("msm",))
    with pytest.raises(ResultsError, match=r"another scene \(it differs in models\)"):
        go_on(other, resume=True)
    with pytest.raises(KeyboardInterrupt):
        go_on(SCENE, resume=True)
    with pytest.raises(KeyboardInterrupt):
        go_on(other, resume=False)


def test_what_is_put_into_a_folder_meanwhile_stays(tmp_path, capsys):
    def foreign(present):
        return min(present - {"ours"}, default=None)

    for turn in range(2):
        with replacing(tmp_path / "out", foreign, "test") as partial:
            (partial / "ours").write_text(str(turn))
            if turn:
                (tmp_path / "out" / "sub").mkdir()
                (tmp_path / "out" / "sub" / "a.txt").write_text("mine")
    assert names(tmp_path / "out") == ["ours", "sub"]
    assert (tmp_path / "out" / "ours").read_text() == "1"
    assert (tmp_path / "out" / "sub" / "a.txt").read_text() == "mine"
    assert "sub was put there meanwhile" in capsys.readouterr().err
    assert names(tmp_path) == ["out"]
