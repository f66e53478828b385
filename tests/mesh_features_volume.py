"""Features of the formats that hold tetrahedra: Abaqus, Gmsh, MEDIT and text lists."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np

from study.mesh.elsewhere import named
from tests.mesh_features import Feature, Treatment
from tests.mesh_samples import SIDE, Ints, cube, cube_surface, gmsh_1, gmsh_2

ABAQUS = "Abaqus and CalculiX (.inp)"
GMSH = "Gmsh (.msh)"
MEDIT = "MEDIT (.mesh, .meshb)"
ELSEWHERE = "Formats that are not read"

Edit = Callable[[str], str]

# ---- Abaqus ------------------------------------------------------------------------------------


def keyword_file(edit: Edit = str) -> Callable[[Path], Path]:
    """Writer of the cube as a keyword file after an edit of its text."""

    def write(folder: Path) -> Path:
        path = folder / "cube.inp"
        path.write_text(edit(keyword_text()))
        return path

    return write


def keyword_text() -> str:
    points, tetrahedra = cube(2)
    rows = ["*HEADING", "cube", "*NODE"]
    rows += [f"{i}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(points.tolist(), start=1)]
    rows += ["*ELEMENT, TYPE=C3D4"]
    rows += [f"{i}, " + ", ".join(map(str, t + 1)) for i, t in enumerate(tetrahedra, start=1)]
    return "\n".join([*rows, ""])


def swap(old: str, new: str, count: int = 1) -> Edit:
    """Put one text for another, which has to be there."""

    def edit(text: str) -> str:
        assert old in text
        return text.replace(old, new, count)

    return edit


def after(keyword: str, *lines: str) -> Edit:
    return swap(f"{keyword}\n", "\n".join([keyword, *lines, ""]))


def at_end(*lines: str) -> Edit:
    return lambda text: "\n".join([text + lines[0], *lines[1:], ""])


def every(pattern: str, new: str) -> Edit:
    return lambda text: re.sub(pattern, new, text, flags=re.MULTILINE)


def both(*edits: Edit) -> Edit:
    def edit(text: str) -> str:
        for one in edits:
            text = one(text)
        return text

    return edit


def part(*instance: str, inside: Edit = str, beside: str = "") -> Edit:
    """The whole mesh as a part, and the lines of an instance of it."""

    def edit(text: str) -> str:
        rows = ["*PART, NAME=Organ", inside(text.removeprefix("*HEADING\ncube\n")).strip()]
        rows += ["*END PART", *filter(None, [beside])]
        rows += ["*ASSEMBLY, NAME=A", *instance, "*END ASSEMBLY", ""]
        return "\n".join(["*Heading", *rows])

    return edit


def renumbered(text: str) -> str:
    """Every node and element by another number, the order being that of the old ones backwards."""
    return "\n".join(
        re.sub(r"\b\d+\b", lambda found: str(999 - 7 * int(found[0])), row, count="." in row)
        if row[:1].isdigit()
        else row
        for row in text.split("\n")
    )


def quadratic(name: str) -> Edit:
    """Elements of ten nodes; those in the middle of the edges are new."""
    points, tetrahedra = cube(2)
    edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]
    middles = points[tetrahedra[:, edges]].mean(axis=2).reshape(-1, 3)

    def edit(text: str) -> str:
        first = len(points) + 1
        more = "\n".join(f"{first + i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(middles))
        head, _, body = text.partition("*ELEMENT, TYPE=C3D4\n")
        rows = [
            f"{row}, " + ", ".join(str(first + 6 * e + i) for i in range(6))
            for e, row in enumerate(body.split("\n")[:-1])
        ]
        return head + more + f"\n*ELEMENT, TYPE={name}\n" + "\n".join([*rows, ""])

    return edit


def _abaqus(name: str, treatment: Treatment, edit: Edit = str, words: str = "") -> Feature:
    return Feature(ABAQUS, name, treatment, keyword_file(edit), words)


_SKIN = "\n".join(
    f"{1000 + i}, " + ", ".join(map(str, 1 + 2 * (t // 4 * 9 + t // 2 % 2 * 3 + t % 2)))
    for i, t in enumerate(cube_surface()[1])
)
_INSTANCE = ("*Instance, name=Organ-1, part=Organ",)
_END = ("*End Instance",)
_REFUSED = {
    "`*INCLUDE`": (at_end("*INCLUDE, INPUT=other.inp"), "line 80: *INCLUDE"),
    "`*NODE, INPUT=`": (at_end("*NODE, INPUT=other.inp"), "line 80: *NODE, INPUT="),
    "`*ELEMENT, INPUT=`": (
        at_end("*ELEMENT, TYPE=C3D4, INPUT=other.inp"),
        "line 80: *ELEMENT, INPUT=",
    ),
    "`*NODE, SYSTEM=C` or `S`": (swap("*NODE", "*Node, system=c"), "line 3: *NODE, SYSTEM=C"),
    "`*SYSTEM` with a point": (after("cube", "*SYSTEM", "1., 0., 0."), "line 3: *SYSTEM"),
    "`*NGEN`, `*NFILL`, `*NCOPY`, `*NMAP`": (
        at_end("*NSET, NSET=A", "1", "*NGEN", "1, 3, 1"),
        "line 82: *NGEN",
    ),
    "`*ELGEN`, `*ELCOPY`": (at_end("*ELGEN", "1, 2, 1, 1"), "line 80: *ELGEN"),
    "`*MODEL CHANGE` of elements": (
        at_end("*STEP", "*MODEL CHANGE, REMOVE", "SET", "*END STEP"),
        "line 81: *MODEL CHANGE",
    ),
    "`*IMPERFECTION`, `*ADJUST`": (at_end("*IMPERFECTION, FILE=a, STEP=1"), "*IMPERFECTION"),
    "`*IMPORT`, `*RESTART, READ`": (at_end("*RESTART, READ"), "line 80: *RESTART, READ"),
    "an expression for a coordinate (`<x>`)": (
        both(after("cube", "*PARAMETER", "x = 0.12"), swap("\n27, 0.12", "\n27, <x>")),
        "line 32: expected 4 numbers",
    ),
    "decimal commas": (
        swap("\n27, 0.12, 0.12, 0.12", "\n27, 0,12, 0,12, 0,12"),
        "line 30: 7 entries without a decimal point",
    ),
    "an unknown keyword": (at_end("*NODES", "1, 0., 0., 0."), "line 80: *NODES is not known"),
    "an unknown option of `*NODE` or `*ELEMENT`": (
        swap("TYPE=C3D4", "TYPE=C3D4, OFFSET=3"),
        "line 31: *ELEMENT, OFFSET is not known",
    ),
    "an unknown element type": (swap("TYPE=C3D4", "TYPE=U1"), "line 31: *ELEMENT, TYPE=U1"),
    "hexahedra, wedges, pyramids": (
        at_end("*ELEMENT, TYPE=C3D8R", "49, 1,2,5,4,10,11,14,13"),
        "1 hexahedron cells beside 48 tetrahedra",
    ),
    "a node given twice": (after("*NODE", "27, 0., 0., 0."), "line 31: node 27"),
    "an element given twice": (at_end("1, 1, 2, 5, 14"), "line 80: element 1 is given a second"),
    "an element with a missing node": (at_end("49, 1, 2, 5, 99"), "line 80: element 49"),
    "an element with too few or too many nodes": (
        at_end("49, 1, 2, 5"),
        "line 80: element 49 has 3 nodes, C3D4 needs 4",
    ),
    "node numbers that are not positive": (after("*NODE", "0, 1., 1., 1."), "line 4: 0 is no node"),
    "an unterminated last line": (str.rstrip, "line 79 is the last one and not ended"),
    "a file that ends with elements and has many nodes without any": (
        lambda text: "".join(text.splitlines(keepends=True)[:35]),
        "the file ends with elements, and 15 of 27 nodes have none: truncated?",
    ),
    "several instances with a body": (
        part(*_INSTANCE, *_END, "*Instance, name=B, part=Organ", "1.", *_END),
        "2 bodies: instance ORGAN-1 (line 82), instance B (line 84)",
    ),
    "an instance of a missing part": (
        part("*Instance, name=B, part=Bone", *_END),
        "line 82: there is no part BONE",
    ),
    "parts without any instance": (part(), "line 2: part ORGAN has no *INSTANCE"),
    "an unterminated part": (swap("*NODE", "*PART, NAME=P\n*NODE"), "no *END PART"),
}

_READ = {
    "nodes, linear tetrahedra": str,
    "hybrid and other variants of an element (`C3D4H`)": swap("C3D4", "C3D4H"),
    "lower case, blanks, quoted names": both(
        swap("*NODE", "*node , nset = all"),
        swap("*ELEMENT, TYPE=C3D4", ' *Element,  type = c3d4 ,elset="my set, a"'),
    ),
    "comments (`**`) anywhere, blank lines": both(
        after("*NODE", "** a", ""),
        after("*ELEMENT, TYPE=C3D4", "**, b"),
        swap("\n9, ", "\n**\n9, "),
    ),
    "several `*NODE` and `*ELEMENT` blocks, in any order": both(
        swap("\n9, ", "\n*NODE, NSET=B\n9, "),
        every(r"^(20, \d+, )", r"*ELEMENT, TYPE=C3D4H\n\1"),
        lambda text: "*ELEMENT" + text.partition("*ELEMENT")[2] + text.partition("*ELEMENT")[0],
    ),
    "keyword lines continued after a comma": swap("*ELEMENT, ", "*ELEMENT, ELSET=A,\n** a\n"),
    "elements on several lines, each ending with a comma": every(
        r"^(\d+, \d+, \d+,) (\d+, \d+)$", r"\1\n\2"
    ),
    "commas at the end of complete lines": every(r"^(\d.*)$", r"\1,"),
    "Fortran exponents (`6.D-2`)": every(r"0\.06\b", "6.D-2"),
    "normals after the coordinates": after("*NODE", "28, 0., 0., 0., 0., 0., 1."),
    "node and element numbers in any order, with gaps": renumbered,
    "CR LF line ends": swap("\n", "\r\n", -1),
    "a part and its instance": part(*_INSTANCE, *_END),
    "an instance with translation and rotation": part(
        *_INSTANCE, "1., 2.", "1., 2., 0., 1., 2., 1., 30.", *_END
    ),
    "nodes and elements in the instance": lambda text: part(
        *_INSTANCE, text.removeprefix("*HEADING\ncube\n").strip(), *_END, inside=lambda _: ""
    )(text),
}

_IGNORED = {
    "`*NSET`, `*ELSET`, generated ones too": at_end(
        "*NSET, NSET=ALL, GENERATE", "1, 27, 1", "*ELSET, ELSET=E", "1, 2, 3,", "4"
    ),
    "`*SURFACE`, `*ORIENTATION`, `*TRANSFORM`, `*DISTRIBUTION`": at_end(
        "*SURFACE, NAME=S", "E, S1", "*ORIENTATION, NAME=O", "1,0,0,0,1,0",
        "*TRANSFORM, NSET=ALL", "0.,1.,0.,-1.,0.,0.", "*DISTRIBUTION, NAME=D", "1, 0."
    ),
    "materials and sections": at_end(
        "*Solid Section, elset=E, material=M", ",", "*Material, name=M",
        "*Hyperelastic, neo hooke", "1., 2.", "*DENSITY", "1000.", "*USER MATERIAL", "1."
    ),
    "boundary conditions, constraints, contact, amplitudes": at_end(
        "*BOUNDARY", "1, 1, 3", "*RIGID BODY, REF NODE=1", "*TIE, NAME=T", "A, B", "*EQUATION", "1",
        "1, 1, 1.", "*AMPLITUDE, NAME=A", "0., 0., 1., 1.", "*CONTACT PAIR, INTERACTION=I", "A, B"
    ),
    "steps, loads and output": at_end(
        "*STEP, NLGEOM=YES", "*STATIC", "*CLOAD", "1, 1, 1.",
        "*MODEL CHANGE, TYPE=CONTACT PAIR, ADD",
        "A, B", "*NODE FILE", "U", "*NODE OUTPUT", "U", "*EL PRINT", "S", "*ELEMENT OUTPUT", "S",
        "*RESTART, WRITE", "*END STEP",
    ),
    "`*PARAMETER`, used elsewhere": at_end("*PARAMETER", "E = 3000.", "*ELASTIC", "<E>, 0.45"),
    "an unterminated last line, of another keyword": lambda text: text + "*PREPRINT, ECHO=NO",
    "trusses, springs, masses, connectors": at_end(
        "*ELEMENT, TYPE=T3D2", "60, 1, 2", "*ELEMENT, TYPE=MASS, ELSET=M", "61, 1",
        "*ELEMENT, TYPE=SPRINGA", "62, 1, 2"
    ),
}  # fmt: skip

_NOTED = {
    "quadratic tetrahedra (`C3D10HS`, `C3D10M`, ...): their corners": (
        quadratic("C3D10HS"),
        "48 cells of type tetra10: mid-side nodes not used",
    ),
    "shells, membranes, rigid faces beside tetrahedra": (
        at_end("*ELEMENT, TYPE=S3R", *_SKIN.split("\n")),
        "12 triangles beside the tetrahedra not used",
    ),
    "missing coordinates of a node: taken as zero": (
        swap("\n1, 0.0, 0.0, 0.0", "\n1"),
        "1 nodes lack coordinates",
    ),
    "nodes of the assembly, which no element uses": (
        part(*_INSTANCE, *_END, "*NODE, NSET=REFERENCE", f"1, {SIDE}, 0., 0."),
        "1 nodes that no element uses dropped",
    ),
    "a part without an instance, beside one that has one": (
        part(
            *_INSTANCE, *_END,
            beside="*PART, NAME=B\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n*END PART",
        ),
        "part B (line 81) has no instance and is left out",
    ),
    "an instance of faces beside that of the body": (
        part(
            *_INSTANCE, *_END, "*INSTANCE, NAME=T, PART=TOOL", *_END,
            beside="*PART, NAME=TOOL\n*NODE\n1, 0., 0.,0.\n2,1.,0.,0.\n3,0.,1.,0.\n"
            "*ELEMENT, TYPE=R3D3\n1,1,2,3\n*END PART",
        ),
        "1 triangles beside the tetrahedra",
    ),
}  # fmt: skip

# ---- Gmsh --------------------------------------------------------------------------------------


def gmsh_bytes(version: str, binary: bool = False, **data: object) -> bytes:
    """The cube with its skin and an edge in a format of Gmsh, written by meshio from 2.2 on."""
    points, tetrahedra = cube(2)
    if version in {"1", "2"}:
        return (gmsh_1 if version == "1" else gmsh_2)(points, tetrahedra).encode()
    cells = [("triangle", SKIN), ("line", np.array([[0, 1]])), ("tetra", tetrahedra)]
    mesh = meshio.Mesh(points, cells, **data)
    path = Path(tempfile.mkdtemp()) / "cube.msh"
    for name in ("gmsh:physical", "gmsh:geometrical"):  # meshio wants these of several cell types
        mesh.cell_data[name] = [np.full(len(block.data), 7) for block in mesh.cells]
    if version == "4.1":
        mesh.point_data["gmsh:dim_tags"] = np.tile([3, 7], (len(points), 1))
    meshio.gmsh.write(path, mesh, version, binary)
    written = path.read_bytes()
    shutil.rmtree(path.parent)
    return written


def numbered_4(is_4_1: bool, first: int = 1, step: int = 1) -> bytes:
    """Text of format 4 with a parametric block of nodes and numbers that have gaps."""
    points, tetrahedra = cube(2)
    number = first + step * np.arange(len(points))
    rows = ["$MeshFormat", "4.1 0 8" if is_4_1 else "4 0 8", "$EndMeshFormat", "$Nodes"]
    rows += [f"2 27 {first} {number[-1]}" if is_4_1 else "2 27"]
    for dimension, part in ((2, slice(9)), (3, slice(9, 27))):
        more = " 0.5 0.5" if dimension == 2 else ""
        entity = f"{dimension} 1" if is_4_1 else f"1 {dimension}"
        rows.append(f"{entity} {int(dimension == 2)} {len(points[part])}")
        places = [" ".join(map(repr, place)) + more for place in points[part].tolist()]
        tags = [str(tag) for tag in number[part]]
        rows += (
            [*tags, *places] if is_4_1 else [f"{t} {p}" for t, p in zip(tags, places, strict=True)]
        )
    rows += ["$EndNodes", "$Elements", "1 48 1 48" if is_4_1 else "1 48"]
    rows += ["3 1 4 48" if is_4_1 else "1 3 4 48"]
    rows += [f"{e} " + " ".join(map(str, number[t])) for e, t in enumerate(tetrahedra, start=1)]
    return "\n".join([*rows, "$EndElements", ""]).encode()


def _gmsh(name: str, treatment: Treatment, data: Callable[[], bytes], words: str = "") -> Feature:
    def write(folder: Path) -> Path:
        path = folder / "cube.msh"
        path.write_bytes(data())
        return path

    return Feature(GMSH, name, treatment, write, words)


def _skin(tetrahedra: Ints) -> Ints:
    """Faces that belong to one tetrahedron."""
    faces = np.sort(tetrahedra[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3))
    unique, count = np.unique(faces, axis=0, return_counts=True)
    return unique[count == 1]


SKIN = _skin(cube(2)[1])

OTHER_SECTIONS = {
    "PhysicalNames": b'$PhysicalNames\n1\n3 7 "$Nodes of the liver"\n$EndPhysicalNames\n',
    "Comments": b"$Comments\n$Nodes\n1\n$Elements\n$EndComments\n",
    "Periodic": b"$Periodic\n1\n2 1 2\n1\n1 3\n$EndPeriodic\n",
    "PartitionedEntities": b"$PartitionedEntities\n2\n0\n0 0 0 0\n$EndPartitionedEntities\n",
    "Parametrizations": b"$Parametrizations\n0 0\n$EndParametrizations\n",
    "GhostElements": b"$GhostElements\n1\n1 1 1 2\n$EndGhostElements\n",
    "InterpolationScheme": b'$InterpolationScheme\n"a"\n0\n$EndInterpolationScheme\n',
    "NodeData": b'$NodeData\n1\n"u"\n1\n0.5\n3\n0\n1\n2\n1 0.1\n27 nan\n$EndNodeData\n',
    "ElementData": b'$ElementData\n1\n"E"\n1\n0\n4\n0\n9\n1\n0\n'
    b"60 1 2 3 4 5 6 7 8 9\n$EndElementData\n",
    "ElementNodeData": b'$ElementNodeData\n1\n"s"\n0\n3\n0\n1\n1\n60 4 1 2 3 4\n'
    b"$EndElementNodeData\n",
    "a section with an unknown name": b"$Whatever\n$Nod\n$EndWhatever\n",
    "binary ElementData": b'$ElementData\n1\n"E"\n1\n0\n3\n0\n1\n2\n'
    + np.array([(60, 0.5), (61, 1e9)], "<i4,<f8").tobytes()
    + b"\n$EndElementData\n",
}

GMSH_FILES: dict[str, Callable[[], bytes]] = {
    "format 1": lambda: gmsh_bytes("1"),
    "format 2.2, text": lambda: gmsh_bytes("2.2"),
    "format 2.2, binary": lambda: gmsh_bytes("2.2", binary=True),
    "format 4.0, text": lambda: gmsh_bytes("4.0"),
    "format 4.0, binary": lambda: gmsh_bytes("4.0", binary=True),
    "format 4.1, text": lambda: gmsh_bytes("4.1"),
    "format 4.1, binary": lambda: gmsh_bytes("4.1", binary=True),
}


def elements_first(data: bytes) -> bytes:
    """The section of the nodes at the end."""
    a, b = data.index(b"$Nodes"), data.index(b"$EndNodes\n") + len(b"$EndNodes\n")
    return data[:a] + data[b:] + data[a:b]


def _second_section() -> bytes:
    data = gmsh_bytes("4.1")
    return data + data[data.index(b"$Nodes") : data.index(b"$Elements")]


def _order_2(version: str) -> bytes:
    """Tetrahedra of ten nodes, those in the middle of the edges being their corners again."""
    points, tetrahedra = cube(2)
    edges = [[0, 1], [1, 2], [2, 0], [0, 3], [2, 3], [1, 3]]
    middles = points[tetrahedra[:, edges]].mean(axis=2).reshape(-1, 3)
    rows = np.hstack([tetrahedra, len(points) + np.arange(len(middles)).reshape(-1, 6)])
    path = Path(tempfile.mkdtemp()) / "cube.msh"
    mesh = meshio.Mesh(np.vstack([points, middles]), [("tetra10", rows)])
    meshio.gmsh.write(path, mesh, version, False)
    written = path.read_bytes()
    shutil.rmtree(path.parent)
    return written


_NOT_USED = "48 triangles beside the tetrahedra not used"

_GMSH = [
    *(
        _gmsh(f"{name}: tetrahedra, triangles, lines", "read", make)
        for name, make in GMSH_FILES.items()
    ),
    _gmsh("node numbers with gaps, in any order", "read", lambda: numbered_4(True, 10, 7)),
    _gmsh("format 4.0: node numbers with gaps", "read", lambda: numbered_4(False, 10, 7)),
    _gmsh("parametric coordinates of nodes", "read", lambda: numbered_4(True)),
    _gmsh("sections in another order", "read", lambda: elements_first(gmsh_bytes("4.1", True))),
    *(
        _gmsh(f"`${name}`" if " " not in name else name, "ignored",
              lambda more=more: numbered_4(True) + more)
        for name, more in OTHER_SECTIONS.items()
    ),
    _gmsh(
        "tags of physical groups, partitions (negative ones too)", "ignored",
        lambda: gmsh_bytes("2").replace(b" 4 2 7 1 ", b" 4 4 -7 1 1 -2 "),
    ),
    _gmsh(
        "triangles beside tetrahedra", "ignored with a note", lambda: gmsh_bytes("4.1"), _NOT_USED
    ),
    _gmsh(
        "tetrahedra of higher order: their corners", "ignored with a note", lambda: _order_2("4.1"),
        "48 cells of type tetra10: mid-side nodes not used",
    ),
    _gmsh(
        "hexahedra, prisms, pyramids", "refused",
        lambda: gmsh_bytes("2").replace(b"1 15 2 0 1 1", b"1 5 2 0 1 1 2 5 4 10 11 14 13"),
        "1 hexahedron cells beside 48 tetrahedra",
    ),
    _gmsh(
        "an unknown element type", "refused",
        lambda: gmsh_bytes("2").replace(b"1 15 2 0 1 1", b"1 99 2 0 1 1"),
        "line 36: Gmsh element type 99",
    ),
    _gmsh(
        "a second section of nodes or elements", "refused", _second_section,
        "a second section $Nodes",
    ),
    _gmsh(
        "an unterminated section", "refused",
        lambda: numbered_4(True) + b"$NodeData\n1\n", "section $NodeData ... $EndNodeData",
    ),
    _gmsh(
        "format 2: `$ParametricNodes`", "refused",
        lambda: gmsh_bytes("2").replace(b"Nodes", b"ParametricNodes"),
        "$ParametricNodes is not read",
    ),
    _gmsh(
        "a missing node", "refused",
        lambda: gmsh_bytes("2").replace(b" 4 2 7 1 1 ", b" 4 2 7 1 99 "), "node number 99",
    ),
    _gmsh(
        "a count other than announced", "refused",
        lambda: numbered_4(True).replace(b"\n3 1 4 48\n", b"\n3 1 4 47\n"), "expected $EndElements",
    ),
    _gmsh(
        "a total other than announced", "refused",
        lambda: numbered_4(True).replace(b"$Nodes\n2 27 ", b"$Nodes\n2 28 "),
        "section $Nodes announces 28 rows but has 27",
    ),
    _gmsh(
        "format 2: a node of five numbers", "refused",
        lambda: gmsh_bytes("2").replace(b"\n1 0.0 0.0 0.0\n", b"\n1 0.0 0.0 0.0 0.1\n"),
        "line 6: a node, with its number, has 4 numbers",
    ),
    _gmsh(
        "format 2: digits grouped by underscores", "refused",
        lambda: gmsh_bytes("2").replace(b" 4 2 7 1 1 ", b" 4 2 7 1 0_1 "), "not an element",
    ),
    _gmsh(
        "format 4: digits grouped by underscores", "refused",
        lambda: numbered_4(True).replace(b"\n1 1 ", b"\n1 0_1 "), "`0_1` is no whole number",
    ),
    _gmsh(
        "format 3 and others", "refused",
        lambda: gmsh_bytes("2").replace(b"2.2 0 8", b"3 0 8"), "Gmsh format 3",
    ),
]  # fmt: skip

# ---- MEDIT -------------------------------------------------------------------------------------


def medit_text() -> str:
    points, tetrahedra = cube(2)
    rows = ["MeshVersionFormatted 2", "Dimension 3", "Vertices", str(len(points))]
    rows += [" ".join(map(repr, place)) + " 0" for place in points.tolist()]
    rows += ["Tetrahedra", str(len(tetrahedra))]
    rows += [" ".join(map(str, t + 1)) + " 5" for t in tetrahedra]
    return "\n".join([*rows, "End", ""])


def medit_binary(version: int, order: str = "<", more: dict[int, bytes] | None = None) -> bytes:
    """The cube with sections of the given codes between vertices and tetrahedra."""
    points, tetrahedra = cube(2)
    integer, real = ("i8" if version > 3 else "i4"), ("f4" if version == 1 else "f8")
    vertices = np.zeros(27, [("place", order + real, 3), ("reference", order + integer)])
    vertices["place"] = points
    cells = np.hstack([tetrahedra + 1, np.full((48, 1), 5)]).astype(order + integer)

    def counted(rows: np.ndarray) -> bytes:
        return np.array([len(rows)], order + integer).tobytes() + rows.tobytes()

    data = np.array([1, version], order + "i4").tobytes()
    content = {3: np.array([3], order + "i4").tobytes(), 4: counted(vertices)}
    for code, section in [*content.items(), *(more or {}).items(), (8, counted(cells))]:
        position = np.dtype(order + ("i4" if version < 3 else "i8"))
        following = len(data) + 4 + position.itemsize + len(section)
        data += np.array([code], order + "i4").tobytes()
        data += np.array([following], position).tobytes() + section
    return data + np.array([54, 0], order + "i4").tobytes()


def before_end(*lines: str) -> Edit:
    return swap("\nEnd\n", "\n".join(["", *lines, "End", ""]))


def _medit(name: str, treatment: Treatment, edit: Edit = str, words: str = "") -> Feature:
    def write(folder: Path) -> Path:
        path = folder / "cube.mesh"
        path.write_text(edit(medit_text()))
        return path

    return Feature(MEDIT, name, treatment, write, words)


def _meditb(name: str, treatment: Treatment, data: bytes, words: str = "") -> Feature:
    def write(folder: Path) -> Path:
        path = folder / "cube.meshb"
        path.write_bytes(data)
        return path

    return Feature(MEDIT, name, treatment, write, words)


def medit_p2(text: str) -> str:
    """Ten nodes for every tetrahedron."""
    points, tetrahedra = cube(2)
    edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]
    middles = points[tetrahedra[:, edges]].mean(axis=2).reshape(-1, 3)
    more = "\n".join(" ".join(map(repr, place)) + " 0" for place in middles.tolist())
    head, _, body = text.partition("Tetrahedra\n48\n")
    rows = [
        " ".join([*row.split()[:4], *(str(28 + 6 * e + i) for i in range(6)), "0"])
        for e, row in enumerate(body.split("\n")[:48])
    ]
    head = head.replace("Vertices\n27", f"Vertices\n{27 + len(middles)}")
    return "\n".join([head + more, "TetrahedraP2", "48", *rows, "End", ""])


MEDIT_IGNORED = {
    "`Corners`, `Ridges`, `RequiredVertices`, ...": before_end(
        "Corners", "2", "1", "2", "Ridges 1", "1", "RequiredVertices", "1", "1",
        "RequiredTriangles 1 1",
    ),
    "`Edges`": before_end("Edges", "1", "1 2 0", "EdgesP2 1", "1 2 3 0"),
    "`Normals`, `NormalAtVertices`, `Tangents`, `TangentAtVertices`": before_end(
        "Normals", "1", "0 0 1", "NormalAtVertices", "1", "1 1", "Tangents", "1", "1 0 0",
        "TangentAtVertices", "1", "1 1", "NormalAtTriangleVertices", "1", "1 1 1",
    ),
    "solutions (`SolAtVertices`, ...)": before_end("SolAtVertices", "1", "1 1", "0.5"),
    "`AngleOfCornerBound`, `BoundingBox`, `Periodic...`, `SubDomain...`": before_end(
        "AngleOfCornerBound", "45.", "BoundingBox", "0 1 0 1 0 1", "PeriodicVertices", "1", "1 2",
        "SubDomainFromMesh", "1", "3 1 1 0",
    ),
    "`Comments`, `Identifier`, `Geometry`": before_end(
        "Comments", "1", '"Organ"', "a liver", "Identifier", '"x"', "Geometry", '"y"'
    ),
}  # fmt: skip

_MEDIT = [
    _medit("text: vertices, tetrahedra, references", "read"),
    *(
        _meditb(f"binary, version {version}{', big-endian' * (order == '>')}", "read",
                medit_binary(version, order))
        for version in (1, 2, 3, 4)
        for order in "<>"
    ),
    _medit("keywords in any case", "read", lambda text: text.upper()),
    _medit("counts on the line of their keyword, blank lines", "read",
           every(r"^(Vertices|Tetrahedra|Dimension)\s+(\d+)$", r"\n\n \1 \2\n")),
    _medit("the dimension on its own line", "read", swap("Dimension 3", "Dimension\n3")),
    _medit("comments (`#`)", "read",
           both(swap("Vertices\n", "# Tetrahedra 9\nVertices # v\n#\n"), every("5$", "5 # 5"))),
    _medit("Fortran exponents (`6.D-2`)", "read", every(r"0\.06\b", "6.D-2")),
    _medit("CR LF line ends", "read", swap("\n", "\r\n", -1)),
    *(_medit(name, "ignored", edit) for name, edit in MEDIT_IGNORED.items()),
    _meditb("binary: every section that holds no cells", "ignored",
            medit_binary(2, more={13: b"\1\0\0\0\1\0\0\0", 62: b"abc", 60: b"", 81: b"text"})),
    _medit("`Triangles`, `Quadrilaterals` beside tetrahedra", "ignored with a note",
           before_end("Triangles", "1", "1 2 5 0", "Quadrilaterals", "1", "1 2 5 4 0"),
           "3 triangles beside the tetrahedra not used"),
    _medit("`TetrahedraP2`, ...: their corners", "ignored with a note", medit_p2,
           "48 cells of type tetra10: mid-side nodes not used"),
    _medit("`Hexahedra`, `Prisms`, `Pyramids`, of any order", "refused",
           before_end("Hexahedra", "1", "1 2 5 4 10 11 14 13 0"), "1 hexahedron cells beside 48"),
    _meditb("binary: `Hexahedra`, ...", "refused",
            medit_binary(2, more={10: b"\1\0\0\0" + bytes(36)}), "1 hexahedron cells beside 48"),
    _medit("an unknown keyword", "refused", before_end("Heptahedra", "1", "1"),
           "line 82: Heptahedra is not known"),
    _meditb("binary: an unknown keyword", "refused", medit_binary(2, more={500: b""}),
            "keyword 500 at byte 796 is not known"),
    _medit("another node order (`TetrahedraP2Ordering`)", "refused",
           before_end("TetrahedraP1Ordering", "4", "1 0 0 0", "0 1 0 0", "0 0 1 0", "0 0 0 1"),
           "line 82: TETRAHEDRAP1ORDERING"),
    _meditb("binary: another node order", "refused", medit_binary(2, more={133: b""}),
            "keyword 133 at byte 796"),
    _medit("a count other than announced", "refused", swap("Tetrahedra\n48", "Tetrahedra\n49"),
           "line 32: TETRAHEDRA announces 49"),
    _medit("digits grouped by underscores", "refused", swap("0.12 0\n", "0.1_2 0\n"),
           "line 3: VERTICES: `0.1_2` is no number"),
    _medit("a missing node", "refused", before_end("Tetrahedra 1", "1 2 5 99 0"),
           "use node numbers outside 0 to 26"),
    _medit("`Vertices` twice", "refused", before_end("Vertices", "1", "0 0 0 0"),
           "line 82: Vertices a second time"),
    _medit("no `End`", "refused", swap("\nEnd\n", "\n"), "no `End`"),
    _medit("two dimensions", "refused", swap("Dimension 3", "Dimension 2"), "Dimension 2"),
]  # fmt: skip

# ---- What is not read --------------------------------------------------------------------------


def _elsewhere(name: str, ending: str) -> Feature:
    def write(folder: Path) -> Path:
        path = folder / f"organ{ending}"
        path.write_text("anything")
        return path

    return Feature(
        ELSEWHERE, f"{name} (`{ending}`, ...)", "refused", write, f"({ending} is for: {name} "
    )


FEATURES: list[Feature] = [
    *(_abaqus(name, "read", edit) for name, edit in _READ.items()),
    *(_abaqus(name, "ignored", edit) for name, edit in _IGNORED.items()),
    *(_abaqus(name, "ignored with a note", edit, words) for name, (edit, words) in _NOTED.items()),
    *(_abaqus(name, "refused", edit, words) for name, (edit, words) in _REFUSED.items()),
    *_GMSH,
    *_MEDIT,
    *(_elsewhere(name, ending) for name, ending in named().items()),
]
