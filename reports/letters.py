"""Letters that the fonts of the documents have no shape for: fonts of more scripts, and a note.

A report's own fonts come with typst and matplotlib and are the same on every machine; what a system
has installed is left out, so that documents are the same bytes everywhere. A title or a control
point may be named in any script, so fonts of the extra `scripts` are taken where a text needs them,
and only there: a document that does without has the same bytes with and without them.
"""

from __future__ import annotations

import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("manimgx_fonts", "manimgx_fonts_cjk")
"""Noto Sans of some thirty scripts, Noto Emoji and Noto Sans CJK, SIL Open Font License 1.1."""
REMEDY = "pip install 'liver-study[scripts]'"
ENDINGS = ("*.ttf", "*.otf", "*.ttc")
MOST = 100
"""Largest number of letters without a shape that are looked for, each by a compilation."""


def extra_fonts() -> list[Path]:
    """Folders of the fonts of the extra `scripts`, as far as they are installed."""
    found = [find_spec(name) for name in PACKAGES]
    return [
        Path(place)
        for spec in found
        if spec is not None
        for place in spec.submodule_search_locations or ()
    ]


def extra_files() -> list[Path]:
    """Files of these fonts, in the same order on every machine."""
    return sorted(
        path for folder in extra_fonts() for ending in ENDINGS for path in folder.glob(ending)
    )


def without_shape(texts: str, refused: Callable[[str], str | None]) -> str:
    """Letters of texts that have no shape, each once.

    `refused` is given letters and returns some of them that have none, or None where all have one.
    """
    found = sorted({c for c in texts if ord(c) > 127 and c.isprintable()})
    left = "".join(c for c in found if not _is_mark(c))
    lost = ""
    while left and len(lost) < MOST:
        bad = refused(left)
        if not bad or not set(bad) & set(left):
            break
        lost += "".join(c for c in bad if c in left)
        left = "".join(c for c in left if c not in bad)
    marks = [c for c in found if _is_mark(c)][: MOST - len(lost)]
    return lost + "".join(mark for mark in marks if refused(mark))


def _is_mark(letter: str) -> bool:
    """Whether a letter is combined with the one before it, which is then named as without shape."""
    return unicodedata.category(letter)[0] == "M"


def boxes(letters: Iterable[str]) -> str:
    """What of a text is printed as boxes and what helps, in letters that every font has."""
    scripts = Counter(_script(letter) for letter in letters)
    if not scripts:
        return ""
    found = ", ".join(f"{count} of {name}" for name, count in sorted(scripts.items()))
    return (
        f"Boxes replace letters that no available font has ({found}). {REMEDY} adds fonts of most "
        "scripts; then liver-study makes the document again without them."
    )


def _script(letter: str) -> str:
    """The script of a letter as its name in Unicode begins, else a code point."""
    name = unicodedata.name(letter, "")
    if not name or unicodedata.category(letter)[0] not in "LM":
        return f"U+{ord(letter):04X}"
    script = name.split()[0]
    return script if script == "CJK" else script.capitalize()
