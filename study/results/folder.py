"""The results folder: what a study found, written aside and moved into place at once.

scene.toml      the scene in full          curves.csv      motion at the control points
results.json    numbers, provenance        bands.csv       type-2 interval carried through
similarity.csv  score of each pair         errors.csv      differences of the whole field
sensitivity.csv choices of the fuzzy side
fields.npz      surface fields to draw     fuzzy.npz       sets and surfaces to draw
MODEL.vtkhdf    motion of all nodes, if asked for
"""

from __future__ import annotations

import json
import shutil
import tomllib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study import folders
from study.problem.response import Motion
from study.results.records import SCHEMA_VERSION, ModelRecord, StudyRecord
from study.results.tables import (
    BandSample,
    CurveSample,
    FieldDifference,
    SensitivityEntry,
    SimilarityScore,
    read_table,
    write_table,
)
from study.scene.file import validate, write_scene
from study.scene.schema import Scene

if TYPE_CHECKING:
    from pydantic import TypeAdapter

Floats = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]

MARK = "results.json"
FILES = {
    *(MARK, "scene.toml", "report.pdf", "fields.npz", "fuzzy.npz", "export"),
    *("curves.csv", "bands.csv", "similarity.csv", "errors.csv", "sensitivity.csv"),
}
OURS, FIELDS = ".report.pdf", ".vtkhdf"


class ResultsError(ValueError):
    """A folder that cannot be read or written; the message says what to do."""


@dataclass(frozen=True)
class Results:
    """Content of a results folder.

    `record`: the numbers; then the rows of the tables. `fields`: arrays of the surface and of each
    model's displacement on it, `fuzzy`: sets and output surfaces, both to be drawn and empty where
    a scene has none.
    """

    scene: Scene
    record: StudyRecord
    curves: tuple[CurveSample, ...] = ()
    bands: tuple[BandSample, ...] = ()
    scores: tuple[SimilarityScore, ...] = ()
    field_differences: tuple[FieldDifference, ...] = ()
    sensitivity: tuple[SensitivityEntry, ...] = ()
    fields: Arrays = field(default_factory=dict)
    fuzzy: Arrays = field(default_factory=dict)

    @classmethod
    def load(cls, folder: Path | str) -> Results:
        """Content of a folder. ResultsError if it holds no results, or those of another version."""
        return read(Path(folder))

    def model(self, name: str) -> ModelRecord:
        """Record of a model. KeyError with the names there are."""
        for record in self.record.models:
            if record.name == name:
                return record
        raise KeyError(f"{name}: not among {', '.join(one.name for one in self.record.models)}")

    def curve(self, model: str, probe: str) -> Motion:
        """Time [s], displacement [m] and velocity [m/s] along the push, (samples,) each.

        Samples that a diverged run lost are missing. KeyError for a model or probe that there is
        not.
        """
        self.model(model)
        if probe not in self.record.probes:
            raise KeyError(f"{probe}: not among {', '.join(self.record.probes)}")
        rows = [row[2:] for row in self.curves if row.model == model and row.probe == probe]
        return Motion(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)


def write(results: Results, folder: Path) -> None:
    """Write the files of a results folder into an empty folder; see `replacing`."""
    (folder / "scene.toml").write_text(write_scene(results.scene), encoding="utf-8")
    plain = _adapter().dump_python(results.record, mode="json")
    text = json.dumps(plain, indent=1, allow_nan=False)
    (folder / MARK).write_text(text + "\n", encoding="utf-8")
    write_table(folder / "curves.csv", CurveSample, results.curves)
    write_table(folder / "bands.csv", BandSample, results.bands)
    write_table(folder / "similarity.csv", SimilarityScore, results.scores)
    write_table(folder / "errors.csv", FieldDifference, results.field_differences)
    write_table(folder / "sensitivity.csv", SensitivityEntry, results.sensitivity)
    for stem, arrays in (("fields", results.fields), ("fuzzy", results.fuzzy)):
        if arrays:
            np.savez_compressed(folder / f"{stem}.npz", allow_pickle=False, **arrays)


def read(folder: Path) -> Results:
    """Read a results folder. ResultsError if it is none, or of another version."""
    try:
        table = json.loads((folder / MARK).read_text(encoding="utf-8"))
        _check_version(folder, table)
        scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
        return Results(
            validate(scene, "scene.toml"),
            _adapter().validate_python(table),
            read_table(folder / "curves.csv", CurveSample),
            read_table(folder / "bands.csv", BandSample),
            read_table(folder / "similarity.csv", SimilarityScore),
            read_table(folder / "errors.csv", FieldDifference),
            read_table(folder / "sensitivity.csv", SensitivityEntry),
            _read_arrays(folder / "fields.npz"),
            _read_arrays(folder / "fuzzy.npz"),
        )
    except FileNotFoundError as error:
        missing = Path(error.filename).name
        raise ResultsError(
            f"{folder}: no results here ({missing} is missing); make some with liver-study run"
        ) from None
    except ResultsError:
        raise
    except (OSError, ValueError) as error:
        raise ResultsError(f"{folder}: damaged results: {error}") from None


def _adapter() -> TypeAdapter[StudyRecord]:
    from pydantic import TypeAdapter

    return TypeAdapter(StudyRecord)


def _check_version(folder: Path, table: object) -> None:
    version = table.get("schema_version") if isinstance(table, dict) else None
    if version != SCHEMA_VERSION:
        raise ResultsError(
            f"{folder}: results of schema {version}, this program reads {SCHEMA_VERSION}; "
            "run the scene again"
        )


def replacing(folder: Path) -> AbstractContextManager[Path]:
    """A folder beside `folder` that takes its place when the block ends without an exception.

    FolderError before the block if `folder` holds anything but results, or cannot be written.
    """
    return folders.replacing(folder, _foreign, "run")


def _foreign(present: set[str]) -> str | None:
    found = sorted(n for n in present - FILES if not n.startswith(OURS) and not n.endswith(FIELDS))
    if not found and MARK not in present:
        found = sorted(present)
    return found[0] if found else None


@contextmanager
def continuing(folder: Path, *, resume: bool) -> Iterator[Path]:
    """A folder beside `folder` for what an interrupted run goes on from; success removes it."""
    folder = folder.resolve()
    state = folder.with_name(f".{folder.name}.state")
    if not resume:
        shutil.rmtree(state, ignore_errors=True)
    state.mkdir(parents=True, exist_ok=True)
    try:
        yield state
        shutil.rmtree(state)
    finally:
        with suppress(OSError):
            state.rmdir()  # where nothing was kept


def _read_arrays(path: Path) -> Arrays:
    """Arrays of a file, none if it is missing: a single point has no fields."""
    if not path.exists():
        return {}
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}
