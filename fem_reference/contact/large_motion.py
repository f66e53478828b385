"""Motion and rest of a neo-Hookean body under rigid tools that are moved, at large strain.

The motion is stepped by the stiffly accurate diagonally implicit Runge-Kutta method of two stages
and second order: Alexander (1977), SIAM J. Numer. Anal. 14:1006. Each stage ends with forces that
keep the vertices out of the tools, and damps what the step cannot follow, so that what an impact
sets ringing does not last. A step for which no balance is found is halved; where the shortest fails
too, the motion ends and says when.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from fem_reference.contact.balance import (
    Balance,
    Balanced,
    Demand,
    TouchedBody,
    UnbalancedError,
)
from fem_reference.contact.finite import Before, Configuration, FiniteContact
from fem_reference.contact.patch import Patch, patch
from fem_reference.direct import symmetric_factors
from fem_reference.elasticity import Body
from fem_reference.hyperelasticity import largest_log_strain
from fem_reference.mixed_strain import on_nodes, relieved
from fem_reference.observation import at_points
from fem_reference.recording import Recorder
from fem_reference.unloading import unload
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
"""Of the shear modulus, the part of lambda [Pa] that keeps each point from collapse: too little to
lock, as that of a Poisson ratio of 0.4."""
HALVINGS = 6
"""How often a step, or an increment of a way, may be halved."""
MARGIN = 0.5
"""Round what a tool would meet of the surface at rest, over its radius, of a plate its travel."""
WAY = 8
"""Stations on the way of tools with friction or an edge to a rest."""
LOOKS, MOST_LOOKS = 32, 1000
"""Places of a tool on its way at which the surface is looked at."""
SHORTLY = 1e-3
"""Of a stage's length, over which the speed of a tool at its end is seen."""
FARTHEST = 0.5
"""Share of its radius that a tool may move in a step: it must not pass through a surface unseen."""


def touched(body: Body, tissue: Tissue, tools: Sequence[RigidTool], times: Floats) -> TouchedBody:
    """A body without stress, where tools may touch it on their way at times [s].

    ValueError for a tool that meets nothing or cannot be followed, or a Poisson ratio at which no
    pressure carries the volume.
    """
    mixed = on_nodes(body.nodes, tissue, body.support, body.composition)
    solid = replace(mixed, pointwise=np.minimum(POINTWISE * mixed.shear, 0.5 * mixed.lame))
    patches = [_patch(body, one, times) for one in tools]
    free = np.ones(solid.size + solid.pressures, dtype=np.bool_)
    if body.fixed is not None:
        free[: solid.size] = ~body.fixed
    contact = FiniteContact(tuple(patches), solid.size)
    return TouchedBody(solid, contact, body.mass, free, np.zeros(solid.size))


def _patch(body: Body, tool: RigidTool, times: Floats) -> Patch:
    """What a tool may touch, of a punch also what is round it, which may be drawn under it."""
    wide = tool
    if tool.shape == PUNCH and not tool.bonded:
        wide = replace(tool, radius=(1.0 + MARGIN) * tool.radius)
    found = patch(body, wide, _looked(tool, times), _margin(tool, times))
    return replace(found, tool=tool)


def _looked(tool: RigidTool, times: Floats) -> Floats:
    """Times [s] between which a tool moves by no more than a share of its radius."""
    way = np.linalg.norm(np.diff(tool.travel(times), axis=0), axis=1).sum()
    count = LOOKS if tool.shape == PLATE else max(LOOKS, int(way / (FARTHEST * tool.radius)))
    return np.linspace(times[0], times[-1], min(count, MOST_LOOKS) + 1)


def _margin(tool: RigidTool, times: Floats) -> float:
    if tool.shape != PLATE:
        return MARGIN * tool.radius
    return MARGIN * float(np.linalg.norm(tool.travel(times), axis=1).max())


def linear_rest(body: Body, tissue: Tissue) -> Floats:
    """Displacement [m] (n,) at rest under all loads in full, if it were small and no tool there.

    ValueError if nothing holds the body.
    """
    bare = touched(body, tissue, (), np.zeros(1))
    load, w = np.zeros(len(bare.free)), np.zeros(len(bare.free))
    load[: bare.solid.size] = body.whole_load
    factors = symmetric_factors(csc_array(bare.solid.linear()[bare.free][:, bare.free]))
    if factors is None:
        raise ValueError("the stiffness is singular: the support does not hold the body")
    w[bare.free] = factors.solve(load[bare.free])
    return w[: bare.solid.size]


