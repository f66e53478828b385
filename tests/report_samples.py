"""A small results folder made up by hand, for the tests of the report."""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import typst

from reports import measured, report
from reports.content import document
from study.results import Results
from study.results.records import (
    Check,
    CurveErrors,
    CurveOrders,
    Dimensionless,
    DiscretisationError,
    ElementsRecord,
    FuzzyRecord,
    LatticeLimits,
    LatticeRecord,
    MeshLevel,
    ModelRecord,
    Provenance,
    StudyRecord,
    SystemEstimate,
)
from study.results.tables import (
    BandSample,
    CurveSample,
    FieldDifference,
    Iso18571Rating,
    ScoreDifference,
    ScoreError,
    SimilarityScore,
    paired,
)
from study.scene.file import write_scene
from study.scene.schema import Fuzzy, OrganTissue, Place, Scene, Time
from study.similarity.score import MEASURES

TITLE = "An octahedron under a tool"
FUZZY = ["msm-mamdani", "msm-sugeno", "msm-interval-type-2"]
MODELS = ["fem", "basafa", *FUZZY]
LABELS = ["Finite elements", "Basafa benchmark", "MSM Mamdani", "MSM Sugeno", "MSM type-2"]
SOFTNESS = dict(zip(MODELS, (1.0, 2.0, 0.70, 0.80, 0.69), strict=True))
ESTIMATES = {"mamdani": 13.9e3, "sugeno": 12e3, "interval-type-2": 14e3}
PROBES = ["tool", "far"]
SAMPLES = 20
LEVELS = (
    MeshLevel(size=2.0, elements=100, unknowns=1215, wall_s=0.9),
    MeshLevel(size=1.5, elements=300, unknowns=3549, wall_s=1.3),
    MeshLevel(size=1.0, elements=800, unknowns=7803, wall_s=3.5),
)
# By their place among the control points; the last stands for all that follow.
MESH_ERRORS = (
    CurveErrors(displacement=0.01, velocity=0.012),
    CurveErrors(displacement=0.02, velocity=0.05),
)
MESH_ORDERS = (
    CurveOrders(displacement=0.8, velocity=3.4),
    CurveOrders(displacement=2.5, velocity=None),
)
TEXT = re.compile(r'"text": ?("(?:[^"\\]|\\.)*")')
POINTS = 0.05 * np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float
)
TRIANGLES = np.array(
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
)


def results_of(
    models: list[str] | None = None, probes: list[str] | None = None, title: str = TITLE
) -> Results:
    """Results of these models and control points."""
    models, probes = models or MODELS, probes or PROBES
    scene = _scene(models, probes, title)
    return Results(
        scene,
        _record(models, probes, scene),
        curves=tuple(row for m in models for p in probes for row in _curve(m, p)),
        bands=tuple(row for p in probes if FUZZY[2] in models for row in _band(p)),
        scores=tuple(row for pair in _pairs(models) for p in probes for row in _scores(pair, p)),
        **known(tuple(row for pair in _pairs(models) for p in probes for row in _scores(pair, p))),
        field_differences=tuple(row for pair in _pairs(models) for row in _differences(pair)),
        fields=_fields(models, len(probes)),
        fuzzy=_fuzzy_arrays(),
    )


def whole() -> Results:
    """Results that a folder may hold: without fuzzy systems, whose views the samples lack."""
    return replace(results_of(["fem", "basafa"]), fuzzy={})


def with_record(results: Results, **changes: Any) -> Results:
    """The same with some of the record changed."""
    return replace(results, record=replace(results.record, **changes))


def with_model(results: Results, name: str, **changes: Any) -> Results:
    """The same with some of one model's record changed."""
    models = [replace(m, **changes) if m.name == name else m for m in results.record.models]
    return with_record(results, models=tuple(models))


def with_elements(results: Results | None = None, **changes: Any) -> Results:
    """The same with some of what only the finite elements have changed."""
    results = results or results_of()
    elements = results.model("fem").elements
    return with_model(results, "fem", elements=replace(elements, **changes))


