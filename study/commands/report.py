"""`report`: the PDF and the page of a results folder, made again."""

from __future__ import annotations

import os
from contextlib import nullcontext
from pathlib import Path


def report(folder: Path, *, html: bool = True) -> None:
    """Make report.pdf and report.html of a results folder again, without simulating.

    Parameters
    ----------
    folder
        Results folder of an earlier run.
    html
        Whether to make report.html.
    """
    from study.folders import claimed

    # Where its parent may not be written the folder cannot be replaced meanwhile, nor locked.
    free = os.access(folder.absolute().parent, os.W_OK)
    with claimed(folder) if free else nullcontext():
        made = make(folder, report=True, page=html)
    print("\n".join(str(path) for path in made))


def make(folder: Path, *, report: bool, page: bool) -> list[Path]:
    """Make the reports that are wanted of a results folder; their files.

    Without plotly there is no page, which is told. ResultsError for a folder that does not do.
    """
    made = []
    if report:
        from reports.report import NAME, make_report

        make_report(folder)
        made.append(folder / NAME)
    if page:
        from reports.page import write
        from study.folders import tell

        if write.is_drawable():
            write.make_page(folder)
            made.append(folder / write.NAME)
        else:
            tell(write.MISSING)
    return made
