"""Whether a results folder holds what a run of a scene would give, so that there is none to make.

Of each run the store keeps the checksums of what it wrote, under the key of the whole scene, the
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
"""What is made of the results, by what a note calls it."""


@dataclass(frozen=True)
class UpToDateRun:
    """What a run left in a folder: when [UTC], in short, and which reports of the run it has."""

    at: str
    results: Results
    has_report: bool
    has_page: bool


def run_key(scene: Scene, folder: Path, *, fields: bool, mesh: bool) -> str:
    """SHA-256 of all that the files of a run into a folder depend on, and of where that is.

    ValueError for a file of the scene that is missing.
    """
    files = [organ_sha256(scene), rule_base_sha256(scene.fuzzy.rule_base)]
    given = [resolved(scene), str(folder.absolute()), files, fields, mesh]
    return digest(["run", *given, everything("reports"), machine()])


def up_to_date_run(store: Store, key: str, folder: Path, scene: Scene) -> UpToDateRun | None:
    """What the folder holds of the run of a key, None if it is not what that wrote."""
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
    """Note what a run has left in a folder."""
    reports = {kind: _sha256(folder / name) for kind, name in REPORTS.items()}
    store.put(key, {"sums": _sha256(folder / manifest.NAME), **reports}, {}, wall=0.0)


def _sha256(path: Path) -> str | None:
    """SHA-256 of a file, None if there is none."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None
