"""The results folder: what a study found, written aside and moved into place at once.

scene.toml      the scene in full          curves.csv      motion at the control points
results.json    numbers, provenance        bands.csv       type-2 interval carried through
similarity.csv  score of each pair         errors.csv      differences of the whole field
sensitivity.csv choices of the fuzzy side  iso_18571.csv   parts of those scores
score_errors.csv, score_differences.csv    what scores depend on, and their differences
certified.csv   bound of a superposition's error
tool_force.csv, tool_similarity.csv        force of rigid tools, and how like they are
fields.npz      surface fields to draw     fuzzy.npz       sets and surfaces to draw
MODEL.vtkhdf    motion of all nodes, if asked for
SHA256SUMS      checksums of all these, which `sha256sum -c` verifies too

Whoever reads it gets the whole folder checked: checksums, and rows and arrays against the scene.
"""

from __future__ import annotations

import json
import math
import shutil
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from study.results import arrays as npz
from study.results import manifest
from study.results.consistency import check
from study.results.errors import ResultsError
from study.results.records import SCHEMA_VERSION, StudyRecord
from study.results.results import Results
from study.results.tables import TABLES, FieldDifference, TableFile, read_table, write_table
from study.scene.file import validate, write_scene
from study.scene.schema import Scene
from study.system import folders

if TYPE_CHECKING:
    from pydantic import TypeAdapter

MARK, SCENE = "results.json", "scene.toml"
FILES = manifest.DATA | {manifest.NAME, manifest.REPORT, manifest.PAGE, "export"}
OURS, FIELDS = (".report.", ".export."), manifest.FIELDS  # the former of killed programs
CHECKSUMS = "sha256"
"""Where results.json has the checksums of the other files, so that two runs are not mixed."""

START_AGAIN = "start again: stages that had ended are kept, and no model had a state to --resume"


def write(results: Results, folder: Path) -> None:
    """Write the files of a results folder into a folder that holds nothing but fields.

    The checksums are written last: they include the fields of all nodes that the models have
    written.
    """
    (folder / SCENE).write_text(write_scene(results.scene), encoding="utf-8")
    for table in _tables(results.record):
        write_table(folder / table.file, table.kind, getattr(results, table.attribute))
    for stem, arrays in (("fields", results.fields), ("fuzzy", results.fuzzy)):
        if arrays:
            np.savez_compressed(folder / f"{stem}.npz", allow_pickle=False, **arrays)
    sums = manifest.digests(folder)
    _write_record(results.record, folder / MARK, sums)
    manifest.write(folder, sums | {MARK: manifest.digest(folder / MARK)})


def _tables(record: StudyRecord) -> Iterator[TableFile]:
    """The tables that a folder with this record has."""
    return (table for table in TABLES if record.tools or not table.of_tools)


