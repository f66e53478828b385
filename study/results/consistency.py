"""Consistency of a results folder with its scene: models, control points, samples, arrays.

Checksums show that a file is not that of the run. These checks name the row, and also hold where
somebody has recomputed the checksums. Messages name file and line.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from study.problem.trajectory import Status
from study.results.arrays import Shapes, check_names, check_numbers, check_shapes
from study.results.records import DiscretisationError, ModelRecord, StudyRecord
from study.results.results import Results
from study.results.tables import (
    QUANTITIES,
    BandSample,
    CertifiedSample,
    CurveSample,
    ScoreDifference,
    ScoreError,
    paired,
    pairs,
)
from study.scene.schema import Scene

Floats = NDArray[np.float64]

FIRST_LINE = 2
"""Line number of a table's first row, below the header."""
STATUSES: tuple[str, ...] = get_args(Status)
SAME_TIME = 1e-9
"""Share of the simulated time within which two times are equal; tables have twelve digits."""
SAME_SCORE = 1e-9
"""Difference within which two scores are equal; tables have twelve digits."""
SURFACE: Shapes = {
    **{"points": "n3", "triangles": "m3", "tool": "23", "probes": "p3", "held": "m", "loaded": "m"},
    **{"cut": "c3", "cut_triangles": "t3", "film": "f"},
}
OF_MODEL: Shapes = {"": "2n3", "cut.": "2c3", "film.": "fn3"}
"""Arrays of a model by the prefix of their names."""
SETS: Shapes = {"sets": "s", "x": "x", "principal": "sx", "lower": "sx", "upper": "sx"}
VIEW: Shapes = {
    **{"unit": "", "inputs": "d", "readings": "d", "answer": "", "interval?": "2"},
    **{"switches?": "22", "rules.number": "r", "rules.lower": "r", "rules.upper": "r"},
    **{"rules.share?": "r", "rules.consequent": "r", "rules.sets_height": "r"},
    **{"rules.text": "r", "x": "dp", "terms.rule": "t", "terms.input": "t", "terms.set": "t"},
    **{"terms.negated": "t", "terms.lower": "tp", "terms.upper": "tp"},
    **{"terms.degree_lower": "t", "terms.degree_upper": "t", "y": "m", "lower?": "m"},
    **{"upper?": "m", "outputs": "k", "outputs.height_lower": "k", "outputs.height_upper": "k"},
    **{"outputs.constant?": "k", "outputs.share?": "k", "outputs.lower?": "km"},
    "outputs.upper?": "km",
}
TEXTS = (".sets", ".unit", ".inputs", ".text", ".terms.set", ".outputs")


class Wanted(NamedTuple):
    """Samples of a model at a control point: the smallest and the largest admissible number."""

    model: str
    probe: str
    fewest: int
    most: int


def check(results: Results) -> None:
    """Raise ValueError naming file and row of what is inconsistent with the scene."""
    scene, record = results.scene, results.record
    _check_record(scene, record)
    _check_models(scene, record)
    times = np.linspace(0.0, scene.time.duration, scene.time.samples)
    _check_motions("curves.csv", results.curves, _curves(record, times), times)
    _check_motions("bands.csv", results.bands, _bands(record, times), times)
    _check_motions("certified.csv", results.certified, _bounded(record, times), times)
    _check_tools(results, times)
    _check_keys("similarity.csv", [row[:-1] for row in results.scores], _scored(record))
    for line, row in enumerate(results.scores, FIRST_LINE):
        if not 0.0 <= row.score <= 1.0:
            raise ValueError(f"similarity.csv, line {line}: score {row.score:g} is not in [0, 1]")
    _check_ratings(results)
    _check_score_errors(results)
    _check_score_differences(results)
    differences = [row[:3] for row in results.field_differences]
    _check_keys("errors.csv", differences, [] if scene.is_point else _different(record))
    _check_sensitivity(results)
    _check_fields(results)
    _check_fuzzy(results)


