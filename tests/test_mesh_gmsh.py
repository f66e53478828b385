"""Gmsh files: every section beside the mesh in every format, and random data through meshio."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.mesh.gmsh import read_gmsh
from study.mesh.gmsh_cells import CELLS
from study.mesh.kinds import MeshError
from tests.mesh_features_volume import (
    GMSH_FILES,
    OTHER_SECTIONS,
    SKIN,
    elements_first,
    gmsh_bytes,
    numbered_4,
)
from tests.mesh_samples import cube

FILES = {name: make() for name, make in GMSH_FILES.items()}


def is_cube(mesh) -> bool:
    points, tetrahedra = cube(2)
    return np.array_equal(mesh.points, points) and np.array_equal(mesh.tetrahedra, tetrahedra)


@pytest.mark.parametrize("more", OTHER_SECTIONS)
@pytest.mark.parametrize("name", FILES)
def test_other_sections_decide_nothing_wherever_they_stand(name, more):
    data = FILES[name]
    nodes = data.index(b"$N", data.index(b"$EndMeshFormat") if b"$Mesh" in data else 0)
    for place in (nodes, len(data)):
        assert is_cube(read_gmsh(data[:place] + OTHER_SECTIONS[more] + data[place:]))


@pytest.mark.parametrize("name", [name for name in FILES if name != "format 1"])
def test_elements_may_come_before_nodes(name):
    assert is_cube(read_gmsh(elements_first(FILES[name])))


@pytest.mark.parametrize("name", FILES)
def test_a_cut_off_file_is_refused(name):
    data = FILES[name] + OTHER_SECTIONS["ElementData"]
    whole = {len(FILES[name]), *range(len(data) - 1, len(data) + 1)}
    for length in sorted({*range(1, len(data), 97), *range(len(data) - 8, len(data))} - whole):
        if data[length - 1 : length] == b"\n" and length >= len(FILES[name]):
            continue  # data that nobody has begun yet
        with pytest.raises(MeshError):
            read_gmsh(data[:length])


def test_element_types_are_those_of_meshio():
    from meshio._common import num_nodes_per_cell
    from meshio.gmsh import common

    theirs = {k: num_nodes_per_cell[name] for k, name in common._gmsh_to_meshio_type.items()}
    both = CELLS.keys() & theirs.keys()
    assert len(both) > 30
    assert {kind: CELLS[kind][1] for kind in both} == {kind: theirs[kind] for kind in both}


@pytest.mark.parametrize("kind", CELLS)
def test_elements_of_any_type_are_counted_or_used(kind):
    """Nothing is left out in silence: volume cells and faces turn up in what is read."""
    name, count = CELLS[kind]
    rows = " ".join(str(i) for i in range(1, count + 1))
    nodes = "\n".join(f"{i} 0 0 0" for i in range(1, count + 1))
    text = (
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{count}\n{nodes}\n$EndNodes\n"
        f"$Elements\n1\n1 {kind} 0 {rows}\n$EndElements\n"
    )
    mesh = read_gmsh(text.encode())
    found = len(mesh.tetrahedra) + len(mesh.triangles) + sum(mesh.solids.values())
    flat = {"triangle": 1, "quad": 2, "tetra": 1, "line": 0, "vertex": 0}
    assert found == flat.get(name.rstrip("0123456789"), 1)


@settings(max_examples=20, deadline=None)
@given(
    st.sampled_from(["2.2", "4.0", "4.1"]),
    st.booleans(),
    st.integers(0, 2**31),
    st.sampled_from(["", "scalar", "vector", "tensor"]),
)
def test_what_meshio_writes_is_read(version, binary, seed, kind):
    rng = np.random.default_rng(seed)
    shape = {"scalar": (), "vector": (3,), "tensor": (9,)}.get(kind, ())
    data = {"u": rng.normal(size=(27, *shape))} if kind else {}
    cells = {"E": [rng.normal(size=(len(block), *shape)) for block in (SKIN, [0], cube(2)[1])]}
    written = gmsh_bytes(version, binary, point_data=data, cell_data=cells if kind else {})
    mesh = read_gmsh(written)
    assert is_cube(mesh)
    assert np.array_equal(mesh.triangles, SKIN)


@pytest.mark.parametrize("is_4_1", [False, True])
@pytest.mark.parametrize(("first", "step"), [(1, 1), (10, 7), (10**9, 100)])
def test_numbers_with_gaps(is_4_1, first, step):
    assert is_cube(read_gmsh(numbered_4(is_4_1, first, step)))


@pytest.mark.parametrize("binary", [False, True])
def test_the_byte_order_is_that_of_the_file(binary):
    """Format 2.2 with big-endian numbers, written here, for meshio writes none."""
    points, tetrahedra = cube(2)
    order = ">" if binary else "<"
    nodes = np.zeros(27, dtype=[("number", f"{order}i4"), ("place", f"{order}f8", 3)])
    nodes["number"], nodes["place"] = -np.arange(1, 28), points
    rows = [[i, 7, 1, *(-t - 1)] for i, t in enumerate(tetrahedra, start=1)]
    data = b"".join(
        [
            b"$MeshFormat\n2.2 1 8\n" + np.array([1], f"{order}i4").tobytes(),
            b"\n$EndMeshFormat\n$Nodes\n27\n" + nodes.tobytes() + b"\n$EndNodes\n$Elements\n48\n",
            np.array([4, 47, 2], f"{order}i4").tobytes(),
            np.array(rows[:47], f"{order}i4").tobytes(),
            np.array([4, 1, 2, *rows[47]], f"{order}i4").tobytes() + b"\n$EndElements\n",
        ]
    )
    assert is_cube(read_gmsh(data))
