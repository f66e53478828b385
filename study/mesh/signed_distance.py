"""Distance from a closed surface, and its nearest points, by VTK."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.mesh.kinds import SurfaceMesh

Floats = NDArray[np.float64]


class SignedDistance:
    """Distance from a closed surface with outward triangles, negative inside.

    The sign follows the angle-weighted mean normal at the nearest point: Baerentzen and Aanaes
    (2005), IEEE Trans. Vis. Comput. Graph. 11:243. VTK is imported at the first evaluation.
    """

    def __init__(self, surface: SurfaceMesh) -> None:
        self.surface = surface

    def __call__(self, points: Floats) -> Floats:
        """Distance [m] of points [m] (..., 3), shape (...)."""
        from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkDoubleArray

        flat = np.ascontiguousarray(points.reshape(-1, 3))
        found = vtkDoubleArray()
        found.SetNumberOfTuples(len(flat))
        self._function.FunctionValue(numpy_to_vtk(flat), found)  # type: ignore[no-untyped-call] # VTK has no types here
        distance = vtk_to_numpy(found)  # type: ignore[no-untyped-call] # VTK has no types here
        return np.array(distance).reshape(points.shape[:-1])

    def nearest(self, points: Floats) -> Floats:
        """Points (n, 3) of the surface nearest to points [m] (n, 3)."""
        found = np.empty_like(points)
        for point, place in zip(points, found, strict=True):
            self._function.EvaluateFunctionAndGetClosestPoint(point, place)
        return found

    @cached_property
    def _function(self) -> Any:
        from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
        from vtkmodules.vtkCommonCore import vtkPoints
        from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
        from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

        points, triangles, poly = vtkPoints(), vtkCellArray(), vtkPolyData()
        places = np.ascontiguousarray(self.surface.points)
        points.SetData(numpy_to_vtk(places, deep=True))  # type: ignore[no-untyped-call] # VTK has no types here
        numbers = np.ascontiguousarray(self.surface.triangles.ravel(), dtype=np.int64)
        triangles.SetData(3, numpy_to_vtkIdTypeArray(numbers, deep=True))  # type: ignore[no-untyped-call] # VTK has no types here
        poly.SetPoints(points)
        poly.SetPolys(triangles)
        function = vtkImplicitPolyDataDistance()
        function.SetInput(poly)
        return function