def _check_tools(results: Results, times: Floats) -> None:
    """Forces are ordered by model, tool and time, over the part of the motion that exists."""
    scene, record = results.scene, results.record
    names = ["tool", *(f"tool.{n}" for n in range(2, len(scene.tools) + 1))]
    moved = [name for name, one in zip(names, scene.tools, strict=True) if one.is_moved]
    sampled = [model.name for model in record.models if _finite_samples(model, times)]
    keys = [(name, tool) for name in sampled for tool in moved]
    _agree("tools", [(one.model, one.tool) for one in record.tools], keys)
    wanted = [
        (model.name, tool)
        for model in record.models
        for tool in moved
        for _ in range(_finite_samples(model, times))
    ]
    _check_keys("tool_force.csv", [row[:2] for row in results.tool_forces], wanted)
    for line, row in enumerate(results.tool_scores, FIRST_LINE):
        if (row.model, row.tool) not in keys or not 0.0 <= row.score <= 1.0:
            raise ValueError(
                f"tool_similarity.csv, line {line}: is no score in [0, 1] of a tool in a model"
            )


# --- results.json --------------------------------------------------------------------------------


def _check_record(scene: Scene, record: StudyRecord) -> None:
    _agree("title", record.title, scene.title)
    probes = ("control-point",) if scene.is_point else scene.probes
    _agree("probes", record.probes, probes)
    systems = tuple(record.fuzzy.systems)
    if systems:
        _agree("fuzzy.systems", systems, tuple(scene.fuzzy.systems))
    names = [model.name for model in record.models]
    if len(set(names)) < len(names) or not names:
        raise ValueError("results.json: models: are none, or two of one name")
    for reference in record.references:
        if reference not in names:
            raise ValueError(f"results.json: references: {reference} is none of its models")


def _agree(key: str, found: object, scenes: object) -> None:
    if found != scenes:
        raise ValueError(f"results.json: {key} is {found!r}, and {scenes!r} in scene.toml")


def _check_models(scene: Scene, record: StudyRecord) -> None:
    """Each model belongs to a kind in the scene; a kind may name its models freely."""
    kinds = [_kind(model.name, scene.models) for model in record.models]
    for model, kind in zip(record.models, kinds, strict=True):
        if kind is None and set(scene.models) <= set(kinds):
            raise ValueError(f"results.json: models: {model.name} is none of the scene's")
        _check_model(model, record)
    for kind in scene.models:
        if kind not in kinds and None not in kinds:
            raise ValueError(f"results.json: models: {kind} of the scene is missing")
    for kind in set(kinds):
        _check_systems(kind, record, [k == kind for k in kinds])


def _kind(name: str, kinds: Sequence[str]) -> str | None:
    fitting = [kind for kind in kinds if name == kind or name.startswith(f"{kind}-")]
    return max(fitting, key=len, default=None)


def _check_systems(kind: str | None, record: StudyRecord, members: Sequence[bool]) -> None:
    """A kind with one model for each fuzzy system has them all, in order."""
    systems = [model.system for model, is_one in zip(record.models, members, strict=True) if is_one]
    if kind is not None and any(systems) and systems != list(record.fuzzy.systems):
        raise ValueError(
            f"results.json: models: those of {kind} have the systems {systems}, not "
            f"{list(record.fuzzy.systems)}"
        )


def _check_model(model: ModelRecord, record: StudyRecord) -> None:
    where = f"results.json: models: {model.name}"
    if model.status not in STATUSES:
        raise ValueError(f"{where}: status {model.status!r} is none of {', '.join(STATUSES)}")
    if (model.status == "finished") != (model.ended_at_s is None):
        raise ValueError(f"{where}: ended_at_s does not go with its status")
    if (model.status == "not finished") != bool(model.reason and model.remedy):
        raise ValueError(f"{where}: reason and remedy do not go with its status")
    if model.system is not None and model.system not in record.fuzzy.systems:
        raise ValueError(f"{where}: {model.system} is none of the fuzzy systems")
    rounding = {} if model.lattice is None else model.lattice.rounding_errors
    tables: list[Mapping[str, object]] = [one for one in (model.time_step_errors, rounding) if one]
    certified = None if model.elements is None else model.elements.certified
    if certified is not None:
        tables += [certified.displacement, certified.largest_m]
    error = model.mesh_error
    if error is not None:
        tables += _by_probe(error)
    for table in tables:
        if set(table) != set(record.probes):
            raise ValueError(f"{where}: errors at {sorted(table)}, not at {list(record.probes)}")


