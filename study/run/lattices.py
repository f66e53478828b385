"""The mass-spring models of a scene: the benchmark and one lattice per fuzzy estimate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from msm import model as lattice_model
from msm import tetrahedra
from msm.calibration import SPRING_POISSON_RATIO, reference_stiffness
from msm.checkpoint import Checkpoint
from msm.damping import NodalDamping, eq_2, eq_9
from msm.integrators import INTEGRATORS
from msm.lattice import LatticeMesh
from msm.laws import Basafa, Hooke, Law, initial_stiffness
from msm.model import Assembly, Automatic, Counts, Fixed, Material, Rate, Step
from msm.volume import volume_term
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.progress import Advance, Progress
from study.results.fields import Mesh
from study.run.keeping import Keeping, OnSample, checkpoint, recorded
from study.run.outcome import Outcome, model_record
from study.scene import Scene

if TYPE_CHECKING:
    from fuzzy.stiffness import Estimate

MASS_LIMIT = 0.05


@dataclass(frozen=True)
class Contender:
    """A lattice model: name, what it is made of, small-strain modulus [Pa]."""

    name: str
    material: Material
    modulus: float


def contenders(
    scene: Scene, lattice: LatticeMesh, estimates: dict[str, Estimate]
) -> Iterator[Contender]:
    """The lattice models that the scene names."""
    if "basafa" in scene.models:
        yield benchmark(scene, lattice.spacing)
    if "msm" in scene.models:
        for system, estimate in estimates.items():
            yield fuzzy_tuned(scene, lattice, system, estimate.estimate)


def fuzzy_tuned(scene: Scene, lattice: LatticeMesh, system: str, modulus: float) -> Contender:
    """Springs of the scene's law for a modulus [Pa], with the volume term if the scene has it."""
    linear = elastic(lattice, modulus, poisson_ratio(scene))
    k = initial_stiffness(linear.law)
    law = spring_law(scene, k)
    material = replace(linear, law=law, damping=node_damping(scene, modulus))
    return Contender(f"msm-{system}", material, modulus * (initial_stiffness(law) / k))


def spring_law(scene: Scene, k: float) -> Law:
    """Linear springs of eq. (1), k [N/m], or the scene's law in proportion to them."""
    law = scene.lattice.law
    return Hooke(k) if law is None else law.make(k)


def elastic(lattice: LatticeMesh, modulus: float, nu: float) -> Material:
    """Linear springs of a modulus [Pa], and the volume term that makes up for nu above 1/4."""
    law = Hooke(reference_stiffness(modulus, lattice.spacing, nu))
    return Material(law, volume_term(lattice, modulus, nu) if nu > SPRING_POISSON_RATIO else None)


def poisson_ratio(scene: Scene) -> float:
    """Poisson ratio of the fuzzy-tuned lattices."""
    return scene.tissue.poisson_ratio if scene.lattice.volume_term else SPRING_POISSON_RATIO


def benchmark(scene: Scene, spacing: float) -> Contender:
    """Eqs. (5)-(9), Table II carried from the reference spacing to the lattice's [m].

    K (h / h_0)^2 keeps the modulus 2.5 K_1 / h_0^2, gamma (h / h_0)^3 the damping per mass.
    """
    h, h_0, table = spacing, scene.damping.reference_spacing, scene.basafa
    per_length = (h / h_0) ** 2 / h
    law = Basafa(table.k1 * per_length, table.k2 * per_length, table.x_c)
    damping = eq_9(table.gamma_0, table.gamma_1, reference_mass(scene))
    return Contender("basafa", Material(law, damping=damping), 2.5 * table.k1 / h_0**2)


def damping_rates(scene: Scene) -> tuple[float, float]:
    """Alpha [1/s] and beta [s] of the reference: Rayleigh's, or eq. (2) at its modulus."""
    found = node_damping(scene, scene.tissue.youngs_modulus)
    return found.gamma_0, found.beta


def node_damping(scene: Scene, modulus: float) -> NodalDamping:
    """Rayleigh's damping, or eq. (2) for springs of a modulus [Pa].

    Eq. (2) is taken for a node at the reference spacing, so that h does not change it.
    """
    if scene.damping.kind == "rayleigh":
        return NodalDamping(scene.damping.mass, beta=scene.damping.stiffness)
    k = reference_stiffness(modulus, scene.damping.reference_spacing, poisson_ratio(scene))
    return eq_2(scene.damping.ratio, k, reference_mass(scene))


def reference_mass(scene: Scene) -> float:
    """Mass [kg] of an inner node at the reference spacing."""
    return float(scene.tissue.density * scene.damping.reference_spacing**3)


def assemble(scene: Scene, posed: Problem) -> Assembly:
    """The lattice over the organ, or on its mesh, which all its models share."""
    if scene.lattice.springs == "tetrahedra":
        return tetrahedra.assemble(
            posed.geometry.mesh,
            posed.surface_rule,
            scene.tissue.density,
            posed.foundation,
            posed.tool,
        )
    return lattice_model.assemble(
        posed.geometry.body,
        posed.surface_rule,
        scene.tissue.density,
        scene.lattice.spacing,
        posed.foundation,
        posed.tool,
        scene.lattice.flexion,
        scene.lattice.body_diagonals,
    )


