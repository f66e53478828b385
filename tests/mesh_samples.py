"""Small synthetic meshes and the files they are stored in, sound and broken.

Lengths are metres: a cube of 0.12 m (1.728 L) and an ellipsoid pass for a liver by volume.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIDE = 0.12
CUBE_VOLUME = SIDE**3


def box(cells: tuple[int, int, int], size: tuple[float, float, float]) -> tuple[Floats, Ints]:
    """Box of 6 positively oriented tetrahedra per cell: one per order of the axes."""
    shape = np.array(cells) + 1
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1)
    number = np.arange(shape.prod()).reshape(shape)
    tetrahedra = []
    for axes in permutations(range(3)):
        steps = np.eye(3, dtype=int)[list(axes)].cumsum(axis=0)
        corners = [np.zeros(3, dtype=int), *steps]
        if np.linalg.det(steps) < 0:
            corners[1], corners[2] = corners[2], corners[1]
        tetrahedra.append(
            np.stack(
                [
                    number[tuple(slice(a, a + n) for a, n in zip(c, cells, strict=True))].ravel()
                    for c in corners
                ],
                axis=1,
            )
        )
    points = grid.reshape(-1, 3) / np.array(cells) * np.array(size)
    return points, np.concatenate(tetrahedra)


def cube(cells: int = 1) -> tuple[Floats, Ints]:
    return box((cells,) * 3, (SIDE,) * 3)


def cube_surface() -> tuple[Floats, Ints]:
    """Twelve outward triangles."""
    points, _ = cube()
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return points, np.array([[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)])


def ellipsoid_surface(levels: int = 2) -> tuple[Floats, Ints]:
    """Octahedron, subdivided and blown up to half axes of 0.11, 0.08 and 0.06 m."""
    points = np.concatenate([np.eye(3), -np.eye(3)])
    triangles = np.array(
        [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    )
    for _ in range(levels):
        corner = points[triangles]
        middle = (corner + np.roll(corner, -1, axis=1)) / 2
        a, b, c = (corner[:, i] for i in range(3))
        ab, bc, ca = (middle[:, i] for i in range(3))
        small = [np.stack(t, axis=1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
        points, inverse = np.unique(
            np.concatenate(small).reshape(-1, 3).round(12), axis=0, return_inverse=True
        )
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        triangles = inverse.reshape(-1, 3)
    return points * [0.11, 0.08, 0.06], triangles


def ellipsoid() -> tuple[Floats, Ints]:
    """Star of tetrahedra from the centre to the surface."""
    points, triangles = ellipsoid_surface()
    centre = np.full((len(triangles), 1), len(points))
    return np.vstack([points, np.zeros(3)]), np.hstack([centre, triangles])


def torus(radius: float = 0.1, tube: float = 0.04, n: int = 8) -> tuple[Floats, Ints]:
    """Surface of genus 1 with outward triangles."""
    u, v = np.meshgrid(*(np.arange(n) * 2 * np.pi / n,) * 2, indexing="ij")
    ring = radius + tube * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], axis=-1)
    i, j = (index.ravel() for index in np.indices((n, n)))
    a, b, c, d = ((i + di) % n * n + (j + dj) % n for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return points.reshape(-1, 3), np.concatenate(
        [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    )


def klein_bottle(n: int = 12) -> tuple[Floats, Ints]:
    """Closed but one-sided: a figure of eight swept round with half a turn, edges in pairs."""
    u, v = np.meshgrid(*(np.arange(n) * 2 * np.pi / n,) * 2, indexing="ij")
    across = np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v)
    up = np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v)
    points = np.stack([(2 + across) * np.cos(u), (2 + across) * np.sin(u), up], axis=-1)
    # No two nodes may coincide, or welding would make the crossing of the bottle a real edge.
    points += 0.01 * np.random.default_rng(1).normal(size=points.shape)
    i, j = (index.ravel() for index in np.indices((n, n)))
    wraps = i == n - 1  # the half turn sends v to -v
    right = np.where(wraps, 0, i + 1)
    j_right, j_right_next = (np.where(wraps, -k % n, k % n) for k in (j, j + 1))
    a, d = i * n + j, i * n + (j + 1) % n
    b, c = right * n + j_right, right * n + j_right_next
    return 0.05 * points.reshape(-1, 3), np.concatenate(
        [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    )


def exploded(points: Floats, elements: Ints) -> tuple[Floats, Ints]:
    """Every element with nodes of its own."""
    return points[elements].reshape(-1, 3), np.arange(elements.size).reshape(elements.shape)


# ---- Files -------------------------------------------------------------------------------------


def write_tetrahedra(path: Path, points: Floats, tetrahedra: Any, **kwargs: Any) -> Path:
    return write_cells(path, points, [("tetra", np.asarray(tetrahedra))], **kwargs)


def write_cells(
    path: Path, points: Floats, cells: list[tuple[str, Any]], file_format: str = "vtu", **kw: Any
) -> Path:
    meshio.Mesh(points, cells).write(path, file_format=file_format, **kw)
    return path


def write_surface(path: Path, points: Floats, triangles: Any) -> Path:
    path.write_text(obj(points, triangles))
    return path


def obj(points: Floats, faces: Any, corner: str = "{0}") -> str:
    """OBJ text; `corner` is one of the ways to write a face's corner."""
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    rows += ["f " + " ".join(corner.format(i + 1) for i in face) for face in np.asarray(faces)]
    return "\n".join(rows) + "\n"