def _by_probe(error: DiscretisationError) -> list[Mapping[str, object]]:
    return [error.by_probe, error.order_by_probe]


# --- tables --------------------------------------------------------------------------------------


def _curves(record: StudyRecord, times: Floats) -> Iterator[Wanted]:
    for model in record.models:
        count = _finite_samples(model, times)
        for probe in record.probes:
            yield Wanted(model.name, probe, count, count)


def _finite_samples(model: ModelRecord, times: Floats) -> int:
    """Number of samples of a model up to the end of its motion."""
    if model.ended_at_s is None:
        return len(times)
    return int((times < model.ended_at_s - SAME_TIME * times[-1]).sum())


def _bands(record: StudyRecord, times: Floats) -> Iterator[Wanted]:
    """Bands of models with an interval; a band ends where the run at a bound diverged."""
    for model in record.models:
        system = record.fuzzy.systems.get(model.system or "")
        if system is None or system.interval_pa is None or model.status == "not finished":
            continue
        lost = any(note.startswith(f"The run of {model.name} at the ") for note in record.notes)
        for probe in record.probes:
            yield Wanted(model.name, probe, 0 if lost else len(times), len(times))


def _bounded(record: StudyRecord, times: Floats) -> Iterator[Wanted]:
    """Bounds of models with a certificate."""
    for model in record.models:
        if model.elements is not None and model.elements.certified is not None:
            for probe in record.probes:
                yield Wanted(model.name, probe, len(times), len(times))


def _check_motions(
    file: str,
    rows: Sequence[CurveSample | BandSample | CertifiedSample],
    wanted: Iterator[Wanted],
    times: Floats,
) -> None:
    """Rows are ordered by model, control point and time, from the first sample on."""
    at = 0
    for model, probe, fewest, most in wanted:
        for sample in range(most):
            found = rows[at] if at < len(rows) else None
            if found is None or (found.model, found.probe) != (model, probe):
                if sample < fewest:
                    reason = f"sample {sample + 1} of {fewest} of {model} at {probe} is missing"
                    raise ValueError(f"{file}, line {at + FIRST_LINE}: {reason}")
                break
            if not abs(found.time_s - times[sample]) <= SAME_TIME * times[-1]:
                reason = f"time {found.time_s:g} s, not {times[sample]:g} s of sample {sample + 1}"
                raise ValueError(f"{file}, line {at + FIRST_LINE}: {reason} of {model} at {probe}")
            at += 1
    if at < len(rows):
        raise ValueError(
            f"{file}, line {at + FIRST_LINE}: {rows[at].model} at {rows[at].probe}, "
            f"{rows[at].time_s:g} s: is no sample of the scene's models"
        )


def _check_keys(
    file: str, found: Sequence[tuple[str, ...]], wanted: Sequence[tuple[str, ...]]
) -> None:
    """The rows are those expected, in order."""
    for line, (row, key) in enumerate(zip(found, wanted, strict=False), FIRST_LINE):
        if row != key:
            raise ValueError(f"{file}, line {line}: {_words(row)}, where {_words(key)} is expected")
    line = min(len(found), len(wanted)) + FIRST_LINE
    if len(found) < len(wanted):
        raise ValueError(f"{file}, line {line}: {_words(wanted[len(found)])} is missing")
    if len(found) > len(wanted):
        raise ValueError(f"{file}, line {line}: {_words(found[len(wanted)])} is a row too many")


def _words(key: tuple[str, ...]) -> str:
    return " ".join(key)


