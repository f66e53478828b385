"""The problem of a scene as files for another code, for `export`."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fem_reference.dynamics import Oscillator, hht, march
from fem_reference.elasticity import Body
from fem_reference.elements import chosen_element
from fem_reference.exchange import calculix
from fem_reference.exchange.calculix import Transient
from fem_reference.exchange.calculix_rule import integrated
from fem_reference.exchange.nodal import nodal_problem
from fem_reference.external_loads import external_loads
from fem_reference.memory import SHARE, available, needed, unknowns
from fem_reference.model import Method
from fem_reference.solvers import solve_static
from study.handover import lattice_files
from study.handover.readme import (
    VTU,
    about_calculix,
    about_mesh,
    about_rest,
    about_vtu,
    external_loads_note,
    organ_notes,
)
from study.mesh.save import save
from study.models.finite_elements import PreparedElements, reference_of
from study.organ.geometry import Level
from study.problem.features import FEATURES
from study.problem.problem import Problem
from study.results import Results
from study.results import folder as results
from study.results.records import ElementsRecord
from study.run.suiting import read_suited
from study.scene import Scene
from study.scene.problem import problem_of
from study.system.folders import replacing
from study.system.progress import Progress

Floats = NDArray[np.float64]

MESHES = {
    "gmsh": ("mesh.msh", "gmsh"),
    "medit": ("mesh.mesh", "medit"),
    "nastran": ("mesh.bdf", "nastran"),
}
"""File of the mesh alone by the program that reads it, and meshio's name of its format."""
LATTICE = "lattice"
FORMATS = ("calculix", "vtu", LATTICE, *MESHES)
HELD = frozenset({"several-loads", "travelling-loads", "gravity", "weights"})
"""Features beside the first load that nodal forces and a gravity field can express."""
MARK = "README.txt"
ALPHA = -0.05
"""Parameter of HHT: CalculiX's own default."""
# Including the files that CalculiX writes beside its decks.
FILES = {MARK, VTU, "mesh.inp", "foundation.inp", "load.inp", "spooles.out"} | {
    f"{deck}.{end}"
    for deck in ("static", "dynamic")
    for end in ("inp", "csv", "dat", "frd", "sta", "cvg", "12d", "eig")
}
FILES |= {calculix.WEIGHTS, calculix.HISTORIES}
FILES |= {file for file, _ in MESHES.values()} | lattice_files.FILES
FURTHER_LOAD = re.compile(r"load\.\d+\.inp")
FRAMES = 4
"""Number of equally spaced times at which the motion of all nodes is compared."""


@dataclass(frozen=True, kw_only=True)
class ExportRequest:
    """The request: a scene or results folder, the format, the folder to write, overrides."""

    target: str
    to: str
    out: Path | None = None
    overrides: Sequence[str] = ()


@dataclass(frozen=True)
class _Target:
    """The scene, the default folder, and the meshes and curves of existing results.

    `counts`: numbers of elements of the meshes, coarse to fine; empty without results.
    """

    scene: Scene
    folder: Path
    counts: tuple[int, ...] = ()
    curves: Results | None = None


def export(request: ExportRequest, progress: Progress) -> Path:
    """Write the problem; returns the folder. ValueError for an unsuitable target or format."""
    if request.to not in FORMATS:
        raise ValueError(f"--to {request.to}: use one of {', '.join(FORMATS)}")
    target = _target(request)
    if target.scene.is_point:
        raise ValueError(
            "organ.shape: a point has no finite elements nor lattice; use liver, block or a mesh"
        )
    _refuse_unheld(request.to, target.scene)
    folder = (request.out or target.folder).resolve()
    with replacing(folder, _foreign, "export") as partial:
        if request.to in MESHES:
            _write_mesh(request.to, target, partial, progress)
        else:
            WRITERS[request.to](target, partial, progress)
    return folder


