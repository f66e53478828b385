"""VTKHDF: one file with a mesh, written once, and fields on its nodes at many times.

VTK's own writer asks a source for one time after another, so only one is held at once. It keeps
the times in single precision. Format: https://docs.vtk.org/en/latest/vtk_file_formats
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import (
    VTK_HEXAHEDRON,
    VTK_TETRA,
    vtkCellArray,
    vtkUnstructuredGrid,
)
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
from vtkmodules.vtkIOHDF import vtkHDFWriter

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Fields = Callable[[int], Mapping[str, Floats]]

CELL_TYPES = {4: VTK_TETRA, 8: VTK_HEXAHEDRON}
# Corner c of a lattice cell lies at the bits of c, x the highest; VTK goes round the lower face,
# then round the upper one.
HEXAHEDRON = (0, 4, 6, 2, 1, 5, 7, 3)
COMPRESSION = 1
"""Level of deflate. Higher levels take several times as long and save a few per cent."""


def write(path: Path, points: Floats, cells: Ints, times: Floats, fields: Fields) -> None:
    """Write a mesh, points [m] (n, 3), and `fields(i)` by name, each (n, 3), at each times[i] [s].

    `cells` (c, 4): tetrahedra; (c, 8): cells of a lattice. OSError if the file cannot be written.
    """
    source = _Source(_grid(points, cells), [float(at) for at in times], fields)
    writer = vtkHDFWriter()
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetFileName(str(path))
    writer.SetCompressionLevel(COMPRESSION)
    path.touch()  # raises an error with a reason, which the writer does not
    done = writer.Write()
    if source.error is not None:
        raise source.error
    if not done or writer.GetErrorCode():
        raise OSError(errno.EIO, "VTK could not write the fields", str(path))


def _grid(points: Floats, cells: Ints) -> vtkUnstructuredGrid:
    corners = cells.shape[1]
    if corners not in CELL_TYPES:
        raise ValueError(f"fields are written on tetrahedra or hexahedra, not cells of {corners}")
    order = HEXAHEDRON if corners == 8 else range(4)
    flat = np.ascontiguousarray(cells[:, list(order)], dtype=np.int64).ravel()
    places, connectivity = vtkPoints(), vtkCellArray()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))  # type: ignore[no-untyped-call] # VTK has no types here
    connectivity.SetData(corners, numpy_to_vtkIdTypeArray(flat, deep=True))  # type: ignore[no-untyped-call] # VTK has no types here
    grid = vtkUnstructuredGrid()
    grid.SetPoints(places)
    grid.SetCells(CELL_TYPES[corners], connectivity)
    return grid


class _Source(VTKPythonAlgorithmBase):
    """Offers the times and, asked for one, the mesh with its fields.

    An error in a method that VTK calls would be printed and lost: it is kept in `error`.
    """

    def __init__(self, grid: vtkUnstructuredGrid, times: list[float], fields: Fields) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkUnstructuredGrid")  # type: ignore[no-untyped-call] # VTK has no types here
        self.grid, self.times, self.fields = grid, times, fields
        self.error: Exception | None = None

    def RequestInformation(self, _request: Any, _inputs: Any, outputs: Any) -> int:  # noqa: N802 - VTK's name
        """Say which times there are."""
        offered = outputs.GetInformationObject(0)
        offered.Set(Pipeline.TIME_STEPS(), self.times, len(self.times))
        offered.Set(Pipeline.TIME_RANGE(), (self.times[0], self.times[-1]), 2)
        return 1

    def RequestData(self, _request: Any, _inputs: Any, outputs: Any) -> int:  # noqa: N802 - VTK's name
        """Give the mesh, shared between all times, with the fields of the time asked for."""
        asked = outputs.GetInformationObject(0)
        at = asked.Get(Pipeline.UPDATE_TIME_STEP())
        at = self.times[0] if at is None else at
        output = vtkUnstructuredGrid.GetData(outputs, 0)
        output.ShallowCopy(self.grid)
        output.GetInformation().Set(output.DATA_TIME_STEP(), at)
        try:
            for name, values in self.fields(self.times.index(at)).items():
                array = numpy_to_vtk(values, deep=True)  # type: ignore[no-untyped-call] # VTK has no types here
                array.SetName(name)
                output.GetPointData().AddArray(array)
        except Exception as error:  # VTK would print it and continue; raised afterwards
            self.error = error
            return 0
        return 1