class Moving(NamedTuple):
    """State at a time [s]: w, velocity v [m/s] (n,) and forces [N] (c,) under the tools.

    `before`: the state from which it was found, if any.
    """

    time: float
    w: Floats
    v: Floats
    force: Floats
    before: Before | None = None


@dataclass(frozen=True, eq=False)
class Pressed:
    """A body under tools, with all else that acts on it: `load` [N] (n,) at a time [s].

    `dead` [N] (n,) is the part of it that acts at all times; `drag` [1/s]: damping over mass.
    """

    body: TouchedBody
    load: Callable[[float], Floats]
    dead: Floats
    drag: float

    @property
    def nothing(self) -> Balanced:
        """Without stress."""
        return Balanced(np.zeros(len(self.body.free)), np.zeros(len(self.body.contact.held)))

    def energy(self, state: Moving) -> float:
        """Kinetic and stored [J]."""
        kinetic = 0.5 * float(state.v @ (self.body.mass @ state.v))
        return kinetic + self.body.solid.energy(state.w)

    def met(self, state: Moving) -> Configuration:
        """Where the body and the tools are."""
        return self.body.contact.at(self.body.given(state.w), state.time, state.before)

    def on_tools(self, state: Moving) -> Floats:
        """Forces [N] (tools, 3)."""
        return self.met(state).on_tools(state.force)

    def since(self, state: Moving) -> Before:
        """The state, as that from which the next is found."""
        return Before(self.body.given(state.w), state.time)


def pressed(
    body: Body,
    tissue: Tissue,
    tools: Sequence[RigidTool],
    damping: RayleighDamping,
    factors: Factors,
    times: Floats,
    borne: Floats | None = None,
) -> Pressed:
    """A body under tools and loads; `borne` [N] (n,): forces at rest under which it is as given.

    ValueError as of `touched`, and for damping by stiffness; UnfinishedError as of `unloaded`.
    """
    refuse(damping, tissue)
    free = touched(body, tissue, tools, times)
    dead = np.zeros(free.solid.size) if body.dead is None else body.dead
    if borne is not None:
        free, dead = unloaded(free, borne), dead + borne
    loads = body.loads

    def load(time: float) -> Floats:
        return np.asarray(dead + loads @ np.atleast_1d(factors(np.array([time]))[0]))

    return Pressed(free, load, dead, damping.mass)


def refuse(damping: RayleighDamping, tissue: Tissue) -> None:
    """ValueError for damping or tissue that a motion at large strain cannot have."""
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


def unloaded(body: TouchedBody, load: Floats) -> TouchedBody:
    """The body without stress that a load [N] (n,) deforms into the given shape.

    UnfinishedError where none is found (`fem_reference.unloading`).
    """
    found, n = unload(body.solid, load, body.free), body.solid.size
    if found.reached < 1.0:
        part = f", but for {100.0 * found.reached:.2g} % of the load" if found.reached else ""
        raise UnfinishedError(
            "gravity.given: no shape without load is found from which the organ would sag into the "
            f"given one{part}",
            'reduce gravity.acceleration, or set gravity.given to "unloaded"',
        )
    return replace(body, solid=relieved(body.solid, found.back), origin=-found.back[:n])