def _scored(record: StudyRecord) -> list[tuple[str, ...]]:
    """Model, reference, control point, curve and measure of each score; notes name missing ones."""
    from study.similarity.score import MEASURES

    names = [model.name for model in record.models if not model.inverted_cells]
    return [
        (model, reference, probe, curve, measure.name)
        for model, reference in pairs(names, record.references)
        for probe in record.probes
        if not any(
            note.startswith(f"No score of {model} against {reference} at {probe}: ")
            for note in record.notes
        )
        for curve, measures in MEASURES.items()
        for measure in measures
    ]


def _check_ratings(results: Results) -> None:
    """The parts of each ISO/TS 18571 score add up to it."""
    scores = [row for row in results.scores if row.measure == "iso-18571"]
    _check_keys("iso_18571.csv", [row[:4] for row in results.ratings], [row[:4] for row in scores])
    for line, (row, score) in enumerate(zip(results.ratings, scores, strict=True), FIRST_LINE):
        if not all(0.0 <= part <= 1.0 for part in row[4:]):
            raise ValueError(f"iso_18571.csv, line {line}: a part is not in [0, 1]")
        if abs(row.overall - score.score) > SAME_SCORE:
            reason = f"parts rate {row.overall:g}, and similarity.csv has {score.score:g}"
            raise ValueError(f"iso_18571.csv, line {line}: {reason}")


def _check_score_errors(results: Results) -> None:
    file, rows, scores = "score_errors.csv", results.score_errors, results.scores
    _check_keys(file, [row[:5] for row in rows], [row[:5] for row in scores])
    places = Counter(row[1:5] for row in scores)
    for line, (row, score) in enumerate(zip(rows, scores, strict=True), FIRST_LINE):
        where = f"{file}, line {line}"
        if not 0.0 <= row.low <= score.score + SAME_SCORE:
            raise ValueError(f"{where}: low {row.low:g} is not between 0 and the score")
        if not score.score - SAME_SCORE <= row.high <= 1.0:
            raise ValueError(f"{where}: high {row.high:g} is not between the score and 1")
        _check_parts(where, row)
        ranks = (row.first_rank, row.last_rank)
        if not 1 <= ranks[0] <= ranks[1] <= places[row[1:5]] or any(rank % 1 for rank in ranks):
            raise ValueError(f"{where}: {ranks[0]:g} to {ranks[1]:g} are no ranks of the models")


def _check_score_differences(results: Results) -> None:
    """Differences of every two models scored in one place, in the order of the scores."""
    file, rows = "score_differences.csv", results.score_differences
    scores = {row[:5]: row.score for row in results.scores}
    pairs_of_keys = paired(list(dict.fromkeys(row[:3] for row in results.scores)))
    wanted = [
        (model, *other, *key[3:])
        for (model, *_), other in pairs_of_keys
        for key in scores
        if key[:3] == other
    ]
    _check_keys(file, [row[:6] for row in rows], wanted)
    for line, row in enumerate(rows, FIRST_LINE):
        where, place = f"{file}, line {line}", row[2:6]
        apart = scores[row.model, *place] - scores[row.other, *place]
        if abs(apart - row.difference) > SAME_SCORE:
            reason = f"difference {row.difference:g}, and {apart:g} in similarity.csv"
            raise ValueError(f"{where}: {reason}")
        low, high = row.low - SAME_SCORE, row.high + SAME_SCORE
        if row.low < -1.0 or row.high > 1.0 or not low <= row.difference <= high:
            raise ValueError(f"{where}: the difference is not between low and high")
        _check_parts(where, row)


def _check_parts(where: str, row: ScoreError | ScoreDifference) -> None:
    for name in ("resampled", "window", "normalised", "numerical"):
        value = getattr(row, name)
        if value is not None and value < 0.0:
            raise ValueError(f"{where}: {name} {value:g} is below 0")


