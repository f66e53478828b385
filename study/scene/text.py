"""The text of a scene file: its encoding, its syntax, and the line that each key is on."""

from __future__ import annotations

import codecs
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from study.scene.consistency import Table
from study.scene.error import SceneError

MAX_BYTES = 65_536
MAX_LINE = 1_000
OTHER_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}
"""Byte order marks of encodings that TOML does not have, the longer ones first."""
IN_OTHER_WORDS = {
    "Cannot overwrite a value": "the key is given twice; remove one",
    "Cannot declare": "the table is given twice, or a key has its name; join them",
    "Cannot mutate immutable namespace": "the table is closed on its line; write the key in it",
    "Invalid value": (
        'neither a number nor true or false; text and quantities are put in quotes, "1 N"'
    ),
    "Invalid statement": "not `key = value`",
    "Expected '=' after a key": "not `key = value`",
    "Illegal character '\\n'": "the closing quote is missing",
    "Unterminated string": "the closing quote is missing",
    "Expected newline or end of document after a statement": (
        'more than one value; a number with a unit is put in quotes, "1 N"'
    ),
}
"""Beginnings of the parser's messages, and what a person does about them."""

_WHERE = re.compile(
    r"(?P<what>.*?) \(at (line (?P<line>\d+), column \d+|end of document)\)", re.DOTALL
)
_NAME = r"[A-Za-z0-9_-]+(?:\s*\.\s*[A-Za-z0-9_-]+)*"
_HEADER = re.compile(rf"\s*\[\s*({_NAME})\s*\]")
_LISTED = re.compile(rf"\s*\[\[\s*({_NAME})\s*\]\]")
_KEY = re.compile(rf"\s*({_NAME})\s*=")


def read_text(path: Path) -> str:
    """Text of a scene file, without a byte order mark. SceneError if it is not short UTF-8."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    # The parser takes seconds over absurd keys and nestings that a scene never has.
    if len(data) > MAX_BYTES:
        raise SceneError(f"{path}: larger than {MAX_BYTES} bytes; a scene is a short text file")
    return _decoded(path, data)


def _decoded(path: Path, data: bytes) -> str:
    for mark, name in OTHER_MARKS.items():
        if data.startswith(mark):
            raise SceneError(f"{path}: is {name}; save it as UTF-8")
    for number, line in enumerate(data.splitlines(), 1):
        if len(line) > MAX_LINE:
            raise SceneError(f"{path}, line {number}: longer than {MAX_LINE} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        number = data.count(b"\n", 0, error.start) + 1
        raise SceneError(
            f"{path}, line {number}: byte 0x{data[error.start]:02x} is not UTF-8; save the file as "
            "UTF-8"
        ) from None


def parsed(text: str, source: str) -> Table:
    """Table of a TOML text; SceneError names the line and what is wrong in it."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(_syntax_fault(text, source, str(error))) from None
    except (ValueError, RecursionError) as error:  # absurd numbers or nesting
        raise SceneError(f"{source}: not valid TOML: {error}") from None


def _syntax_fault(text: str, source: str, message: str) -> str:
    """One line on a fault of syntax: where, the line itself, and what to do."""
    match = _WHERE.fullmatch(message)
    if match is None or match["line"] is None:
        return f"{source}: not valid TOML: {message}; is the end of the file missing?"
    number = int(match["line"])
    lines = text.split("\n")  # as the parser counts them
    line = "".join(c if c.isprintable() else "?" for c in lines[number - 1].strip()[:60])
    known = (words for start, words in IN_OTHER_WORDS.items() if match["what"].startswith(start))
    return f"{source}, line {number}: not valid TOML: `{line}`: {next(known, match['what'])}"


def key_lines(text: str) -> dict[str, int]:
    """Numbers of the lines of a TOML text that open a table or give a key, by its full name.

    The second [[weight]] is `weight.2`; the first is both `weight.1` and `weight`. Names in quotes
    are left out, as are lines within a value of several lines that look like keys.
    """
    found: dict[str, int] = {}
    counts: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        listed, header, key = _LISTED.match(line), _HEADER.match(line), _KEY.match(line)
        if listed is not None:
            name = _tidy(listed[1])
            counts[name] = counts.get(name, 0) + 1
            table = f"{name}.{counts[name]}."
        elif header is not None:
            table = _numbered(f"{_tidy(header[1])}.", counts)
        if listed is not None or header is not None:
            _note(found, table.removesuffix("."), number)
        elif key is not None:
            _note(found, table + _tidy(key[1]), number)
    return found


def _numbered(table: str, counts: Mapping[str, int]) -> str:
    """The name of a table with the number of the listed one round it, such as `tool.2.history.`."""
    for name, count in counts.items():
        if table.startswith(f"{name}."):
            return f"{name}.{count}.{table.removeprefix(f'{name}.')}"
    return table


def _note(found: dict[str, int], name: str, line: int) -> None:
    """Note the line of a key, for the first of a list of tables by its name without number too."""
    found.setdefault(name, line)
    found.setdefault(name.replace(".1.", ".", 1).removesuffix(".1"), line)


def _tidy(name: str) -> str:
    return re.sub(r"\s", "", name)
