"""Tetrahedra from a closed surface."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from study.mesh.kinds import MeshError, SurfaceMesh
from study.mesh.surface import enclosed_volume
from study.mesh.tetrahedra import boundary, volumes
from study.mesh.tetrahedralise import tetrahedralise
from study.stages.once import keeping_in
from study.stages.store import Store
from tests.mesh_samples import cube, cube_surface, ellipsoid_surface

ELLIPSOID = SurfaceMesh(*ellipsoid_surface())


@pytest.fixture
def mesher(monkeypatch):
    """Replace the mesher by one that gives the answer it is told."""

    def install(answer):
        def fill(*_, **__):
            if isinstance(answer, Exception):
                raise answer
            return answer

        monkeypatch.setitem(sys.modules, "pytetwild", SimpleNamespace(tetrahedralize=fill))

    return install


def test_an_ellipsoid_is_filled(capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh, notes = tetrahedralise(ELLIPSOID, 0.05)
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []  # the mesher would leave a file here
    inside = volumes(mesh)
    assert inside.min() > 0
    assert inside.sum() == pytest.approx(
        enclosed_volume(ELLIPSOID.points, ELLIPSOID.triangles), rel=0.02
    )
    surface = boundary(mesh)
    # The boundary stays within a twentieth of the element size of the surface, hence of its box.
    np.testing.assert_allclose(
        np.ptp(surface.points, axis=0), np.ptp(ELLIPSOID.points, axis=0), atol=2 * 0.05 * 0.05
    )
    assert "by fTetWild" in notes[0]


@pytest.mark.parametrize("size", [0.0, -0.01, np.nan, 0.3])
def test_sizes_that_do_not_fit_are_refused(size):
    with pytest.raises(MeshError, match="`element_size`"):
        tetrahedralise(ELLIPSOID, size)


def test_too_many_elements_are_refused_beforehand():
    with pytest.raises(MeshError, match=r"needs about 1\.7e\+07 tetrahedra"):
        tetrahedralise(ELLIPSOID, 0.001)


def test_a_changed_volume_is_refused(mesher):
    points, tetrahedra = cube()
    surface = SurfaceMesh(*cube_surface())
    mesher((points * [1, 1, 1.019], tetrahedra))
    assert "volume +1.90 %" in tetrahedralise(surface, 0.05)[1][0]
    mesher((points * [1, 1, 1.021], tetrahedra))
    with pytest.raises(MeshError, match=r"change the volume by \+2.10 %"):
        tetrahedralise(surface, 0.05)


def test_what_the_mesher_gives_is_checked_like_a_file(mesher):
    points, tetrahedra = cube()
    mesher((points, np.vstack([tetrahedra, [[0, 1, 2, 3]]])))
    with pytest.raises(MeshError, match="no volume"):
        tetrahedralise(SurfaceMesh(*cube_surface()), 0.05)


@pytest.mark.parametrize("answer", [RuntimeError("no luck"), (np.empty((0, 3)), np.empty((0, 4)))])
def test_a_failing_mesher_is_an_error(mesher, answer):
    mesher(answer)
    with pytest.raises(MeshError, match="fTetWild"):
        tetrahedralise(ELLIPSOID, 0.05)


def test_a_missing_mesher_is_named_with_its_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "pytetwild", None)  # hidden: importing it fails
    with pytest.raises(MeshError, match=r'pytetwild.*pip install -e "\.\[surface\]"'):
        tetrahedralise(ELLIPSOID, 0.05)


def test_a_surface_is_filled_once_for_all_runs(mesher, tmp_path):
    """Another filling is another mesh, on which no stage of a run could be kept."""
    surface, store = SurfaceMesh(*cube_surface()), Store(tmp_path / "store")
    store.prepare()

    def filled(width, size=0.05, **how):
        points, tetrahedra = cube()
        mesher((points * [1, 1, width], tetrahedra))
        with keeping_in(store, **how):
            return float(np.ptp(tetrahedralise(surface, size)[0].points[:, 2]))

    first = filled(1.0)
    assert filled(1.01) == first
    assert filled(1.01, size=0.04) == pytest.approx(1.01 * first)
    assert filled(1.015, readable=False) == pytest.approx(1.015 * first)
    assert filled(1.0) == pytest.approx(1.015 * first)
    assert tetrahedralise(surface, 0.05)[0].points[:, 2].max() == first
