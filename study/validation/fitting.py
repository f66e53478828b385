"""Quantities of a scene fitted to a measured curve, with their confidence intervals.

Least squares in the logarithms of the quantities, with the model's motion at each; the interval is
that of the linearised problem, with Student's t. A quantity that the curve does not identify is
refused: one whose interval exceeds its allowed range, that ends at a limit, or that is collinear
with another.
"""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from study.annotation.quantity import Quantity
from study.models.estimates import estimates
from study.models.model import Model
from study.models.table import MODELS, is_tuned, models_of
from study.problem.problem import Problem
from study.problem.trajectory import Trajectory
from study.scene import Scene
from study.scene.consistency import contradictions
from study.scene.problem import problem_of
from study.system.progress import Progress
from study.validation.user_data import Curve
from study.validation.user_scene import coarser, probe_number, refuse_unanswered, seen

Floats = NDArray[np.float64]
Predict = Callable[[Floats], Floats]
"""Maps values of the free quantities to the curve (k,)."""

CONFIDENCE = 0.95
STEP = 0.02
"""Difference of the logarithm for derivatives, far above the rounding of models."""
AT_LIMIT = 1e-3
"""Distance of a logarithm from a limit within which it counts as being there."""
LARGEST_CONDITION = 1e6
MOST_RUNS = 60
CHOSEN = ("lattice", "reference", "superposition", "corrected", "region", "time", "require")
"""Tables of a scene whose quantities belong to a computation, not to the body."""


@dataclass(frozen=True)
class Fitted:
    """A quantity [SI] of a scene: its best value and 95 % interval.

    `numerical`: possible shift by the model's own error, nan if that is unknown.
    """

    key: str
    unit: str
    value: float
    low: float
    high: float
    numerical: float


@dataclass(frozen=True)
class Fit:
    """Quantities fitted to a curve, and the curve with them (k,).

    `rms`: of the residual, in the unit of the curve; `scatter_known`: whether the interval follows
    from stated uncertainties of the measurement, or from the residual; `chi`: residual over the
    stated uncertainties, above 1 where the model does not follow the curve.
    """

    quantities: tuple[Fitted, ...]
    curve: Curve
    found: Floats
    rms: float
    scatter_known: bool
    chi: float
    runs: int


@dataclass(frozen=True)
class Free:
    """A free key of a scene, between limits [SI], with its start value."""

    key: str
    unit: str
    low: float
    high: float
    start: float


def free_of(scene: Scene, key: str) -> Free:
    """A key that may be fitted: table.key of one positive quantity. ValueError for any other."""
    table, _, name = key.partition(".")
    part = getattr(scene, table, None)
    value = getattr(part, name, None) if dataclasses.is_dataclass(part) else None
    quantity = _quantity(part, name) if value is not None else None
    if quantity is None or not isinstance(value, float) or not value > 0.0:
        raise ValueError(
            f"--free {key}: is no positive quantity of the scene; give for example "
            "tissue.youngs_modulus"
        )
    if table in CHOSEN:
        raise ValueError(
            f"--free {key}: is a choice of the computation, which no measurement determines; give "
            "a quantity of the body, for example tissue.youngs_modulus"
        )
    low = max(quantity.low, 1e-6 * value, 1e-12)
    return Free(key, quantity.unit, low, quantity.high, value)


def _quantity(part: Any, name: str) -> Quantity | None:
    """The annotation of a field."""
    hints = typing.get_type_hints(type(part), include_extras=True)
    found = typing.get_args(hints.get(name))
    return next((one for one in found if isinstance(one, Quantity)), None)


def changed(scene: Scene, values: dict[str, float]) -> Scene:
    """The scene with other values of keys table.key."""
    for key, value in values.items():
        table, _, name = key.partition(".")
        part = dataclasses.replace(getattr(scene, table), **{name: float(value)})
        scene = dataclasses.replace(scene, **{table: part})
    return scene


