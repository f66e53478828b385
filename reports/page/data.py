"""What the page draws, as records that become JSON; arrays as base64."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reports import fuzzy_figures, tradeoff
from reports.appearance import labels, looks, reference_name, system_colour, system_name
from reports.digits import fixed, short, words
from reports.field_figures import HELD, LOADED, drawable, exaggeration
from reports.motion_figures import ProbeMotion, motions
from reports.page.answer import curve_error, nearest
from reports.ranking import columns, references, score_table, tool_probe
from reports.score_digits import Key, printed_score, score_decimals
from reports.tables import CURVE_NAMES, MEASURE_NAMES
from study.results import Results

Floats = NDArray[np.float64]

KILO = 1e-3
MILLI = 1e3
MOST_SETS = 12
INTERVAL = 3
"""Decimals at most of the ends of an interval."""
DECIMALS = 9
ROUND = 1e-3
"""Share of the largest value of a curve to which it is printed at the finest."""
CURVES: tuple[Literal["displacement"], Literal["velocity"]] = ("displacement", "velocity")
SHADES = 33
STEPS = 2**15 - 1
"""Whole numbers that a displacement is rounded to, up to the largest: 16 bits with a sign."""
DASHES = {"fem": "solid", "basafa": "longdash", "reading": "dot"}
OTHER_DASHES = ("solid", "dashdot", "dash", "longdashdot")


@dataclass(frozen=True)
class Packed:
    """An array: its shape, the kind of its numbers as a dtype, and their bytes in base64."""

    shape: tuple[int, ...]
    kind: str
    base64: str


@dataclass(frozen=True)
class Line:
    """A model's motion at a control point: rows time [s], displacement [mm], velocity [mm/s].

    `decimals`: of a displacement and a velocity that the errors of the curves by mesh and steps
    leave, three digits of the largest where they are not known. `lower` and `upper`: the motion of
    the runs at both ends of a stiffness interval, if any.
    """

    model: str
    motion: Packed
    decimals: tuple[int, int]
    lower: Packed | None
    upper: Packed | None


@dataclass(frozen=True)
class Probe:
    """A control point and the motion of every model there."""

    name: str
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Model:
    """How a model is shown: its label, colour and line."""

    name: str
    label: str
    colour: str
    dash: str
    status: str


@dataclass(frozen=True)
class Film:
    """Displacement of a surface (frames, s, 3) in whole numbers of a `unit` [mm]."""

    values: Packed
    unit: float


@dataclass(frozen=True)
class Organ:
    """Surface at rest [mm], triangles, and its motion by model.

    `samples`: those of the curves that the frames are of; a model that diverged has the first of
    them alone. `held` and `loaded`: numbers of triangles. `ways` [mm] (2 k, 3): both ends of each
    dash of the ways of tools. `push`: direction of the tool; `probes` [mm]; `factor`: by which
    displacements are exaggerated at first. `reference`: of the differences, if there is one.
    """

    points: Packed
    triangles: Packed
    tool: tuple[float, ...]
    push: tuple[float, ...]
    probes: Packed
    films: dict[str, Film]
    samples: tuple[int, ...]
    held: Packed
    loaded: Packed
    ways: Packed
    factor: float
    reference: str | None


@dataclass(frozen=True)
class Cell:
    """A score, for its shade, and as printed to the digits that its error leaves.

    `interval`: over blocks of the motion, printed; empty where it is not known.
    """

    score: float
    printed: str
    interval: str


@dataclass(frozen=True)
class Matrix:
    """Scores against a reference at a control point: a row per model, a column per measure."""

    reference: str
    probe: str
    models: tuple[str, ...]
    cells: tuple[tuple[Cell | None, ...], ...]


@dataclass(frozen=True)
class Sets:
    """Sets of a variable over kPa, membership (sets, samples) with the ends of the footprint."""

    name: str
    is_output: bool
    sets: tuple[str, ...]
    x: Packed
    lower: Packed
    principal: Packed
    upper: Packed


@dataclass(frozen=True)
class Surface:
    """Estimate [kPa] of a system over a grid of two readings, and how far between its lines.

    `error` [kPa]: see `interpolation_error`.
    """

    system: str
    name: str
    colour: str
    estimate: float | None
    values: Packed
    error: float


@dataclass(frozen=True)
class Fuzzy:
    """Sets, and surfaces over the readings `inputs`, grid lines `x` and `y` [kPa].

    `start`: readings [kPa] where the sliders stand at first. `unread`: the inputs that the scene
    has no reading of.
    """

    sets: tuple[Sets, ...]
    surfaces: tuple[Surface, ...]
    inputs: tuple[str, str]
    x: Packed
    y: Packed
    start: tuple[float, float]
    unread: tuple[str, ...]


@dataclass(frozen=True)
class Configuration:
    """A point of the trade-off: name, wall per simulated second, error and its bar [%].

    `on_front`: none is both faster and more accurate; `on_any_load_front`: none of those that
    follow any load.
    """

    name: str
    wall: float
    error: float | None
    bar: float
    on_front: bool
    on_any_load_front: bool
    any_load: bool
    stated: str


@dataclass(frozen=True)
class Tradeoff:
    """Configurations measured beforehand on the built-in liver, and where."""

    configurations: tuple[Configuration, ...]
    conditions: str


@dataclass(frozen=True)
class Page:
    """All that the page draws; `nearest`: the model shown first; `scale`: colours of a number."""

    models: tuple[Model, ...]
    probes: tuple[Probe, ...]
    tool_probe: str
    nearest: str | None
    scale: tuple[str, ...]
    organ: Organ | None
    measures: tuple[str, ...]
    matrices: tuple[Matrix, ...]
    fuzzy: Fuzzy | None
    tradeoff: Tradeoff


def page(results: Results) -> Page:
    """What the page of a run draws."""
    found = nearest(results)
    return Page(
        models=tuple(_models(results)),
        probes=tuple(_probe(results, name) for name in results.record.probes),
        tool_probe=tool_probe(results),
        nearest=None if found is None else found.model.name,
        scale=_scale(),
        organ=_organ(results),
        measures=tuple(_measure(curve, measure) for curve, measure in columns(results)),
        matrices=tuple(_matrices(results)),
        fuzzy=_fuzzy(results),
        tradeoff=_tradeoff(),
    )


def packed(array: NDArray[np.generic], kind: str | None = None) -> Packed:
    """An array as 32-bit numbers or as another kind, the lowest byte first on every machine."""
    kind = kind or ("<i4" if array.dtype.kind in "iu" else "<f4")
    data = np.ascontiguousarray(array, dtype=kind).tobytes()
    return Packed(tuple(array.shape), kind, base64.b64encode(data).decode("ascii"))


def film(frames: Floats) -> Film:
    """Frames [mm] in 16 bits: each number is off by half a unit at most."""
    unit = float(np.abs(frames).max(initial=0.0)) / STEPS or 1.0
    return Film(packed(np.rint(frames / unit), "<i2"), unit)


def _models(results: Results) -> Iterator[Model]:
    for i, (name, look) in enumerate(looks(results).items()):
        dash = DASHES.get(name, OTHER_DASHES[i % len(OTHER_DASHES)])
        status = results.model(name).status
        yield Model(name, words(look.label), look.colour, dash, status)


def _scale() -> tuple[str, ...]:
    """Colours that are in the same order to every eye and in grey, dark to light."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return tuple(to_hex(colormaps["cividis"](x)) for x in np.linspace(0.0, 1.0, SHADES))


