"""A blunt tool that travels: its stations, and lattices corrected by elements under it.

    python -m tests.benchmarks.travelling

writes reports/data/travelling_stations.csv, what stations a distance apart are off the tool itself,
reports/data/travelling_cost.csv, what a simulated second takes, and then, a row for each place and
strain, reports/data/travelling_places.csv, and of graded corrected lattices there
reports/data/travelling_graded.csv. Tables and rows that are there are kept: started again, it goes
on where it was stopped.

The tool goes 30 mm in 0.7 s over the built-in liver, pressed in within 0.1 s. Errors are relative
L2 differences over time of the displacement under the tool: that of the tissue at its stations,
between these as their shares are. As in `corrected_places.csv`, what a corrected lattice adds to
the linear elements is held against what the lattice of 5 mm adds, a lattice alone against the sum
of both, and, as `own`, against the lattice of 5 mm.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from fem_reference.elasticity import loaded_surface, patch_load
from fem_reference.observation import at_points, evaluation, largest_strain
from fem_reference.solvers import solver
from fem_reference.subspace import Subspace
from msm import model as msm
from msm.model import Counts, Run
from study.models.corrected import CorrectedLattice
from study.models.deformed import superposed
from study.models.lattice import PreparedLattice, requested_step
from study.models.model import Prepared
from study.models.remainder import PreparedRemainder
from study.models.table import model
from study.problem.problem import Problem
from study.problem.tool_travel import DEGREE, StationFactor
from study.scene import LoadHistory, Scene
from study.scene.place import depths
from study.scene.problem import problem_of
from study.scene.schema import Waypoint
from study.system.progress import Silent
from study.tradeoff.timing import in_turns
from tests.benchmarks.corrected_places import by_frames, in_frame
from tests.benchmarks.corrected_runs import LEVEL as FINER
from tests.benchmarks.graded_places import free, known, placed
from tests.benchmarks.tables import complete, read, write

Floats = NDArray[np.float64]

DATA = Path(__file__).parents[2] / "reports" / "data"
STATIONS, COSTS, PLACES, GRADED = (
    DATA / f"travelling_{name}.csv" for name in ("stations", "cost", "places", "graded")
)
LENGTH, SECONDS, RAMP, DURATION, SAMPLES = 0.03, 0.7, 0.1, 0.8, 65
LEVEL = 0
"""Mesh of the elements, the scene's own: what corrected lattices add does not depend on it."""
WHERE = (0, 19, 36, 57, 76)
"""Rows of `corrected_places.csv` at whose places the tool starts: of both radii."""
STRAINS = (0.05, 0.2)
"""Largest of the linear elements at rest, with the tool at any of its stations."""
APART = (0.5, 1.0 / 3.0, 0.25, 0.125)
"""Distances of stations, in radii."""
LOOKED = 9
"""Places in between at which the tool itself is put."""
CORRECTED = (0.02, 0.015, 0.01, 0.008)
UNIFORM = (0.02, 0.015, 0.01, 0.008, 0.02 / 3, 0.005)
FINEST = UNIFORM[-1]
REACHES = (0.6, 1.0)
TURNS = 5


class Off(NamedTuple):
    """What stations are off the tool itself, in the displacement under it, at rest and linear.

    Of so many `stations`, `apart` radii: largest relative errors of the cardinal splines that a
    scene has, and of hat functions. `pull`: largest share of the force that the splines' pressure
    pulls by where it is negative.
    """

    radius_m: float
    apart: float
    stations: int
    spline: float
    hat: float
    pull: float


class Row(NamedTuple):
    """A start of the tool and a strain; lengths [m], relative errors.

    `way_m`: towards the middle along x. `vectors`: of the elements and of each corrected lattice.
    `nonlinear`: what the lattice of 5 mm adds to the elements. `error_H`: of the corrected lattice
    of H mm; `static_H`: of the lattice with the difference of both at rest at each place of the
    tool; `uniform_H` and `own_H`: of a lattice alone. `inverted`: whether cells of any were.
    """

    at_x: float
    at_z: float
    radius_m: float
    way_m: float
    strain: float
    force_n: float
    stations: int
    vectors: int
    nonlinear: float
    error_20: float
    error_15: float
    error_10: float
    error_8: float
    static_20: float
    static_10: float
    uniform_20: float
    uniform_15: float
    uniform_10: float
    uniform_8: float
    uniform_7: float
    uniform_5: float
    own_20: float
    own_15: float
    own_10: float
    own_8: float
    own_7: float
    inverted: bool


class Graded(NamedTuple):
    """A corrected lattice whose cells are of 5 mm within `reach` radii of the tool's way.

    `error`: of what it adds to the elements against what the lattice of 5 mm throughout adds, over
    the motion of that. `nodes`: that do not hang; `gain`: processor time of a simulated second of
    the lattice of 5 mm alone over that of the corrected one.
    """

    at_x: float
    at_z: float
    strain: float
    reach: float
    nodes: int
    error: float
    gain: float


