"""The mass-spring lattice as a model of the study: motion of a body under the tool, from rest."""

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
from msm.stability import DEFAULT, CriticalStepTracker, critical_time_step
from msm.statics import static_displacement
from msm.stepper import LatticeStepper, grids_for, refuse_unfit
from msm.timestep import LOOK, Automatic, Counts, Fixed, Rate, Step, StepControl
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
AUTOMATIC = Automatic()
DIVERGED_SIZE = 1.0
"""Displacement, relative to the size of the organ, above which a run counts as diverged."""


@dataclass(frozen=True)
class Run:
    """Trajectory of a run, with its steps and cost.

    `substeps` (samples - 1,): steps in each sampling interval, zero after the one in which a run
    diverged. `smallest_step`, `largest_step` [s]; `critical_time_step` [s] at rest; `margin`:
    smallest ratio of the critical step to an accepted step, over all checks; `repeated_steps`:
    steps repeated because the critical step had fallen below them; `wall` [s]: time of the steps
    and checks, without compilation. `largest_strain`: largest absolute strain of a spring;
    `inverted_cells`: largest number of inverted cells, both over the samples; `overlap` [m]:
    deepest overlap of body and rigid tools.
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
    step: Step = AUTOMATIC,
    on_progress: Callable[[float], None] = lambda _: None,
    *,
    integrator: str = DEFAULT,
    linear: bool = False,
    single: bool = False,
    on_sample: OnSample = lambda *_: None,
    checkpoint: Checkpoint | None = None,
) -> Run:
    """Motion from rest under the load times `factor` of the time [s].

    With an automatic step, an unconditionally stable integrator takes one step per sample. `linear`
    uses the forces of small displacements, `single` single precision. `on_sample(sample, u, v)` is
    called at each sample with u [m] and v [m/s] (n, 3), which it must copy. When samples are
    repeated, it is called again with the sample from which the run continues, so the last call
    always has the current state. A run with a `checkpoint` can be resumed, and calls it first with
    the sample from which it resumes.

    ValueError for too many steps, a step that does not divide the sampling interval, an integrator
    that does not support the springs or single precision, or a checkpoint of another run.
    """
    stepper = LatticeStepper(assembly, material, factor, integrator, linear=linear, single=single)
    steps = _step_control(step, observation, stepper.limit_at_rest)
    recorded = (assembly.lattice, stepper.net, observation, len(stepper.tool_force))
    recorder, progress = _Recorder(*recorded), _Progress()
    recorder.record(0, stepper)
    keeper = None
    if checkpoint is not None:
        key = _identity(assembly, stepper, integrator, step, observation)
        keeper = Keeper(checkpoint, key, _mutable_parts(progress, stepper, steps, recorder))
        keeper.resume()
    divergence = _march(stepper, steps, recorder, progress, on_progress, on_sample, keeper)
    return _result(progress, divergence, steps, recorder)


def _identity(
    assembly: Assembly,
    stepper: LatticeStepper,
    integrator: str,
    step: Step,
    observation: Observation,
) -> str:
    """Hash of everything that determines the trajectory.

    The load history enters by its values at the samples and half-way between them.
    """
    times = observation.times
    history = stepper.factor(np.concatenate([times, 0.5 * (times[1:] + times[:-1])]))
    observed = tuple(getattr(observation, field.name) for field in fields(observation))
    body = (
        assembly.lattice.nodes,
        stepper.law,
        stepper.net,
        stepper.start,
        _external_factors(stepper, times),
    )
    code = program(force_law_of(stepper.law).tension, stepper.method.advance)
    # Precision and number of lanes change the rounding.
    lanes = () if stepper.grids is None else _lanes(stepper.grids.grids[0])
    return identity(code, lanes, body, integrator, step, observed, history)


def _lanes(grid: Grid) -> tuple[str, int]:
    return grid.u.dtype.name, len(grid.lanes)


def _external_factors(stepper: LatticeStepper, times: Floats) -> Floats:
    """Factors of further loads and displacements of tools at the samples and half-way between."""
    if stepper.external_loads is None:
        return np.zeros(0)
    return stepper.external_loads.factor_rows(times, float(times[1] - times[0]), (0.5, 1.0))


def _mutable_parts(
    progress: _Progress, stepper: LatticeStepper, steps: StepControl, recorder: _Recorder
) -> dict[str, object]:
    """The objects that change in a run, by their names in `msm.checkpoint`."""
    return {
        "progress": progress,
        "stepper": stepper,
        "contact_state": stepper.contact_state,
        "steps": steps,
        "tracker": stepper.tracker,
        "recorder": recorder,
        "trajectory": recorder.trajectory,
    }


def refuse(
    assembly: Assembly,
    material: Material,
    observation: Observation,
    step: Step = AUTOMATIC,
    *,
    integrator: str = DEFAULT,
    linear: bool = False,
    single: bool = False,
) -> None:
    """ValueError for all that `run` refuses, except a checkpoint, without taking a step."""
    refuse_unfit(integrator, material, assembly.external_loads)
    net = arrays(assembly, material, linear=linear)
    if single:  # only then a grid is required, which takes time to build
        grids_for(assembly.lattice, net, integrator, single=True)
    tracker = CriticalStepTracker(material.law, net, INTEGRATORS[integrator])
    _step_control(step, observation, tracker.limit(np.zeros_like(net.load)))


def _step_control(step: Step, observation: Observation, at_rest: float) -> StepControl:
    """Step control for a critical step at rest [s]; ValueError for too many steps."""
    interval = float(observation.times[1] - observation.times[0])
    steps = StepControl(step, interval, len(observation.times) - 1, at_rest)
    if not isinstance(step, Counts):  # those come from a run that was accepted
        _refuse_too_many_steps(steps, step)
    return steps


def _refuse_too_many_steps(steps: StepControl, step: Step) -> None:
    intervals, prescribed = len(steps.substeps), steps.prescribed
    count = steps.choose(0) * intervals if prescribed is None else int(prescribed.sum())
    duration = steps.interval * intervals
    if count > MAX_STEPS:
        raise ValueError(
            f"the lattice needs {count:.2g} steps of about {duration / count:.2g} "
            f"s, the limit is {MAX_STEPS:.0e}: reduce time.duration, or {_remedy(step)}"
        )


def _remedy(step: Step) -> str:
    """How to need fewer steps."""
    if isinstance(step, Fixed):
        return "enlarge lattice.time_step"
    if isinstance(step, Rate):
        return "reduce lattice.step_rate"
    return "support.stiffness, or enlarge lattice.spacing or lattice.step_fraction"


class _Divergence(NamedTuple):
    """Last sample before a divergence, its time [s] and node."""

    sample: int
    time: float
    node: int


@dataclass
class _Progress:
    """Progress of a run: last sample, number of repeated steps, wall time [s]."""

    sample: int = 0
    repeated: int = 0
    wall: float = 0.0


def _march(
    stepper: LatticeStepper,
    steps: StepControl,
    recorder: _Recorder,
    progress: _Progress,
    on_progress: Callable[[float], None],
    on_sample: OnSample,
    keeper: Keeper | None,
) -> _Divergence | None:
    """Advance from sample to sample; return to the last checked one where steps were too long."""
    u, v, intervals = stepper.u, stepper.v, len(steps.substeps)
    checked = (progress.sample, stepper.state())
    on_sample(progress.sample, u, v)
    while progress.sample < intervals:
        started = time.perf_counter()
        taken, failed = _advance_interval(stepper, steps, recorder, progress.sample)
        progress.wall += time.perf_counter() - started
        if failed is None:
            progress.sample += 1
            recorder.record(progress.sample, stepper)
            on_progress(progress.sample / intervals)
            on_sample(progress.sample, u, v)
            if stepper.unchecked == 0:
                checked = (progress.sample, stepper.state())
                if keeper is not None:
                    keeper.keep(last=progress.sample == intervals)
        elif steps.gives_up():
            return _divergence(steps, recorder, progress.sample, taken, failed)
        else:
            progress.repeated += taken + int(steps.substeps[checked[0] : progress.sample].sum())
            progress.sample = checked[0]
            stepper.put_back(checked[1])
            stepper.unchecked = 0
            on_sample(progress.sample, u, v)
    return None


def _divergence(
    steps: StepControl, recorder: _Recorder, sample: int, taken: int, node: int
) -> _Divergence:
    at = recorder.times[sample] + steps.interval * taken / steps.substeps[sample]
    steps.substeps[sample + 1 :] = 0
    return _Divergence(sample, float(at), node)


def _advance_interval(
    stepper: LatticeStepper, steps: StepControl, recorder: _Recorder, sample: int
) -> tuple[int, int | None]:
    """Advance to the next sample; the number of steps taken, and a node if they failed."""
    count = steps.choose(sample)
    dt = steps.interval / count
    taken = 0
    for stretch in _stretches(count):
        stepper.t = recorder.times[sample] + taken * dt
        stepper.advance(stretch, dt)
        taken += stretch
        size, node = stepper.farthest()
        if not size < recorder.diverged_size:
            steps.halve()
            return taken, node
        due = steps.is_check_due(sample, stepper.unchecked)
        if due and not steps.accepts(dt, stepper.limit()):
            return taken, stepper.tracker.stiffest_node()
    return taken, None


def _stretches(count: int) -> Iterator[int]:
    """Nearly equal parts, of at most LOOK steps, of a number of steps."""
    parts = -(-count // LOOK)
    for part in range(parts):
        yield (part + 1) * count // parts - part * count // parts


def _result(
    progress: _Progress, divergence: _Divergence | None, steps: StepControl, recorder: _Recorder
) -> Run:
    dt = steps.interval / steps.substeps[steps.substeps > 0]
    return Run(
        recorder.trajectory if divergence is None else recorder.diverged(divergence),
        steps.substeps,
        float(dt.min(initial=np.inf)),
        float(dt.max(initial=0.0)),
        steps.at_rest,
        steps.margin,
        progress.repeated,
        progress.wall,
        float(recorder.strain.max()),
        int(recorder.inverted.max()),
        float(recorder.overlap.max()),
    )


@lru_cache(maxsize=1)
def _interpolation_weights(
    lattice: LatticeMesh, observation: Observation
) -> tuple[csr_array, csr_array, csr_array]:
    """Weights (q, n) of probes, points in the volume and points of the surface.

    Those of the last lattice are cached, since it is run with several spring laws and time steps.
    """
    points = observation.probes, observation.volume_points, observation.surface_points
    probes, volume, surface = (lattice.interpolation(some)[0] for some in points)
    return probes, volume, surface


class _Recorder:
    """Writes the observed quantities of each sample into arrays; repeated samples overwrite."""

    def __init__(
        self, lattice: LatticeMesh, net: Network, observation: Observation, tools: int
    ) -> None:
        self.net, self.lattice = net, lattice
        self.diverged_size = DIVERGED_SIZE * float(np.ptp(lattice.nodes, axis=0).max())
        self.times, self.frames = observation.times, observation.frames
        self.trajectory = empty_trajectory(observation, tools)
        self.overlap = np.zeros(len(observation.times))
        self.strain = np.zeros(len(observation.times))
        self.inverted = np.zeros(len(observation.times), dtype=np.int64)
        self.at_probes, self.in_volume, self.on_surface = _interpolation_weights(
            lattice, observation
        )

    def record(self, sample: int, stepper: LatticeStepper) -> None:
        """Record the motion at one sample."""
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

    def diverged(self, divergence: _Divergence) -> Trajectory:
        """The trajectory up to the divergence, with all later samples cleared."""
        after = np.arange(len(self.times)) > divergence.sample
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
            ended_at=divergence.time,
            ended_near=self.lattice.nodes[divergence.node],
        )