def _write_record(record: StudyRecord, path: Path, sums: Mapping[str, str]) -> None:
    plain = _adapter().dump_python(record, mode="json") | {CHECKSUMS: sums}
    text = json.dumps(plain, indent=1, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def read(folder: Path) -> Results:
    """Read a results folder and check it completely.

    Raises ResultsError, with the file and, in a table, the line: for a folder that holds no results
    or those of another version, that lacks a file or has one of another run, or in which a row or
    an array is missing, unexpected, changed or inconsistent with its scene.
    """
    try:
        table = _numbers(folder)
        _check_version(folder, table)
        altered = manifest.altered(folder)
        for name in altered:
            if name.endswith(".npz"):  # numpy's own messages do not help the user
                _refuse(folder, name)
        results = _content(folder, table)
        if altered:
            _refuse(folder, altered[0])
        _check_mixed(folder, table, manifest.read(folder))
    except FileNotFoundError as error:
        missing = Path(error.filename).name
        raise ResultsError(
            f"{folder}: no results here ({missing} is missing); make some with liver-study run"
        ) from None
    except NotADirectoryError:
        raise ResultsError(
            f"{folder}: is a file; name the results folder that liver-study run made"
        ) from None
    except ResultsError:
        raise
    except (OSError, ValueError) as error:
        raise ResultsError(f"{folder}: damaged results: {error}; {manifest.REMEDY}") from None
    return results


def summary(folder: Path, scene: Scene) -> Results | None:
    """Numbers of a folder that a run of the scene has left: its record and field differences.

    None if the folder is not as that run left it; its content is assumed to be that of the scene.
    """
    try:
        table = _numbers(folder)
        _check_version(folder, table)
        if manifest.altered(folder):
            return None
        rows = read_table(folder / "errors.csv", FieldDifference)
        return Results(scene, _record(table), field_differences=rows)
    except (OSError, ValueError):
        return None


def _content(folder: Path, table: Mapping[str, object]) -> Results:
    """All files in memory. ValueError naming file and line of what is damaged or inconsistent."""
    record, scene = _record(table), _scene(folder)
    rows: dict[str, Any] = {
        one.attribute: read_table(folder / one.file, one.kind) for one in _tables(record)
    }
    results = Results(
        scene,
        record,
        **rows,
        fields=npz.read(folder / "fields.npz"),
        fuzzy=npz.read(folder / "fuzzy.npz"),
    )
    check(results)
    if manifest.digest(folder / SCENE) != record.provenance.scene_sha256:
        raise ValueError(f"{SCENE}: is not the scene of {MARK} (provenance.scene_sha256 differs)")
    return results


def _refuse(folder: Path, name: str) -> NoReturn:
    raise ResultsError(
        f"{folder / name}: is not as the run left it (its checksum in {manifest.NAME} differs); "
        f"{manifest.REMEDY}"
    )


def _check_mixed(folder: Path, table: Mapping[str, object], sums: Mapping[str, str]) -> None:
    """Raise where files of two runs were mixed, even if somebody recomputed the checksums."""
    wanted = table.get(CHECKSUMS)
    wanted = wanted if isinstance(wanted, dict) else {}
    for name in sorted(sums.keys() | wanted.keys() - {MARK}):
        if name != MARK and sums.get(name) != wanted.get(name):
            raise ResultsError(
                f"{folder / name}: is of another run than {MARK}, which has another checksum for "
                f"it; {manifest.REMEDY}"
            )


def _numbers(folder: Path) -> dict[str, object]:
    """What results.json holds. ValueError naming the line that is not JSON."""
    try:
        text = (folder / MARK).read_text(encoding="utf-8")
        table = json.loads(text, parse_constant=_finite, parse_float=_finite)
    except json.JSONDecodeError as error:
        raise ValueError(f"{MARK}, line {error.lineno}: not JSON ({error.msg})") from None
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{MARK}: not JSON ({error})") from None
    if not isinstance(table, dict):
        raise ValueError(f"{MARK}: holds no table of numbers by name")  # noqa: TRY004 - the file is at fault
    return table


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no finite number")
    return value


def _record(table: Mapping[str, object]) -> StudyRecord:
    """Raise ValueError naming a key that is missing or has a value of the wrong type."""
    from pydantic import ValidationError

    try:
        return _adapter().validate_python(table)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        key = ".".join(map(str, first["loc"]))
        raise ValueError(f"{MARK}: {key}: {first['msg']}") from None


def _scene(folder: Path) -> Scene:
    try:
        text = (folder / SCENE).read_text(encoding="utf-8")
        return validate(tomllib.loads(text), SCENE)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{SCENE}: not valid TOML: {error}") from None


def _adapter() -> TypeAdapter[StudyRecord]:
    from pydantic import TypeAdapter

    return TypeAdapter(StudyRecord)


def _check_version(folder: Path, table: Mapping[str, object]) -> None:
    version = table.get("schema_version")
    if version != SCHEMA_VERSION:
        raise ResultsError(
            f"{folder / MARK}: results of schema {version}, this program reads {SCHEMA_VERSION}; "
            "run the scene again"
        )


def replacing(folder: Path) -> AbstractContextManager[Path]:
    """A folder beside `folder` that replaces it when the block ends without an exception.

    FolderError before the block if `folder` holds anything but results, or cannot be written.
    """
    return folders.replacing(folder, _foreign, "run")


def refuse_unwritable(folder: Path) -> None:
    """FolderError if `replacing` would refuse the folder; nothing is left behind."""
    folders.refuse_unwritable(folder, _foreign, "run")


def default_folder(scene: str) -> Path:
    """Where a run of a scene by name or file puts its results."""
    return Path("results") / Path(scene).stem


def _foreign(present: set[str]) -> str | None:
    found = sorted(n for n in present - FILES if not n.startswith(OURS) and not n.endswith(FIELDS))
    if not found and MARK not in present:
        found = sorted(present)
    return found[0] if found else None


@contextmanager
def advising_restart() -> Iterator[None]:
    """Add a note on how to continue to an OSError of the block that has none.

    Such an error occurs when results are moved into place, after `continuing` removed its states.
    """
    try:
        yield
    except OSError as error:
        if not getattr(error, "__notes__", None):
            error.add_note(START_AGAIN)
        raise


@contextmanager
def continuing(folder: Path, scene: Scene, *, resume: bool) -> Iterator[Path]:
    """A folder beside `folder` for the states of an interrupted run; success removes it.

    ResultsError if the states are of another scene than the one to be resumed. What the machine or
    a signal ends in the block gets a note on how to continue.
    """
    folder = folder.resolve()
    state = folder.with_name(f".{folder.name}.state")
    if state.is_dir() and not resume:
        shutil.rmtree(state, ignore_errors=True)
        folders.tell(f"{state}: left by an interrupted run; removed, for this one has no --resume")
    _check_same(state, scene)
    state.mkdir(parents=True, exist_ok=True)
    try:
        (state / SCENE).write_text(write_scene(scene), encoding="utf-8")
        yield state
        shutil.rmtree(state, ignore_errors=True)
    except (KeyboardInterrupt, MemoryError, OSError) as error:
        error.add_note(_how_to_go_on(state, _kept(state)))
        raise
    finally:
        if not _kept(state):
            shutil.rmtree(state, ignore_errors=True)


def _check_same(state: Path, scene: Scene) -> None:
    """Raise if the states are of another scene, before any model is run."""
    try:
        before = tomllib.loads((state / SCENE).read_text(encoding="utf-8"))
    except (OSError, ValueError):  # missing or half written: each state is checked itself
        return
    now = tomllib.loads(write_scene(scene))
    moving = sorted((before.keys() | now.keys()) - {"title", "renders", "remarks"})
    changed = [key for key in moving if before.get(key) != now.get(key)]
    if changed:
        raise ResultsError(
            f"{state}: is of a run of another scene (it differs in {', '.join(changed)}); run "
            "without --resume: stages that do not depend on these are kept all the same"
        )


def _kept(state: Path) -> list[str]:
    """Names of the models that have a state; fields without a state are of no use."""
    return sorted(path.stem for path in state.glob("[!.]*.npz")) if state.is_dir() else []


def _how_to_go_on(state: Path, kept: list[str]) -> str:
    if not kept:
        return START_AGAIN
    return f"kept {', '.join(kept)} in {state}: the same command with --resume goes on from there"
