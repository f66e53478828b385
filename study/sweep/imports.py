"""Which sources a module executes, found by parsing imports without running them."""

from __future__ import annotations

import ast
import functools
import hashlib
import json
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from study.system.folders import write_text

STATEMENTS = ("body", "orelse", "handlers", "finalbody", "cases")
"""Fields of a statement that hold other statements."""
DYNAMIC = ("import_module", "__import__", "iter_modules", "walk_packages", "run_module")
"""A source with one of these words may load modules by names that no source states."""
TABLED = re.compile(r"""(["'])([a-z]\w*(?:\.\w+)*):[A-Z]\w*\1""")
"""A text such as "msm.integrators:INTEGRATORS", whose module is loaded when it is resolved."""

KEPT = Path(__file__).parent / "__pycache__" / "imports.json"
"""Imports of each source by the hash of its text: parsing is the slowest part of this module."""
MOST = 4_000
"""Largest number of cached sources; beyond it only those of this process are kept."""


def reached(module: str, roots: Sequence[Path]) -> dict[str, Path]:
    """Sources below the folders `roots` that a module can import, itself included, by name.

    Imports within functions count, and so do texts that name an object as "module:NAME". A module
    that may load others by name is assumed to load its whole package.
    """
    found: dict[str, Path] = {}
    waiting = {module}
    while waiting:
        name = waiting.pop()
        path = _file(name, tuple(roots))
        if path is not None and name not in found:
            found[name] = path
            waiting |= set(_parents(name)) | _named(name, path)
    _known().keep()
    return found


@functools.cache
def _file(name: str, roots: tuple[Path, ...]) -> Path | None:
    """Source of a module; None for a module outside the roots, and for a name that is no module."""
    places = [root.joinpath(*name.split(".")) for root in roots]
    candidates = [(place / "__init__.py", place.with_name(f"{place.name}.py")) for place in places]
    return next((path for pair in candidates for path in pair if path.is_file()), None)


def _parents(name: str) -> Iterator[str]:
    parts = name.split(".")
    yield from (".".join(parts[:depth]) for depth in range(1, len(parts)))


@functools.cache
def _named(name: str, path: Path) -> frozenset[str]:
    """Names that a source imports, and those of its package if it may load any of them."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    text = path.read_text(encoding="utf-8")
    names = set(_known().stated(package, text, str(path)))
    if any(word in text for word in DYNAMIC):
        names |= set(_members(package, path.parent))
    return frozenset(names)


def _stated(package: str, text: str, file: str) -> list[str]:
    """Names that a source of a package imports, in order."""
    tree = ast.parse(text, filename=file)
    names = {found for node in _statements(tree) for found in _imported(node, package)}
    return sorted(names | {found[2] for found in TABLED.finditer(text)})


class _Known:
    """Imported names by SHA-256 of the source's text, its package and this module.

    They are cached beside the compiled kernels, and computed again where the cache is missing,
    unreadable or of another text. A read-only folder is left alone.
    """

    def __init__(self) -> None:
        self.before = _read(KEPT)
        self.used: dict[str, list[str]] = {}
        self.is_kept = True
        self.own = Path(__file__).read_text(encoding="utf-8")

    def stated(self, package: str, text: str, file: str) -> list[str]:
        """See `_stated`."""
        key = hashlib.sha256("\0".join((self.own, package, text)).encode()).hexdigest()
        names = self.before.get(key)
        if names is None:
            names, self.is_kept = _stated(package, text, file), False
        self.used[key] = names
        return names

    def keep(self) -> None:
        """Write new entries to the cache."""
        if self.is_kept:
            return
        known = self.before | self.used
        with suppress(OSError):
            KEPT.parent.mkdir(exist_ok=True)
            write_text(KEPT, json.dumps(self.used if len(known) > MOST else known))
            self.is_kept = True


def _read(path: Path) -> dict[str, list[str]]:
    """The cached entries, without malformed ones."""
    try:
        found = json.loads(path.read_bytes())
        return {
            key: names
            for key, names in found.items()
            if isinstance(names, list) and all(isinstance(name, str) for name in names)
        }
    except (OSError, ValueError, AttributeError, RecursionError):
        return {}


@functools.cache
def _known() -> _Known:
    return _Known()


def _statements(node: ast.AST) -> Iterator[ast.stmt]:
    """All statements within a node, without expressions, which make up most of a source."""
    for part in STATEMENTS:
        for below in getattr(node, part, ()):
            if isinstance(below, ast.stmt):
                yield below
            yield from _statements(below)


def _imported(node: ast.stmt, package: str) -> Iterator[str]:
    """Absolute names in an import; of `from a import b` both a and a.b, as b may be a module."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        above = package.rsplit(".", node.level - 1)[0] if node.level else ""
        base = ".".join(filter(None, (above, node.module)))
        yield base
        yield from (f"{base}.{alias.name}" for alias in node.names)


def _members(package: str, folder: Path) -> Iterator[str]:
    """Every module of a package and of its subpackages."""
    for path in folder.rglob("*.py"):
        parts = path.relative_to(folder).with_suffix("").parts
        yield ".".join([package, *(part for part in parts if part != "__init__")])