# --- motion --------------------------------------------------------------------------------------


def _probe(results: Results, name: str) -> Probe:
    named = {model.label: model.name for model in results.record.models}
    found = tuple(
        _line(model, one, [curve_error(results.model(model), name, curve) for curve in CURVES])
        for one in motions(results, name)
        if (model := named[one.look.label])
    )
    return Probe(name, found)


def _decimals(values: Floats, error: float | None) -> int:
    """Decimals down to the first digit of an error that is relative to the largest value."""
    largest = float(np.abs(values).max(initial=0.0))
    known = largest * (ROUND if error is None else max(error, ROUND))
    return DECIMALS if known == 0.0 else int(np.clip(-np.floor(np.log10(known)), 0, DECIMALS))


def _line(model: str, one: ProbeMotion, errors: Sequence[float | None]) -> Line:
    lower, upper = one.bounds or (None, None)
    return Line(
        model,
        packed(one.motion),
        (_decimals(one.motion[1], errors[0]), _decimals(one.motion[2], errors[1])),
        None if lower is None else packed(lower),
        None if upper is None else packed(upper),
    )


# --- organ ---------------------------------------------------------------------------------------


def _organ(results: Results) -> Organ | None:
    names, fields = drawable(results), results.fields
    if not names:
        return None
    place, push = fields["tool"]
    return Organ(
        points=packed(MILLI * fields["points"]),
        triangles=packed(fields["triangles"]),
        tool=tuple(round(MILLI * float(x), 4) for x in place),
        push=tuple(round(float(x), 6) for x in push),
        probes=packed(MILLI * fields["probes"]),
        films={name: film(MILLI * _finite(fields[f"film.{name}"])) for name in names},
        samples=tuple(int(sample) for sample in fields["film"]),
        held=packed(np.flatnonzero(fields["held"] > HELD)),
        loaded=packed(np.flatnonzero(fields["loaded"] > LOADED)),
        ways=packed(MILLI * _dashes(fields.get("ways", np.zeros((0, 0, 3))))),
        factor=_factor(fields["points"], [fields[name][0] for name in names]),
        reference=next((name for name in results.record.references if name in names), None),
    )


