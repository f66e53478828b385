"""The results folder: what a study found, written aside and moved into place at once.

scene.toml      the scene in full          curves.csv      motion at the control points
results.json    numbers, provenance        bands.csv       type-2 interval carried through
similarity.csv  score of each pair         errors.csv      differences of the whole field
sensitivity.csv choices of the fuzzy side
fields.npz      surface fields to draw     fuzzy.npz       sets and surfaces to draw
MODEL.vtkhdf    motion of all nodes, if asked for
"""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study import folders

Floats = NDArray[np.float64]

SCHEMA_VERSION = 1
MARK = "results.json"
TABLES: dict[str, tuple[str, ...]] = {
    "curves": ("model", "probe", "time_s", "displacement_m", "velocity_m_per_s"),
    "bands": (
        "model",
        "probe",
        "time_s",
        "displacement_at_lower_m",
        "displacement_at_upper_m",
        "velocity_at_lower_m_per_s",
        "velocity_at_upper_m_per_s",
    ),
    "similarity": ("model", "reference", "probe", "curve", "measure", "score"),
    "errors": ("model", "reference", "quantity", "value"),
    "sensitivity": (
        "choice",
        "base",
        "alternative",
        "system",
        "change_at_readings_pa",
        "rms_change_pa",
        "largest_change_pa",
        "readings",
    ),
}
TEXT_COLUMNS = {
    *("model", "probe", "reference", "curve", "measure", "quantity"),
    *("choice", "base", "alternative", "system"),
}
FILES = {
    *(MARK, "scene.toml", "report.pdf", "fields.npz", "fuzzy.npz", "export"),
    *(f"{name}.csv" for name in TABLES),
}
OURS, FIELDS = ".report.pdf", ".vtkhdf"
Row = tuple[str | float, ...]


class ResultsError(ValueError):
    """A folder that cannot be read or written; the message says what to do."""


@dataclass(frozen=True)
class Results:
    """Content of a results folder.

    `scene`: its TOML text; `numbers`: results.json; `tables`: rows by table name as in TABLES;
    `arrays`: arrays to draw, by file stem and name.
    """

    scene: str
    numbers: dict[str, Any]
    tables: dict[str, list[Row]]
    arrays: dict[str, dict[str, NDArray[Any]]]


def write(results: Results, folder: Path) -> None:
    """Write the files of a results folder into an empty folder; see `replacing`."""
    (folder / "scene.toml").write_text(results.scene, encoding="utf-8")
    text = json.dumps(results.numbers, indent=1, allow_nan=False)
    (folder / MARK).write_text(text + "\n", encoding="utf-8")
    for name, header in TABLES.items():
        _write_table(folder / f"{name}.csv", header, results.tables.get(name, []))
    for stem, arrays in results.arrays.items():
        np.savez_compressed(folder / f"{stem}.npz", allow_pickle=False, **arrays)


def read(folder: Path) -> Results:
    """Read a results folder. ResultsError if it is none, or of another version."""
    try:
        numbers = json.loads((folder / MARK).read_text(encoding="utf-8"))
        scene = (folder / "scene.toml").read_text(encoding="utf-8")
        tables = {name: list(_read_table(folder / f"{name}.csv", name)) for name in TABLES}
        arrays = {path.stem: _read_arrays(path) for path in sorted(folder.glob("*.npz"))}
    except FileNotFoundError as error:
        missing = Path(error.filename).name
        raise ResultsError(
            f"{folder}: no results here ({missing} is missing); make some with liver-study run"
        ) from None
    except (OSError, ValueError) as error:
        raise ResultsError(f"{folder}: damaged results: {error}") from None
    version = numbers.get("schema_version")
    if version != SCHEMA_VERSION:
        raise ResultsError(
            f"{folder}: results of schema {version}, this program reads {SCHEMA_VERSION}; "
            "run the scene again"
        )
    return Results(scene, numbers, tables, arrays)


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


def _write_table(path: Path, header: Sequence[str], rows: Iterable[Row]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([_cell(value) for value in row] for row in rows)


def _cell(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.12g}"


def _read_table(path: Path, name: str) -> Iterator[Row]:
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        header = tuple(next(reader, ()))
        if header != TABLES[name]:
            raise ValueError(f"{path.name} has columns {', '.join(header)}")
        for row in reader:
            yield tuple(
                text if column in TEXT_COLUMNS else float(text)
                for column, text in zip(header, row, strict=True)
            )


def _read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}
