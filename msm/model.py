"""The mass-spring lattice as a model of the study: a body under the tool, from rest."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from msm.assembly import Assembly, Material, arrays, assemble, of_tissue
from msm.checkpoint import Checkpoint, Keeper, identity, program
from msm.grid import Grid
from msm.integrators import INTEGRATORS
from msm.lattice import LatticeMesh
from msm.laws import force_law_of
from msm.linearised import largest_strain
from msm.network import Network
from msm.stability import DEFAULT, Follower, critical_time_step
from msm.statics import static_displacement
from msm.stepper import LatticeStepper, grids_for, refuse_unfit
from msm.timestep import LOOK, Automatic, Counts, Fixed, Pace, Rate, Step
from study.problem.trajectory import Observation, Trajectory, empty_trajectory

__all__ = [
    "DEFAULT",
    "Assembly",
    "Automatic",
    "Checkpoint",
    "Counts",
    "Fixed",
    "LatticeStepper",
    "Material",
    "Rate",
    "Run",
    "Step",
    "arrays",
    "assemble",
    "critical_time_step",
    "of_tissue",
    "refuse",
    "run",
    "static_displacement",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
OnSample = Callable[[int, Floats, Floats], None]

MAX_STEPS = 300_000
FOLLOWED = Automatic()
FAR = 1.0
"""A displacement of more than this many organ sizes is divergence, however finite."""


@dataclass(frozen=True)
class Run:
    """Trajectory with what it took.

    `substeps` (samples - 1,): steps in each sampling interval, zero after the one in which a run
    diverged. `smallest_step`, `largest_step` [s]; `critical_time_step` [s] at rest; `margin`:
    smallest ratio of the critical step to the step taken, wherever it was looked at;
    `repeated_steps`: steps undone because the limit had fallen below them; `wall` [s]: steps and
    following of the limit, without compilation. `largest_strain`: largest absolute strain of a
    spring, `inverted_cells`: largest number of cells turned inside out, both over the samples;
    `overlap` [m]: deepest one of body and rigid tools.
    """

    trajectory: Trajectory
    substeps: Ints
    smallest_step: float
    largest_step: float
    critical_time_step: float
    margin: float
    repeated_steps: int
    wall: float
    largest_strain: float
    inverted_cells: int
    overlap: float = 0.0

    @property
    def steps(self) -> int:
        """Steps in all intervals."""
        return int(self.substeps.sum())


def run(
    assembly: Assembly,
    material: Material,
    factor: Callable[[Floats], Floats],
    observation: Observation,
    step: Step = FOLLOWED,
    on_progress: Callable[[float], None] = lambda _: None,
    *,
    integrator: str = DEFAULT,
    linear: bool = False,
    single: bool = False,
    on_sample: OnSample = lambda *_: None,
    checkpoint: Checkpoint | None = None,
) -> Run:
    """Motion from rest under the load times `factor` of the time [s].

    An integrator without a limit takes, with an automatic step, one step per sample; `linear` takes
    the forces of small displacements, `single` steps in single precision. `on_sample(sample, u,
    v)`, u [m] and v [m/s] (n, 3) to be copied, is told each sample in turn, and where samples are
    undone again the one from which the run goes on: the last one told is where it stands. A run
    with a `checkpoint` can be continued from it, and then tells first the sample it continues from.
    ValueError if there would be too many steps, if the step does not suit the samples, the
    integrator the springs or single precision, or the checkpoint the run.
    """
    stepper = LatticeStepper(assembly, material, factor, integrator, linear=linear, single=single)
    pace = _pace(step, observation, stepper.limit_at_rest)
    recorded = (assembly.lattice, stepper.net, observation, len(stepper.tool_force))
    recorder, motion = _Recorder(*recorded), _Motion()
    recorder.record(0, stepper)
    keeper = None
    if checkpoint is not None:
        found = _identity(assembly, stepper, integrator, step, observation)
        keeper = Keeper(checkpoint, found, _parts(motion, stepper, pace, recorder))
        keeper.resume()
    lost = _march(stepper, pace, recorder, motion, on_progress, on_sample, keeper)
    return _result(motion, lost, pace, recorder)


def _identity(
    assembly: Assembly,
    stepper: LatticeStepper,
    integrator: str,
    step: Step,
    observation: Observation,
) -> str:
    """Of all that the trajectory follows from; the load's history at samples and between them."""
    times = observation.times
    history = stepper.factor(np.concatenate([times, 0.5 * (times[1:] + times[:-1])]))
    seen = tuple(getattr(observation, field.name) for field in fields(observation))
    body = assembly.lattice.nodes, stepper.law, stepper.net, stepper.start, _driven(stepper, times)
    runs = program(force_law_of(stepper.law).tension, stepper.method.advance)
    # Which round differently.
    lanes = () if stepper.grids is None else _lanes(stepper.grids.grids[0])
    return identity(runs, lanes, body, integrator, step, seen, history)


