"""How near the certified error of a superposition is to its error, by damping and vectors.

    python -m tests.benchmarks.certified

writes reports/data/certified.csv in a few minutes: the built-in liver's own mesh under loads linear
over frames, in so many load-dependent Ritz vectors. The error is against a Krylov space of 320
vectors, and stands beside what half of these change. Bounds are those by certificates
of fewer and of more vectors than a scene has by default.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_reference.certificate import Certificate, comparison, krylov_space
from fem_reference.certified import CertifiedMotion
from fem_reference.elasticity import Body
from fem_reference.observation import evaluation
from fem_reference.solvers import by_factors
from fem_reference.subspace import Subspace, ritz_subspace, superposition
from study.models.superposition import STEP, models
from study.problem.damping import RayleighDamping
from study.scene.file import read_scene
from study.scene.problem import problem_of

Floats = NDArray[np.float64]

TABLE = Path(__file__).parents[2] / "reports" / "data" / "certified.csv"
VECTORS = (4, 8, 16)
CERTIFICATES = (64, 128, 256)
TRUTH = 320
FRAMES = 90


class Row(NamedTuple):
    """One subspace under one load, by one certificate.

    `mass_per_s`, `stiffness_s`: Rayleigh damping; `vectors` of the subspace and of the
    `certificate`. Largest over the motion, of the energy norm over its largest, and at the tool of
    the length over its largest: the error, what half of the truth's vectors change, and the
    bound.
    """

    damping: str
    mass_per_s: float
    stiffness_s: float
    load: str
    vectors: int
    certificate: int
    error: float
    error_change: float
    bound: float
    error_at_tool: float
    bound_at_tool: float


class Load(NamedTuple):
    """A damping and the share of the load at each frame."""

    damping: str
    rayleigh: RayleighDamping
    name: str
    loads: Floats


def ramp(seconds: float) -> Floats:
    """A ramp of so long, and a hold."""
    return np.minimum(np.arange(FRAMES + 1) * STEP / seconds, 1.0)


def cases(scene_s: RayleighDamping) -> list[Load]:
    """From heavy damping to light, and from slow loads to sudden ones."""
    wave = np.sin(2.0 * np.pi * np.arange(FRAMES + 1) * STEP)
    light, stiff = RayleighDamping(32.0), RayleighDamping(0.0, 2e-3)
    return [
        Load("the scene's", scene_s, "ramp of 1 s", ramp(1.0)),
        Load("both", RayleighDamping(10.0, 1e-3), "ramp of 0.5 s", ramp(0.5)),
        Load("stiffness", stiff, "ramp of 0.1 s", ramp(0.1)),
        Load("light", light, "1 Hz", wave),
        Load("light", light, "ramp of 0.1 s", ramp(0.1)),
        Load("very light", RayleighDamping(8.0), "ramp of 0.1 s", ramp(0.1)),
        Load("light", light, "ramp of a frame", ramp(STEP)),
        Load("light", light, "at once", np.ones(FRAMES + 1)),
    ]


class ReferenceSolution(NamedTuple):
    """Motion in the large Krylov space: coordinates by all and by half of its vectors."""

    space: Subspace
    whole: Floats
    half: Floats


def moved(space: Subspace, load: Load) -> Floats:
    """Coordinates (frames, m)."""
    times = STEP * np.arange(FRAMES + 1)
    return superposition(space, load.rayleigh, lambda t: np.interp(t, times, load.loads), times)[0]


def energy_norms(stiffness: Floats, coordinates: Floats) -> Floats:
    """Of each frame, by the products of vectors in the stiffness."""
    squares = np.einsum("ti,ij,tj->t", coordinates, stiffness, coordinates)
    return np.sqrt(np.maximum(squares, 0.0))


def both(body: Body, space: Subspace, subspace: Subspace) -> Floats:
    """Products in the stiffness of the vectors of one and, with minus, of the other."""
    pushed = np.column_stack([body.stiffness @ v for v in subspace.vectors.T])
    across = -space.vectors.T @ pushed
    return np.block([[space.stiffness, across], [across.T, subspace.stiffness]])


def lengths(at_tool: Floats, vectors: Floats, coordinates: Floats) -> Floats:
    """Of each frame's displacement [m] at the tool, by the weights of its nodes."""
    shapes = np.einsum("n,ndm->dm", at_tool, vectors.reshape(len(at_tool), 3, -1))
    return np.linalg.norm(coordinates @ shapes.T, axis=1)


def rows() -> Iterator[Row]:
    """By load, subspace and certificate."""
    scene = read_scene("liver")
    ready = next(iter(models(scene, {}))).prepare(problem_of(scene))
    body, probes = ready.body, evaluation(ready.body, ready.problem.observation.probes)
    whole, space = ritz_subspace(body, max(VECTORS)), krylov_space(body, by_factors(body), TRUTH)
    lowest = float(np.linalg.eigvalsh(space.stiffness)[0])
    compared = {k: comparison(body, lowest, k) for k in CERTIFICATES}
    certificates = {
        (m, k): one.certificate(whole.leading(m), probes)
        for m in VECTORS
        for k, one in compared.items()
    }
    for load in cases(ready.model.damping):
        truth = ReferenceSolution(space, moved(space, load), moved(space.leading(TRUTH // 2), load))
        for m in VECTORS:
            given = {k: certificates[m, k] for k in CERTIFICATES}
            yield from _rows(body, probes.toarray()[0], load, truth, whole.leading(m), given)


def _rows(
    body: Body,
    at_tool: Floats,
    load: Load,
    truth: ReferenceSolution,
    subspace: Subspace,
    certificates: dict[int, Certificate],
) -> Iterator[Row]:
    own, space = moved(subspace, load), truth.space
    off = np.column_stack([truth.whole, own])
    apart = np.column_stack([space.vectors, -subspace.vectors])
    change = truth.whole.copy()
    change[:, : truth.half.shape[1]] -= truth.half
    largest = energy_norms(space.stiffness, truth.whole).max()
    farthest = lengths(at_tool, space.vectors, truth.whole).max()
    error = energy_norms(both(body, space, subspace), off).max() / largest
    by_half = energy_norms(space.stiffness, change).max() / largest
    at = lengths(at_tool, apart, off).max() / farthest
    kind = (load.damping, load.rayleigh.mass, load.rayleigh.stiffness, load.name)
    for count, given in certificates.items():
        energy, tool = bounds(given, load)
        found = (error, by_half, energy / largest, at, tool / farthest)
        yield Row(*kind, subspace.load.size, count, *(float(f"{x:.3g}") for x in found))


def bounds(given: Certificate, load: Load) -> tuple[float, float]:
    """Largest of the energy norm and at the first control point [m]."""
    times = STEP * np.arange(FRAMES + 1)
    motion = CertifiedMotion(given, load.rayleigh, lambda t: np.interp(t, times, load.loads), STEP)
    energy = tool = 0.0
    for _ in range(FRAMES):
        motion.take_step()
        energy = max(energy, motion.bound.energy)
        tool = max(tool, float(motion.bound.displacement[0]))
    return energy, tool


def main() -> None:
    """Write the table."""
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Row._fields)
        writer.writerows(rows())


if __name__ == "__main__":
    main()