def with_mesh_error(results: Results | None = None, **changes: Any) -> Results:
    """The same with some of the error of the finite elements by their mesh changed."""
    results = results or results_of()
    return with_elements(results, mesh_error=replace(results.model("fem").mesh_error, **changes))


def without_arrays(results: Results | None = None) -> Results:
    """The same without fields and fuzzy sets to draw."""
    return replace(results or results_of(), fields={}, fuzzy={})


def bare(results: Results | None = None) -> dict[str, Any]:
    """Content of a report without figures."""
    results = without_arrays(results)
    results = with_record(results, lattice_limits=None)  # the text on them refers to a figure
    return document(results) | {"drawing": None}


def beforehand() -> dict[str, Any]:
    """Content of the document of what was measured beforehand, without the rankings' figures."""
    return measured.measured() | dict.fromkeys(("ranking_study", "organ_ranking"))


def beforehand_pdf(figures: report.Figures | None = None) -> bytes:
    """That document without figures, or with some."""
    return report.compile_pdf(beforehand(), figures or {}, measured.TEMPLATE)


def printed(content: dict[str, Any], name: str = report.TEMPLATE) -> list[str]:
    """Every text in the figures and strong words of a document that typst lays out."""

    def query(path: str, *, root: str, ignore_system_fonts: bool, **_: Any) -> bytes:
        given: Any = {"root": root, "ignore_system_fonts": ignore_system_fonts}
        return "".join(typst.query(path, kind, **given) for kind in ("figure", "strong")).encode()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typst, "compile", query)
        text = report.compile_pdf(content, {"motion": []}, name).decode()
    # A number and its unit are kept on one line by a space that does not break.
    return [json.loads(piece).replace("\u00a0", " ") for piece in TEXT.findall(text)]


def printed_beforehand() -> list[str]:
    """Every text in the figures and strong words of what was measured beforehand."""
    return printed(beforehand(), measured.TEMPLATE)


def _scene(models: list[str], probes: list[str], title: str) -> Scene:
    return Scene(
        title=title,
        models=tuple(dict.fromkeys("msm" if model in FUZZY else model for model in models)),
        fuzzy=Fuzzy(systems=tuple(_systems(models)), sensitivity_readings=0),
        time=Time(duration=1.0, samples=SAMPLES),
        tissue=OrganTissue(youngs_modulus=10e3),
        control_points=dict.fromkeys(probes, Place(side="anterior", at=(0.5, 0.5))),
    )


def _systems(models: list[str]) -> list[str]:
    return [model[4:] for model in models if model in FUZZY]


def _record(models: list[str], probes: list[str], scene: Scene) -> StudyRecord:
    return StudyRecord(
        title=scene.title,
        probes=tuple(probes),
        fuzzy=FuzzyRecord(
            systems={system: _estimate(system) for system in _systems(models)}, rule_count=247
        ),
        models=tuple(model_record(model, probes) for model in models),
        references=tuple(name for name in ("fem", "basafa") if name in models),
        checks=(
            Check(name="mass", value=0.01, limit=0.05, meaning="of the organ"),
            Check(name="step", value=0.02, limit=0.01, meaning="of time"),
        ),
        warnings=(),
        assumptions=("The shape is an octahedron.", "There is no gravity."),
        notes=("Made up by hand.",),
        strain_limit=0.05,
        study_wall_s=12.0,
        provenance=Provenance(
            versions={"python": "3.11.7", "numpy": "2.4.6"},
            commit=None,
            platform="Linux",
            processor=None,
            seed=None,
            scene_sha256=hashlib.sha256(write_scene(scene).encode()).hexdigest(),
            mesh_sha256=None,
        ),
        dimensionless=Dimensionless(
            extent_m=0.1,
            volume_m3=1.667e-4,
            sag_rho_g_l_over_e=0.1,
            tool_pressure_over_e=0.02,
            tool_radius_over_spacing=2.5,
            tool_radius_over_element_size=1.5,
        ),
        lattice_limits=LatticeLimits(
            spacing_m=0.01,
            poisson_ratio=0.45,
            relative_l2_at_quarter=0.05,
            relative_l2=0.24,
            best_factor=0.95,
            relative_l2_at_best_factor=0.23,
            relative_l2_with_volume_term=None,
        ),
    )


