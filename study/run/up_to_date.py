"""Whether a results folder already holds what a run of a scene would write.

The store keeps the checksums of the files that each run wrote, under a key of the whole scene, the
files that it names, and the whole program.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from study.results import Results, manifest
from study.results.folder import summary
from study.results.provenance import organ_sha256, rule_base_sha256
from study.scene import Scene
from study.scene.file import resolved
from study.stages.fingerprint import machine
from study.stages.store import Store
from study.sweep.canonical import digest
from study.sweep.program import everything

REPORTS = {"report": manifest.REPORT, "page": manifest.PAGE}
"""The files made of the results, by their names in the store."""


@dataclass(frozen=True)
class UpToDateRun:
    """An earlier run that a folder holds: its date [UTC], its results, and the reports it has."""

    at: str
    results: Results
    has_report: bool
    has_page: bool


def run_key(scene: Scene, folder: Path, *, fields: bool, mesh: bool) -> str:
    """SHA-256 of everything that the files of a run depend on, and of the folder's path.

    ValueError for a file of the scene that is missing.
    """
    files = [organ_sha256(scene), rule_base_sha256(scene.fuzzy.rule_base)]
    given = [resolved(scene), str(folder.absolute()), files, fields, mesh]
    return digest(["run", *given, everything("reports"), machine()])


def up_to_date_run(store: Store, key: str, folder: Path, scene: Scene) -> UpToDateRun | None:
    """The run with this key that the folder holds, None if its files are not those written."""
    found = store.get(key)
    if found is None or found.value["sums"] != _sha256(folder / manifest.NAME):
        return None
    results = summary(folder, scene)
    if results is None:
        return None
    at = datetime.fromtimestamp(found.measured, UTC).isoformat(timespec="seconds")
    report, page = (
        (digest := _sha256(folder / name)) is not None and found.value.get(kind) == digest
        for kind, name in REPORTS.items()
    )
    return UpToDateRun(at, results, report, page)


def record_run(store: Store, key: str, folder: Path) -> None:
    """Record the checksums of what a run has written into a folder."""
    reports = {kind: _sha256(folder / name) for kind, name in REPORTS.items()}
    store.put(key, {"sums": _sha256(folder / manifest.NAME), **reports}, {}, wall=0.0)


def _sha256(path: Path) -> str | None:
    """SHA-256 of a file, None if there is none."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None
