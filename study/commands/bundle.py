"""`bundle`: a results folder with all that made it in one archive."""

from __future__ import annotations

from pathlib import Path


def bundle(folder: Path, *, out: Path | None = None) -> None:
    """Pack results, inputs, versions and a credibility summary into one archive.

    `liver-study report ARCHIVE` rebuilds the reports elsewhere and compares them byte by byte.

    Parameters
    ----------
    folder
        Results folder of an earlier run.
    out
        Archive to write; NAME.zip beside the folder by default.
    """
    from reports.bundle import bundle as write

    archive = out or folder.absolute().with_name(f"{folder.absolute().name}.zip")
    write(folder, archive)
    print(archive)
