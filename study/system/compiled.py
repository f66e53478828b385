"""Compiled kernels kept on disk, dropped when any source of the package has changed.

Numba keeps a kernel until the file that it stands in changes, not the files that it calls into: a
changed spring law would leave the old one running inside the integrators.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

STAMP = "sources.stamp"


def drop_outdated(package: Path) -> None:
    """Delete the kernels kept in a package's folders unless they belong to its sources as they are.

    A folder that cannot be written is left alone, as is one that NUMBA_CACHE_DIR names.
    """
    kept = package / "__pycache__"
    stamp, now = kept / STAMP, _stamp(package)
    with suppress(OSError):
        if stamp.exists() and stamp.read_text() == now:
            return
        for file in package.rglob("__pycache__/*.nb[ci]"):  # numba's code and index files
            file.unlink(missing_ok=True)
        kept.mkdir(exist_ok=True)
        stamp.write_text(now)


def _stamp(package: Path) -> str:
    """Path, time of change [ns] and size of every source, a line each."""
    sources = ((file.relative_to(package), file.stat()) for file in sorted(package.rglob("*.py")))
    return "".join(f"{name} {found.st_mtime_ns} {found.st_size}\n" for name, found in sources)
