"""Stiffness and mass by GetFEM, run by the system's Python: GIVEN.npz FOUND.

From GIVEN come points, elements and material alone; GetFEM builds the mesh, shape functions,
quadrature and matrices of its own, and FOUND-... have them in the numbering of GIVEN.
"""

import sys

import getfem
import numpy as np
from scipy.sparse import csc_matrix, save_npz
from scipy.spatial import cKDTree

DEGREE = {4: 1, 10: 2}
RULE = "IM_TETRAHEDRON(5)"  # exact for straight elements
# Reference coordinates of our nodes: corners, then the middles of edges 01, 12, 02, 03, 13, 23.
CORNERS = np.vstack([np.zeros(3), np.eye(3)])
MIDDLES = 0.5 * (CORNERS[[0, 1, 0, 0, 1, 2]] + CORNERS[[1, 2, 2, 3, 3, 3]])


def mesh_of(nodes, elements):
    shape = getfem.GeoTrans(f"GT_PK(3,{DEGREE[elements.shape[1]]})")
    theirs = np.asarray(shape.pts()).T
    order = cKDTree(np.vstack([CORNERS, MIDDLES])).query(theirs)[1]
    mesh = getfem.Mesh("empty", 3)
    for element in elements:
        mesh.add_convex(shape, np.ascontiguousarray(nodes[element[order]].T))
    return mesh


def numbered(matrix, unknowns):
    """A matrix of GetFEM with rows and columns in our order."""
    starts, rows = matrix.csc_ind()
    found = csc_matrix((matrix.csc_val(), rows, starts), shape=matrix.size())
    return csc_matrix(found[unknowns][:, unknowns])


def main(given, out):
    data = np.load(given)
    nodes, elements = data["nodes"], data["elements"]
    E, nu, density = data["modulus"], data["poisson_ratio"], data["density"]
    mesh = mesh_of(nodes, elements)
    field = getfem.MeshFem(mesh, 3)
    field.set_fem(getfem.Fem(f"FEM_PK(3,{DEGREE[elements.shape[1]]})"))
    scalar = getfem.MeshFem(mesh, 1)
    scalar.set_fem(getfem.Fem("FEM_PK(3,0)"))
    rule = getfem.MeshIm(mesh, getfem.Integ(str(data["rule"]) or RULE))
    ones = np.ones(scalar.nbdof())
    lame, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    K = getfem.asm_linear_elasticity(rule, field, scalar, lame * ones, mu * ones)
    M = getfem.asm_mass_matrix(rule, field)
    distance, first = cKDTree(field.basic_dof_nodes()[:, ::3].T).query(nodes)
    assert distance.max() < 1e-9
    unknowns = (3 * first[:, None] + np.arange(3)).ravel()
    save_npz(f"{out}-stiffness.npz", numbered(K, unknowns))
    save_npz(f"{out}-mass.npz", density * numbered(M, unknowns))
    sys.stdout.write(getfem.getfem_env("version"))


main(*sys.argv[1:])
