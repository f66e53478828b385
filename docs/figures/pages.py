"""README.md and the pages, and the marks between which a figure stands in them."""

import re
from pathlib import Path

from docs.figures.tables import ROOT

MARK = re.compile(r"(<!-- figure: ([\w.-]+) -->)(.*?)(<!-- -->)", re.DOTALL)


def pages() -> list[Path]:
    """README.md and all pages."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def updated(text: str, known: dict[str, str]) -> str:
    """The text of a page with its figures as they are known. ValueError for an unknown name."""

    def figure(found: re.Match[str]) -> str:
        if found[2] not in known:
            raise ValueError(f"figure {found[2]}: docs/figures has none of this name")
        return found[1] + known[found[2]] + found[4]

    return MARK.sub(figure, text)