def _refuse_unheld(to: str, scene: Scene) -> None:
    """Raise ValueError for features that a format cannot express."""
    unheld = [name for name in scene.features if name not in HELD]
    if unheld and to not in (*MESHES, LATTICE):
        what = " and ".join(FEATURES[name] for name in unheld)
        why = " (their force follows from contact, and is none of nodes)"
        raise ValueError(
            f"--to {to}: holds no {what}{why if 'moved-tools' in unheld else ''}; use one of "
            f"{', '.join(MESHES)}"
        )


def _target(request: ExportRequest) -> _Target:
    path = Path(request.target)
    if not path.is_dir():
        return _Target(read_suited(request.target, request.overrides), Path(f"{path.stem}-export"))
    if request.overrides:
        raise ValueError(
            f"--set: {path} is exported as it was run; leave it out, or name {path}/scene.toml"
        )
    found = results.read(path)
    elements = next((one.elements for one in found.record.models if one.elements), None)
    return _Target(found.scene, path / "export", _counts(elements), found)


def _counts(elements: ElementsRecord | None) -> tuple[int, ...]:
    if elements is None:
        return ()
    return tuple(one.elements for one in elements.levels) or (elements.elements,)


# --- what is written ---------------------------------------------------------------------------


def _write_mesh(to: str, target: _Target, folder: Path, progress: Progress) -> None:
    """The tetrahedra of the reference as a mesh file, corners only, in metres."""
    with progress.stage("organ"):
        prepared = reference_of(target.scene).prepare(problem_of(target.scene))
    mesh = _level(prepared, target.counts, progress).mesh
    file, format_ = MESHES[to]
    save(mesh, folder / file, format_)
    _write(folder, {MARK: about_mesh(target.scene, file, mesh)})


def _write_vtu(target: _Target, folder: Path, progress: Progress) -> None:
    from fem_reference.exchange import vtu

    scene, (body, problem) = target.scene, _discretised(target, progress)
    given = nodal_problem(body, scene.tissue, problem.foundation, external_loads(problem))
    with progress.stage("at rest under full load"):
        displacement = solve_static(body).reshape(-1, 3)
    _write(
        folder,
        {
            VTU: vtu.text(given, displacement),
            MARK: about_vtu(scene, given)
            + external_loads_note(problem, given)
            + organ_notes(scene, problem),
        },
    )


def _write_calculix(target: _Target, folder: Path, progress: Progress) -> None:
    scene, (body, problem) = target.scene, _discretised(target, progress, steps=True)
    given = nodal_problem(body, scene.tissue, problem.foundation, external_loads(problem))
    motion = None if problem.weights else motion_of(scene, problem)
    files = calculix.files(given, motion)
    theirs = integrated(body, scene.tissue, given)
    with progress.stage("at rest under full load"):
        rest, own_rest = solve_static(theirs), solve_static(body)
    files["static.csv"] = _table([(0.0, rest)], timed=False)
    at_rest = _difference(rest, own_rest)
    if motion is None:
        about = about_rest(scene, given, at_rest)
    else:
        with progress.stage("motion"):
            moved, own_moved = frames(theirs, motion), _own_frames(body, motion)
        files["dynamic.csv"] = _table(moved)
        pairs = zip(moved, own_moved, strict=True)
        differences = (at_rest, max(_difference(u, v) for (_, u), (_, v) in pairs))
        about = about_calculix(scene, given, motion, differences)
    about += external_loads_note(problem, given, merged=given.is_merged) + organ_notes(
        scene, problem
    )
    _write(folder, files | {MARK: about})


def _write_lattice(target: _Target, folder: Path, progress: Progress) -> None:
    from study.handover.lattice import check_curves, lattices

    found = lattices(target.scene, progress)
    if target.curves is not None:
        check_curves(found, target.curves)
    lattice_files.write(found, folder)
    _write(folder, {MARK: lattice_files.about(found)})


WRITERS = {"vtu": _write_vtu, "calculix": _write_calculix, LATTICE: _write_lattice}


