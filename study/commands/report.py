"""`report`: the PDF of a results folder, made again."""

from __future__ import annotations

import os
from contextlib import nullcontext
from pathlib import Path


def report(folder: Path) -> None:
    """Make report.pdf of a results folder again, without simulating.

    Parameters
    ----------
    folder
        Results folder of an earlier run.
    """
    from reports.report import make_report
    from study.folders import claimed

    # Where its parent may not be written the folder cannot be replaced meanwhile, nor locked.
    free = os.access(folder.absolute().parent, os.W_OK)
    with claimed(folder) if free else nullcontext():
        make_report(folder)
    print(folder / "report.pdf")