class Cost(NamedTuple):
    """Processor time [s] of a simulated second of a lattice alone or corrected, by frames."""

    model: str
    spacing_m: float
    stations: int
    per_second: float


def scene(start: dict[str, float]) -> Scene:
    """The liver with a tool of 1 N that travels from a place towards the middle along x."""
    given = placed(start)
    way = LENGTH if start["at_x"] < 0.5 else -LENGTH
    path = (
        Waypoint(time=0.0, offset=(0.0, 0.0, 0.0)),
        Waypoint(time=SECONDS, offset=(way, 0.0, 0.0)),
    )
    history = LoadHistory(kind="ramp-hold-release", ramp=RAMP, hold=6.0, release=1.0)
    return replace(
        given,
        tool=replace(given.tool, force=1.0, path=path, history=history),
        time=replace(given.time, duration=DURATION, samples=SAMPLES),
        control_points={},
    )


def watched(given: Scene) -> Problem:
    """Its problem, with a control point at each station."""
    problem = problem_of(given)
    places = np.array([problem.tool.centre, *(one.tool.centre for one in problem.loads)])
    names = tuple(f"station-{n}" for n in range(len(places)))
    seen = replace(problem.observation, probes=places)
    return replace(problem, observation=seen, probes=names)


def station_loads(problem: Problem) -> list[StationFactor]:
    """Factors of its stations."""
    found = [problem.factor, *(one.factor for one in problem.loads)]
    assert all(isinstance(one, StationFactor) for one in found)
    return found  # type: ignore[return-value]


def under(problem: Problem, motion: Floats) -> Floats:
    """Displacement [m] (samples, 3) under the tool, by that (samples, stations, 3) at stations."""
    shares = np.column_stack(
        [one.share(problem.observation.times) for one in station_loads(problem)]
    )
    return np.asarray(np.einsum("tk,tkd->td", shares, motion))


def times_as_hard(problem: Problem, force: float) -> Problem:
    """The problem with so many times the force."""
    (first, *rest) = [_harder(one, force) for one in station_loads(problem)]
    loads = tuple(replace(one, factor=turn) for one, turn in zip(problem.loads, rest, strict=True))
    return replace(problem, factor=first, loads=loads)


def _harder(turn: StationFactor, force: float) -> StationFactor:
    def history(times: Floats) -> Floats:
        return force * turn.history(times)

    return replace(turn, history=history)


def pressed(one: PreparedLattice, problem: Problem) -> PreparedLattice:
    """A lattice under the same loads, with the factors of a problem."""
    assert one.assembly.external_loads is not None
    loads = replace(one.assembly.external_loads, factors=tuple(x.factor for x in problem.loads))
    return replace(one, problem=problem, assembly=replace(one.assembly, external_loads=loads))


@dataclass(frozen=True)
class Elements:
    """Linear elements under 1 N: subspace, and motion and rests [m] (.., stations, 3) at stations.

    `rests` (stations, stations, 3): with the whole tool at each. `strain`: largest of all of these.
    """

    among: Subspace
    motion: Floats
    rests: Floats
    strain: float


def elements(given: Scene, problem: Problem) -> Elements:
    """Those of the corrected lattice."""
    fine = corrected(given).fine.varied(level=LEVEL).prepare(problem)
    solved = fine.solved_on(None, Silent())
    among, body = superposed(solved).subspace, fine.body()
    weights = evaluation(body, problem.observation.probes)
    rests = [among.rest(one) for one in np.eye(1 + len(problem.loads))]
    strain = max(largest_strain(body, u) for u in rests)
    motion = solved.found.trajectory.displacement
    return Elements(among, motion, np.array([at_points(weights, u) for u in rests]), strain)


def corrected(given: Scene) -> CorrectedLattice:
    """That of a scene."""
    found = model(given, "corrected")
    assert isinstance(found, CorrectedLattice)
    return found


def lattice(given: Scene, problem: Problem, spacing: float) -> PreparedLattice:
    """The coarse lattice of a corrected one."""
    return corrected(given).varied(spacing=spacing, step_fraction=0.8).coarse.prepare(problem)


class Parts(NamedTuple):
    """A lattice's run, what it is beyond itself linear [m] (samples, stations, 3), and rests."""

    run: Run
    added: Floats
    rests: Floats


