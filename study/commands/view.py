"""`view`: the page of a results folder in the browser."""

from __future__ import annotations

import sys
from pathlib import Path


def view(folder: Path) -> None:
    """Open report.html of a results folder in the browser; build it if it is missing.

    Parameters
    ----------
    folder
        Results folder of an earlier run.
    """
    from reports.page.write import NAME, make_page

    if not (folder / NAME).is_file():
        make_page(folder)
    show(folder / NAME)


def show(page: Path) -> None:
    """Open a page in the browser and print its path, since there may be no browser."""
    import webbrowser

    if page.is_file() and not webbrowser.open(page.resolve().as_uri()):
        print("liver-study: no browser here; open the file by hand", file=sys.stderr)
    print(page)
