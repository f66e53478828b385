"""Tetrahedra inside a closed surface, by fTetWild."""

from __future__ import annotations

from contextlib import chdir
from dataclasses import replace
from functools import partial
from tempfile import TemporaryDirectory

import numpy as np

from study.mesh.check import repair_tetrahedra
from study.mesh.draft import Draft, start_draft
from study.mesh.kinds import MeshError, SurfaceMesh, TetrahedralMesh
from study.mesh.quality import sliver_notes, tetrahedron_quality
from study.mesh.surface import enclosed_volume
from study.mesh.tetrahedra import mean_edge, volumes
from study.stages.flat import Arrays
from study.stages.once import made_once

VOLUME_TOLERANCE = 0.02
"""Largest relative change of volume accepted from the mesher."""

_MAX_TETRAHEDRA = 2e6
_ENVELOPE = 0.05  # how far the new boundary may leave the old one, in element sizes
_REGULAR = 6 * np.sqrt(2)  # edge^3 / volume of a regular tetrahedron


def tetrahedralise(
    surface: SurfaceMesh, element_size: float
) -> tuple[TetrahedralMesh, tuple[str, ...]]:
    """Tetrahedra inside a checked surface, with edges up to about `element_size` [m]; also notes.

    Edges come out shorter where the surface asks for it. The mesher gives a slightly different
    mesh every time; a run takes that of an earlier one from its store. Keep the mesh, not the
    surface, if a run has to be repeated exactly elsewhere.

    Raises
    ------
    MeshError
        If the size does not suit the surface, the mesher is not installed, fails, or changes the
        volume by more than 2 %.
    """
    volume = enclosed_volume(surface.points, surface.triangles)
    _check_size(surface, element_size, volume)
    draft = repair_tetrahedra(_filled(surface, element_size))
    mesh = TetrahedralMesh(draft.points + draft.offset, draft.elements)
    change = float(volumes(mesh).sum()) / volume - 1
    if abs(change) > VOLUME_TOLERANCE:
        raise MeshError(
            f"tetrahedra of {element_size:g} m change the volume by {100 * change:+.2f} %, more "
            f"than {100 * VOLUME_TOLERANCE:g} %: choose a smaller `element_size`"
        )
    quality = tetrahedron_quality(mesh, draft.element_ids)
    note = (
        f"{len(mesh.tetrahedra)} tetrahedra from the surface by fTetWild (not exactly "
        f"repeatable): mean edge {mean_edge(mesh):.3g} m for {element_size:g} m asked, volume "
        f"{100 * change:+.2f} %, smallest dihedral angle {quality.dihedral_min:.1f} degrees"
    )
    return mesh, (note, *draft.notes, *sliver_notes(quality))


def _check_size(surface: SurfaceMesh, element_size: float, volume: float) -> None:
    diagonal = _diagonal(surface)
    if not 0 < element_size < diagonal:
        raise MeshError(
            f"`element_size` = {element_size:g} m must be positive and smaller than the organ "
            f"({diagonal:.3g} m across)"
        )
    expected = _REGULAR * volume / element_size**3
    if expected > _MAX_TETRAHEDRA:
        raise MeshError(
            f"`element_size` = {element_size:g} m needs about {expected:.2g} tetrahedra, the "
            f"limit is {_MAX_TETRAHEDRA:.2g}: choose a larger one"
        )


def _diagonal(surface: SurfaceMesh) -> float:
    return float(np.linalg.norm(np.ptp(surface.points, axis=0)))


def _filled(surface: SurfaceMesh, element_size: float) -> Draft:
    """As the mesher filled it before, if a run keeps that: another time it fills it otherwise."""
    given = (surface.points, surface.triangles, element_size)
    found = made_once("filled", partial(_fill, surface, element_size), *given, modules=(__name__,))
    started = start_draft(found["points"], found["tetrahedra"], np.inf)
    return replace(started, notes=())


def _fill(surface: SurfaceMesh, element_size: float) -> Arrays:
    """Points [m] (n, 3) and tetrahedra (m, 4) as the mesher gives them."""
    try:
        import pytetwild
    except ImportError as error:
        raise MeshError(_missing(error)) from error
    try:
        # It leaves a file behind in the working directory, which is therefore made a passing one.
        with TemporaryDirectory() as folder, chdir(folder):
            points, tetrahedra = pytetwild.tetrahedralize(
                surface.points,
                surface.triangles.astype(np.int32),
                edge_length_abs=element_size,
                epsilon=_ENVELOPE * element_size / _diagonal(surface),
                quiet=True,
                vtk_ordering=True,
            )
    except Exception as error:  # a compiled library with errors of its own kinds
        raise MeshError(f"fTetWild could not fill the surface: {error}") from error
    if not len(tetrahedra):
        raise MeshError("fTetWild found nothing inside the surface: is it closed?")
    return {"points": np.asarray(points, dtype=float), "tetrahedra": tetrahedra.astype(np.int64)}


def _missing(error: ImportError) -> str:
    """What to do where there is no mesher, which is not built for every platform."""
    return (
        f"a closed surface is filled with tetrahedra by pytetwild, which cannot be imported "
        f'({error}): install it with pip install -e ".[surface]", or give the organ as tetrahedra'
    )