def _different(record: StudyRecord) -> list[tuple[str, ...]]:
    """Model, reference and quantity of each field difference, for models that finished."""
    sound = [model for model in record.models if not model.inverted_cells]
    names = [model.name for model in sound]
    lost = {model.name for model in sound if model.status != "finished"}
    return [
        (*pair, quantity)
        for pair in pairs(names, record.references)
        if not lost & set(pair)
        for quantity in QUANTITIES
    ]


def _check_sensitivity(results: Results) -> None:
    systems = results.record.fuzzy.systems
    fuzzy = results.scene.fuzzy
    varied = bool(systems) and fuzzy.sensitivity_readings > 0 and fuzzy.rule_base is None
    rows = results.sensitivity
    if varied != bool(rows):
        raise ValueError(
            f"sensitivity.csv: {len(rows)} rows, where fuzzy.sensitivity_readings is "
            f"{results.scene.fuzzy.sensitivity_readings} and {len(systems)} systems estimate"
        )
    keys = [row[:4] for row in rows]
    for line, (key, row) in enumerate(zip(keys, rows, strict=True), FIRST_LINE):
        if key in keys[: line - FIRST_LINE]:
            raise ValueError(f"sensitivity.csv, line {line}: {_words(key)} appears twice")
        if not 0.0 <= row.rms_change_pa <= row.largest_change_pa * (1.0 + SAME_TIME):
            raise ValueError(
                f"sensitivity.csv, line {line}: rms_change_pa {row.rms_change_pa:g} is not between "
                f"0 and largest_change_pa {row.largest_change_pa:g}"
            )


# --- arrays --------------------------------------------------------------------------------------


def _check_fields(results: Results) -> None:
    """Surface, tools and their paths, control points, inclusions, section, and model fields."""
    file, fields, record = "fields.npz", results.fields, results.record
    if results.scene.is_point:
        return check_names(file, fields, [])
    names = [model.name for model in record.models]
    inside = {"inclusions": "ko3"} if results.scene.tissue.inclusion else {}
    inside |= {"ways": "wv3"} if "travelling-loads" in results.scene.features else {}
    surface = {**SURFACE, **inside}
    of_models = {start + name: dims for name in names for start, dims in OF_MODEL.items()}
    check_names(file, fields, [*surface, *of_models])
    check_shapes(file, fields, {**surface, **of_models}, {"p": len(record.probes)})
    ended = {model.name for model in record.models if model.status != "finished"}
    lost = {start + name for name in ended for start in OF_MODEL}
    check_numbers(file, {name: array for name, array in fields.items() if name not in lost})
    for name, of in (("triangles", "points"), ("cut_triangles", "cut")):
        _check_indices(file, name, fields[name], len(fields[of]))
    _check_indices(file, "film", fields["film"], results.scene.time.samples)
    return None


def _check_indices(file: str, name: str, array: NDArray[Any], count: int) -> None:
    if array.dtype.kind not in "iu" or not ((array >= 0) & (array < count)).all():
        raise ValueError(f"{file}: array {name} names points that are not there")


def _check_fuzzy(results: Results) -> None:
    """Sets of each variable, and output surface and view of the rules of each system."""
    file, arrays, systems = "fuzzy.npz", results.fuzzy, list(results.record.fuzzy.systems)
    if results.scene.fuzzy.rule_base is not None:
        return check_names(file, arrays, [])
    variables = [name.removesuffix(".sets") for name in arrays if name.endswith(".sets")]
    if systems and "stiffness" not in variables:
        raise ValueError(f"{file}: array stiffness.sets is missing")
    shapes = [{f"{one}.{part}": dims for part, dims in SETS.items()} for one in variables]
    shapes += [{f"view.{system}.{part}": dims for part, dims in VIEW.items()} for system in systems]
    surfaces = {f"surface.{name}": "yx" for name in systems}
    shapes += [{"surface.x": "x", "surface.y": "y", **surfaces}] if systems else []
    check_names(file, arrays, [name.removesuffix("?") for group in shapes for name in group])
    for group in shapes:
        check_shapes(file, arrays, group, {})
    check_numbers(file, arrays, TEXTS)
    return None