def _check_memory(level: Level, scene: Scene) -> None:
    """Time steps factorise the matrix, here and in CalculiX."""
    element = chosen_element(scene.reference.element, scene.tissue.highest_poisson_ratio)
    count = unknowns(level.mesh, element)
    wanted, limit = needed(count, element, stepping=True), SHARE * available()
    if wanted > limit:
        raise ValueError(
            f"reference.element_size: {count} unknowns stepped in time need "
            f"{wanted / 2**30:.1f} GiB of {limit / 2**30:.1f}; enlarge it, or export to vtu"
        )


def _discretised(
    target: _Target, progress: Progress, *, steps: bool = False
) -> tuple[Body, Problem]:
    """The body and its problem; ValueError before assembly, with `steps` for time steps too."""
    with progress.stage("organ"):
        problem = problem_of(target.scene)
        prepared = reference_of(target.scene).prepare(problem)
        prepared.refuse()
    level = _level(prepared, target.counts, progress)
    if steps:
        _check_memory(level, target.scene)
    with progress.stage("assembly"):
        return prepared.body(level), problem


def _level(prepared: PreparedElements, counts: Sequence[int], progress: Progress) -> Level:
    """The mesh of the scene, or the finer one that its results took for their accuracy."""
    if not counts:
        return prepared.own_level()
    found = prepared.level_of(counts, progress)
    if found is None:
        raise ValueError(
            f"the results have {counts[-1]} finite elements, which this version does not make of "
            "their scene; run it again"
        )
    return found


def motion_of(scene: Scene, problem: Problem) -> Transient:
    """The scene's steps and load history, from no load: a step load is a ramp over one step."""
    times = problem.observation.times
    stepping = Method("hht-alpha", scene.reference.steps_per_sample)
    count = stepping.time_steps(problem.factors, times).count(len(times) - 1)
    factors = problem.factors(np.linspace(0.0, times[-1], count + 1))
    factors[0] = 0.0
    damping = reference_of(scene).damping
    return Transient(float(times[-1]) / count, factors, damping, ALPHA, -(-count // FRAMES))


def frames(body: Body, motion: Transient) -> list[tuple[float, Floats]]:
    """Times [s] at which CalculiX prints a motion, and the unknowns at these times."""
    system = Oscillator(body.mass, body.stiffness, body.loads, motion.damping)
    steps = hht(system, motion.factor, motion.step, motion.count, motion.alpha)
    return _kept(steps, motion)


def _own_frames(body: Body, motion: Transient) -> list[tuple[float, Floats]]:
    """The motion at the times of `frames` by the reference's own steps, mass and quadrature."""
    system = Oscillator(body.mass, body.stiffness, body.loads, motion.damping)
    return _kept(march(system, motion.factor, motion.step, motion.count), motion)


def _kept(steps: Iterator[tuple[Floats, Floats]], motion: Transient) -> list[tuple[float, Floats]]:
    return [(n * motion.step, u) for n, (u, _) in enumerate(steps) if motion.prints(n)]


def _difference(u: Floats, v: Floats) -> float:
    return float(np.linalg.norm(u - v) / np.linalg.norm(v))


def _table(moved: Sequence[tuple[float, Floats]], *, timed: bool = True) -> str:
    """Displacement [m] of each node, numbered from 1, at each time [s]."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["node", "ux_m", "uy_m", "uz_m", *(["time_s"] if timed else [])])
    for time, u in moved:
        end = [f"{time:.9g}"] if timed else []
        for number, at in enumerate(u.reshape(-1, 3), 1):
            writer.writerow([number, *(f"{value:.12e}" for value in at), *end])
    return text.getvalue()


# --- the folder --------------------------------------------------------------------------------


def _write(folder: Path, files: Mapping[str, str]) -> None:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


def _foreign(present: set[str]) -> str | None:
    own = (lattice_files.OF_A_MODEL, FURTHER_LOAD)
    others = (name for name in present - FILES if not any(one.fullmatch(name) for one in own))
    return min(others, default=None)
