"""Stiffness and mass by DOLFINx, run by the system's Python: GIVEN.npz FOUND.

From GIVEN come points, elements, material, and what foundation and tool are; DOLFINx builds the
mesh, generates kernels from the weak forms and assembles. FOUND-... have the matrices and the load
in the numbering of GIVEN.
"""

import sys

import dolfinx
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import create_mesh
from mpi4py import MPI
from scipy.sparse import csr_matrix, save_npz
from scipy.spatial import cKDTree

DEGREE = {4: 1, 10: 2}
# Basix numbers edges by the corners that they do not touch.
ORDER = {4: [0, 1, 2, 3], 10: [0, 1, 2, 3, 9, 8, 5, 7, 6, 4]}
CELL_DEGREE = 8  # exact for straight elements, nearly so for curved ones
FACET_DEGREE = 30  # support and load are no polynomials: nearly exact


def mesh_of(nodes, elements):
    corners = elements.shape[1]
    shape = ufl.VectorElement("Lagrange", "tetrahedron", DEGREE[corners])
    cells = np.ascontiguousarray(elements[:, ORDER[corners]])
    return create_mesh(MPI.COMM_SELF, cells, nodes, ufl.Mesh(shape))


def assembled(form, unknowns):
    matrix = fem.petsc.assemble_matrix(fem.form(form))
    matrix.assemble()
    starts, columns, values = matrix.getValuesCSR()
    found = csr_matrix((values, columns, starts), shape=matrix.getSize())
    return csr_matrix(found[unknowns][:, unknowns])


def ds(mesh):
    return ufl.Measure("ds", mesh, metadata={"quadrature_degree": FACET_DEGREE})


def foundation(data, mesh):
    """Stiffness per area: full over half the depth, then fading, by the area's projection."""
    x, n = ufl.SpatialCoordinate(mesh), ufl.FacetNormal(mesh)
    outward = ufl.as_vector(data["outward"].tolist())
    below = (float(data["level"]) - ufl.dot(x, outward)) / float(data["depth"])
    fade = ufl.min_value(ufl.max_value(2 * (1 - below), 0.0), 1.0)
    facing = ufl.max_value(ufl.dot(n, outward), 0.0)
    return float(data["stiffness"]) * fade**2 * (3 - 2 * fade) * facing


def traction(data, mesh):
    """Of the tool, up to a factor: (1 - (r/radius)^2)^2 on what faces it, by its projection."""
    x, n = ufl.SpatialCoordinate(mesh), ufl.FacetNormal(mesh)
    direction = ufl.as_vector(data["direction"].tolist())
    offset = x - ufl.as_vector(data["centre"].tolist())
    along, radius = ufl.dot(offset, direction), float(data["radius"])
    across = (ufl.dot(offset, offset) - along**2) / radius**2
    inside = ufl.conditional(ufl.lt(abs(along), radius), ufl.max_value(1 - across, 0.0) ** 2, 0.0)
    return inside * ufl.max_value(-ufl.dot(n, direction), 0.0) * direction


def main(given, out):
    data = np.load(given)
    nodes, elements = data["nodes"], data["elements"]
    E, nu, density = (float(data[key]) for key in ("modulus", "poisson_ratio", "density"))
    mesh = mesh_of(nodes, elements)
    space = fem.VectorFunctionSpace(mesh, ("Lagrange", DEGREE[elements.shape[1]]))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    lame, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    strain = ufl.sym(ufl.grad(u))
    stress = 2 * mu * strain + lame * ufl.tr(strain) * ufl.Identity(3)
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": CELL_DEGREE})
    distance, first = cKDTree(space.tabulate_dof_coordinates()).query(nodes)
    assert distance.max() < 1e-9
    unknowns = (3 * first[:, None] + np.arange(3)).ravel()
    save_npz(
        f"{out}-stiffness.npz", assembled(ufl.inner(stress, ufl.sym(ufl.grad(v))) * dx, unknowns)
    )
    save_npz(f"{out}-mass.npz", assembled(density * ufl.inner(u, v) * dx, unknowns))
    save_npz(
        f"{out}-support.npz",
        assembled(foundation(data, mesh) * ufl.inner(u, v) * ds(mesh), unknowns),
    )
    nodal = fem.petsc.assemble_vector(fem.form(ufl.inner(traction(data, mesh), v) * ds(mesh))).array
    nodal = nodal[unknowns]
    total = nodal.reshape(-1, 3).sum(axis=0) @ data["direction"]
    np.save(f"{out}-load.npy", nodal * data["force"] / total)
    sys.stdout.write(dolfinx.__version__)


main(*sys.argv[1:])