def fit(
    scene: Scene,
    curve: Curve,
    keys: Sequence[str],
    model: str,
    progress: Progress,
    probe: str | None = None,
) -> Fit:
    """Fit quantities of a scene by one of its models.

    ValueError for unknown keys, model or control point, and for a curve that does not identify the
    quantities.
    """
    if model not in MODELS:
        raise ValueError(f"--model {model}: is not one of {', '.join(MODELS)}")
    if scene.is_point:
        raise ValueError("organ.shape: a single point has no body to be fitted; give an organ")
    asked = dataclasses.replace(scene, models=(model,))
    for problem in contradictions(asked, {}):
        raise ValueError(f"--model {model}: {problem}")
    if not curve.values.any():
        raise ValueError("--curve: is zero throughout, which any quantity fits; measure a load")
    free = [free_of(scene, key) for key in keys]
    if len({one.key for one in free}) < len(free) or not free:
        raise ValueError("--free: give each quantity once, one at least")
    refuse_unanswered(problem_of(scene), curve)
    own = _Runs(scene, curve, keys, model, probe)
    with progress.stage(f"fit by {model}"):
        found = solve(own.predict, curve, free)
    with progress.stage(f"own error of {model}"):
        return dataclasses.replace(
            found.fit, quantities=_shifted(found, own.own_error(found.values), free)
        )


class _Runs:
    """A model of a scene at values of its free quantities."""

    def __init__(
        self, scene: Scene, curve: Curve, keys: Sequence[str], model: str, probe: str | None
    ) -> None:
        self.scene, self.curve, self.keys = scene, curve, tuple(keys)
        self.model, self.probe = model, probe
        self._at(np.array([getattr(getattr(scene, t), n) for t, n in self._split()]))

    def _split(self) -> list[tuple[str, str]]:
        return [(key.partition(".")[0], key.partition(".")[2]) for key in self.keys]

    def _at(self, values: Floats) -> tuple[Model, Problem]:
        """The model and the problem. ValueError if the scene has no such model."""
        scene = changed(self.scene, dict(zip(self.keys, values, strict=True)))
        scene = dataclasses.replace(scene, models=(self.model,))
        found = list(models_of(scene, estimates(scene) if is_tuned(scene) else {}))
        if len(found) > 1:
            raise ValueError(
                f"--model {self.model}: is a kind of {len(found)} models; name one system in "
                "fuzzy.systems, or another model"
            )
        return found[0], problem_of(scene)

    def predict(self, values: Floats) -> Floats:
        """The curve; nan after the motion diverged."""
        model, problem = self._at(values)
        found = model.prepare(problem).simulate().trajectory
        return seen(problem, found, self.curve, probe_number(problem, self.probe))

    def own_error(self, values: Floats) -> Floats | None:
        """Change of the curve (k,) on coarser meshes or lattices, as an error; None if unknown."""
        model, problem = self._at(values)
        at = probe_number(problem, self.probe)

        def read(motion: Trajectory) -> Floats:
            return seen(problem, motion, self.curve, at)

        return coarser(model, problem).own_error(self.predict(values), read)


@dataclass(frozen=True)
class Solved:
    """A fit with its derivative by the logarithms (k, quantities), over the scatter."""

    fit: Fit
    values: Floats
    slope: Floats
    scatter: Floats


class _Left:
    """Residuals of a prediction, over the scatter, at logarithms of the quantities.

    Runs are counted and never repeated; none is outside `limits` (2, quantities).
    """

    def __init__(self, predict: Predict, curve: Curve, scatter: Floats, limits: Floats) -> None:
        self.predict, self.curve, self.scatter, self.limits = predict, curve, scatter, limits
        self._known: dict[bytes, Floats] = {}

    @property
    def runs(self) -> int:
        """Number of runs of the model so far."""
        return len(self._known)

    def __call__(self, logs: Floats) -> Floats:
        """Residuals (k,)."""
        name = logs.tobytes()
        if name not in self._known:
            found = (self.predict(np.exp(logs)) - self.curve.values) / self.scatter
            self._known[name] = np.where(np.isfinite(found), found, 1e6)
        return self._known[name]

    def slope(self, logs: Floats, *, both_ways: bool = False) -> Floats:
        """Derivative (k, quantities) by differences over STEP, independent of units.

        First order during the iteration, second order with `both_ways`.
        """
        low, high = self.limits
        columns = []
        for step in STEP * np.eye(len(logs)):
            up, back = np.minimum(logs + step, high), np.maximum(logs - step, low)
            if not both_ways and (up != logs).any():
                back = logs
            columns.append((self(up) - self(back)) / (up - back).sum())
        return np.stack(columns, axis=1)


