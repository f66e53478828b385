"""`report`: the PDF of a results folder, made again."""

from __future__ import annotations

from pathlib import Path


def report(folder: Path) -> None:
    """Make report.pdf of a results folder again, without simulating.

    Parameters
    ----------
    folder
        Results folder of an earlier run.
    """
    from reports.report import make_report

    make_report(folder)
    print(folder / "report.pdf")
