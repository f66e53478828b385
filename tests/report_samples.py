"""A small results folder made up by hand, for the tests of the report."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import typst

from reports import report
from reports.content import document
from study.results.folder import Results, Row
from study.similarity.score import MEASURES

TITLE = "An octahedron under a tool"
FUZZY = ["msm-mamdani", "msm-sugeno", "msm-interval-type-2"]
MODELS = ["fem", "basafa", *FUZZY]
SOFTNESS = dict(zip(MODELS, (1.0, 2.0, 0.70, 0.80, 0.69), strict=True))
ESTIMATES = {"mamdani": 13.9e3, "sugeno": 12e3, "interval-type-2": 14e3}
PROBES = ["tool", "far"]
SAMPLES = 20
# The record of a reference whose error is known by three meshes; `_record` has that of older runs.
THREE_MESHES: dict[str, Any] = {
    "element": "p2",
    "unknowns": 7803,
    "method": "ritz-vectors",
    "subspace_vectors": 57,
    "truncation_error": 0.0004,
    "mesh_levels": [
        {"size": 2.0, "elements": 100, "unknowns": 1215, "wall_s": 0.9},
        {"size": 1.5, "elements": 300, "unknowns": 3549, "wall_s": 1.3},
        {"size": 1.0, "elements": 800, "unknowns": 7803, "wall_s": 3.5},
    ],
    "mesh_error_by_probe": {
        "tool": {"displacement": 0.01, "velocity": 0.012},
        "far": {"displacement": 0.02, "velocity": 0.05},
    },
    "mesh_order": {"field_peak": 1.6},
    "mesh_order_by_probe": {
        "tool": {"displacement": 0.8, "velocity": 3.4},
        "far": {"displacement": 2.5, "velocity": None},
    },
}
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
    tables = {
        "curves": [row for m in models for p in probes for row in _curve(m, p)],
        "bands": [row for p in probes for row in _band(p)] if FUZZY[2] in models else [],
        "similarity": [row for pair in _pairs(models) for p in probes for row in _scores(pair, p)],
        "errors": [row for pair in _pairs(models) for row in _errors(pair)],
    }
    arrays = {"fields": _fields(models, len(probes)), "fuzzy": _fuzzy_arrays()}
    return Results("", _numbers(models, probes, title), tables, arrays)


def with_meshes(models: list[str] | None = None, **changes: Any) -> Results:
    """Results whose reference has three meshes, with some of its record changed."""
    results = results_of(models)
    results.numbers["models"][0] |= THREE_MESHES | changes
    return results


def bare(results: Results | None = None) -> dict[str, Any]:
    """Content of a report without figures."""
    results = replace(results or results_of(), arrays={})
    results.numbers.pop("lattice_limits", None)  # the text on them refers to a figure
    return document(results) | {"drawing": None}


def printed(content: dict[str, Any]) -> list[str]:
    """Every text in the figures and strong words of the document that typst lays out."""

    def query(path: str, *, root: str, ignore_system_fonts: bool) -> bytes:
        given: Any = {"root": root, "ignore_system_fonts": ignore_system_fonts}
        return "".join(typst.query(path, kind, **given) for kind in ("figure", "strong")).encode()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typst, "compile", query)
        text = report.compile_pdf(content, {"motion": []}).decode()
    return [json.loads(piece) for piece in TEXT.findall(text)]


def _numbers(models: list[str], probes: list[str], title: str) -> dict[str, Any]:
    place = {"side": "anterior", "at": [0.5, 0.5], "snap": True}
    return {
        "schema_version": 1,
        "title": title,
        "scene": {
            "title": title,
            "models": ["fem", "basafa", "msm"],
            "organ": {"shape": "liver"},
            "tool": {"place": place, "force": "0.5 N"},
            "tissue": {"youngs_modulus": "10000.0 Pa", "poisson_ratio": 0.45},
            "control_points": dict.fromkeys(probes, place),
            "renders": True,
        },
        "stiffness": {m[4:]: _stiffness(m[4:]) for m in models if m in FUZZY},
        "rule_count": 247,
        "probes": probes,
        "models": [_record(model) for model in models],
        "checks": [
            {
                "name": "mass",
                "value": 0.01,
                "limit": 0.05,
                "passed": True,
                "meaning": "of the organ",
            },
            {"name": "step", "value": 0.02, "limit": 0.01, "passed": False, "meaning": "of time"},
        ],
        "strain_limit": 0.05,
        "warnings": [],
        "assumptions": ["The shape is an octahedron.", "There is no gravity."],
        "notes": ["Made up by hand."],
        "study_wall_s": 12.0,
        "provenance": {
            "versions": {"python": "3.11.7", "numpy": "2.4.6"},
            "commit": None,
            "platform": "Linux",
            "scene_sha256": 64 * "a",
        },
        "dimensionless": {"extent_m": 0.1, "volume_m3": 1.667e-4},
        "lattice_limits": {
            "spacing_m": 0.01,
            "poisson_ratio": 0.45,
            "relative_l2_at_quarter": 0.05,
            "relative_l2": 0.24,
            "best_factor": 0.95,
            "relative_l2_at_best_factor": 0.23,
        },
    }


def _stiffness(system: str) -> dict[str, Any]:
    found = {
        "estimate_pa": ESTIMATES[system],
        "relative_to_reference": ESTIMATES[system] / 10e3,
        "quadrature_error_pa": 38.0,
        "notes": ["hbv: no reading"],
    }
    return found | ({"interval_pa": [12.5e3, 16e3]} if system == "interval-type-2" else {})


def _record(model: str) -> dict[str, Any]:
    record: dict[str, Any] = {
        "name": model,
        "simulated_s": 1.0,
        "status": "finished",
        "diverged_at_s": None,
        "diverged_near_m": None,
        "nodes": 1000,
        "time_step_s": 1e-3,
        "critical_time_step_s": 2e-3,
        "steps": 1000,
        "wall_s": 0.5,
        "time_step_error": 0.001,
        "time_step_error_velocity": 0.01,
    }
    if model == "fem":
        mesh = {"field_peak": 0.03, "displacement": 0.02, "velocity": 0.05}
        return record | {"elements": 800, "mesh_error": mesh, "largest_strain": 0.04}
    return record | {"springs": 9000}


def _curve(model: str, probe: str) -> list[Row]:
    times = np.linspace(0.0, 1.0, SAMPLES)
    u = 1e-3 * SOFTNESS[model] * np.sin(np.pi * times)
    v = 1e-3 * SOFTNESS[model] * np.pi * np.cos(np.pi * times)
    return [(model, probe, *map(float, row)) for row in zip(times, u, v, strict=True)]


def _band(probe: str) -> list[Row]:
    rows = _curve(FUZZY[2], probe)
    return [
        (m, p, t, 1.1 * float(u), 0.9 * float(u), 1.1 * float(v), 0.9 * float(v))
        for m, p, t, u, v in rows
    ]


def _pairs(models: list[str]) -> list[tuple[str, str]]:
    pairs = [(m, "fem") for m in models if m != "fem" and "fem" in models]
    return pairs + [(m, "basafa") for m in models if m in FUZZY and "basafa" in models]


def score_of(model: str, reference: str) -> float:
    """Score of every measure: one minus the relative difference of the softness."""
    return max(0.0, 1.0 - abs(SOFTNESS[model] / SOFTNESS[reference] - 1.0))


def _scores(pair: tuple[str, str], probe: str) -> list[Row]:
    return [
        (*pair, probe, curve, measure.name, score_of(*pair))
        for curve, measures in MEASURES.items()
        for measure in measures
    ]


def _errors(pair: tuple[str, str]) -> list[Row]:
    values = {
        "field-relative-l2-peak": 0.4,
        "field-relative-l2-final": 0.5,
        "field-l2-final-over-peak": 0.1,
        "field-best-factor-peak": 1.3,
        "field-relative-l2-peak-at-best-factor": 0.25,
    }
    return [(*pair, name, value) for name, value in values.items()]


def _fields(models: list[str], probe_count: int) -> dict[str, np.ndarray]:
    shape = np.exp(-((POINTS - [0.0, -0.05, 0.0]) ** 2).sum(axis=1) / 0.03**2)
    peak = 1e-3 * shape[:, np.newaxis] * np.array([0.0, 1.0, 0.0])
    fields = {
        "points": POINTS,
        "triangles": TRIANGLES,
        "tool": np.array([[0.0, -0.05, 0.0], [0.0, 1.0, 0.0]]),
        "probes": POINTS[(3 + np.arange(probe_count)) % len(POINTS)],
    }
    return fields | {m: SOFTNESS[m] * np.stack([peak, 0.2 * peak]) for m in models}


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
