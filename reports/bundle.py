"""A run in one archive, from which another machine makes its reports again, for `bundle`.

README.txt       what the archive holds      results/     the results folder with its reports
credibility.md   in terms of ASME V&V 40     inputs/      scene and the files that it names
CITATION.cff     how to cite                 environment/ installed versions, the lock file
SHA256SUMS       of all these

The archive holds no time and no name of a person or machine but what the results say; the same
folder and environment give the same bytes.
"""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import distributions, metadata
from pathlib import Path

from reports.credibility import credibility
from study.results import Results, ResultsError, manifest
from study.results import folder as results_folder
from study.results.provenance import (
    ROOT,
    mesh_sha256,
    rule_base_sha256,
    tissue_files,
    tissue_sha256,
)
from study.scene import Scene
from study.scene.file import write_scene
from study.system.folders import check_file, write_bytes

SUMS = "SHA256SUMS"
LARGEST = 2**31
"""Bytes of an unpacked member beyond which an archive is refused."""
REPORTS = (manifest.REPORT, manifest.PAGE)
ENDING = ".zip"
EPOCH = (1980, 1, 1, 0, 0, 0)
"""The time of every member: the earliest that a zip file has."""
MEMBER = re.compile(r"(results|inputs|environment)/[^/\\\0]+|[^/\\\0]+")
LINE = re.compile(r"([0-9a-f]{64})  (.+)")
Files = Mapping[str, bytes]


def bundle(folder: Path, out: Path) -> None:
    """Write the archive of a results folder.

    Reports that are missing are left out. Raises ResultsError for a folder that is not whole, and
    ValueError for inputs that have changed since the run or a place that cannot be written.
    """
    _check_place(folder, out)
    found = results_folder.read(folder)
    check_file(out)
    _check_inputs(found)
    write_bytes(out, packed(files(folder, found)))


def _check_place(folder: Path, out: Path) -> None:
    """ValueError for another ending, or a place where the next run would refuse the archive."""
    if out.suffix.lower() != ENDING:
        raise ValueError(f"--out {out}: end it with {ENDING}")
    if out.absolute().parent == folder.absolute():
        raise ValueError(f"--out {out}: a results folder holds nothing else; put it elsewhere")


def files(folder: Path, found: Results) -> dict[str, bytes]:
    """What the archive of results holds, by name."""
    kept = sorted(path for path in folder.iterdir() if _is_kept(path))
    made = {
        "README.txt": _readme(found).encode(),
        "credibility.md": credibility(found).encode(),
        "CITATION.cff": _citation(),
        "environment/installed.txt": _installed().encode(),
        **{f"results/{path.name}": path.read_bytes() for path in kept},
        **_inputs(found.scene),
    }
    lock = ROOT / "requirements.lock"
    if lock.is_file():
        made["environment/requirements.lock"] = lock.read_bytes()
    sums = "".join(f"{_digest(data)}  {name}\n" for name, data in sorted(made.items()))
    return made | {SUMS: sums.encode()}


def packed(found: Files) -> bytes:
    """A zip archive of files, the same bytes for the same files."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name, data in sorted(found.items()):
            member = zipfile.ZipInfo(name, EPOCH)
            member.external_attr = 0o644 << 16
            member.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(member, data)
    return made.getvalue()


def _is_kept(path: Path) -> bool:
    return path.is_file() and (_is_result(path.name) or path.name in REPORTS)


def _is_result(name: str) -> bool:
    """Whether a file is one that a run leaves, its checksums among them, and no report."""
    return name in manifest.DATA | {manifest.NAME} or name.endswith(manifest.FIELDS)


def _check_inputs(found: Results) -> None:
    """The files that the scene names must still be those of the run."""
    made_by, scene = found.record.provenance, found.scene
    for key, digest, then in (
        ("organ.mesh", mesh_sha256(scene.organ.mesh), made_by.mesh_sha256),
        ("fuzzy.rule_base", rule_base_sha256(scene.fuzzy.rule_base), made_by.rule_base_sha256),
        (" or ".join(tissue_files(scene)), tissue_sha256(scene), made_by.tissue_sha256),
    ):
        if digest != then:
            raise ValueError(
                f"{key}: the file has changed since the run; restore it, or run the scene again"
            )


def _inputs(scene: Scene) -> dict[str, bytes]:
    """The scene, and the files that it names under names that it finds beside itself."""
    found: dict[str, bytes] = {}
    mesh, rules = scene.organ.mesh, scene.fuzzy.rule_base
    if mesh is not None:
        name = f"mesh{Path(mesh).suffix}"
        found[f"inputs/{name}"] = Path(mesh).read_bytes()
        scene = replace(scene, organ=replace(scene.organ, mesh=name))
    if rules is not None:
        name = f"rules{Path(rules).suffix}"
        found[f"inputs/{name}"] = Path(rules).read_bytes()
        scene = replace(scene, fuzzy=replace(scene.fuzzy, rule_base=name))
    of_tissue, scene = _with_tissue(scene)
    found |= of_tissue
    return found | {"inputs/scene.toml": write_scene(scene).encode()}


def _with_tissue(scene: Scene) -> tuple[dict[str, bytes], Scene]:
    """Meshes of inclusions and the map of stiffness, and the scene that names them so."""
    found: dict[str, bytes] = {}

    def kept(file: str, stem: str) -> str:
        ends = Path(file).suffixes
        name = stem + "".join(ends[-2:] if ends[-1:] == [".gz"] else ends[-1:])
        found[f"inputs/{name}"] = Path(file).read_bytes()
        return name

    tissue = scene.tissue
    inclusions = tuple(
        one if one.mesh is None else replace(one, mesh=kept(one.mesh, f"inclusion-{number}"))
        for number, one in enumerate(tissue.inclusion, 1)
    )
    image = tissue.stiffness_map
    if image is not None:
        image = replace(image, file=kept(image.file, "stiffness-map"))
    return found, replace(scene, tissue=replace(tissue, inclusion=inclusions, stiffness_map=image))


def _citation() -> bytes:
    """The checkout's own file, or what the installed package says of itself."""
    file = ROOT / "CITATION.cff"
    if file.is_file():
        return file.read_bytes()
    about = metadata("liver-study")
    return (
        "cff-version: 1.2.0\nmessage: If you use this software, please cite it as below.\n"
        f"title: {about['Name']}\ntype: software\nauthors:\n  - name: The liver-study authors\n"
        f"version: {about['Version']}\n"
    ).encode()