def _estimate(system: str) -> SystemEstimate:
    return SystemEstimate(
        estimate_pa=ESTIMATES[system],
        relative_to_reference=ESTIMATES[system] / 10e3,
        quadrature_error_pa=38.0,
        method="made up",
        notes=("hbv: no reading",),
        interval_pa=(12.5e3, 16e3) if system == "interval-type-2" else None,
    )


def model_record(name: str, probes: list[str]) -> ModelRecord:
    """Record of a model that finished, a lattice unless it is the finite elements."""
    by_step = CurveErrors(displacement=0.001, velocity=0.01)
    is_fem = name == "fem"
    return ModelRecord(
        name=name,
        label=dict(zip(MODELS, LABELS, strict=True))[name],
        simulated_s=1.0,
        status="finished",
        system=name[4:] if name in FUZZY else None,
        nodes=1000,
        time_step_s=1e-3,
        critical_time_step_s=2e-3,
        steps=1000,
        wall_s=0.5,
        largest_strain=0.04 if is_fem else None,
        time_step_errors=dict.fromkeys(probes, by_step),
        elements=_elements(probes) if is_fem else None,
        lattice=None if is_fem else LATTICE,
    )


LATTICE = LatticeRecord(
    springs=9000,
    integrator="symplectic-euler",
    poisson_ratio=0.25,
    smallest_time_step_s=1e-3,
    smallest_step_margin=2.0,
    repeated_steps=0,
    node_mass_kg=1e-3,
    inverted_cells=0,
)


def _elements(probes: list[str]) -> ElementsRecord:
    place = {probe: min(k, 1) for k, probe in enumerate(probes)}
    return ElementsRecord(
        element="p2",
        elements=800,
        unknowns=7803,
        method="ritz-vectors",
        subspace_vectors=57,
        truncation_error=0.0004,
        levels=LEVELS,
        mesh_error=DiscretisationError(
            field_peak=0.03,
            field_order=1.6,
            formal_order=3.0,
            by_probe={probe: MESH_ERRORS[k] for probe, k in place.items()},
            order_by_probe={probe: MESH_ORDERS[k] for probe, k in place.items()},
        ),
    )


def _curve(model: str, probe: str) -> Iterator[CurveSample]:
    times = np.linspace(0.0, 1.0, SAMPLES)
    u = 1e-3 * SOFTNESS[model] * np.sin(np.pi * times)
    v = 1e-3 * SOFTNESS[model] * np.pi * np.cos(np.pi * times)
    for row in zip(times, u, v, strict=True):
        yield CurveSample(model, probe, *map(float, row))


def _band(probe: str) -> Iterator[BandSample]:
    for model, _, t, u, v in _curve(FUZZY[2], probe):
        yield BandSample(model, probe, t, 1.1 * u, 0.9 * u, 1.1 * v, 0.9 * v)


def _pairs(models: list[str]) -> list[tuple[str, str]]:
    pairs = [(m, "fem") for m in models if m != "fem" and "fem" in models]
    return pairs + [(m, "basafa") for m in models if m in FUZZY and "basafa" in models]


def score_of(model: str, reference: str) -> float:
    """Score of every measure: one minus the relative difference of the softness."""
    return max(0.0, 1.0 - abs(SOFTNESS[model] / SOFTNESS[reference] - 1.0))


def _scores(pair: tuple[str, str], probe: str) -> list[SimilarityScore]:
    return [
        SimilarityScore(*pair, probe, curve, measure.name, score_of(*pair))
        for curve, measures in MEASURES.items()
        for measure in measures
    ]