def by_vectors(one: PreparedLattice, vectors: Floats) -> Parts:
    """With its linear part in vectors, as a corrected lattice has it."""
    prepared = PreparedRemainder(one, vectors.shape[1])
    prepared.__dict__["vectors"] = vectors  # whatever the force, the same
    found, linear = prepared.run(requested_step(one.model.lattice)), prepared.linear()
    weights, _ = one.assembly.lattice.interpolation(one.problem.observation.probes)
    loads = np.vstack([linear.load, linear.others])
    rests = [weights @ linear.displacement(load / linear.squares) for load in loads]
    return Parts(found.lattice, found.trajectory.displacement, np.array(rests))


def by_steps(one: PreparedLattice) -> Parts:
    """With its linear part stepped."""
    given = (one.assembly, one.springs.material, one.problem.factor, one.problem.observation)
    whole = msm.run(*given, requested_step(one.model.lattice))
    linear = msm.run(*given, Counts(whole.substeps), linear=True)
    added = whole.trajectory.displacement - linear.trajectory.displacement
    return Parts(whole, added, np.zeros(0))


def rows(start: dict[str, float], missing: Sequence[float]) -> Iterator[Row]:
    """All errors of a start, strain by strain."""
    given = scene(start)
    unit = watched(given)
    linear = elements(given, unit)
    vectors = linear.among.load.size
    ready = {h: lattice(given, unit, h) for h in UNIFORM}
    spans = {h: PreparedRemainder(ready[h], vectors).vectors for h in CORRECTED}
    for strain in missing:
        force = strain / linear.strain
        problem = times_as_hard(unit, force)
        found = {h: by_vectors(pressed(ready[h], problem), spans[h]) for h in CORRECTED}
        found |= {h: by_steps(pressed(ready[h], problem)) for h in UNIFORM if h not in CORRECTED}
        way = given.tool.path[-1].offset
        assert way is not None
        place = (start["at_x"], start["at_z"], start["radius_m"], way[0], strain, force)
        yield Row(*place, len(linear.rests), vectors, *errors(problem, linear, force, found))


def errors(
    problem: Problem, linear: Elements, force: float, found: dict[float, Parts]
) -> Iterator[float]:
    """Columns of a row from `nonlinear` on."""
    alone = {h: under(problem, one.run.trajectory.displacement) for h, one in found.items()}
    added = {h: under(problem, one.added) for h, one in found.items()}
    truth = force * under(problem, linear.motion) + added[FINEST]

    def size(difference: Floats) -> float:
        return float(np.linalg.norm(difference) / np.linalg.norm(truth))

    def at_rest(h: float) -> Floats:
        rests = linear.rests - found[h].rests / 1.0
        factors = problem.factors(problem.observation.times)
        return under(problem, np.einsum("tk,kpd->tpd", factors, rests))

    yield size(added[FINEST])
    yield from (size(added[h] - added[FINEST]) for h in CORRECTED)
    yield from (size(alone[h] + at_rest(h) - truth) for h in (0.02, 0.01))
    yield from (size(alone[h] - truth) for h in UNIFORM)
    yield from (size(alone[h] - alone[FINEST]) for h in UNIFORM[:-1])
    yield any(one.run.inverted_cells for one in found.values())


# --- stations -------------------------------------------------------------------------------------


def off() -> Iterator[Off]:
    """What stations are off at the first start, by their distance."""
    given = scene(known(1)[WHERE[0]])
    problem = problem_of(replace(given, tool=replace(given.tool, path=())))
    level = problem.geometry.level(FINER)
    assert level is not None
    prepared = corrected(given).fine.prepare(problem)
    body, solve = prepared.body(level), solver(prepared.body(level))
    where = (problem.tissue, problem.foundation, problem.tool, "auto", problem.geometry.project)
    surface, rule = loaded_surface(level.mesh, *where)[1], problem.surface_rule
    way = given.tool.path[-1].offset
    assert way is not None
    looked = (np.arange(LOOKED) + 0.4) / LOOKED
    for radius in (0.025, 0.015):
        tool = replace(problem.tool, radius=radius)

        def placed_at(share: float, tool=tool) -> Floats:
            moved = tool.centre + share * np.array(way)
            met = depths(moved, tool.direction, problem.geometry.surface)
            return np.asarray(moved + met[np.abs(met).argmin()] * tool.direction)

        def at(share: float, tool=tool, placed_at=placed_at) -> tuple[Floats, Floats]:
            patch = replace(tool, centre=placed_at(share))
            pressure = patch.profile(rule.points, rule.normals)
            return solve(patch_load(surface, patch)), pressure / (pressure @ rule.weights)

        weights = evaluation(body, np.array([placed_at(share) for share in looked]))
        exact = np.array([at_points(weights, at(share)[0])[n] for n, share in enumerate(looked)])
        for apart in APART:
            count = int(np.ceil(abs(way[0]) / (apart * radius))) + 1
            shares = np.linspace(0.0, 1.0, count)
            parts = [at(share) for share in shares]
            rests = np.array([at_points(weights, u) for u, _ in parts])
            pressures = np.array([pressure for _, pressure in parts])
            found = [_off(shares, looked, rests, exact, degree) for degree in (DEGREE, 1)]
            mixed = _spline(shares, DEGREE)(looked) @ pressures
            pull = float((-np.minimum(mixed, 0.0) @ rule.weights).max())
            yield Off(radius, apart, count, *found, pull)


