"""Seconds in which DOLFINx assembles a stiffness, by the system's Python: MESH.npz REPEATS.

The kernel is compiled before and timed apart; straight elements, so the corners give the mesh.
"""

import json
import os
import sys
import tempfile
import time

import numpy as np

os.environ["XDG_CACHE_HOME"] = tempfile.mkdtemp()  # or an earlier run's kernel would be taken

import dolfinx
import ufl
from dolfinx import fem
from dolfinx.mesh import create_mesh
from mpi4py import MPI


def assembled(mesh, E, nu):
    space = fem.VectorFunctionSpace(mesh, ("Lagrange", 2))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    lame, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    strain = ufl.sym(ufl.grad(u))
    stress = 2 * mu * strain + lame * ufl.tr(strain) * ufl.Identity(3)
    matrix = fem.petsc.assemble_matrix(fem.form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx))
    matrix.assemble()
    return matrix


def main(path, repeats):
    data, seconds = np.load(path), []
    E, nu = float(data["modulus"]), float(data["poisson_ratio"])
    corners = data["elements"][:, :4]
    used, cells = np.unique(corners, return_inverse=True)
    shape = ufl.Mesh(ufl.VectorElement("Lagrange", "tetrahedron", 1))
    mesh = create_mesh(MPI.COMM_SELF, cells.reshape(corners.shape), data["nodes"][used], shape)
    for _ in range(int(repeats) + 1):
        start = time.perf_counter()
        matrix = assembled(mesh, E, nu)
        seconds.append(time.perf_counter() - start)
    compiled = seconds[0] - float(np.median(seconds[1:]))
    norm = float(matrix.norm())
    sys.stdout.write(json.dumps([dolfinx.__version__, seconds[1:], norm, compiled]))


main(*sys.argv[1:])
