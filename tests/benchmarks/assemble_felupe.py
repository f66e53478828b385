"""Seconds in which FElupe assembles a stiffness, in an environment of its own: MESH.npz REPEATS."""

import json
import sys
import time

import felupe
import numpy as np


def assembled(data):
    mesh = felupe.Mesh(data["nodes"], data["elements"], "tetra10")
    field = felupe.FieldContainer([felupe.Field(felupe.RegionQuadraticTetra(mesh), dim=3)])
    law = felupe.LinearElastic(E=float(data["modulus"]), nu=float(data["poisson_ratio"]))
    return felupe.SolidBody(law, field).assemble.matrix().tocsr()


def main(path, repeats):
    data, seconds = dict(np.load(path)), []
    for _ in range(int(repeats)):
        start = time.perf_counter()
        matrix = assembled(data)
        seconds.append(time.perf_counter() - start)
    norm = float(np.linalg.norm(matrix.data))
    sys.stdout.write(json.dumps([felupe.__version__, seconds, norm, 0.0]))


main(*sys.argv[1:])