def stl_binary(points: Floats, triangles: Ints, header: bytes = b"") -> bytes:
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    body = np.zeros(len(triangles), dtype=record)
    body["corners"] = points[triangles]
    return header.ljust(80, b" ") + np.uint32(len(triangles)).tobytes() + body.tobytes()


def stl_ascii(points: Floats, triangles: Ints) -> str:
    rows = ["solid organ"]
    for triangle in points[triangles]:
        rows += ["facet normal 0 0 0", " outer loop"]
        rows += ["  vertex " + " ".join(map(repr, corner)) for corner in triangle.tolist()]
        rows += [" endloop", "endfacet"]
    return "\n".join([*rows, "endsolid organ"]) + "\n"


def polydata_ascii(points: Floats, faces: list[list[int]]) -> str:
    counted = [[len(face), *face] for face in faces]
    rows = ["# vtk DataFile Version 3.0", "organ", "ASCII", "DATASET POLYDATA"]
    rows += [f"POINTS {len(points)} double", *(" ".join(map(repr, p)) for p in points.tolist())]
    rows += [f"POLYGONS {len(faces)} {sum(map(len, counted))}"]
    rows += [" ".join(map(str, face)) for face in counted]
    return "\n".join([*rows, f"POINT_DATA {len(points)}", "SCALARS a float", ""])


def polydata_binary(points: Floats, faces: list[list[int]]) -> bytes:
    counted = [i for face in faces for i in (len(face), *face)]
    return b"".join(
        [
            b"# vtk DataFile Version 3.0\norgan\nBINARY\nDATASET POLYDATA\n",
            b"FIELD FieldData 1\ntime 1 1 double\n" + np.array([0.5], ">f8").tobytes() + b"\n",
            b"POINTS %d double\n" % len(points) + points.astype(">f8").tobytes() + b"\n",
            b"METADATA\nINFORMATION 0\n\n",
            b"POLYGONS %d %d\n" % (len(faces), len(counted)),
            np.array(counted, ">i4").tobytes() + b"\n",
        ]
    )


def polydata_version_5(points: Floats, faces: list[list[int]]) -> bytes:
    offsets = np.cumsum([0, *map(len, faces)])
    flat = [i for face in faces for i in face]
    return b"".join(
        [
            b"# vtk DataFile Version 5.1\n\nBINARY\nDATASET POLYDATA\n",
            b"POINTS %d double\n" % len(points) + points.astype(">f8").tobytes() + b"\n",
            b"POLYGONS %d %d\nOFFSETS vtktypeint64\n" % (len(offsets), len(flat)),
            offsets.astype(">i8").tobytes() + b"\nCONNECTIVITY vtktypeint64\n",
            np.array(flat, ">i8").tobytes() + b"\n",
        ]
    )


def gmsh_1(points: Floats, tetrahedra: Ints, first: int = 1, step: int = 1) -> str:
    """Gmsh 1 text with trailing blanks; node numbers start at `first` and may have gaps."""
    number = first + step * np.arange(len(points))
    rows = ["$NOD ", str(len(points))]
    rows += [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in zip(number, points.tolist(), strict=True)]
    rows += ["$ENDNOD ", "$ELM ", str(len(tetrahedra))]
    rows += [
        f"{e} 4 1 1 4 " + " ".join(map(str, number[t])) + " " for e, t in enumerate(tetrahedra)
    ]
    return "\n".join([*rows, "$ENDELM ", ""])