def _lanes(grid: Grid) -> tuple[str, int]:
    return grid.u.dtype.name, len(grid.lanes)


def _driven(stepper: LatticeStepper, times: Floats) -> Floats:
    """What drives further loads and tools at the samples, and between them."""
    if stepper.burden is None:
        return np.zeros(0)
    return stepper.burden.drive(times, float(times[1] - times[0]), (0.5, 1.0))


def _parts(
    motion: _Motion, stepper: LatticeStepper, pace: Pace, recorder: _Recorder
) -> dict[str, object]:
    """What changes in a run, by the names of `msm.checkpoint`."""
    return {
        "motion": motion,
        "stepper": stepper,
        "standing": stepper.standing,
        "pace": pace,
        "follower": stepper.follower,
        "recorder": recorder,
        "trajectory": recorder.trajectory,
    }


def refuse(
    assembly: Assembly,
    material: Material,
    observation: Observation,
    step: Step = FOLLOWED,
    *,
    integrator: str = DEFAULT,
    linear: bool = False,
    single: bool = False,
) -> None:
    """ValueError for all that `run` refuses but checkpoints, without a step taken."""
    refuse_unfit(integrator, material, assembly.burden)
    net = arrays(assembly, material, linear=linear)
    if single:  # else there is nothing to refuse, and a grid takes a while
        grids_for(assembly.lattice, net, integrator, single=True)
    follower = Follower(material.law, net, INTEGRATORS[integrator])
    _pace(step, observation, follower.limit(np.zeros_like(net.load)))


def _pace(step: Step, observation: Observation, at_rest: float) -> Pace:
    """The steps of a run whose limit at rest [s] is known; ValueError if there are too many."""
    interval = float(observation.times[1] - observation.times[0])
    pace = Pace(step, interval, len(observation.times) - 1, at_rest)
    if not isinstance(step, Counts):  # which follow from a run that was not refused
        _refuse_too_many_steps(pace, step)
    return pace


def _refuse_too_many_steps(pace: Pace, step: Step) -> None:
    intervals = len(pace.substeps)
    steps = pace.choose(0) * intervals if pace.plan is None else int(pace.plan.sum())
    if steps > MAX_STEPS:
        raise ValueError(
            f"the lattice needs {steps:.2g} steps of about {pace.interval * intervals / steps:.2g} "
            f"s, the limit is {MAX_STEPS:.0e}: reduce time.duration, or {_shortens(step)}"
        )


def _shortens(step: Step) -> str:
    """What else leaves fewer steps to take."""
    if isinstance(step, Fixed):
        return "enlarge lattice.time_step"
    if isinstance(step, Rate):
        return "reduce lattice.step_rate"
    return "support.stiffness, or enlarge lattice.spacing or lattice.step_fraction"


class _Lost(NamedTuple):
    """Last sample before the lattice was lost, time [s] and node."""

    sample: int
    at: float
    near: int


@dataclass
class _Motion:
    """Where a run stands: at which sample, steps undone, time taken [s]."""

    sample: int = 0
    repeated: int = 0
    wall: float = 0.0


def _march(
    stepper: LatticeStepper,
    pace: Pace,
    recorder: _Recorder,
    motion: _Motion,
    on_progress: Callable[[float], None],
    on_sample: OnSample,
    keeper: Keeper | None,
) -> _Lost | None:
    """Go from sample to sample, and back to the last one kept where the steps were too long."""
    u, v, intervals = stepper.u, stepper.v, len(pace.substeps)
    kept = (motion.sample, stepper.state())
    on_sample(motion.sample, u, v)
    while motion.sample < intervals:
        started = time.perf_counter()
        taken, failed = _pass_interval(stepper, pace, recorder, motion.sample)
        motion.wall += time.perf_counter() - started
        if failed is None:
            motion.sample += 1
            recorder.record(motion.sample, stepper)
            on_progress(motion.sample / intervals)
            on_sample(motion.sample, u, v)
            if stepper.unseen == 0:
                kept = (motion.sample, stepper.state())
                if keeper is not None:
                    keeper.keep(last=motion.sample == intervals)
        elif pace.gives_up():
            return _lost(pace, recorder, motion.sample, taken, failed)
        else:
            motion.repeated += taken + int(pace.substeps[kept[0] : motion.sample].sum())
            motion.sample = kept[0]
            stepper.put_back(kept[1])
            stepper.unseen = 0
            on_sample(motion.sample, u, v)
    return None


