"""Provenance of results: versions, commit, platform."""

from __future__ import annotations

import hashlib
import platform
import shutil
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from study.results.records import Provenance
from study.scene import Scene

PACKAGES = (
    "liver-study",
    "matplotlib",
    "meshio",
    "numba",
    "numpy",
    "pyvista",
    "scikit-fem",
    "scipy",
    "typst",
)
ROOT = Path(__file__).resolve().parents[2]


def provenance(
    scene: str, mesh: str | None, rule_base: str | None = None, tissue: str | None = None
) -> Provenance:
    """Versions, commit, platform, and hashes of the scene and of the files that it names.

    `tissue`: the hash of `tissue_sha256`.
    """
    return Provenance(
        versions={p: _version(p) for p in PACKAGES} | {"python": platform.python_version()},
        commit=_commit(),
        platform=platform.platform(),
        processor=_processor(),
        seed=None,
        scene_sha256=hashlib.sha256(scene.encode()).hexdigest(),
        mesh_sha256=mesh_sha256(mesh),
        rule_base_sha256=rule_base_sha256(rule_base),
        tissue_sha256=tissue,
    )


def mesh_sha256(mesh: str | None) -> str | None:
    """SHA-256 of a scene's mesh file, None without one. ValueError if it cannot be read."""
    return _sha256(mesh, "{}: no such file", "organ.mesh: {} cannot be read ({}); name a mesh file")


def organ_sha256(scene: Scene) -> str | None:
    """SHA-256 of all files of a scene's organ: its mesh, inclusions and map of stiffness.

    That of the mesh alone where there is no other file; None without any. ValueError if a file
    cannot be read.
    """
    own = mesh_sha256(scene.organ.mesh)
    sums = _tissue_sums(scene)
    return _joined((own, *sums)) if sums else own


def tissue_files(scene: Scene) -> dict[str, str]:
    """Files of a scene's tissue by their keys: meshes of inclusions, and the map of stiffness."""
    named = {
        f"tissue.inclusion.{number}.mesh": one.mesh
        for number, one in enumerate(scene.tissue.inclusion, 1)
        if one.mesh is not None
    }
    if scene.tissue.stiffness_map is not None:
        named["tissue.stiffness_map.file"] = scene.tissue.stiffness_map.file
    return named


def tissue_sha256(scene: Scene) -> str | None:
    """SHA-256 of all files of a scene's tissue, None without any. ValueError for an unreadable."""
    sums = _tissue_sums(scene)
    return _joined(sums) if sums else None


def _tissue_sums(scene: Scene) -> tuple[str | None, ...]:
    refusal = "{key}: {{}} cannot be read ({{}}); name a file"
    return tuple(
        _sha256(path, f"{key}: {{}}: no such file", refusal.format(key=key))
        for key, path in tissue_files(scene).items()
    )


def _joined(sums: tuple[str | None, ...]) -> str:
    return hashlib.sha256(" ".join(map(str, sums)).encode()).hexdigest()


def rule_base_sha256(rule_base: str | None) -> str | None:
    """SHA-256 of a scene's rule base, None without one. ValueError if it cannot be read."""
    missing = "fuzzy.rule_base: {} is no file; name a .fis or .json file"
    return _sha256(rule_base, missing, "fuzzy.rule_base: {} cannot be read ({}); name a file")


def _sha256(path: str | None, missing: str, refusal: str) -> str | None:
    if path is None:
        return None
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except FileNotFoundError:
        raise ValueError(missing.format(path)) from None
    except OSError as error:
        raise ValueError(refusal.format(path, error.strerror)) from None


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _commit() -> str | None:
    """Commit of the checkout of this program, marked if it is modified; None without a checkout."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        return None
    command = [git, "-C", str(ROOT), "describe", "--always", "--dirty", "--abbrev=40"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - git, fixed words
    return done.stdout.strip() or None


def _processor() -> str | None:
    """Name of the processor, as reported by Linux."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or None
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]} ({len(names)} threads)" if names else None