def run_lattices(
    scene: Scene,
    posed: Problem,
    assembly: Assembly,
    estimates: dict[str, Estimate],
    outcome: Outcome,
    progress: Progress,
    keeping: Keeping | None = None,
) -> None:
    """Run every lattice model, and type-2's at both ends of its interval, into the outcome."""
    _check_mass(scene, posed, assembly, outcome)
    for contender in contenders(scene, assembly.lattice, estimates):
        _run(scene, posed, assembly, contender, outcome, progress, keeping)
    for system, estimate in estimates.items():
        if estimate.interval is not None and "msm" in scene.models:
            lattice = assembly.lattice
            ends = [fuzzy_tuned(scene, lattice, system, e) for e in estimate.interval]
            outcome.bounds[f"msm-{system}"] = (
                _bound(scene, posed, assembly, ends[0], "lower", progress, keeping),
                _bound(scene, posed, assembly, ends[1], "upper", progress, keeping),
            )
            _note_lost_bounds(system, outcome)


def _note_lost_bounds(system: str, outcome: Outcome) -> None:
    for side, run in zip(("lower", "upper"), outcome.bounds[f"msm-{system}"], strict=True):
        if run.status == "diverged":
            outcome.notes.append(
                f"The run of msm-{system} at the {side} bound of its interval diverged at "
                f"{run.diverged_at:g} s: its band ends there."
            )


def _check_mass(scene: Scene, posed: Problem, assembly: Assembly, outcome: Outcome) -> None:
    expected = posed.geometry.volume * scene.tissue.density
    difference = abs(float(assembly.mass.sum()) / expected - 1.0)
    meaning = "mass of the lattice against that of the finite-element mesh"
    outcome.add_check("lattice: mass", difference, MASS_LIMIT, meaning)


def _run(
    scene: Scene,
    posed: Problem,
    assembly: Assembly,
    contender: Contender,
    outcome: Outcome,
    progress: Progress,
    keeping: Keeping | None,
) -> None:
    step, name = asked_step(scene), contender.name
    mesh = Mesh(assembly.lattice.nodes, assembly.lattice.cells)
    with (
        progress.stage(name) as advance,
        recorded(keeping, name, mesh, posed.observation.times) as on_sample,
    ):
        kept = checkpoint(keeping, name)
        run = _march(scene, posed, assembly, contender, step, advance, kept, on_sample)
    outcome.runs[contender.name] = run.trajectory
    record = model_record(contender.name, scene, run.trajectory) | {
        "nodes": len(assembly.mass),
        "springs": len(assembly.springs.weight),
        "time_step_s": run.largest_step,
        "smallest_time_step_s": run.smallest_step,
        "repeated_steps": run.repeated_steps,
        "integrator": scene.lattice.integrator,
        "poisson_ratio": _poisson_ratio_of(scene, contender),
        "critical_time_step_s": _finite(run.critical_time_step),
        "smallest_step_margin": _finite(run.margin),
        "steps": run.steps,
        "wall_s": run.wall,
        "small_strain_modulus_pa": contender.modulus,
        "node_mass_kg": _node_mass(scene, assembly),
        "damping_rate_per_s": contender.material.damping.gamma_0,
        "stiffness_damping_s": contender.material.damping.beta,
        "largest_spring_strain": run.largest_strain,
        "inverted_cells": run.inverted_cells,
    }
    outcome.models.append(record)
    if run.trajectory.status == "finished":
        with progress.stage(f"{contender.name}: halved steps") as advance:
            halved = Counts(2 * run.substeps)
            kept = checkpoint(keeping, f"{name}-halved")
            half = _march(scene, posed, assembly, contender, halved, advance, kept).trajectory
        order = INTEGRATORS[scene.lattice.integrator].order
        outcome.add_time_step_errors(record, posed.probes, run.trajectory, half, order)


def _poisson_ratio_of(scene: Scene, contender: Contender) -> float | None:
    """Of a lattice model; None where the mesh decides, and not the springs."""
    if scene.lattice.springs == "tetrahedra":
        return None
    return contender.material.poisson_ratio


def _node_mass(scene: Scene, assembly: Assembly) -> float:
    """Of an inner node of the cubic lattice, or the mean of a mesh [kg]."""
    if scene.lattice.springs == "tetrahedra":
        return float(assembly.mass.mean())
    return scene.tissue.density * scene.lattice.spacing**3


def asked_step(scene: Scene) -> Step:
    """How the scene wants steps to be chosen."""
    lattice = scene.lattice
    if lattice.time_step is not None:
        return Fixed(lattice.time_step)
    if lattice.step_rate is not None:
        return Rate(lattice.step_rate)
    return Automatic(lattice.step_fraction)


def _finite(value: float) -> float | None:
    """The value, or None where an integrator has no limit."""
    return value if np.isfinite(value) else None


def _march(
    scene: Scene,
    posed: Problem,
    assembly: Assembly,
    contender: Contender,
    step: Step,
    advance: Advance,
    kept: Checkpoint | None,
    on_sample: OnSample = lambda *_: None,
) -> lattice_model.Run:
    return lattice_model.run(
        assembly,
        contender.material,
        posed.factor,
        posed.observation,
        step,
        advance,
        integrator=scene.lattice.integrator,
        linear=scene.lattice.geometry == "linear",
        checkpoint=kept,
        on_sample=on_sample,
    )


def _bound(
    scene: Scene,
    posed: Problem,
    assembly: Assembly,
    contender: Contender,
    side: str,
    progress: Progress,
    keeping: Keeping | None,
) -> Trajectory:
    with progress.stage(f"{contender.name}: {side} bound") as advance:
        kept = checkpoint(keeping, f"{contender.name}-{side}")
        return _march(
            scene, posed, assembly, contender, asked_step(scene), advance, kept
        ).trajectory