def _dashes(ways: Floats) -> Floats:
    """Both ends (2 k, 3) of dashes along ways (k, m, 3): of every other pair of places."""
    pairs = [way[: 2 * (len(way) // 2)] for way in ways]
    return np.concatenate(pairs) if pairs else np.zeros((0, 3))


def _finite(frames: Floats) -> Floats:
    """The frames before the first that a model did not reach."""
    lost = np.flatnonzero(~np.isfinite(frames).all(axis=(1, 2)))
    return frames[: int(lost[0])] if lost.size else frames


def _factor(points: Floats, peaks: list[Floats]) -> float:
    """Exaggeration as in the pictures of report.pdf."""
    return exaggeration(points, [np.linalg.norm(u, axis=-1) for u in peaks])


# --- similarity ----------------------------------------------------------------------------------


def _measure(curve: str, measure: str) -> str:
    return f"{CURVE_NAMES.get(curve, curve)}: {MEASURE_NAMES.get(measure, measure)}"


def _matrices(results: Results) -> Iterator[Matrix]:
    heads, named, places = columns(results), labels(results), score_decimals(results)
    intervals = {row[:5]: (row.low, row.high) for row in results.score_errors}
    for reference in references(results):
        for probe in results.record.probes:
            scores = score_table(results, reference, probe)
            rows = tuple(
                tuple(
                    None
                    if (score := row.get(head)) is None
                    else _cell(score, (model, reference, probe, *head), places, intervals)
                    for head in heads
                )
                for model, row in scores.items()
            )
            if rows:
                of = reference_name(results, reference)
                yield Matrix(of, probe, tuple(named[name] for name in scores), rows)


def _cell(
    score: float,
    key: Key,
    places: Mapping[Key, int | None],
    intervals: Mapping[Key, tuple[float, float]],
) -> Cell:
    shown = places.get(key)
    ends = () if shown is None else intervals.get(key, ())
    interval = " to ".join(fixed(end, min(shown or 0, INTERVAL)) for end in ends)
    return Cell(float(f"{score:.6g}"), printed_score(score, places, key), interval)


# --- fuzzy systems -------------------------------------------------------------------------------


def _fuzzy(results: Results) -> Fuzzy | None:
    arrays = results.fuzzy
    systems = fuzzy_figures.systems(arrays)
    if not systems:
        return None
    inputs = results.scene.fuzzy.surface
    x, y = (KILO * arrays[f"surface.{axis}"] for axis in "xy")
    read = _readings(results, inputs)
    return Fuzzy(
        sets=tuple(_sets(results, name) for name in fuzzy_figures.variables(arrays)),
        surfaces=tuple(_surface(results, system) for system in systems),
        inputs=inputs,
        x=packed(x),
        y=packed(y),
        start=(_start(read, inputs[0], x), _start(read, inputs[1], y)),
        unread=tuple(name for name in inputs if name not in read),
    )


def _readings(results: Results, inputs: Sequence[str]) -> dict[str, float]:
    """The scene's readings [kPa] among some inputs, by input."""
    found = {name: getattr(results.scene.patient, name, None) for name in inputs}
    return {name: KILO * float(value) for name, value in found.items() if value is not None}


def _start(read: Mapping[str, float], name: str, lines: Floats) -> float:
    """The scene's reading [kPa]; where it has none that of the other, the lowest line without any.

    Two readings that agree are nearest to one alone, so that the page starts at about the scene's
    own estimate.
    """
    kilo = read.get(name, next(iter(read.values()), float(lines[0])))
    return float(np.clip(kilo, lines[0], lines[-1]))


def _sets(results: Results, name: str) -> Sets:
    """Sets of a variable; of very many, as many as can be told apart, equally spread."""
    arrays = results.fuzzy
    names = [str(one) for one in arrays[f"{name}.sets"]]
    kept = np.unique(np.linspace(0, len(names) - 1, min(len(names), MOST_SETS)).astype(int))
    return Sets(
        name=name,
        is_output=name == fuzzy_figures.OUTPUT,
        sets=tuple(short(names[i]) for i in kept),
        x=packed(KILO * arrays[f"{name}.x"]),
        lower=packed(arrays[f"{name}.lower"][kept]),
        principal=packed(arrays[f"{name}.principal"][kept]),
        upper=packed(arrays[f"{name}.upper"][kept]),
    )


def _surface(results: Results, system: str) -> Surface:
    values = KILO * np.asarray(results.fuzzy[f"surface.{system}"], dtype=np.float64)
    found = results.record.fuzzy.systems.get(system)
    return Surface(
        system=system,
        name=system_name(system),
        colour=system_colour(system),
        estimate=None if found is None else KILO * found.estimate_pa,
        values=packed(values),
        error=interpolation_error(values),
    )


def interpolation_error(values: Floats) -> float:
    """What bilinear interpolation between the lines of a grid may miss, in the unit of the values.

    Of each direction the largest difference of a node from the mean of its two neighbours, which is
    what leaving out every second line would miss: four times that of all lines of a smooth surface,
    and twice that at a crease.
    """
    rows = 0.5 * (values[:-2] + values[2:]) - values[1:-1]
    lines = 0.5 * (values[:, :-2] + values[:, 2:]) - values[:, 1:-1]
    return sum(float(np.abs(part).max(initial=0.0)) for part in (rows, lines))


# --- trade-off -----------------------------------------------------------------------------------


def _tradeoff() -> Tradeoff:
    found = tradeoff.timed(tradeoff.configurations())
    made = tradeoff.conditions()
    where = "" if made is None or made.processor is None else f" on {made.processor}"
    points = tuple(
        Configuration(
            name=one.name,
            wall=one.timing.quartiles[1],
            error=None if one.error is None else 100.0 * one.error,
            bar=100.0 * one.bar,
            on_front=one.on_front,
            on_any_load_front=one.on_any_load_front,
            any_load=one.any_load,
            stated=one.stated_error,
        )
        for one in found
    )
    return Tradeoff(points, f"Not of this run: measured beforehand on the built-in liver{where}.")
