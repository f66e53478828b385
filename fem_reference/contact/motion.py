"""Motion of a linear elastic body in contact with rigid tools of prescribed motion.

Modes too fast for the sampling respond statically; their vibration would make the contact forces
oscillate at every step. The others are integrated by the stiffly accurate, singly diagonally
implicit Runge-Kutta method of two stages and order 2: Alexander (1977), SIAM J. Numer. Anal.
14:1006. Each stage ends with contact forces that satisfy the contact conditions, and damps
frequencies that the step does not resolve.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fem_reference.contact.linear import ContactNotConvergedError, ContactSolution, SurfaceResponse
from fem_reference.contact.outcome import ContactOutcome
from fem_reference.contact.reduction import (
    ContactResponse,
    Factors,
    ReducedBody,
    contact_response,
    krylov,
    reduced,
)
from fem_reference.direct import Solve
from fem_reference.elasticity import Body
from fem_reference.model import Advance, Method, Solution, start_of
from fem_reference.recording import Recorder
from fem_reference.subspace import Subspace
from fem_reference.superposition import GOOD, CurveChange, ProbeCurves, curve_change, fewer
from study.problem.damping import RayleighDamping
from study.problem.rigid import RigidTool
from study.problem.trajectory import Observation, Trajectory

Floats = NDArray[np.float64]

GAMMA = 1.0 - np.sqrt(0.5)
ORDER = 2
OWN_STEPS = 200
"""Least number of steps of a motion: contact forces are less smooth than displacements."""
GENERATIONS, MOST_GENERATIONS = 5, 15
WAY = 9
"""Positions on the path to the peak at which the static contact problem is solved."""
LESS = 0.75
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class MotionState:
    """State at a time [s].

    `q`, `v` (m,): modal displacement and velocity; `r`, `s` (c + k,): contact forces [N] and load
    factors as delayed by damping in the static residuals, and their rates [N/s, 1/s]; `solution`:
    contact forces.
    """

    time: float
    q: Floats
    v: Floats
    r: Floats
    s: Floats
    solution: ContactSolution


class Stages:
    """Implicit stages of a reduced body, all of the same `length` [s].

    `base` [m] (n,): static displacement without tools.
    """

    def __init__(
        self,
        given: ContactResponse,
        body: ReducedBody,
        damping: RayleighDamping,
        factors: Factors,
        base: Floats,
        length: float,
    ) -> None:
        self.given, self.body, self.factors, self.length = given, body, factors, length
        unknowns = given.contact.unknowns
        self.base, self.shapes = base[unknowns], body.shapes[unknowns]
        self.residual = body.residual[unknowns]
        self.damped = 1.0 / (
            1.0
            + length * (damping.mass + damping.stiffness * body.squares)
            + length**2 * body.squares
        )
        self.delay = damping.stiffness / (damping.stiffness + length)
        influence = (self.shapes * (length**2 * self.damped)) @ body.contact_modes.T
        self.under_tools = len(body.contact_modes)
        self.influence = influence + (1.0 - self.delay) * self.residual[:, : self.under_tools]
        compliance = np.asarray(given.contact.means @ self.influence)
        self.compliance = 0.5 * (compliance + compliance.T)

    def loaded(self, time: float) -> Floats:
        """Factors (k,) of the loads at a time [s]."""
        return np.atleast_1d(self.factors(np.array([time]))[0])

    def reached(
        self, time: float, q: Floats, v: Floats, r: Floats, solution: ContactSolution
    ) -> MotionState:
        """State at the end of a stage at a time [s], from its start values and the last forces."""
        body, length, count = self.body, self.length, self.under_tools
        loaded = self.loaded(time)
        free = (v + length * (body.loads @ loaded - body.squares * q)) * self.damped
        delayed = self.delay * r
        delayed[count:] += (1.0 - self.delay) * loaded
        base = self.base + self.shapes @ (q + length * free) + self.residual @ delayed
        response = SurfaceResponse(base, self.influence, self.compliance)
        found = self.given.contact.solve(response, solution, time)
        speed = free + length * self.damped * (body.contact_modes.T @ found.force)
        delayed[:count] += (1.0 - self.delay) * found.force
        rate = (delayed - r) / length
        return MotionState(time, q + length * speed, speed, delayed, rate, found)


def march(stages: Stages, start: MotionState, step: float) -> Iterator[MotionState]:
    """States from a start at rest, one `step` [s] apart."""
    now = start
    yield now
    for n in range(1, 2**62):
        begun = (n - 1) * step
        first = stages.reached(begun + GAMMA * step, now.q, now.v, now.r, now.solution)
        rest = (1.0 - GAMMA) * step
        acceleration = (first.v - now.v) / stages.length
        now = stages.reached(
            n * step,
            now.q + rest * first.v,
            now.v + rest * acceleration,
            now.r + rest * first.s,
            first.solution,
        )
        yield now


@dataclass(frozen=True, eq=False)
class Sampled:
    """States at the samples, and the time [s] at which contact did not converge, if any."""

    states: tuple[MotionState, ...]
    not_converged_at: float | None

    def curves(self, body: ReducedBody, recorder: Recorder) -> ProbeCurves:
        """Displacement and velocity of the control points."""
        matrix = recorder.at_probes
        modes, residuals = (_seen(matrix, one) for one in (body.shapes, body.residual))
        pairs = [((one.q, one.r), (one.v, one.s)) for one in self.states]
        curves = [
            np.array([modes @ a + residuals @ b for a, b in (pair[k] for pair in pairs)])
            for k in range(2)
        ]
        return ProbeCurves(*curves)

    def forces(self, given: ContactResponse) -> Floats:
        """Forces [N] (samples, tools, 3) on the tools."""
        return np.array([given.contact.tool_forces(one.solution.force) for one in self.states])


def _seen(matrix: csr_array, vectors: Floats) -> Floats:
    """Vectors (n, m) at the control points, (p, 3, m)."""
    count = vectors.shape[1]
    nodal = vectors.reshape(-1, 3 * count)
    return np.asarray(matrix @ nodal).reshape(-1, 3, count)


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """A motion in contact: body, damping, load factors, static displacement, samples and steps."""

    given: ContactResponse
    damping: RayleighDamping
    factors: Factors
    base: Floats
    times: Floats
    per_sample: int

    @property
    def step(self) -> float:
        """Time step [s]."""
        return float(self.times[1] - self.times[0]) / self.per_sample

    @property
    def highest(self) -> float:
        """Nyquist angular frequency [1/s] of the samples."""
        return float(np.pi / (self.times[1] - self.times[0]))

    def start(self, body: ReducedBody) -> MotionState:
        """Equilibrium under the dead load with the tools at their start."""
        solution = self.given.at_rest(self.base, self.given.free, np.zeros(1))
        q = (body.contact_modes.T @ solution.force) / body.squares
        delayed = np.append(solution.force, np.zeros(self.given.body.loads.shape[1]))
        return MotionState(0.0, q, np.zeros_like(q), delayed, np.zeros_like(delayed), solution)

    def stages(self, body: ReducedBody) -> Stages:
        """The implicit stages of this motion."""
        length = GAMMA * self.step
        return Stages(self.given, body, self.damping, self.factors, self.base, length)

    def sampled(self, body: ReducedBody, advance: Advance) -> Sampled:
        """States of the motion in a reduced basis at the samples."""
        states: list[MotionState] = []
        count = len(self.times)
        steps = march(self.stages(body), self.start(body), self.step)
        try:
            for n, state in enumerate(islice(steps, (count - 1) * self.per_sample + 1)):
                if n % self.per_sample == 0:
                    states.append(state)
                    advance(len(states) / count)
        except ContactNotConvergedError:
            return Sampled(tuple(states), float(self.times[len(states)]))
        return Sampled(tuple(states), None)


def run(
    body: Body,
    tools: tuple[RigidTool, ...],
    damping: RayleighDamping,
    factors: Factors,
    observation: Observation,
    method: Method,
    advance: Advance = lambda _: None,
) -> Solution:
    """Motion from rest under loads and tools of prescribed motion, with the tool forces.

    ValueError for a tool that touches nothing.
    """
    started = clock.perf_counter()
    start, times = start_of(body), observation.times
    recorder = Recorder(body, observation, start, len(tools))
    base = recorder.start
    peak = float(times[observation.frames[0]])
    given = contact_response(body, tools, times, base, peak)
    problem = ContactProblem(given, damping, factors, base, times, steps_per_sample(method, times))
    chosen, found, change = _enough(problem, recorder, advance)
    outcome = _outcome(problem, chosen, found, change, _rest(problem, chosen, found, peak))
    _record(recorder, problem, chosen, found)
    sizes = body.node_count, len(body.mesh.tetrahedra), body.element
    steps = (len(times) - 1) * problem.per_sample
    return Solution(
        _trajectory(recorder, found),
        *sizes,
        problem.step,
        steps,
        clock.perf_counter() - started,
        recorder.strain,
        recorder.rotation,
        start=start,
        moving=lambda sample: _state(problem, chosen, found.states[sample]),
        contact=outcome,
    )


def steps_per_sample(method: Method, times: Floats) -> int:
    """Steps per sample as given by the method, by default for at least OWN_STEPS steps."""
    if method.steps_per_sample is not None:
        return method.steps_per_sample * method.times
    return -(-OWN_STEPS // (len(times) - 1)) * method.times


def _enough(
    problem: ContactProblem, recorder: Recorder, advance: Advance
) -> tuple[ReducedBody, Sampled, tuple[CurveChange, Floats]]:
    """The motion in a converged subspace, and its change by the last quarter of the vectors."""
    generations = GENERATIONS
    while True:
        space = krylov(problem.given, generations)
        whole = reduced(problem.given, space, problem.highest)
        found = problem.sampled(whole, advance)
        change = _change(problem, space, whole, found, recorder)
        good = change[0].displacement < GOOD and change[1].max(initial=0.0) < GOOD
        if good or generations >= MOST_GENERATIONS or found.not_converged_at is not None:
            return whole, found, change
        generations += GENERATIONS


def _change(
    problem: ContactProblem, space: Subspace, whole: ReducedBody, found: Sampled, recorder: Recorder
) -> tuple[CurveChange, Floats]:
    """Relative change of curves and tool forces by the last quarter of vectors and frequencies."""
    less = reduced(problem.given, space.leading(fewer(space.load.size)), LESS * problem.highest)
    other = problem.sampled(less, lambda _: None)
    count = min(len(found.states), len(other.states))
    curves = [
        ProbeCurves(*(curve[:count] for curve in one.curves(body, recorder)))
        for one, body in ((found, whole), (other, less))
    ]
    a, b = (one.forces(problem.given)[:count] for one in (found, other))
    sizes = np.maximum(np.linalg.norm(a, axis=(0, 2)), TINY)
    return curve_change(curves[0], curves[1]), np.linalg.norm(a - b, axis=(0, 2)) / sizes


def _state(problem: ContactProblem, body: ReducedBody, state: MotionState) -> tuple[Floats, Floats]:
    """Displacement from the given shape [m] and velocity [m/s] (n,) of all unknowns."""
    moved = problem.base + body.shapes @ state.q + body.residual @ state.r
    return moved, body.shapes @ state.v + body.residual @ state.s


def _record(recorder: Recorder, problem: ContactProblem, body: ReducedBody, found: Sampled) -> None:
    """Record the motion; strain also where a control point is farthest out."""
    curves = found.curves(body, recorder)
    for sample, (u, v) in enumerate(zip(*curves, strict=True)):
        recorder.motion(sample, u, v)
    forces = found.forces(problem.given)
    recorder.trajectory.tool_force[: len(forces)] = forces
    farthest = int(np.linalg.norm(curves.displacement, axis=2).max(axis=1).argmax())
    for sample in {*recorder.observation.frames, farthest}:
        if sample < len(found.states):
            u = _state(problem, body, found.states[sample])[0] - problem.base
            recorder.field(sample, u)
            recorder.look(u)


def _trajectory(recorder: Recorder, found: Sampled) -> Trajectory:
    if found.not_converged_at is None:
        return recorder.trajectory
    return replace(recorder.trajectory, status="diverged", ended_at=found.not_converged_at)


def _outcome(
    problem: ContactProblem,
    body: ReducedBody,
    found: Sampled,
    change: tuple[CurveChange, Floats],
    rest: PeakEquilibrium,
) -> ContactOutcome:
    contact, unknowns = problem.given.contact, problem.given.contact.unknowns
    deepest = max(
        contact.penetration(_state(problem, body, one)[0][unknowns], one.time)
        for one in found.states
    )
    vertices = sum(one.count for one in contact.patches)
    return ContactOutcome(
        vertices,
        body.size,
        *change,
        deepest,
        rest.displacement,
        rest.nodal_forces,
        found.not_converged_at,
    )


@dataclass(frozen=True, eq=False)
class PeakEquilibrium:
    """Static equilibrium with the tools at the peak and all loads in full.

    `displacement` [m] (n,); `nodal_forces` [N] (tools, n) of the tools; `forces` [N] (tools, 3) on
    the tools; `solve`: solver of the body.
    """

    displacement: Floats
    nodal_forces: Floats
    forces: Floats
    solve: Solve


def at_peak(body: Body, tools: tuple[RigidTool, ...], observation: Observation) -> PeakEquilibrium:
    """Static equilibrium of a body at the peak. ValueError for a tool that touches nothing."""
    base = Recorder(body, observation, start_of(body)).start
    peak = float(observation.times[observation.frames[0]])
    return _at_rest(contact_response(body, tools, observation.times, base, peak), base, peak)


def _at_rest(given: ContactResponse, base: Floats, peak: float) -> PeakEquilibrium:
    loaded, contact = base + _under_loads(given), given.contact
    way = np.linspace(0.0, peak, WAY) if peak > 0.0 else np.zeros(1)
    solution = given.at_rest(loaded, given.free, way)
    nodal_forces = []
    for part in contact.slices:
        own = np.zeros_like(solution.force)
        own[part] = solution.force[part]
        nodal_forces.append(contact.nodal_forces @ own)
    found = given.moved(loaded, solution)
    return PeakEquilibrium(
        found, np.array(nodal_forces), contact.tool_forces(solution.force), given.solve
    )


def _rest(
    problem: ContactProblem, body: ReducedBody, found: Sampled, peak: float
) -> PeakEquilibrium:
    """Equilibrium at the peak; without convergence, the state of the motion there or the last."""
    given, contact = problem.given, problem.given.contact
    try:
        return _at_rest(given, problem.base, peak)
    except ContactNotConvergedError:
        state = next((one for one in found.states if one.time >= peak), found.states[-1])
        nodal_forces = np.zeros((len(contact.patches), len(problem.base)))
        moved = _state(problem, body, state)[0]
        return PeakEquilibrium(
            moved, nodal_forces, contact.tool_forces(state.solution.force), given.solve
        )


def _under_loads(given: ContactResponse) -> Floats:
    """Static displacement [m] (n,) under all loads in full, without tools and dead load."""
    whole = given.body.full_load
    return given.solve(whole) if whole.any() else np.zeros_like(whole)
