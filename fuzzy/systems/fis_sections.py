"""Parser of the lines, sections and values of a `.fis` file."""

import codecs
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from fuzzy.systems import arithmetic

TYPE_2 = "belongs to a type-2 system, which is not read from .fis: give the system as JSON"

# A line up to its comment, if any.
_CODE = re.compile(r"""(?:[^'"%#]|'[^']*'?|"[^"]*"?)*""")
_QUOTED = re.compile(r"""(['"])(.*)\1""")
_HEADER = re.compile(r"\[\s*([a-z]+)\s*(\d*)\s*\]", re.IGNORECASE)
_KNOWN_HEADER = re.compile(r"system|rules|(in|out)put[1-9]\d*")
_SET_KEY = re.compile(r"mf[1-9]\d*")
_TYPE_2_KEY = re.compile(r"type.+|mf\d+[ul]")


class FisError(ValueError):
    """A `.fis` file that cannot be read or written; the message names file, line and remedy."""


class Line(NamedTuple):
    """A numbered line, or the value of its key."""

    file: str
    number: int
    text: str

    def fault(self, what: str) -> FisError:
        """A FisError that names this line by file and number."""
        return FisError(f"{self.file}:{self.number}: {what}")

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Prefix errors of a set, rule or system with file and line."""
        try:
            yield
        except FisError:
            raise
        except ValueError as error:
            raise self.fault(str(error)) from error

    def unquoted(self) -> str:
        """The text of the line without its quotes, single or double, which may be missing."""
        if _QUOTED.fullmatch(self.text):
            return unquoted(self.text)
        if "'" in self.text:
            raise self.fault(f"{self.text}: put the text between one pair of single quotes")
        return self.text

    def numbers(self) -> tuple[float, ...]:
        """The numbers, or expressions, between brackets, separated by blanks or commas."""
        inside = re.fullmatch(r"\[([^][]*)\]", self.text)
        if not inside:
            raise self.fault(f"{self.text}: write the numbers between one pair of [ ]")
        with self.blamed():
            return tuple(arithmetic.number(part) for part in arithmetic.parts(inside[1]))

    def parsed(self, word: str) -> float:
        """A word of the line as a number; FisError if it is not finite."""
        with self.blamed():
            return arithmetic.number(word)


@dataclass(frozen=True)
class Values:
    """The values of a section, by key in lower case."""

    head: Line
    by_key: dict[str, Line]

    def __contains__(self, key: str) -> bool:
        return key.lower() in self.by_key

    def __getitem__(self, key: str) -> Line:
        if key not in self:
            raise self.head.fault(f"the section has no {key}; add it")
        return self.by_key[key.lower()]

    def sets(self) -> list[Line]:
        """Definitions of the sets, numbered consecutively from 1."""
        lines = [(key, line) for key, line in self.by_key.items() if _SET_KEY.fullmatch(key)]
        for number, (key, line) in enumerate(lines, start=1):
            if key != f"mf{number}":
                raise line.fault(f"{key.upper()} where MF{number} is due; renumber the sets")
        return [line for _, line in lines]

    def check_count(self, key: str, found: int, what: str) -> None:
        """FisError if an optional Num... key disagrees with the contents."""
        if key in self and self[key].parsed(self[key].text) != found:
            raise self[key].fault(
                f"{key} is {self[key].text}, but there are {found} {what}; correct one of both"
            )


class Section(NamedTuple):
    """One section of a `.fis` file: its `[header]` and the lines under it."""

    head: Line
    body: list[Line]

    def values(self, keys: tuple[str, ...]) -> Values:
        """Values of the keys and, where NumMFs is one of them, of MF1, MF2, ..."""
        values: dict[str, Line] = {}
        for line in self.body:
            key, equals, value = (part.strip() for part in line.text.partition("="))
            if not equals:
                raise line.fault(f"{line.text!r} is no key=value; correct or remove it")
            _check_key(line, key, keys)
            if key.lower() in values:
                raise line.fault(f"a second {key}; remove one of both")
            values[key.lower()] = line._replace(text=value.rstrip("; \t"))
        return Values(self.head, values)


def _check_key(line: Line, key: str, keys: tuple[str, ...]) -> None:
    name = key.lower()
    if name in {known.lower() for known in keys}:
        return
    if _TYPE_2_KEY.fullmatch(name):
        raise line.fault(f"{key} {TYPE_2}")
    if not ("NumMFs" in keys and _SET_KEY.fullmatch(name)):
        raise line.fault(f"{key!r} is no key of this section ({', '.join(keys)}); remove the line")


def unquoted(text: str) -> str:
    """The text between a pair of quotes, in which a doubled quote means one."""
    return text[1:-1].replace(2 * text[0], text[0])


def words(text: str) -> list[str]:
    """Words of a text, separated by blanks or commas."""
    return [word for word in re.split(r"[\s,]+", text) if word]


@dataclass(frozen=True)
class Sections:
    """The sections of a file by name in lower case, such as `input1`."""

    file: str
    by_name: dict[str, Section]

    def __getitem__(self, name: str) -> Section:
        if name not in self.by_name:
            raise FisError(f"{self.file}: has no [{name.capitalize()}] section; add it")
        return self.by_name[name]

    def numbered(self, kind: str) -> list[Section]:
        """The sections of a kind by their consecutive numbers from 1."""
        count = sum(name.startswith(kind) for name in self.by_name)
        return [self[f"{kind}{number}"] for number in range(1, max(count, 1) + 1)]


def read_sections(path: Path) -> Sections:
    """The sections of a file, without comments, empty lines and byte order mark."""
    found: dict[str, Section] = {}
    section = None
    for line in _lines(path):
        header = _HEADER.fullmatch(line.text)
        if header:
            name = "".join(header.groups()).lower()
            _check_header(line, name, found)
            section = found[name] = Section(line, [])
        elif section is None:
            raise line.fault("stands before any section; start the file with [System]")
        else:
            section.body.append(line)
    return Sections(str(path), found)


def _check_header(line: Line, name: str, found: dict[str, Section]) -> None:
    if not _KNOWN_HEADER.fullmatch(name):
        raise line.fault(f"{line.text} is no section of a .fis file; remove or correct it")
    if name in found:
        raise line.fault(f"a second {line.text}; remove one of both")


def _lines(path: Path) -> Iterator[Line]:
    for number, text in enumerate(_text(path).split("\n"), start=1):
        code = _CODE.match(text)
        if code and code[0].strip():
            yield Line(str(path), number, code[0].strip())


def _text(path: Path) -> str:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FisError(f"{path}: cannot be read ({error.strerror})") from None
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise FisError(f"{path}: is UTF-16 text; save it as UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:  # MATLAB's older files are in the encoding of their machine
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")
