"""Step an exported lattice in plain NumPy, as its run did: python step_lattice.py MODEL."""

import json
import sys
from pathlib import Path

import numpy as np


def tension(law, x):
    """Tension [N/m] at strain x, of which `scale` makes a force; Basafa's is eqs. (6), (7)."""
    if law["name"] == "hooke":
        return law["k"] * x
    inner = np.clip(x, -law["x_c"], law["x_c"])
    slope = law["k1"] + 3.0 * law["k2"] * law["x_c"] ** 2
    return law["k1"] * inner + law["k2"] * inner**3 + slope * (x - inner)


def internal_force(a, law, u):
    """Force [N] (n, 3) of springs, volume term and foundation at displacement u [m]."""
    (i, j), rest = a["ends"].T, np.linalg.norm(a["rest"], axis=1)
    d = a["rest"] + u[j] - u[i]
    length = np.linalg.norm(d, axis=1)
    pull = (a["scale"] * tension(law, (length - rest) / rest) / length)[:, None] * d
    force = np.zeros_like(u)
    np.add.at(force, i, pull)
    np.subtract.at(force, j, pull)
    if len(a["cells"]):
        f = np.einsum("cai,aj->cij", u[a["cells"]], a["slopes"]) + np.eye(3)
        cofactor = np.cross(f[:, [1, 2, 0]], f[:, [2, 0, 1]])
        swelling = np.einsum("cj,cj->c", f[:, 0], cofactor[:, 0]) - 1.0  # J - 1
        push = np.einsum("c,cij,aj->cai", a["bulk"] * swelling, cofactor, a["slopes"])
        np.subtract.at(force, a["cells"], push)
    np.subtract.at(force, a["foundation_row"], a["foundation"][:, None] * u[a["foundation_column"]])
    return force


def run(folder, model):
    """Displacement [m] (samples, probes) along the push."""
    folder = Path(folder)
    a = dict(np.load(folder / "lattice.npz")) | dict(np.load(folder / f"lattice-{model}.npz"))
    law = json.loads((folder / "lattice.json").read_text())["models"][model]["law"]
    u, v, found, done = np.zeros_like(a["nodes"]), np.zeros_like(a["nodes"]), [], 0
    mass, interval = a["mass"][:, None], a["times"][1] - a["times"][0]
    for count in [0, *a["substeps"]]:
        for factor in a["factors"][done : done + count]:
            dt, away = interval / count, np.linalg.norm(u, axis=1, keepdims=True)
            damping = (a["gamma_0"] + a["gamma_1"] * away) * mass
            pushed = internal_force(a, law, u) + factor * a["load"]
            v = (mass * v + dt * pushed) / (mass + dt * damping)
            u = u + dt * v
        done += count
        found.append(a["probes"] @ u @ a["push"])
    return np.array(found)


if __name__ == "__main__":
    curve = np.load(f"lattice-{sys.argv[1]}.npz")["curve"]
    gap = np.abs(run(".", sys.argv[1]) - curve).max() / np.abs(curve).max()
    print(f"largest difference from the run's curves: {gap:.1e} of the largest displacement")