class Steps:
    """Implicit steps of a body under tools."""

    def __init__(self, pressed: Pressed) -> None:
        self.pressed, self.balance = pressed, Balance(pressed.body)

    def at_rest(self, start: Moving, time: float, load: Floats) -> Moving:
        """The rest at a time [s] under a load [N] (n,), which grows from that of a rest before.

        The tools are brought there on their way. UnbalancedError where the way ends before.
        """
        begun = self.pressed.body.solid.gradient(start.w)[: len(load)]
        begun -= self._pushes(start)

        def demand(share: float) -> Demand:
            at = start.time + share * (time - start.time)
            since = self.pressed.since(now)
            return Demand(at, 0.0, begun + share * (load - begun), since)

        share, goal, now = 0.0, 1.0, start
        scale = float(np.linalg.norm(load))
        while share < 1.0:
            try:
                self._refuse_far(now.time, demand(goal).time)
                found = self._kept_out(Balanced(now.w, now.force), demand(goal), scale)
            except UnbalancedError:
                goal = 0.5 * (share + goal)
                if goal - share < 0.5**HALVINGS:
                    raise
                continue
            asked = demand(goal)
            still = np.zeros_like(now.v)
            now = Moving(asked.time, found.w, still, found.force, asked.before)
            share, goal = goal, 1.0
        return now

    def _kept_out(self, guess: Balanced, demand: Demand, scale: float) -> Balanced:
        """The state that balances; an UnbalancedError if a tool has gone through the surface."""
        found, body = self.balance.found(guess, demand, scale), self.pressed.body
        if body.met(found.w, demand).through:
            raise UnbalancedError("a tool has gone through the surface")
        return found

    def _pushes(self, state: Moving) -> Floats:
        """Nodal forces [N] (n,) of the tools."""
        return np.asarray(self.pressed.met(state).derivative.T @ state.force)

    def start(self) -> Moving:
        """At rest under what acts at all times, with the tools where they start."""
        pressed, n = self.pressed, self.pressed.body.solid.size
        w = np.zeros(len(pressed.body.free))
        w[:n] = pressed.body.origin
        begun = Moving(0.0, w, np.zeros(n), pressed.nothing.force)
        return self.at_rest(begun, 0.0, pressed.dead)

    def peak(self, time: float, load: Floats) -> Moving:
        """At rest with the tools where they are at a time [s], under a load [N] (n,).

        What rubs, or has an edge, is followed there by stations on its way.
        """
        now, contact = self.start(), self.pressed.body.contact
        edged = any(one.tool.shape == PUNCH for one in contact.patches)
        stations = WAY if contact.rubs or edged else 1
        begun = self.pressed.dead
        for share in np.arange(1, stations + 1) / stations:
            now = self.at_rest(now, share * time, begun + share * (load - begun))
        return now

    def march(self, start: Moving, step: float) -> Iterator[Moving]:
        """States from a start on, a step [s] apart; ends with an UnbalancedError if it must."""
        before, now = start, start
        yield now
        for k in range(1, 2**62):
            goal = start.time + k * step
            before, now = now, self._to(goal, now, before, HALVINGS)
            yield now

    def _to(self, goal: float, now: Moving, before: Moving, halvings: int) -> Moving:
        """One step to a time [s], or where it fails two of half the length."""
        try:
            self._refuse_far(now.time, goal)
            return self._step(goal, now, before)
        except UnbalancedError:
            if halvings == 0:
                raise
        middle = self._to(0.5 * (now.time + goal), now, before, halvings - 1)
        return self._to(goal, middle, now, halvings - 1)

    def _refuse_far(self, begun: float, time: float) -> None:
        """UnbalancedError for a tool that moves too far at once."""
        for tool in (one.tool for one in self.pressed.body.contact.patches):
            away = np.linalg.norm(np.diff(tool.travel(np.array([begun, time])), axis=0))
            if tool.shape != PLATE and away > FARTHEST * tool.radius:
                raise UnbalancedError("a tool moves too far in a step")

    def _step(self, goal: float, now: Moving, before: Moving) -> Moving:
        step = goal - now.time
        length, n = GAMMA * step, self.pressed.body.solid.size
        guess = self._onward(before, now, now.time + length)
        since = self.pressed.since(now)
        first = self._stage(now.time + length, length, now.w[:n], now.v, guess, since)
        acceleration = (first.v - now.v) / length
        rest = step - length
        guess = self._onward(now, first, goal)
        base = now.w[:n] + rest * first.v
        since = self.pressed.since(first)
        last = self._stage(goal, length, base, now.v + rest * acceleration, guess, since)
        state, demand = Balanced(last.w, last.force), Demand(goal, 0.0, base, since)
        v = self.balance.in_touch(state, last.v, demand, goal - SHORTLY * length)
        return last._replace(v=v)

    def _stage(
        self,
        time: float,
        length: float,
        place: Floats,
        speed: Floats,
        guess: Balanced,
        since: Before,
    ) -> Moving:
        """The state at the end of a stage [s], from what it starts from and a guess."""
        body, n = self.pressed.body, self.pressed.body.solid.size
        inertia = 1.0 / length**2 + self.pressed.drag / length
        given = self.pressed.load(time)
        load = given + body.mass @ (inertia * place + speed / length)
        scale = float(np.linalg.norm(given))
        found = self._kept_out(guess, Demand(time, inertia, load, since), scale)
        return Moving(time, found.w, (found.w[:n] - place) / length, found.force, since)

    def _onward(self, before: Moving, now: Moving, time: float) -> Balanced:
        """A guess at a time [s], on the line through two states.

        It is the later state where elements of the line are inside out: tissue that is drawn under
        the edge of a punch moves at once, by as much in a short step as in a long one.
        """
        last = Balanced(now.w, now.force)
        if now.time <= before.time:
            return last
        share = (time - now.time) / (now.time - before.time)
        w = now.w + share * (now.w - before.w)
        return last._replace(w=w) if self.pressed.body.solid.volume_ratio(w).min() > 0.0 else last


