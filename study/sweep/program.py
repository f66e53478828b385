"""What a result depends on beside its arguments: sources, data files and numerical libraries."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from study.sweep.canonical import digest
from study.sweep.imports import reached

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("study", "fem_reference", "msm", "fuzzy")
DATA = {".csv", ".toml"}
LIBRARIES = (
    "llvmlite",
    "matplotlib",
    "meshio",
    "numba",
    "numpy",
    "pyamg",
    "pyvista",
    "scikit-fem",
    "scikit-fuzzy",
    "scipy",
    "typst",
    "vtk",
)


@functools.cache
def program(module: str) -> str:
    """SHA-256 of everything that a function of this module can execute and read.

    It covers the module, all sources that it imports directly or indirectly, all data files of the
    packages, and the versions of libraries; when in doubt a run is repeated rather than a stale
    result used. It is computed once per process, so that a sweep keeps the program it started with.
    ValueError if there is no such module.
    """
    sources = reached(module, (_root(module), ROOT))
    files = {name: _sha256_once(path) for name, path in sources.items()}
    return digest([files, _data(), _versions()])


def everything(*more: str) -> str:
    """SHA-256 of all sources and data files of the packages and of `more`, and of the libraries.

    Equal hashes mean the same program, whatever a module of it imports; nothing is parsed.
    """
    paths = (path for package in (*PACKAGES, *more) for path in (ROOT / package).rglob("*"))
    files = {
        path.relative_to(ROOT).as_posix(): _sha256(path)
        for path in sorted(paths)
        if path.is_file() and "__pycache__" not in path.parts
    }
    return digest([files, _versions()])


def _root(module: str) -> Path:
    """The folder in which a module is found, without running it."""
    try:
        found = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        found = None
    if found is None or found.origin is None:
        raise ValueError(f"{module}: no such module; name a function as package.module:function")
    origin = Path(found.origin)
    return origin.parents[module.count(".") + (origin.name == "__init__.py")]


@functools.cache
def _data() -> dict[str, str]:
    """SHA-256 of each data file of the packages."""
    paths = [path for package in PACKAGES for path in (ROOT / package).rglob("*")]
    return {
        path.relative_to(ROOT).as_posix(): _sha256(path) for path in paths if path.suffix in DATA
    }


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@functools.cache
def _sha256_once(path: Path) -> str:
    return _sha256(path)


@functools.cache
def _versions() -> dict[str, str | None]:
    return {"python": platform.python_version()} | {name: _version(name) for name in LIBRARIES}


def _version(library: str) -> str | None:
    try:
        return version(library)
    except PackageNotFoundError:
        return None
