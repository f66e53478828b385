"""VTU, which ParaView reads: the mesh with its curved edges, and fields on its nodes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import (
    VTK_QUADRATIC_TETRA,
    VTK_TETRA,
    vtkCellArray,
    vtkUnstructuredGrid,
)
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

from fem_reference.exchange.nodal import NodalProblem

Floats = NDArray[np.float64]

CELL_TYPES = {4: VTK_TETRA, 10: VTK_QUADRATIC_TETRA}


def text(problem: NodalProblem, displacement: Floats) -> str:
    """A .vtu file with the displacement [m] (n, 3), loads [N] and support density [Pa/m]."""
    fields = {
        "displacement": displacement,
        "load": problem.load,
        "support_density": problem.support_density,
        **{f"load_{n}": forces for n, forces in enumerate(problem.others, 2)},
        **({} if problem.weight_forces is None else {"weights": problem.weight_forces}),
    }
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(_grid(problem, fields))
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    return str(writer.GetOutputString())


def _grid(problem: NodalProblem, fields: Mapping[str, Floats]) -> vtkUnstructuredGrid:
    corners = problem.elements.shape[1]
    places, connectivity = vtkPoints(), vtkCellArray()
    places.SetData(numpy_to_vtk(problem.nodes, deep=True))  # type: ignore[no-untyped-call] # VTK has no types here
    flat = np.ascontiguousarray(problem.elements).ravel()
    connectivity.SetData(corners, numpy_to_vtkIdTypeArray(flat, deep=True))  # type: ignore[no-untyped-call] # VTK has no types here
    grid = vtkUnstructuredGrid()
    grid.SetPoints(places)
    grid.SetCells(CELL_TYPES[corners], connectivity)
    for name, values in fields.items():
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)  # type: ignore[no-untyped-call] # VTK has no types here
        array.SetName(name)
        grid.GetPointData().AddArray(array)
    return grid