@dataclass(frozen=True, eq=False)
class LargeSolution:
    """A motion and what it took: `iterations` of Newton's method, and how often it `factored`.

    `states` at the samples, as many as were reached. `largest_strain`: largest absolute principal
    logarithmic strain in the kept frames, `smallest_volume`: smallest J there. `penetration` [m]:
    how deep any point of the surface was inside a tool at a sample, and `overlooked` [m]: of what
    no patch sees; `vertices` that tools may touch; `wall` [s].
    """

    trajectory: Trajectory
    states: tuple[Moving, ...]
    step: float
    steps: int
    iterations: int
    factored: int
    largest_strain: float
    smallest_volume: float
    penetration: float
    overlooked: float
    vertices: int
    wall: float


def run(
    body: Body,
    pressed: Pressed,
    observation: Observation,
    per_sample: int,
    advance: Advance = lambda _: None,
) -> LargeSolution:
    """Motion from rest under loads and tools, by so many steps from sample to sample."""
    started, times = clock.perf_counter(), observation.times
    recorder = Recorder(body, observation, None, len(pressed.body.contact.patches))
    step = float(times[1] - times[0]) / per_sample
    steps, states = Steps(pressed), list[Moving]()
    lost: float | None = None
    try:
        for n, state in enumerate(steps.march(steps.start(), step)):
            if n % per_sample == 0:
                _record(recorder, pressed, len(states), state)
                states.append(state)
                advance(len(states) / len(times))
            if len(states) == len(times):
                break
    except UnbalancedError:
        lost = float(times[len(states)])
    trajectory = recorder.trajectory
    if lost is not None:
        trajectory = replace(trajectory, status="diverged", ended_at=lost)
    kept = [states[k] for k in set(observation.frames) if k < len(states)]
    gradients = [pressed.body.solid.deformation(one.w) for one in kept]
    contact, given = pressed.body.contact, pressed.body.given
    deepest = max((pressed.met(one).penetration for one in states), default=0.0)
    return LargeSolution(
        trajectory,
        tuple(states),
        step,
        (len(times) - 1) * per_sample,
        steps.balance.iterations,
        steps.balance.factored,
        max(map(largest_log_strain, gradients), default=0.0),
        min((float(np.linalg.det(F).min()) for F in gradients), default=1.0),
        deepest,
        max((_beside(body, contact, given(one.w), one.time) for one in kept), default=0.0),
        sum(one.count for one in contact.patches),
        clock.perf_counter() - started,
    )


def _record(recorder: Recorder, pressed: Pressed, sample: int, state: Moving) -> None:
    u = pressed.body.given(state.w)
    points = recorder.at_probes
    recorder.motion(sample, at_points(points, u), at_points(points, state.v))
    recorder.trajectory.tool_force[sample] = pressed.on_tools(state)
    recorder.field(sample, u)


def _beside(body: Body, contact: FiniteContact, u: Floats, time: float) -> float:
    """How deep [m] surface nodes that no patch sees are inside a tool that slides."""
    boundary = body.nodes.get_dofs(body.nodes.mesh.boundary_facets()).flatten()  # scikit-fem's
    deepest = 0.0
    for one, seen in zip(contact.patches, contact.nodes, strict=True):
        if not one.tool.bonded:
            others = np.setdiff1d(boundary, seen)
            moved = (body.points + u.reshape(-1, 3))[others]
            deepest = max(deepest, -float(one.tool.gap(moved, time)[0].min(initial=np.inf)))
    return deepest