def solve(predict: Predict, curve: Curve, free: Sequence[Free]) -> Solved:
    """Least squares of a prediction. ValueError if the curve does not identify the quantities."""
    scatter = np.ones_like(curve.values) if curve.uncertainty is None else curve.uncertainty
    scatter = scatter * (float(np.abs(curve.values).max()) if curve.uncertainty is None else 1.0)
    if len(curve.values) <= len(free):
        raise ValueError(f"--curve: {len(curve.values)} values cannot determine {len(free)}")

    limits = np.log([[one.low for one in free], [one.high for one in free]])
    left = _Left(predict, curve, scatter, limits)
    start = np.clip(np.log([one.start for one in free]), limits[0] + STEP, limits[1] - STEP)
    best = least_squares(
        left, start, left.slope, bounds=limits, x_scale=1.0, xtol=1e-6, max_nfev=MOST_RUNS
    )
    slope = left.slope(best.x, both_ways=True)
    freedom = len(curve.values) - len(free)
    variance = float((best.fun**2).sum()) / freedom
    known = curve.uncertainty is not None
    _refuse_undetermined(slope, free)
    spread = np.sqrt(np.diag(np.linalg.inv(slope.T @ slope)))
    # A model that does not follow the curve widens the interval, and never narrows it.
    spread *= np.sqrt(max(1.0, variance) if known else variance)
    half = float(student.ppf(0.5 + 0.5 * CONFIDENCE, freedom)) * spread
    _refuse_open(best.x, half, limits, free)
    quantities = tuple(
        Fitted(
            one.key, one.unit, float(np.exp(x)), float(np.exp(x - h)), float(np.exp(x + h)), np.nan
        )
        for one, x, h in zip(free, best.x, half, strict=True)
    )
    found = best.fun * scatter + curve.values
    rms = float(np.sqrt(((found - curve.values) ** 2).mean()))
    whole = Fit(quantities, curve, found, rms, known, np.sqrt(variance), left.runs)
    return Solved(whole, np.exp(best.x), slope, scatter)


def _refuse_undetermined(slope: Floats, free: Sequence[Free]) -> None:
    names = ", ".join(one.key for one in free)
    sizes = np.linalg.svd(slope, compute_uv=False)
    if not sizes[0] > 0.0:
        raise ValueError(f"--free {names}: the curve does not change with it; fit another quantity")
    if sizes[-1] * LARGEST_CONDITION < sizes[0] or len(sizes) < len(free):
        raise ValueError(
            f"--free {names}: the curve does not distinguish them; fit fewer, or measure elsewhere"
        )


def _refuse_open(logs: Floats, half: Floats, limits: Floats, free: Sequence[Free]) -> None:
    for x, h, low, high, one in zip(logs, half, *limits, free, strict=True):
        if min(x - low, high - x) < AT_LIMIT:
            raise ValueError(
                f"--free {one.key}: no value between {one.low:g} and {one.high:g} {one.unit} fits "
                "best; check the units of the curve and the scene's load"
            )
        if not (2.0 * h < high - low and x + h < high):
            raise ValueError(
                f"--free {one.key}: the curve does not determine it: its 95 % interval goes beyond "
                f"{one.low:g} to {one.high:g} {one.unit}; measure more, or fit fewer"
            )


def _shifted(found: Solved, error: Floats | None, free: Sequence[Free]) -> tuple[Fitted, ...]:
    """The fitted quantities, with the shift due to the model's own error of the curve."""
    if error is None or not np.isfinite(error).all():
        return found.fit.quantities
    logs = np.linalg.lstsq(found.slope, error / found.scatter, rcond=None)[0]
    return tuple(
        dataclasses.replace(one, numerical=float(one.value * abs(x)))
        for one, x in zip(found.fit.quantities, logs[: len(free)], strict=True)
    )