def known(scores: tuple[SimilarityScore, ...]) -> dict[str, Any]:
    """Tables on how well scores are known: a thousandth each way, and every rank open."""
    places = Counter(row[1:5] for row in scores)
    of = {row[:5]: row.score for row in scores}
    return {
        "ratings": tuple(
            Iso18571Rating(*row[:4], *[row.score] * 4)
            for row in scores
            if row.measure == "iso-18571"
        ),
        "score_errors": tuple(
            ScoreError(
                *row[:5],
                low=max(row.score - 1e-3, 0.0),
                high=min(row.score + 1e-3, 1.0),
                resampled=1e-4,
                window=0.02,
                normalised=0.03 if row.curve == "phase-plane" else 0.0,
                numerical=0.01,
                first_rank=1,
                last_rank=places[row[1:5]],
            )
            for row in scores
        ),
        "score_differences": tuple(
            _apart(one[0], row.model, row[1:5], of[one[0], *row[1:5]] - row.score)
            for one, other in paired(list(dict.fromkeys(row[:3] for row in scores)))
            for row in scores
            if row[:3] == other
        ),
    }


def _apart(model: str, other: str, place: Any, apart: float) -> ScoreDifference:
    return ScoreDifference(
        model, other, *place, apart, apart - 1e-3, apart + 1e-3, 1e-4, 0.02, 0.0, 0.01
    )


def _differences(pair: tuple[str, str]) -> list[FieldDifference]:
    values = {
        "field-relative-l2-peak": 0.4,
        "field-relative-l2-final": 0.5,
        "field-l2-final-over-peak": 0.1,
        "field-best-factor-peak": 1.3,
        "field-relative-l2-peak-at-best-factor": 0.25,
    }
    return [FieldDifference(*pair, name, value) for name, value in values.items()]


def _fields(models: list[str], probe_count: int) -> dict[str, np.ndarray]:
    shape = np.exp(-((POINTS - [0.0, -0.05, 0.0]) ** 2).sum(axis=1) / 0.03**2)
    peak = 1e-3 * shape[:, np.newaxis] * np.array([0.0, 1.0, 0.0])
    fields: dict[str, np.ndarray] = {
        "points": POINTS,
        "triangles": TRIANGLES,
        "tool": np.array([[0.0, -0.05, 0.0], [0.0, 1.0, 0.0]]),
        "probes": POINTS[(3 + np.arange(probe_count)) % len(POINTS)],
    }
    fields |= {"held": np.eye(8)[0], "loaded": np.eye(8)[1], "film": np.array([0, 10, SAMPLES - 1])}
    fields |= {"cut": POINTS[[0, 2, 1, 3]], "cut_triangles": np.array([[0, 1, 2], [0, 2, 3]])}
    for model in models:
        frames = SOFTNESS[model] * np.stack([peak, 0.2 * peak])
        film = np.stack([0.0 * peak, *frames]).astype(np.float32)
        fields |= {model: frames, f"cut.{model}": frames[:, [0, 2, 1, 3]], f"film.{model}": film}
    return fields


def _fuzzy_arrays() -> dict[str, np.ndarray]:
    x = np.linspace(2e3, 75e3, 31)
    mild = np.exp(-((x - 7e3) ** 2) / (2 * 3e3**2))
    sets = np.stack([mild, 1.0 - mild])
    arrays: dict[str, np.ndarray] = {}
    for name in ("hcv", "hbv", "stiffness"):
        arrays[f"{name}.sets"] = np.array(["mild", "severe"])
        arrays |= {f"{name}.x": x, f"{name}.principal": sets}
        arrays |= {f"{name}.lower": 0.9 * sets, f"{name}.upper": np.minimum(1.0, 1.1 * sets)}
    grid = np.linspace(2e3, 75e3, 5)
    surfaces = {f"surface.{name}": np.add.outer(grid, grid) for name in ESTIMATES}
    return arrays | {"surface.x": grid, "surface.y": grid} | surfaces