def _spline(shares: Floats, degree: int) -> Callable[[Floats], Floats]:
    found: Callable[[Floats], Floats] = make_interp_spline(
        shares, np.eye(len(shares)), min(degree, len(shares) - 1)
    )
    return found


def _off(shares: Floats, looked: Floats, rests: Floats, exact: Floats, degree: int) -> float:
    """Largest relative error under the tool."""
    mixed = np.einsum("pk,kpd->pd", _spline(shares, degree)(looked), rests)
    return float((np.linalg.norm(mixed - exact, axis=1) / np.linalg.norm(exact, axis=1)).max())


# --- costs ----------------------------------------------------------------------------------------


def costs() -> list[Cost]:
    """Of all in turns, at the first start."""
    given = scene(known(1)[WHERE[0]])
    problem = problem_of(given)
    same = {"step_fraction": 0.8}
    alone, both = model(given, "tissue"), corrected(given)
    ready: dict[tuple[str, float], Prepared] = {
        ("uniform", h): alone.varied(spacing=h, volume_term=True, **same).prepare(problem)
        for h in UNIFORM
    }
    ready |= {
        ("corrected", h): both.varied(spacing=h, level=LEVEL, **same).prepare(problem)
        for h in CORRECTED
    }
    steppers = [one.stepper() for one in ready.values()]
    timings = in_turns([*map(by_frames, steppers)], TURNS, time.process_time)
    return [
        Cost(
            *named,
            1 + len(problem.loads),
            float(timing.walls.min(axis=0).mean()) / (in_frame(one) * one.step),
        )
        for named, one, timing in zip(ready, steppers, timings, strict=True)
    ]


# --- graded lattices ------------------------------------------------------------------------------


def graded(start: dict[str, float], known: Sequence[Row]) -> Iterator[Graded]:
    """Graded corrected lattices of a start, at strains whose forces are known."""
    given = scene(start)
    unit = watched(given)
    both = corrected(given).varied(level=LEVEL, step_fraction=0.8)
    whole = lattice(given, unit, FINEST)
    for reach in REACHES:
        radius = reach * start["radius_m"]
        made = both.varied(coarse="graded", spacing=FINEST, radius=radius)
        prepared = made.prepare(unit)
        gain = ratio(whole, prepared)
        for row in known:
            problem = times_as_hard(unit, row.force_n)
            parts = [by_steps(pressed(one, problem)) for one in (prepared.coarse, whole)]
            near, far = (under(problem, one.added) for one in parts)
            motion = under(problem, parts[1].run.trajectory.displacement)
            error = float(np.linalg.norm(near - far) / np.linalg.norm(motion))
            place = start["at_x"], start["at_z"], row.strain
            yield Graded(*place, reach, free(prepared.coarse), error, gain)


def ratio(one: Prepared, other: Prepared) -> float:
    """Processor time of a simulated second of one over that of another, by frames in turns."""
    steppers = [each.stepper() for each in (one, other)]
    timings = in_turns([*map(by_frames, steppers)], TURNS, time.process_time)
    dear, cheap = (
        float(timing.walls.min(axis=0).mean()) / (in_frame(each) * each.step)
        for each, timing in zip(steppers, timings, strict=True)
    )
    return dear / cheap


# --- the tables -----------------------------------------------------------------------------------


def kept() -> dict[tuple[float, float, float], Row]:
    """Rows of the table of places that are there."""
    return {(one.at_x, one.at_z, one.strain): one for one in read(PLACES, Row)}


def main() -> None:
    """Write what is missing of the tables."""
    if not STATIONS.exists():
        write(STATIONS, off())
    if not COSTS.exists():
        write(COSTS, costs())
    done = kept()
    starts = known(1)
    for start in (starts[n] for n in WHERE):
        missing = [s for s in STRAINS if (start["at_x"], start["at_z"], s) not in done]
        for one in rows(start, missing) if missing else ():
            done[one.at_x, one.at_z, one.strain] = one
            write(PLACES, done.values())
            sys.stdout.write(f"{one}\n")
            sys.stdout.flush()
    tasks = {
        (place := (start["at_x"], start["at_z"])): partial(
            graded, start, [done[*place, strain] for strain in STRAINS]
        )
        for start in (starts[n] for n in WHERE)
    }
    complete(GRADED, Graded, tasks, lambda one: (one.at_x, one.at_z))


if __name__ == "__main__":
    main()
