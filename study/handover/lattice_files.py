"""The files of exported lattices: arrays, their description, a stepper, scenes for SOFA."""

from __future__ import annotations

import json
import re
from importlib import resources
from pathlib import Path

import numpy as np

from study.handover.lattice import ExportedLattices
from study.handover.sofa import lattice_scene, tetrahedra_scene

RECORD, SHARED, STEPPER = "lattice.json", "lattice.npz", "step_lattice.py"
FILES = {RECORD, SHARED, STEPPER}
OF_A_MODEL = re.compile(r"(lattice-[\w-]+\.(npz|scn)|tetrahedra-[\w-]+\.scn)")
ARRAYS = {
    SHARED: {
        "nodes": "(n, 3) [m] nodes at rest",
        "mass": "(n,) [kg]",
        "ends": "(s, 2) nodes of each spring",
        "rest": "(s, 3) [m] from its first node to its second, at rest",
        "scale": "(s,) [m] relative stiffness times rest length: force is scale * tension(strain)",
        "foundation": "(f,) [N/m] entries of the support's matrix, alike along x, y and z",
        "foundation_row": "(f,) node of the force",
        "foundation_column": "(f,) node of the displacement",
        "load": "(n, 3) [N] of the tool at full load",
        "probes": "(p, n) weights of the nodes at each control point",
        "push": "(3,) unit vector of the tool's push",
        "times": "(samples,) [s]",
    },
    "lattice-MODEL.npz": {
        "gamma_0": "[1/s] damping per mass",
        "gamma_1": "[1/(m s)] the same per displacement of the node",
        "cells": "(c, 8) nodes of each cell with a volume term, x the highest bit, z the lowest",
        "bulk": "(c,) [J] kappa V of each cell: its energy is bulk (J - 1)^2 / 2",
        "slopes": "(8, 3) [1/m] gradient of the mean deformation per corner",
        "substeps": "(samples - 1,) steps of symplectic Euler from one sample to the next",
        "factors": "(steps,) share of the load at each step",
        "curve": "(samples, p) [m] displacement of the run along the push",
    },
}
"""Description of the arrays of each file."""


def write(found: ExportedLattices, folder: Path) -> None:
    """Write all files into a folder."""
    np.savez_compressed(folder / SHARED, allow_pickle=False, **found.shared)
    for model in found.models:
        path = folder / f"lattice-{model.name}.npz"
        np.savez_compressed(path, allow_pickle=False, **model.arrays)
        for kind, scene in (("lattice", lattice_scene), ("tetrahedra", tetrahedra_scene)):
            text = scene(found, model)
            (folder / f"{kind}-{model.name}.scn").write_text(text, encoding="utf-8")
    text = json.dumps(_record(found), indent=1, allow_nan=False) + "\n"
    (folder / RECORD).write_text(text, encoding="utf-8")
    (folder / STEPPER).write_bytes(resources.files("study.handover").joinpath(STEPPER).read_bytes())


def _record(found: ExportedLattices) -> dict[str, object]:
    models = {
        model.name: {
            "label": model.label,
            "youngs_modulus_pa": model.modulus,
            "law": {"name": model.law.name, **model.law.constants},
        }
        for model in found.models
    }
    return {
        "title": found.title,
        "units": "SI",
        "probes": list(found.problem.probes),
        "models": models,
        "arrays": ARRAYS,
    }


def about(found: ExportedLattices) -> str:
    """Description of the folder for a reader."""
    shared = found.shared
    names = ", ".join(model.name for model in found.models)
    return f"""\
{found.title or "A scene"}
Its lattice of springs for your own program, SI units throughout. Models: {names}.

{SHARED}            {len(shared["nodes"])} nodes, {len(shared["ends"])} springs, support, load
lattice-MODEL.npz      damping, volume term, steps and curves of each model
{RECORD}           what each array is, and the constants of each model's springs
{STEPPER}        a stepper in plain NumPy: `python {STEPPER} {found.models[0].name}`
                       steps the lattice and says how far it is from the run's curves
lattice-MODEL.scn      the same springs as a scene for SOFA, where that has a counterpart
tetrahedra-MODEL.scn   corotational tetrahedra with the model's modulus for SOFA

The stepper differs from the run by rounding only, some 1e-14 of the largest displacement. The SOFA
scenes were checked against SOFA's documented components and fields, and were not run; each says
what it does otherwise.
"""
