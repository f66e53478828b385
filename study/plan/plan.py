"""What of a scene is modelled, derived from its requirements.

The choice is the cheapest candidate that is predicted to meet error, rate and memory: by its step
time if a rate is required, else by the time of the whole run. Without a required error it is the
most accurate. The choice is made before anything expensive runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from msm.timestep import whole_steps
from study.models.table import named
from study.plan import moved
from study.plan.candidates import Candidate, Omitted, candidates, lattice_name, resting
from study.plan.elements import elements
from study.plan.look import Look, look
from study.plan.motions import HISTORY, PEAK_FORCE, difference
from study.plan.moved import MovedLook
from study.plan.prediction import Foresight, Measure
from study.problem.problem import Problem
from study.scene import Require, Scene
from study.scene.problem import problem_of

FIELD = "field"
"""The required quantity that includes the whole organ."""
Alone = Callable[[], Mapping[str, Sequence[Candidate]]]
"""Makes candidates with their errors at single control points, by name."""

ESTIMATED_BY = {
    "tissue": "a lattice of twice the spacing",
    "corrected": "a lattice of half the spacing, and by meshes and vectors",
    "hyperelastic": "a coarser mesh and by longer steps",
}
"""How a run estimates its error, by its model."""
NOTHING_REQUIRED = (
    'the scene requires nothing; give it a table require, or for example --set require.error="5 %"'
)
"""Why a scene is run as it stands, and how it would be planned."""
NOTHING_OFFERED = (
    "no model follows the scene to its end; reduce its loads, displacements or "
    "lattice.step_fraction, or remove what stops one of them"
)


@dataclass(frozen=True)
class Decision:
    """A decision about a part of the model, with its reason; `cost` is that on this machine."""

    about: str
    choice: str
    reason: str = ""
    cost: str = ""


@dataclass(frozen=True)
class Plan:
    """The scene to run, and the decisions behind it.

    `candidate`: None where the scene's own models are kept.
    """

    scene: Scene
    decisions: tuple[Decision, ...]
    candidate: Candidate | None = None

    @property
    def moves(self) -> bool:
        """Whether a motion is computed, and not only the state at rest."""
        required = self.scene.require
        return required is None or required.moves

    @property
    def large(self) -> bool:
        """Whether large displacements are modelled."""
        return self.candidate is None or not self.candidate.is_linear


def plan(scene: Scene) -> Plan:
    """Decide what is modelled of a scene.

    Raises ValueError, with the nearest alternative, if no candidate is predicted to meet the
    requirements.
    """
    required = scene.require
    if required is None:
        return Plan(scene, tuple(_as_stated(scene, NOTHING_REQUIRED)))
    if scene.is_point:
        return Plan(scene, tuple(_point(scene)))
    problem = problem_of(scene)
    if problem.has_further_loads:
        return _by_motions(scene, problem, required)
    seen = look(scene, problem)
    points = measure(required, problem)
    foresight = Foresight(seen, points)
    offering = candidates if HISTORY in required.quantities else resting

    def alone() -> dict[str, list[Candidate]]:
        """Candidates judged at one required control point each, if there are several."""
        each = points.probes if len(points.probes) > 1 else ()
        measures = {problem.probes[i]: Measure((i,), None) for i in each}
        return {
            name: list(offering(scene, seen, Foresight(seen, at))) for name, at in measures.items()
        }

    chosen = choose(list(offering(scene, seen, foresight)), required, alone)
    return Plan(chosen.scene, tuple(_decisions(scene, seen, foresight, chosen)), chosen)


def _by_motions(scene: Scene, problem: Problem, required: Require) -> Plan:
    """For moved tools or more than one load: lattices, corrected or else finite elements."""
    points = measure(required, problem)
    seen = moved.look(scene, problem, points)
    found: list[Candidate | Omitted] = [*moved.lattices(scene, seen)]
    found += moved.corrected(scene, seen)
    if problem.rigid_tools and _needs_elements(_offered(found), required):
        found.append(elements(scene, problem, partial(difference, problem, required, points)))
    omitted = [one for one in found if isinstance(one, Omitted)]
    chosen = choose(_offered(found), required, omitted=omitted)
    decisions = [*_moved_decisions(scene, seen, chosen, required), *_omitted(omitted)]
    return Plan(chosen.scene, tuple(decisions), chosen)


def _offered(found: Iterable[Candidate | Omitted]) -> list[Candidate]:
    return [one for one in found if isinstance(one, Candidate)]


def _needs_elements(offered: Sequence[Candidate], required: Require) -> bool:
    """Whether finite elements in contact may be chosen: they are slower than any lattice."""
    if required.rate is not None:
        return False
    return required.error is None or not any(_keeps(one, required) for one in offered)


def measure(required: Require, problem: Problem) -> Measure:
    """Where the error is evaluated. ValueError for an unknown control point."""
    for name in required.at:
        if name not in problem.probes:
            raise ValueError(
                f"require.at: {name!r} is no control point; there are {', '.join(problem.probes)}"
            )
    names = required.at or problem.probes
    volumes = problem.volume_rule.weights if FIELD in required.quantities else None
    return Measure(tuple(problem.probes.index(name) for name in names), volumes)


def choose(
    offered: Sequence[Candidate],
    required: Require,
    alone: Alone = dict,
    omitted: Sequence[Omitted] = (),
) -> Candidate:
    """The cheapest that meets all requirements. ValueError, with the nearest, where none does.

    `alone`: makes the same candidates with their errors at single control points, by name.
    `omitted`: what is not among them, which the error names.
    """
    offered = [_at_rate(one, required.rate) for one in offered]
    able = [one for one in offered if _keeps(one, required)]
    if not able:
        left = "".join(f"; {one}" for one in omitted)
        if not offered:
            raise ValueError(f"require: {NOTHING_OFFERED}{left}")
        raise ValueError(_refusal(offered, required, alone) + left)
    if required.error is None:
        return min(able, key=lambda one: one.prediction.error)
    if required.rate is None:
        return min(able, key=lambda one: one.wall)
    return min(able, key=lambda one: one.wall_per_s)


def _at_rate(one: Candidate, rate: float | None) -> Candidate:
    """With steps no longer than the time between two states at a rate [Hz]."""
    return one if rate is None else replace(one, step=min(one.step, 1.0 / rate))


def _keeps(one: Candidate, required: Require) -> bool:
    return (
        (required.error is None or one.prediction.error <= required.error)
        and (required.memory is None or one.memory <= required.memory)
        and (required.rate is None or in_time(one, required.rate))
    )


def in_time(one: Candidate, rate: float) -> bool:
    """Whether the steps of a frame at a rate [Hz] are predicted to finish within it."""
    return whole_steps(1.0 / rate, one.step) * one.step_wall <= 1.0 / rate


def _otherwise_able(offered: Iterable[Candidate], required: Require) -> list[Candidate]:
    """Candidates that meet all requirements but that of an error."""
    at_rate = (_at_rate(one, required.rate) for one in offered)
    return [one for one in at_rate if _keeps(one, replace(required, error=None))]


def _smallest_error(offered: Iterable[Candidate]) -> Candidate:
    return min(offered, key=lambda one: one.prediction.error)


def _refusal(offered: Sequence[Candidate], required: Require, alone: Alone) -> str:
    """What cannot be met, and the nearest error at this rate and memory, or the nearest rate."""
    rest = _otherwise_able(offered, required)
    if required.error is not None and rest:
        nearest = _smallest_error(rest)
        error, relaxed = nearest.prediction.error, len(rest) < len(offered)
        remedies = ["allow it"] if error <= 1.0 else []
        remedies += ["relax require.rate or require.memory"] if relaxed or required.rate else []
        remedies += ["refine lattice.spacing or reference.element_size"]
        at_points = [
            f"{name} {_percent(_smallest_error(_otherwise_able(found, required)).prediction.error)}"
            for name, found in alone().items()
        ]
        if at_points:
            remedies += [
                "name fewer control points in require.at, whose nearest alone are "
                f"{', '.join(at_points)}"
            ]
        return (
            f"require.error: {_percent(required.error)} is not expected of any model; the nearest "
            f"is {_percent(error)}, by a {nearest.name}: {', or '.join(remedies)}"
        )
    fastest = min(offered, key=lambda one: (one.wall_per_s, one.memory))
    return (
        "require: no model meets this rate or memory; the nearest is a "
        f"{fastest.name}, {fastest.wall_per_s:.2g} s of wall per simulated second and "
        f"{fastest.memory / 1e6:.0f} MB: relax require.rate or require.memory"
    )


# --- what was decided, in words -------------------------------------------------------------------


def _as_stated(scene: Scene, why: str) -> Iterator[Decision]:
    yield Decision("models", ", ".join(named(scene)), f"as stated: {why}")


def _point(scene: Scene) -> Iterator[Decision]:
    yield Decision("organ", "none, no mesh", "the scene is a single control mass point")
    yield from _as_stated(scene, "an equation each, whose solution costs nothing")


def _decisions(
    scene: Scene, seen: Look, foresight: Foresight, chosen: Candidate
) -> Iterator[Decision]:
    required = scene.require
    assert required is not None  # noqa: S101 - there is nothing to decide without
    moves = HISTORY in required.quantities
    yield Decision(*_time(scene, required))
    yield Decision("displacements", _geometry(chosen), _strain(seen, foresight))
    yield Decision("model", chosen.name, _why(chosen, required))
    if moves:
        yield Decision("step", f"{1e3 * chosen.step:.3g} ms", cost=_step(chosen, required))
    yield Decision("reference", *_reference(chosen))
    yield Decision("output", *_output(required))
    yield Decision("left out", *_left_out(scene, chosen))


def _moved_decisions(
    scene: Scene, seen: MovedLook, chosen: Candidate, required: Require
) -> Iterator[Decision]:
    yield Decision(*_time(scene, required))
    yield Decision("displacements", _geometry(chosen), _springs_strain(seen))
    yield Decision("model", chosen.name, _why(chosen, required))
    yield Decision("step", f"{1e3 * chosen.step:.3g} ms", cost=_step(chosen, required))
    by = ESTIMATED_BY[chosen.scene.models[0]]
    yield Decision("reference", "none", f"a run estimates its own error by {by}")
    yield Decision("output", *_output(required))
    yield Decision("left out", *_left_out(scene, chosen))


def _springs_strain(seen: MovedLook) -> str:
    if not seen.motions.finished:
        return "more than a lattice bears"
    strain, at = seen.finest.run.largest_strain, lattice_name(seen.finest.spacing)
    return f"springs strained by up to {_percent(strain)} on a {at}"


def _omitted(found: Iterable[Omitted]) -> Iterator[Decision]:
    """What was not offered, each with its reason."""
    for one in found:
        yield Decision("not offered", one.name, one.reason)


def _time(scene: Scene, required: Require) -> tuple[str, str, str]:
    how = (
        f"{scene.time.duration:g} s of motion"
        if required.moves
        else "no step: rest under the full load"
    )
    return "time", how, f"wanted: {', '.join(required.quantities)}"


def _geometry(chosen: Candidate) -> str:
    return "small" if chosen.is_linear else "large"


def _strain(seen: Look, foresight: Foresight) -> str:
    part = foresight.geometry
    known = (
        f"about {_percent(part)}"
        if part < float("inf")
        else "more than a coarse lattice can resolve"
    )
    return f"strain of {_percent(seen.strain)} at rest; small ones alone would be off by {known}"


def _why(chosen: Candidate, required: Require) -> str:
    parts = ", ".join(f"{part.cause} {_percent(part.error)}" for part in chosen.prediction.parts)
    wanted = "" if required.error is None else f" of {_percent(required.error)} allowed"
    return f"expected error {_percent(chosen.prediction.error)}{wanted}: {parts}"


def _step(chosen: Candidate, required: Require) -> str:
    cost = f"{chosen.wall_per_s:.2g} s of wall per simulated second, {chosen.setup:.2g} s before"
    if required.rate is None:
        return cost
    count = whole_steps(1.0 / required.rate, chosen.step)
    share = count * chosen.step_wall * required.rate
    return f"{cost}; {count} to a frame of {required.rate:g} Hz, {_percent(share)} of its time"


def _reference(chosen: Candidate) -> tuple[str, str]:
    if len(chosen.scene.models) > 1:
        return "finite elements", "a lattice alone gives no estimate of its error"
    return "none", "the parts of the error are stated without one"


def _output(required: Require) -> tuple[str, str]:
    wanted = [", ".join(required.at) or "all control points"]
    wanted += ["the whole field"] if FIELD in required.quantities else []
    wanted += ["the force of the tools"] if PEAK_FORCE in required.quantities else []
    return ", ".join(wanted), "as wanted"


def _left_out(scene: Scene, chosen: Candidate) -> tuple[str, str]:
    others = [name for name in named(scene) if name not in chosen.scene.models]
    more = "; ".join(chosen.leaves_out)
    return ", ".join(others) or "none of its models", more or "not required"


def _percent(value: float) -> str:
    """A percentage, with decimals where they are significant."""
    if 0.0 < value < 0.0005:
        return f"{100.0 * value:.1g} %"
    return f"{100.0 * value:.1f} %" if value < 0.0995 else f"{100.0 * value:.0f} %"


def lines(found: Plan, *, costs: bool = True) -> list[str]:
    """The decisions for a reader; without costs they are the same on every machine."""
    return [_line(one, one.cost if costs else "") for one in found.decisions]


def _line(one: Decision, cost: str) -> str:
    why = "; ".join(part for part in (one.reason, cost) if part)
    return f"{one.about}: {one.choice}" + (f" ({why})" if why else "")