def _lost(pace: Pace, recorder: _Recorder, sample: int, taken: int, node: int) -> _Lost:
    at = recorder.times[sample] + pace.interval * taken / pace.substeps[sample]
    pace.substeps[sample + 1 :] = 0
    return _Lost(sample, float(at), node)


def _pass_interval(
    stepper: LatticeStepper, pace: Pace, recorder: _Recorder, sample: int
) -> tuple[int, int | None]:
    """Steps taken from a sample to the next; a node where they failed, and then not all of them."""
    count = pace.choose(sample)
    dt = pace.interval / count
    taken = 0
    for stretch in _stretches(count):
        stepper.t = recorder.times[sample] + taken * dt
        stepper.advance(stretch, dt)
        taken += stretch
        size, node = stepper.farthest()
        if not size < recorder.far:
            pace.halve()
            return taken, node
        if pace.is_due(sample, stepper.unseen) and not pace.keeps_up(dt, stepper.limit()):
            return taken, stepper.follower.stiffest()
    return taken, None


def _stretches(count: int) -> Iterator[int]:
    """Parts of at most LOOK steps, nearly equal, of a number of steps."""
    parts = -(-count // LOOK)
    for part in range(parts):
        yield (part + 1) * count // parts - part * count // parts


def _result(motion: _Motion, lost: _Lost | None, pace: Pace, recorder: _Recorder) -> Run:
    steps = pace.interval / pace.substeps[pace.substeps > 0]
    return Run(
        recorder.trajectory if lost is None else recorder.diverged(lost),
        pace.substeps,
        float(steps.min(initial=np.inf)),
        float(steps.max(initial=0.0)),
        pace.at_rest,
        pace.margin,
        motion.repeated,
        motion.wall,
        float(recorder.strain.max()),
        int(recorder.inverted.max()),
        float(recorder.overlap.max()),
    )


@lru_cache(maxsize=1)
def _seen(lattice: LatticeMesh, observation: Observation) -> tuple[csr_array, csr_array, csr_array]:
    """Weights (q, n) of probes, points in the volume and points of the surface.

    Those of the last lattice are kept: one is run with springs of several kinds, and at half steps.
    """
    points = observation.probes, observation.volume_points, observation.surface_points
    probes, volume, surface = (lattice.interpolation(some)[0] for some in points)
    return probes, volume, surface


class _Recorder:
    """Writes what is observed into arrays, over what was written there before."""

    def __init__(
        self, lattice: LatticeMesh, net: Network, observation: Observation, tools: int
    ) -> None:
        self.net, self.lattice = net, lattice
        self.far = FAR * float(np.ptp(lattice.nodes, axis=0).max())
        self.times, self.frames = observation.times, observation.frames
        self.trajectory = empty_trajectory(observation, tools)
        self.overlap = np.zeros(len(observation.times))
        self.strain = np.zeros(len(observation.times))
        self.inverted = np.zeros(len(observation.times), dtype=np.int64)
        self.at_probes, self.in_volume, self.on_surface = _seen(lattice, observation)

    def record(self, sample: int, stepper: LatticeStepper) -> None:
        """Keep the motion at one sample."""
        u, v = stepper.u, stepper.v
        self.trajectory.tool_force[sample] = stepper.tool_force
        self.overlap[sample] = stepper.overlap
        self.strain[sample] = largest_strain(self.net, u)
        self.inverted[sample] = self.lattice.inverted_cells(u)
        self.trajectory.displacement[sample] = self.at_probes @ u
        self.trajectory.velocity[sample] = self.at_probes @ v
        for i, frame in enumerate(self.frames):  # the peak may be the last sample too
            if frame == sample:
                self.trajectory.volume_field[i] = self.in_volume @ u
                self.trajectory.surface_field[i] = self.on_surface @ u

    def diverged(self, lost: _Lost) -> Trajectory:
        """The trajectory up to where it was lost; later samples that were undone are cleared."""
        after = np.arange(len(self.times)) > lost.sample
        late = after[np.asarray(self.frames, dtype=int)]
        self.strain[after], self.inverted[after] = 0.0, 0
        self.overlap[after] = 0.0
        self.trajectory.tool_force[after] = np.nan
        self.trajectory.displacement[after] = np.nan
        self.trajectory.velocity[after] = np.nan
        self.trajectory.volume_field[late] = np.nan
        self.trajectory.surface_field[late] = np.nan
        return replace(
            self.trajectory,
            status="diverged",
            ended_at=lost.at,
            ended_near=self.lattice.nodes[lost.near],
        )
