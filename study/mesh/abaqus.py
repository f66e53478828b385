"""Abaqus and CalculiX keyword files: nodes, elements, parts and the placement of instances."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from study.mesh.abaqus_words import REFUSED, cell_type, is_harmless
from study.mesh.kinds import FloatArray, IndexArray, MeshError
from study.mesh.listing import some
from study.mesh.placement import Placement, placement
from study.mesh.raw import Block, RawMesh, is_solid, nodes_of, raw_mesh
from study.mesh.text import NumberedLine, floats

_LINE_END = re.compile(r"\r\n|\r|\n")
_OPTION = re.compile(r'((?:[^,"]|"[^"]*"?)+)')
_KNOWN_OPTIONS = {"NODE": {"NSET", "SYSTEM"}, "ELEMENT": {"TYPE", "ELSET"}}
UNUSED = 0.2
"""Share of nodes without elements above which a file that ends with elements is truncated."""
_NODE_COLUMNS = 7  # number, three coordinates, three components of a normal


class _Keyword(NamedTuple):
    """A keyword line with its data lines, which are without comments and blank lines."""

    line: int
    name: str
    """In capitals, without blanks."""
    options: dict[str, str]
    rows: list[tuple[int, str]]
    written: str
    """The name as errors show it."""


class _Cells(NamedTuple):
    """Elements of one block, by the numbers of their nodes in the file."""

    name: str
    lines: Sequence[int]
    numbers: IndexArray
    nodes: IndexArray


class _Scope(NamedTuple):
    """Nodes and elements that are numbered together: those of a part, or outside all parts."""

    nodes: list[NumberedLine]
    cells: list[_Cells]


class _Instance(NamedTuple):
    line: int
    name: str
    part: str
    place: Placement
    own: _Scope


class _Model(NamedTuple):
    """The file as it is read, with the part and instance being read."""

    free: _Scope
    parts: dict[str, tuple[int, _Scope]]
    instances: list[_Instance]


def read_abaqus(data: bytes) -> RawMesh:
    """Nodes and elements of a keyword file.

    Raises
    ------
    MeshError
        On a keyword, option or element type that may change the mesh in a way not followed here,
        and on nodes and elements that contradict each other, with the line.
    """
    lines = _LINE_END.split(data.removeprefix(b"\xef\xbb\xbf").decode("latin-1"))
    keywords = _keywords(lines)
    _refuse_cut_off(lines, keywords)
    pieces, notes = _pieces(_model(keywords))
    _refuse_cut_between_lines(keywords, pieces)
    return _joined(pieces, notes)


# ---- Grammar -----------------------------------------------------------------------------------


def _keywords(lines: Sequence[str]) -> list[_Keyword]:
    found: list[_Keyword] = []
    numbered = ((i, line) for i, line in enumerate(lines, start=1))
    for number, line in numbered:
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            found.append(_keyword(number, _continued(number, text, numbered)))
        elif found:
            found[-1].rows.append((number, text))
        else:
            raise MeshError(f"line {number}: `{text[:60]}` before any keyword: no Abaqus file")
    return found


def _continued(start: int, text: str, following: Iterator[tuple[int, str]]) -> str:
    """A keyword line that ends with a comma continues in the next line that is no comment."""
    while text.endswith(","):
        number, further = next(
            (line for line in following if not line[1].lstrip().startswith("**")), (start, "")
        )
        if not re.match(r"\s*[A-Za-z]", further):
            raise MeshError(
                f"line {number}: `{further.strip()[:40]}` follows a keyword line that ends with a "
                "comma, but is no option of it; remove the comma"
            )
        text += further.strip()
    return text


def _keyword(number: int, text: str) -> _Keyword:
    name, *options = _OPTION.findall(text.lstrip("* "))[:50] or [""]
    pairs = (option.partition("=") for option in options)
    named = {_squeezed(key): value.strip().strip('"') for key, _, value in pairs if key.strip()}
    return _Keyword(number, _squeezed(name), named, [], " ".join(name.upper().split())[:40])


def _squeezed(text: str) -> str:
    return re.sub(r"\s", "", text).upper()


def _refuse_cut_off(lines: Sequence[str], keywords: Sequence[_Keyword]) -> None:
    """No count of nodes or elements is announced, but the last line shows if it is cut."""
    if lines[-1].strip() and keywords and keywords[-1].name in {"NODE", "ELEMENT"}:
        raise MeshError(
            f"line {len(lines)} is the last one and not ended: truncated? If it is complete, add "
            "a newline"
        )


def _refuse_cut_between_lines(keywords: Sequence[_Keyword], pieces: Sequence[_Piece]) -> None:
    """Refuse a file that ends with elements and leaves many nodes without any.

    A file cut after a whole line looks like that, and would be the mesh of a part of the body. Some
    nodes without elements are usual, such as the centres of arcs that Gmsh writes.
    """
    if not keywords or keywords[-1].name != "ELEMENT" or _has_lines(keywords):
        return
    for piece in pieces:
        used = np.unique(
            np.concatenate(
                [np.empty(0, dtype=np.int64), *(np.ravel(rows) for _, rows in piece.blocks)]
            )
        )
        unused = len(piece.points) - len(used)
        if piece.blocks and unused > UNUSED * len(piece.points):
            raise MeshError(
                f"the file ends with elements, and {unused} of {len(piece.points)} nodes have "
                "none: truncated? If it is complete, remove these nodes"
            )


def _has_lines(keywords: Sequence[_Keyword]) -> bool:
    """Whether there are elements without area and volume, whose nodes are not kept."""
    types = (one.options.get("TYPE", "") for one in keywords if one.name == "ELEMENT")
    return any(cell_type(_squeezed(one))[0] == "line" for one in types)


# ---- The model ---------------------------------------------------------------------------------


def _model(keywords: Sequence[_Keyword]) -> _Model:
    model = _Model(_Scope([], []), {}, [])
    scope, opened = model.free, ["", ""]
    for keyword in keywords:
        if keyword.name in {"PART", "INSTANCE", "ASSEMBLY"}:
            opened = [keyword.name, *opened]
            scope = _open(keyword, model)
        elif keyword.name in {"ENDPART", "ENDINSTANCE", "ENDASSEMBLY"}:
            if opened[0] != keyword.name[3:]:
                raise MeshError(f"line {keyword.line}: *{keyword.written} ends nothing")
            opened, scope = opened[1:], model.free
        else:
            _take(keyword, scope)
    if opened[0]:
        raise MeshError(f"no *END {opened[0]}: truncated, export it again")
    return model


def _open(keyword: _Keyword, model: _Model) -> _Scope:
    """The scope of what follows the first line of a part, an instance or the assembly."""
    if keyword.name == "ASSEMBLY":
        return model.free
    name, where = keyword.options.get("NAME", "").upper(), f"line {keyword.line}"
    scope = _Scope([], [])
    if keyword.name == "PART":
        if name in model.parts:
            raise MeshError(f"{where}: part {name} is given a second time")
        model.parts[name] = keyword.line, scope
        return scope
    _check_options(keyword, {"NAME", "PART"})
    place = placement([(i, _numbers(text)) for i, text in keyword.rows])
    model.instances.append(
        _Instance(keyword.line, name, keyword.options.get("PART", "").upper(), place, scope)
    )
    return scope


def _take(keyword: _Keyword, scope: _Scope) -> None:
    """Store nodes and elements, skip keywords that are harmless, and refuse the rest."""
    if keyword.name == "NODE":
        _check_options(keyword, _KNOWN_OPTIONS["NODE"])
        scope.nodes.extend((number, _numbers(text)) for number, text in keyword.rows)
    elif keyword.name == "ELEMENT":
        _check_options(keyword, _KNOWN_OPTIONS["ELEMENT"])
        scope.cells.extend(_cells(keyword))
    else:
        _refuse_unknown(keyword)


def _refuse_unknown(keyword: _Keyword) -> None:
    contact = keyword.options.get("TYPE", "").upper().startswith("CONTACT")
    reset = keyword.name == "SYSTEM" and not keyword.rows
    if reset or (keyword.name == "MODELCHANGE" and contact):
        return
    where = f"line {keyword.line}: *{keyword.written}"
    if keyword.name == "RESTART" and "READ" in keyword.options:
        raise MeshError(f"{where}, READ takes the mesh from another analysis; write it out")
    if keyword.name in REFUSED:
        raise MeshError(
            f"{where} {REFUSED[keyword.name]}, which is not read: export the mesh with all its "
            "nodes and elements written out in one file"
        )
    if not is_harmless(keyword.name):
        raise MeshError(f"{where} is not known and might change the mesh; remove it if it does not")


def _check_options(keyword: _Keyword, known: set[str]) -> None:
    where = f"line {keyword.line}: *{keyword.written}"
    if "INPUT" in keyword.options:
        raise MeshError(f"{where}, INPUT= refers to another file; put the mesh into one file")
    for option in keyword.options:
        if option not in known:
            raise MeshError(f"{where}, {option[:40]} is not known and might change the mesh")
    system = keyword.options.get("SYSTEM", "R").upper()
    if not system.startswith("R"):
        raise MeshError(f"{where}, SYSTEM={system[:40]}: only rectangular coordinates are read")


# ---- Nodes and elements ------------------------------------------------------------------------


def _numbers(text: str) -> list[str]:
    """Words between commas, with Fortran exponents converted; a trailing comma ends the line."""
    words = [word.strip() for word in text.upper().replace("D", "E").split(",")]
    return words[:-1] if words[-1] == "" else words


def _coordinates(lines: Sequence[NumberedLine]) -> tuple[FloatArray, list[str]]:
    """Numbers and coordinates of nodes, shape (n, 4), and a note on values taken as zero."""
    longest = max(lines, key=lambda line: len(line[1]), default=(0, []))
    if len(longest[1]) > _NODE_COLUMNS:
        raise MeshError(
            f"line {longest[0]}: {len(longest[1])} entries, a node has at most {_NODE_COLUMNS}"
        )
    _refuse_decimal_commas(lines)
    short = [number for number, words in lines if len(words) < 4 or "" in words[:4]]
    whole = [
        (number, [word or "0" for word in [*words, "", "", ""][:4]]) for number, words in lines
    ]
    note = f"{len(short)} nodes lack coordinates, which are zero then; first lines: {some(short)}"
    return floats(whole, 4), [note] if short else []


def _refuse_decimal_commas(lines: Sequence[NumberedLine]) -> None:
    """A decimal comma separates too: `1, 0,12, 3,5, 0,1` would be a node at (0, 12, 3)."""
    for number, words in lines:
        if 4 < len(words) <= _NODE_COLUMNS and not any("." in word for word in words):
            raise MeshError(
                f"line {number}: {len(words)} entries without a decimal point for a node, "
                f"`{', '.join(words)[:60]}`: write points instead of decimal commas; a node with a "
                "normal needs a point in one of its numbers"
            )


def _cells(keyword: _Keyword) -> list[_Cells]:
    element_type = _squeezed(keyword.options.get("TYPE", ""))
    name, nodes = cell_type(element_type)
    if not name:
        known = f"TYPE={element_type[:40]} is not known" if element_type else "TYPE is missing"
        raise MeshError(f"line {keyword.line}: *ELEMENT, {known}; export tetrahedra (C3D4)")
    if name == "line" or not keyword.rows:
        return []
    lines, rows = _whole_rows(keyword.rows, 1 + nodes)
    if not nodes_of(name):  # refused later, with the count
        empty = np.empty((len(rows), 0), dtype=np.int64)
        return [_Cells(name, lines, np.empty(0, dtype=np.int64), empty)]
    found = _integers(lines, rows, element_type, nodes)
    return [_Cells(name, lines, found[:, 0], found[:, 1:])]


def _whole_rows(rows: Sequence[tuple[int, str]], width: int) -> tuple[list[int], list[list[str]]]:
    """Words of each element, and the line it begins in.

    A line that ends with a comma continues in the next one, unless the element is complete.
    """
    lines: list[int] = []
    whole: list[list[str]] = []
    goes_on = False
    for number, text in rows:
        words = text.split(",")
        open_end = not words[-1].strip()
        words = words[:-1] if open_end else words
        if goes_on:
            whole[-1] += words
        else:
            lines.append(number)
            whole.append(words)
        goes_on = open_end and len(whole[-1]) < width
    return lines, whole


def _integers(
    lines: Sequence[int], rows: Sequence[list[str]], element_type: str, nodes: int
) -> IndexArray:
    """Numbers of the elements and of their nodes, shape (n, 1 + nodes)."""
    for line, row in zip(lines, rows, strict=True):
        if len(row) != 1 + nodes:
            raise MeshError(
                f"line {line}: element {row[0].strip()[:20]} has {len(row) - 1} nodes, "
                f"{element_type} needs {nodes}"
            )
    if not any("_" in word for row in rows for word in row):  # Python reads 1_3 as 13
        with suppress(ValueError, OverflowError):
            return np.array(rows).astype(np.int64)
    line, bad = next(
        (line, word)
        for line, row in zip(lines, rows, strict=True)
        for word in row
        if not re.fullmatch(r"[ \t]*[+-]?[0-9]{1,18}[ \t]*", word)
    )
    raise MeshError(f"line {line}: `{bad.strip()[:40]}` is no node or element number")


# ---- Putting together --------------------------------------------------------------------------


class _Piece(NamedTuple):
    """The mesh of a placed instance, or of what is outside all parts."""

    name: str
    points: FloatArray
    blocks: list[Block]
    notes: list[str]


def _pieces(model: _Model) -> tuple[list[_Piece], list[str]]:
    """The one body of the model and what is beside it, and notes on what is left out.

    Several bodies are refused: in contact they would be welded.
    """
    left_out = list(_left_out(model))
    free = "the assembly" if model.instances else "the model"
    pieces = [
        _assembled(free, Placement(), [model.free]),
        *(
            _assembled(
                f"instance {one.name} (line {one.line})", one.place, [_part(one, model), one.own]
            )
            for one in model.instances
        ),
    ]
    _refuse_several(pieces)
    return pieces, left_out


def _joined(pieces: Sequence[_Piece], left_out: Sequence[str]) -> RawMesh:
    """The mesh of all pieces."""
    starts = np.cumsum([0, *(len(piece.points) for piece in pieces)])
    blocks = [
        (cell, rows + start)
        for start, piece in zip(starts, pieces, strict=False)
        for cell, rows in piece.blocks
    ]
    notes = [*left_out, *(note for piece in pieces for note in piece.notes)]
    return raw_mesh(np.concatenate([piece.points for piece in pieces]), blocks, notes)


def _left_out(model: _Model) -> Iterator[str]:
    """Notes on parts without an instance, which are not in the model."""
    used = {one.part for one in model.instances}
    for name, (line, scope) in model.parts.items():
        if name not in used and not used:
            raise MeshError(f"line {line}: part {name} has no *INSTANCE that puts it somewhere")
        if name not in used and scope.cells:
            yield f"part {name} (line {line}) has no instance and is left out"


def _part(instance: _Instance, model: _Model) -> _Scope:
    if instance.part not in model.parts:
        raise MeshError(f"line {instance.line}: there is no part {instance.part[:40] or 'named'}")
    return model.parts[instance.part][1]


def _refuse_several(pieces: Sequence[_Piece]) -> None:
    for wanted in (True, False):
        bodies = [
            piece.name
            for piece in pieces
            if any(is_solid(cell) == wanted for cell, _ in piece.blocks)
        ]
        if len(bodies) > 1:
            raise MeshError(f"{len(bodies)} bodies: {some(bodies)}; export one of them")
        if bodies:
            return


def _assembled(name: str, place: Placement, scopes: Sequence[_Scope]) -> _Piece:
    lines = [node for scope in scopes for node in scope.nodes]
    cells = [block for scope in scopes for block in scope.cells]
    nodes, notes = _coordinates(lines)
    order = _unique("node", nodes[:, 0], [number for number, _ in lines])
    _unique(
        "element",
        np.concatenate([np.empty(0), *(block.numbers for block in cells)]),
        [line for block in cells if len(block.numbers) for line in block.lines],
    )
    blocks = [(block.name, _rows(block, nodes[:, 0], order)) for block in cells]
    return _Piece(name, place.moved(nodes[:, 1:]), blocks, notes)


def _unique(kind: str, numbers: FloatArray, lines: Sequence[int]) -> IndexArray:
    """The order of the numbers, which must be whole, positive and all different."""
    wrong = np.flatnonzero((numbers < 1) | (numbers % 1 != 0))
    if len(wrong):
        raise MeshError(
            f"line {lines[wrong[0]]}: {numbers[wrong[0]]:g} is no {kind} number: they are whole "
            "and positive"
        )
    order = np.argsort(numbers, kind="stable")
    again = np.flatnonzero(np.diff(numbers[order]) == 0)
    if len(again):
        first, second = (lines[order[again[0] + i]] for i in range(2))
        raise MeshError(
            f"line {second}: {kind} {numbers[order[again[0]]]:.0f} is given a second time, after "
            f"line {first}"
        )
    return order


def _rows(block: _Cells, numbers: FloatArray, order: IndexArray) -> IndexArray:
    """Node numbers of a block as rows of the coordinates."""
    if not block.nodes.size:
        return block.nodes
    ordered = numbers[order]
    place = np.minimum(np.searchsorted(ordered, block.nodes), max(len(ordered) - 1, 0))
    missing = ordered[place] != block.nodes if len(ordered) else np.ones_like(place, dtype=bool)
    if missing.any():
        element, column = np.argwhere(missing)[0]
        raise MeshError(
            f"line {block.lines[element]}: element {block.numbers[element]} uses node "
            f"{block.nodes[element, column]}, which is not in the file"
        )
    return order[place]