def gmsh_2(points: Floats, tetrahedra: Ints) -> str:
    rows = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
    rows += [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(points.tolist(), start=1)]
    rows += ["$EndNodes", "$Elements", str(len(tetrahedra) + 1), "1 15 2 0 1 1"]
    rows += [f"{e} 4 2 7 1 " + " ".join(map(str, t + 1)) for e, t in enumerate(tetrahedra, start=2)]
    return "\n".join([*rows, "$EndElements", ""])


def _text(writer: Callable[..., str]) -> Callable[[Path, Floats, Ints], None]:
    return lambda path, points, elements: _discard(path.write_text(writer(points, elements)))


def _bytes(writer: Callable[..., bytes]) -> Callable[[Path, Floats, Ints], None]:
    return lambda path, points, elements: _discard(path.write_bytes(writer(points, elements)))


def _meshio(cell: str, file_format: str, **kwargs: Any) -> Callable[[Path, Floats, Ints], None]:
    return lambda path, points, elements: _discard(
        write_cells(path, points, [(cell, elements)], file_format, **kwargs)
    )


def _discard(_: object) -> None:
    """Forget what a writer returns."""


Writer = Callable[[Path, Floats, Ints], None]

SOLID_FORMATS: dict[str, tuple[str, Writer]] = {
    "vtu": (".vtu", _meshio("tetra", "vtu", binary=False)),
    "vtu, compressed": (".vtu", _meshio("tetra", "vtu", binary=True)),
    "vtk 4.2 text": (".vtk", _meshio("tetra", "vtk42", binary=False)),
    "vtk 4.2": (".vtk", _meshio("tetra", "vtk42", binary=True)),
    "vtk 5.1 text": (".vtk", _meshio("tetra", "vtk", binary=False)),
    "vtk 5.1": (".vtk", _meshio("tetra", "vtk", binary=True)),
    "gmsh 1": (".msh", _text(gmsh_1)),
    "gmsh 2 text": (".msh", _text(gmsh_2)),
    "gmsh 2": (".msh", _meshio("tetra", "gmsh22", binary=True)),
    "gmsh 4 text": (".msh", _meshio("tetra", "gmsh", binary=False)),
    "gmsh 4": (".msh", _meshio("tetra", "gmsh", binary=True)),
    "abaqus": (".inp", _meshio("tetra", "abaqus")),
    "medit": (".mesh", _meshio("tetra", "medit")),
    "medit binary": (".meshb", _meshio("tetra", "medit")),
}
"""Name -> file name ending and writer, for tetrahedra."""

SURFACE_FORMATS: dict[str, tuple[str, Writer]] = {
    "stl text": (".stl", _text(stl_ascii)),
    "stl": (".stl", _bytes(stl_binary)),
    "obj": (".obj", _text(obj)),
    "polydata text": (".vtk", _text(lambda p, t: polydata_ascii(p, t.tolist()))),
    "polydata": (".vtk", _bytes(lambda p, t: polydata_binary(p, t.tolist()))),
    "polydata 5": (".vtk", _bytes(lambda p, t: polydata_version_5(p, t.tolist()))),
    "ply text": (".ply", _meshio("triangle", "ply", binary=False)),
    "ply": (".ply", _meshio("triangle", "ply", binary=True)),
    "off": (".off", _meshio("triangle", "off")),
    "vtu": (".vtu", _meshio("triangle", "vtu", binary=False)),
}
"""Name -> file name ending and writer, for triangles."""


def write_format(folder: Path, kind: str, name: str) -> tuple[Path, Floats, Ints]:
    """A cube in the named format, with what was written: path, points, elements."""
    suffix, writer = (SOLID_FORMATS if kind == "tetrahedra" else SURFACE_FORMATS)[name]
    points, elements = cube() if kind == "tetrahedra" else cube_surface()
    path = folder / f"cube{suffix}"
    writer(path, points, elements)
    return path, points, elements


ALL_FORMATS = [
    *(("tetrahedra", name) for name in SOLID_FORMATS),
    *(("surface", name) for name in SURFACE_FORMATS),
]


def truncations(data: bytes) -> list[bytes]:
    """The data cut at every line end, in the middle of every line and at even byte steps."""
    ends = [0, *(i + 1 for i, byte in enumerate(data) if byte == ord("\n"))]
    middles = [(a + b) // 2 for a, b in pairwise(ends)]
    steps = range(0, len(data), max(1, len(data) // 60))
    last = range(max(0, len(data) - 12), len(data))
    return [data[:i] for i in sorted({*ends, *middles, *steps, *last} - {0, len(data)})]
