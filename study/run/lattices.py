"""The mass-spring models of a scene: the benchmark and one lattice per fuzzy estimate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from msm import model as lattice_model
from msm.calibration import reference_stiffness
from msm.damping import Damping, eq_2, eq_9
from msm.kernel import ORDER
from msm.laws import Basafa, Hooke, Law
from msm.model import Assembly
from study.progress import Advance, Progress
from study.run.outcome import Outcome, model_record
from study.run.posed import Posed
from study.scene import Scene
from study.trajectory import Trajectory

if TYPE_CHECKING:
    from fuzzy.stiffness import Estimate

MASS_LIMIT = 0.05


@dataclass(frozen=True)
class Contender:
    """A lattice model: name, spring law, damping, small-strain modulus [Pa]."""

    name: str
    law: Law
    damping: Damping
    modulus: float


def contenders(scene: Scene, estimates: dict[str, Estimate]) -> Iterator[Contender]:
    """The lattice models that the scene names."""
    if "basafa" in scene.models:
        yield benchmark(scene)
    if "msm" in scene.models:
        for system, estimate in estimates.items():
            yield fuzzy_tuned(scene, system, estimate.estimate)


def fuzzy_tuned(scene: Scene, system: str, modulus: float) -> Contender:
    """Linear springs of eq. (1) for a modulus [Pa]."""
    law = Hooke(reference_stiffness(modulus, scene.lattice.spacing))
    return Contender(f"msm-{system}", law, node_damping(scene, modulus), modulus)


def benchmark(scene: Scene) -> Contender:
    """Eqs. (5)-(9), Table II carried from the reference spacing to the lattice's.

    K (h / h_0)^2 keeps the modulus 2.5 K_1 / h_0^2, gamma (h / h_0)^3 the damping per mass.
    """
    h, h_0, table = scene.lattice.spacing, scene.damping.reference_spacing, scene.basafa
    per_length = (h / h_0) ** 2 / h
    law = Basafa(table.k1 * per_length, table.k2 * per_length, table.x_c)
    damping = eq_9(table.gamma_0, table.gamma_1, reference_mass(scene))
    return Contender("basafa", law, damping, 2.5 * table.k1 / h_0**2)


def node_damping(scene: Scene, modulus: float) -> Damping:
    """Eq. (2) for a node of the lattice at the reference spacing, so that h does not change it."""
    k = reference_stiffness(modulus, scene.damping.reference_spacing)
    return eq_2(scene.damping.ratio, k, reference_mass(scene))


def reference_mass(scene: Scene) -> float:
    """Mass [kg] of an inner node at the reference spacing."""
    return float(scene.tissue.density * scene.damping.reference_spacing**3)


def assemble(scene: Scene, posed: Posed) -> Assembly:
    """The lattice over the organ, which all its models share."""
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
    posed: Posed,
    assembly: Assembly,
    estimates: dict[str, Estimate],
    outcome: Outcome,
    progress: Progress,
) -> None:
    """Run every lattice model, and type-2's at both ends of its interval, into the outcome."""
    _check_mass(scene, posed, assembly, outcome)
    for contender in contenders(scene, estimates):
        _run(scene, posed, assembly, contender, outcome, progress)
    for system, estimate in estimates.items():
        if estimate.interval is not None and "msm" in scene.models:
            ends = [fuzzy_tuned(scene, system, modulus) for modulus in estimate.interval]
            outcome.bounds[f"msm-{system}"] = (
                _bound(scene, posed, assembly, ends[0], "lower", progress),
                _bound(scene, posed, assembly, ends[1], "upper", progress),
            )
            _note_lost_bounds(system, outcome)


def _note_lost_bounds(system: str, outcome: Outcome) -> None:
    for side, run in zip(("lower", "upper"), outcome.bounds[f"msm-{system}"], strict=True):
        if run.status == "diverged":
            outcome.notes.append(
                f"The run of msm-{system} at the {side} bound of its interval diverged at "
                f"{run.diverged_at:g} s: its band ends there."
            )


def _check_mass(scene: Scene, posed: Posed, assembly: Assembly, outcome: Outcome) -> None:
    expected = posed.geometry.volume * scene.tissue.density
    difference = abs(float(assembly.mass.sum()) / expected - 1.0)
    meaning = "mass of the lattice against that of the finite-element mesh"
    outcome.add_check("lattice: mass", difference, MASS_LIMIT, meaning)


def _run(
    scene: Scene,
    posed: Posed,
    assembly: Assembly,
    contender: Contender,
    outcome: Outcome,
    progress: Progress,
) -> None:
    fraction = scene.lattice.step_fraction
    with progress.stage(contender.name) as advance:
        run = _march(posed, assembly, contender, fraction, 1, advance)
    outcome.runs[contender.name] = run.trajectory
    record = model_record(contender.name, scene, run.trajectory) | {
        "nodes": len(assembly.mass),
        "springs": len(assembly.springs.weight),
        "time_step_s": run.time_step,
        "critical_time_step_s": run.critical_time_step,
        "steps": run.steps,
        "wall_s": run.wall,
        "small_strain_modulus_pa": contender.modulus,
        "node_mass_kg": scene.tissue.density * scene.lattice.spacing**3,
        "damping_rate_per_s": contender.damping.gamma_0,
        "largest_spring_strain": run.largest_strain,
        "inverted_cells": run.inverted_cells,
    }
    outcome.models.append(record)
    if run.trajectory.status == "finished":
        with progress.stage(f"{contender.name}: halved steps") as advance:
            half = _march(posed, assembly, contender, fraction, 2, advance).trajectory
        outcome.add_time_step_errors(record, posed.probes, run.trajectory, half, ORDER)


def _march(
    posed: Posed,
    assembly: Assembly,
    contender: Contender,
    fraction: float,
    refinement: int,
    advance: Advance,
) -> lattice_model.Run:
    return lattice_model.run(
        assembly,
        contender.law,
        contender.damping,
        posed.factor,
        posed.observation,
        fraction,
        refinement,
        advance,
    )


def _bound(
    scene: Scene,
    posed: Posed,
    assembly: Assembly,
    contender: Contender,
    side: str,
    progress: Progress,
) -> Trajectory:
    with progress.stage(f"{contender.name}: {side} bound") as advance:
        fraction = scene.lattice.step_fraction
        return _march(posed, assembly, contender, fraction, 1, advance).trajectory