def _installed() -> str:
    """Every distribution that is installed, one to a line."""
    lines = {f"{one.metadata['Name']}=={one.version}" for one in distributions()}
    return "".join(f"{line}\n" for line in sorted(lines, key=str.lower))


def _readme(found: Results) -> str:
    return f"""\
{found.record.title or "Untitled scene"}

results/        what the run left; `liver-study report ARCHIVE` makes the reports of it again and
                says whether they have the same bytes
inputs/         the scene and the files that it names; `liver-study run inputs/scene.toml` runs it
environment/    versions that were installed, and the lock file of the program
credibility.md  summary in the terms of ASME V&V 40
CITATION.cff    how to cite the program
SHA256SUMS      of all these: `sha256sum -c SHA256SUMS`

The reports have the same bytes with the same versions of the program and its packages, and where
the organ's pictures are rendered by the same renderer, which the report names.
"""


# --- an archive again ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Unpacked:
    """A results folder from an archive, and the SHA-256 of the reports that came in it, by name."""

    folder: Path
    reports: dict[str, str]


def is_archive(path: Path) -> bool:
    """Whether a path is an archive and no folder."""
    return path.is_file() and (path.suffix.lower() == ENDING or zipfile.is_zipfile(path))


def unpack(archive: Path, folder: Path) -> Unpacked:
    """Write the results of an archive, without its reports, into a folder that they replace.

    ResultsError for an archive that is damaged or none of a run.
    """
    found = _read(archive)
    reports: dict[str, str] = {}
    with results_folder.replacing(folder) as partial:
        for name, data in found.items():
            where, _, file = name.partition("/")
            if where != "results":
                continue
            if file in REPORTS:
                reports[file] = _digest(data)
            elif _is_result(file):
                (partial / file).write_bytes(data)
        results_folder.read(partial)
    return Unpacked(folder, reports)


def changed(unpacked: Unpacked, made: list[Path]) -> list[str]:
    """Names of reports, made again, whose bytes are not those of the archive."""
    now = {path.name: _digest(path.read_bytes()) for path in made}
    return [name for name, digest in unpacked.reports.items() if now.get(name, digest) != digest]


def _read(archive: Path) -> dict[str, bytes]:
    """Every file by name, held against the checksums."""
    try:
        with zipfile.ZipFile(archive) as opened:
            members = opened.infolist()
            if any(
                one.file_size > LARGEST or not MEMBER.fullmatch(one.filename) for one in members
            ):
                raise ResultsError(f"{archive}: holds what no bundle does; it is none of a run")
            found = {one.filename: opened.read(one) for one in members}
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        raise ResultsError(f"{archive}: damaged archive: {error}; make it again") from None
    lines = found.pop(SUMS, b"").decode("utf-8", "replace").splitlines()
    sums = {m[2]: m[1] for line in lines if (m := LINE.fullmatch(line))}
    if not sums:
        raise ResultsError(f"{archive}: has no {SUMS}; make it with liver-study bundle DIR")
    for name in sorted(sums.keys() | found.keys()):
        if name not in found or _digest(found[name]) != sums.get(name):
            raise ResultsError(
                f"{archive}: {name} is not as it was packed (its checksum in {SUMS} differs); make "
                "the archive again"
            )
    return found


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
