"""Motion and equilibrium of a neo-Hookean body in contact with moving rigid tools, at large strain.

Time integration is by the stiffly accurate, singly diagonally implicit Runge-Kutta method of two
stages and order 2: Alexander (1977), SIAM J. Numer. Anal. 14:1006. Each stage ends with contact
forces that satisfy the contact conditions, and damps frequencies that the step does not resolve,
such as those excited by an impact. A step without an equilibrium is halved; where the shortest
fails too, the motion ends and reports the time.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.contact.equilibrium import (
    ContactBody,
    ContactState,
    EquilibriumSolver,
    Increment,
    NoEquilibriumError,
)
from fem_reference.contact.kinematics import Configuration, FiniteContact, PreviousState
from fem_reference.contact.patch import Patch, on_free_nodes, patch
from fem_reference.elasticity import Body
from fem_reference.hyperelasticity import largest_log_strain
from fem_reference.mixed_strain import on_nodes, relieved
from fem_reference.observation import at_points
from fem_reference.recording import Recorder
from fem_reference.unloading import unload
from study.numerics.factors import symmetric_factors
from study.problem.damping import RayleighDamping
from study.problem.rigid import PLATE, PUNCH, RigidTool
from study.problem.tissue import Tissue
from study.problem.trajectory import Observation, Trajectory
from study.problem.unfinished import UnfinishedError

Floats = NDArray[np.float64]
Factors = Callable[[Floats], Floats]
Advance = Callable[[float], None]

GAMMA = 1.0 - np.sqrt(0.5)
POINTWISE = 4.0
"""Part of lambda that acts at each integration point, over the shear modulus: enough to prevent
local collapse, too little to lock, as that of a Poisson ratio of 0.4."""
HALVINGS = 6
"""How often a step, or an increment of a static path, may be halved."""
MARGIN = 0.5
"""Margin of the patch around a tool, relative to its radius, for a plate to its travel."""
WAY = 8
"""Static increments on the path of tools with friction or an edge."""
LOOKS, MOST_LOOKS = 32, 1000
"""Least and largest number of positions of a tool on its path at which the patch is determined."""
SHORTLY = 1e-3
"""Interval, relative to a stage, over which the velocity of a tool at its end is measured."""
FARTHEST = 0.5
"""Largest travel of a tool in a step, relative to its radius, so that it cannot pass a surface."""


def contact_body(
    body: Body, tissue: Tissue, tools: Sequence[RigidTool], times: Floats
) -> ContactBody:
    """The stress-free body with the surface that tools may touch on their paths at times [s].

    ValueError for a tool that touches nothing or moves too fast, or a Poisson ratio without a mixed
    formulation.
    """
    mixed = on_nodes(body.nodes, tissue, body.support, body.composition)
    solid = replace(mixed, pointwise=np.minimum(POINTWISE * mixed.shear, 0.5 * mixed.lame))
    patches = [_patch(body, one, times) for one in tools]
    free = np.ones(solid.size + solid.pressures, dtype=np.bool_)
    if body.fixed is not None:
        free[: solid.size] = ~body.fixed
    contact = FiniteContact(tuple(patches), solid.size)
    return ContactBody(solid, contact, body.mass, free, np.zeros(solid.size))


def _patch(body: Body, tool: RigidTool, times: Floats) -> Patch:
    """The patch of a tool; that of a punch is wider, as tissue may be drawn under it."""
    wide = tool
    if tool.shape == PUNCH and not tool.bonded:
        wide = replace(tool, radius=(1.0 + MARGIN) * tool.radius)
    found = patch(body, wide, _looked(tool, times), _margin(tool, times))
    return replace(on_free_nodes(found, body.fixed), tool=tool)


def _looked(tool: RigidTool, times: Floats) -> Floats:
    """Times [s] between which a tool moves by a share of its radius at most."""
    way = np.linalg.norm(np.diff(tool.travel(times), axis=0), axis=1).sum()
    count = LOOKS if tool.shape == PLATE else max(LOOKS, int(way / (FARTHEST * tool.radius)))
    return np.linspace(times[0], times[-1], min(count, MOST_LOOKS) + 1)


def _margin(tool: RigidTool, times: Floats) -> float:
    if tool.shape != PLATE:
        return MARGIN * tool.radius
    return MARGIN * float(np.linalg.norm(tool.travel(times), axis=1).max())


def linear_rest(body: Body, tissue: Tissue) -> Floats:
    """Static displacement [m] (n,) under all loads in full, without tools, at small strain.

    ValueError if the support does not hold the body.
    """
    bare = contact_body(body, tissue, (), np.zeros(1))
    load, w = np.zeros(len(bare.free)), np.zeros(len(bare.free))
    load[: bare.solid.size] = body.whole_load
    factors = symmetric_factors(csc_array(bare.solid.linear()[bare.free][:, bare.free]))
    if factors is None:
        raise ValueError("the stiffness is singular: the support does not hold the body")
    w[bare.free] = factors.solve(load[bare.free])
    return w[: bare.solid.size]


class MotionState(NamedTuple):
    """State at a time [s]: w, velocity v [m/s] (n,) and contact forces [N] (c,).

    `previous`: the state from which it was found, if any.
    """

    time: float
    w: Floats
    v: Floats
    force: Floats
    previous: PreviousState | None = None


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """A body under tools and a `load` [N] (n,) that depends on the time [s].

    `dead` [N] (n,): the constant part of the load; `damping_rate` [1/s]: damping over mass.
    """

    body: ContactBody
    load: Callable[[float], Floats]
    dead: Floats
    damping_rate: float

    @property
    def stress_free(self) -> ContactState:
        """The stress-free state without contact forces."""
        return ContactState(np.zeros(len(self.body.free)), np.zeros(len(self.body.contact.bonded)))

    def energy(self, state: MotionState) -> float:
        """Kinetic and strain energy [J]."""
        kinetic = 0.5 * float(state.v @ (self.body.mass @ state.v))
        return kinetic + self.body.solid.energy(state.w)

    def configuration(self, state: MotionState) -> Configuration:
        """Positions of body and tools in a state."""
        return self.body.contact.at(self.body.given(state.w), state.time, state.previous)

    def tool_forces(self, state: MotionState) -> Floats:
        """Force [N] (tools, 3) of the body on each tool."""
        return self.configuration(state).tool_forces(state.force)

    def as_previous(self, state: MotionState) -> PreviousState:
        """The state as the reference of the next one."""
        return PreviousState(self.body.given(state.w), state.time)


def contact_problem(
    body: Body,
    tissue: Tissue,
    tools: Sequence[RigidTool],
    damping: RayleighDamping,
    factors: Factors,
    times: Floats,
    borne: Floats | None = None,
) -> ContactProblem:
    """A body under tools and loads.

    `borne` [N] (n,): load under which the given shape is in equilibrium. ValueError as of
    `contact_body`, and for stiffness-proportional damping; UnfinishedError as of `unloaded`.
    """
    refuse(damping, tissue)
    free = contact_body(body, tissue, tools, times)
    dead = np.zeros(free.solid.size) if body.dead is None else body.dead
    if borne is not None:
        free, dead = unloaded(free, borne), dead + borne
    loads = body.loads

    def load(time: float) -> Floats:
        return np.asarray(dead + loads @ np.atleast_1d(factors(np.array([time]))[0]))

    return ContactProblem(free, load, dead, damping.mass)


def refuse(damping: RayleighDamping, tissue: Tissue) -> None:
    """ValueError for damping or tissue without a formulation at large strain."""
    if damping.stiffness > 0.0:
        raise ValueError(
            "damping.stiffness: at large strain damping goes by mass only; set it to 0, or leave "
            "hyperelastic out of models"
        )
    if not tissue.poisson_ratio > 0.0:
        raise ValueError(
            "tissue.poisson_ratio: 0 leaves elements with a pressure of their own undefined; "
            "enlarge it, or leave hyperelastic out of models"
        )


def unloaded(body: ContactBody, load: Floats) -> ContactBody:
    """The stress-free body that a load [N] (n,) deforms into the given shape.

    UnfinishedError if none is found (`fem_reference.unloading`).
    """
    found, n = unload(body.solid, load, body.free), body.solid.size
    if found.reached < 1.0:
        part = f", but for {100.0 * found.reached:.2g} % of the load" if found.reached else ""
        raise UnfinishedError(
            "gravity.given: no stress-free shape is found that gravity deforms into the given one"
            f"{part}",
            'reduce gravity.acceleration, or set gravity.given to "unloaded"',
        )
    return replace(body, solid=relieved(body.solid, found.back), origin=-found.back[:n])


class Integrator:
    """Time steps and static equilibria of a body in contact."""

    def __init__(self, problem: ContactProblem) -> None:
        self.problem, self.solver = problem, EquilibriumSolver(problem.body)

    def equilibrium(self, start: MotionState, time: float, load: Floats) -> MotionState:
        """The equilibrium at a time [s] under a load [N] (n,), from one before.

        Tools and load move there together, in increments. NoEquilibriumError if the path ends
        before.
        """
        begun = self.problem.body.solid.gradient(start.w)[: len(load)]
        begun -= self._contact_forces(start)

        def increment(share: float) -> Increment:
            at = start.time + share * (time - start.time)
            reference = self.problem.as_previous(now)
            return Increment(at, 0.0, begun + share * (load - begun), reference)

        share, goal, now = 0.0, 1.0, start
        scale = float(np.linalg.norm(load))
        while share < 1.0:
            try:
                self._refuse_long_travel(now.time, increment(goal).time)
                found = self._equilibrium(ContactState(now.w, now.force), increment(goal), scale)
            except NoEquilibriumError:
                goal = 0.5 * (share + goal)
                if goal - share < 0.5**HALVINGS:
                    raise
                continue
            asked = increment(goal)
            still = np.zeros_like(now.v)
            now = MotionState(asked.time, found.w, still, found.force, asked.previous)
            share, goal = goal, 1.0
        return now

    def _equilibrium(self, guess: ContactState, increment: Increment, scale: float) -> ContactState:
        """The equilibrium of an increment; NoEquilibriumError if a tool has passed through."""
        found, body = self.solver.solve(guess, increment, scale), self.problem.body
        if body.configuration(found.w, increment).passed_through:
            raise NoEquilibriumError("a tool has gone through the surface")
        return found

    def _contact_forces(self, state: MotionState) -> Floats:
        """Nodal forces [N] (n,) of the tools."""
        return np.asarray(self.problem.configuration(state).derivative.T @ state.force)

    def start(self) -> MotionState:
        """Equilibrium under the constant load, with the tools at their start."""
        problem, n = self.problem, self.problem.body.solid.size
        w = np.zeros(len(problem.body.free))
        w[:n] = problem.body.origin
        begun = MotionState(0.0, w, np.zeros(n), problem.stress_free.force)
        return self.equilibrium(begun, 0.0, problem.dead)

    def peak_equilibrium(self, time: float, load: Floats) -> MotionState:
        """Equilibrium with the tools at their places of a time [s], under a load [N] (n,).

        With friction, or a punch, the path there is followed in increments.
        """
        now, contact = self.start(), self.problem.body.contact
        edged = any(one.tool.shape == PUNCH for one in contact.patches)
        stations = WAY if contact.frictional or edged else 1
        begun = self.problem.dead
        for share in np.arange(1, stations + 1) / stations:
            now = self.equilibrium(now, share * time, begun + share * (load - begun))
        return now

    def march(self, start: MotionState, step: float) -> Iterator[MotionState]:
        """States one `step` [s] apart; NoEquilibriumError where the motion ends."""
        previous, now = start, start
        yield now
        for k in range(1, 2**62):
            goal = start.time + k * step
            previous, now = now, self._to(goal, now, previous, HALVINGS)
            yield now

    def _to(
        self, goal: float, now: MotionState, previous: MotionState, halvings: int
    ) -> MotionState:
        """One step to a time [s], or two of half the length if it fails."""
        try:
            self._refuse_long_travel(now.time, goal)
            return self._step(goal, now, previous)
        except NoEquilibriumError:
            if halvings == 0:
                raise
        middle = self._to(0.5 * (now.time + goal), now, previous, halvings - 1)
        return self._to(goal, middle, now, halvings - 1)

    def _refuse_long_travel(self, begun: float, time: float) -> None:
        """NoEquilibriumError for a tool that moves too far in one step."""
        for tool in (one.tool for one in self.problem.body.contact.patches):
            away = np.linalg.norm(np.diff(tool.travel(np.array([begun, time])), axis=0))
            if tool.shape != PLATE and away > FARTHEST * tool.radius:
                raise NoEquilibriumError("a tool moves too far in a step")

    def _step(self, goal: float, now: MotionState, previous: MotionState) -> MotionState:
        step = goal - now.time
        length, n = GAMMA * step, self.problem.body.solid.size
        guess = self._extrapolated(previous, now, now.time + length)
        reference = self.problem.as_previous(now)
        first = self._stage(now.time + length, length, now.w[:n], now.v, guess, reference)
        acceleration = (first.v - now.v) / length
        rest = step - length
        guess = self._extrapolated(now, first, goal)
        base = now.w[:n] + rest * first.v
        reference = self.problem.as_previous(first)
        last = self._stage(goal, length, base, now.v + rest * acceleration, guess, reference)
        state, increment = ContactState(last.w, last.force), Increment(goal, 0.0, base, reference)
        v = self.solver.compatible_velocity(state, last.v, increment, goal - SHORTLY * length)
        return last._replace(v=v)

    def _stage(
        self,
        time: float,
        length: float,
        place: Floats,
        speed: Floats,
        guess: ContactState,
        previous: PreviousState,
    ) -> MotionState:
        """The state at the end of a stage of a `length` [s], from its start values and a guess."""
        body, n = self.problem.body, self.problem.body.solid.size
        inertia = 1.0 / length**2 + self.problem.damping_rate / length
        given = self.problem.load(time)
        load = given + body.mass @ (inertia * place + speed / length)
        scale = float(np.linalg.norm(given))
        found = self._equilibrium(guess, Increment(time, inertia, load, previous), scale)
        return MotionState(time, found.w, (found.w[:n] - place) / length, found.force, previous)

    def _extrapolated(self, previous: MotionState, now: MotionState, time: float) -> ContactState:
        """Linear extrapolation of two states to a time [s], with the contact forces of the last.

        The last state itself if elements of the extrapolation are inverted: tissue drawn under the
        edge of a punch moves at once, by as much in a short step as in a long one.
        """
        last = ContactState(now.w, now.force)
        if now.time <= previous.time:
            return last
        share = (time - now.time) / (now.time - previous.time)
        w = now.w + share * (now.w - previous.w)
        inverted = self.problem.body.solid.volume_ratio(w).min() <= 0.0
        return last if inverted else last._replace(w=w)


@dataclass(frozen=True, eq=False)
class LargeSolution:
    """A motion with its cost: numbers of Newton `iterations` and `factorisations`, `wall` [s].

    `states` at the samples that were reached. `largest_strain`: largest absolute principal
    logarithmic strain in the recorded frames, `smallest_volume`: smallest J there. `penetration`
    [m]: largest penetration of a contact point at a sample, `overlooked` [m]: of the surface
    outside the patches in the recorded frames. `vertices`: number that tools may touch.
    """

    trajectory: Trajectory
    states: tuple[MotionState, ...]
    step: float
    steps: int
    iterations: int
    factorisations: int
    largest_strain: float
    smallest_volume: float
    penetration: float
    overlooked: float
    vertices: int
    wall: float


def run(
    body: Body,
    problem: ContactProblem,
    observation: Observation,
    per_sample: int,
    advance: Advance = lambda _: None,
) -> LargeSolution:
    """Motion from rest under loads and tools, with `per_sample` steps between samples."""
    started, times = clock.perf_counter(), observation.times
    recorder = Recorder(body, observation, None, len(problem.body.contact.patches))
    step = float(times[1] - times[0]) / per_sample
    steps, states = Integrator(problem), list[MotionState]()
    lost: float | None = None
    try:
        for n, state in enumerate(steps.march(steps.start(), step)):
            if n % per_sample == 0:
                _record(recorder, problem, len(states), state)
                states.append(state)
                advance(len(states) / len(times))
            if len(states) == len(times):
                break
    except NoEquilibriumError:
        lost = float(times[len(states)])
    trajectory = recorder.trajectory
    if lost is not None:
        trajectory = replace(trajectory, status="diverged", ended_at=lost)
    kept = [states[k] for k in set(observation.frames) if k < len(states)]
    gradients = [problem.body.solid.deformation(one.w) for one in kept]
    contact, given = problem.body.contact, problem.body.given
    deepest = max((problem.configuration(one).penetration for one in states), default=0.0)
    return LargeSolution(
        trajectory,
        tuple(states),
        step,
        (len(times) - 1) * per_sample,
        steps.solver.iterations,
        steps.solver.factorisations,
        max(map(largest_log_strain, gradients), default=0.0),
        min((float(np.linalg.det(F).min()) for F in gradients), default=1.0),
        deepest,
        max(
            (_unseen_penetration(body, contact, given(one.w), one.time) for one in kept),
            default=0.0,
        ),
        sum(one.count for one in contact.patches),
        clock.perf_counter() - started,
    )


def _record(recorder: Recorder, problem: ContactProblem, sample: int, state: MotionState) -> None:
    u = problem.body.given(state.w)
    points = recorder.at_probes
    recorder.motion(sample, at_points(points, u), at_points(points, state.v))
    recorder.trajectory.tool_force[sample] = problem.tool_forces(state)
    recorder.field(sample, u)


def _unseen_penetration(body: Body, contact: FiniteContact, u: Floats, time: float) -> float:
    """Largest penetration [m] of surface nodes outside the patches into a tool not bonded."""
    boundary = body.nodes.get_dofs(body.nodes.mesh.boundary_facets()).flatten()  # scikit-fem's
    deepest = 0.0
    for one, seen in zip(contact.patches, contact.nodes, strict=True):
        if not one.tool.bonded:
            others = np.setdiff1d(boundary, seen)
            moved = (body.points + u.reshape(-1, 3))[others]
            deepest = max(deepest, -float(one.tool.gap(moved, time)[0].min(initial=np.inf)))
    return deepest
