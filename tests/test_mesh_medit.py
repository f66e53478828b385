"""MEDIT files: what meshio writes, and truncation of every version."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.mesh.kinds import MeshError
from study.mesh.medit import read_medit
from tests.mesh_features_volume import MEDIT_IGNORED, SKIN, medit_binary, medit_text
from tests.mesh_samples import cube


@settings(max_examples=20, deadline=None)
@given(st.booleans(), st.booleans(), st.integers(0, 2**31))
def test_what_meshio_writes_is_read(tmp_path_factory, binary, single, seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(27, 3)).astype(np.float32 if single else np.float64)
    cells = {"triangle": SKIN, "line": [[0, 1]], "tetra": rng.permutation(cube(2)[1])}
    data = {"medit:ref": [rng.integers(0, 9, len(block)) for block in cells.values()]}
    path = tmp_path_factory.mktemp("medit") / ("a.meshb" if binary else "a.mesh")
    meshio.Mesh(points, cells, cell_data=data).write(path)
    mesh = read_medit(path.read_bytes())
    assert np.array_equal(mesh.points.astype(points.dtype), points)
    assert np.array_equal(mesh.tetrahedra, cells["tetra"])
    assert np.array_equal(mesh.triangles, SKIN)


@pytest.mark.parametrize("version", [1, 2, 3, 4])
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_cut_off_binary_file_is_refused(version, order):
    data = medit_binary(version, order, more={13: bytes(8)})
    assert len(read_medit(data).tetrahedra) == 48
    for length in [*range(9, len(data) - 8, 53), *range(len(data) - 20, len(data) - 7)]:
        with pytest.raises(MeshError):
            read_medit(data[:length])


@pytest.mark.parametrize("name", MEDIT_IGNORED)
def test_what_is_ignored_may_stand_before_the_vertices(name):
    text = medit_text()
    edited = MEDIT_IGNORED[name]("\nEnd\n").removesuffix("End\n").lstrip()
    mesh = read_medit(text.replace("Vertices", edited + "Vertices").encode())
    assert np.array_equal(mesh.points, cube(2)[0])
    assert np.array_equal(mesh.tetrahedra, cube(2)[1])
