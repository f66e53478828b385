"""Results of a study in memory."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from study.problem.response import Motion, ToolCurve
from study.results.arrays import Arrays
from study.results.records import ModelRecord, StudyRecord
from study.results.tables import (
    BandSample,
    CertifiedSample,
    CurveSample,
    FieldDifference,
    Iso18571Rating,
    ScoreDifference,
    ScoreError,
    SensitivityEntry,
    SimilarityScore,
    ToolForceSample,
    ToolForceScore,
)
from study.scene.schema import Scene


@dataclass(frozen=True)
class Results:
    """Content of a results folder.

    `record`: the numbers; then the rows of the tables. `fields`: arrays of the surface and of each
    model's displacement on it; `fuzzy`: sets and output surfaces. Both are for figures, and empty
    where a scene has none.
    """

    scene: Scene
    record: StudyRecord
    curves: tuple[CurveSample, ...] = ()
    bands: tuple[BandSample, ...] = ()
    certified: tuple[CertifiedSample, ...] = ()
    tool_forces: tuple[ToolForceSample, ...] = ()
    tool_scores: tuple[ToolForceScore, ...] = ()
    scores: tuple[SimilarityScore, ...] = ()
    ratings: tuple[Iso18571Rating, ...] = ()
    score_errors: tuple[ScoreError, ...] = ()
    score_differences: tuple[ScoreDifference, ...] = ()
    field_differences: tuple[FieldDifference, ...] = ()
    sensitivity: tuple[SensitivityEntry, ...] = ()
    fields: Arrays = field(default_factory=dict)
    fuzzy: Arrays = field(default_factory=dict)

    @classmethod
    def load(cls, folder: Path | str) -> Results:
        """Content of a folder, fully checked. ResultsError: see `study.results.folder.read`."""
        from study.results.folder import read  # it imports this module

        return read(Path(folder))

    def model(self, name: str) -> ModelRecord:
        """Record of a model. KeyError with the names there are."""
        for record in self.record.models:
            if record.name == name:
                return record
        raise KeyError(f"{name}: not among {', '.join(one.name for one in self.record.models)}")

    def tool_force(self, model: str, tool: str) -> ToolCurve:
        """Force of a rigid tool on a model's body, up to the end of the run.

        KeyError for an unknown model or tool.
        """
        self.model(model)
        if tool not in {one.tool for one in self.record.tools}:
            raise KeyError(f"{tool}: is no rigid tool of this scene")
        rows = [row[2:] for row in self.tool_forces if row.model == model and row.tool == tool]
        return ToolCurve(*np.array(rows, dtype=np.float64).reshape(-1, 4).T)

    def curve(self, model: str, probe: str) -> Motion:
        """Time [s], displacement [m] and velocity [m/s] along the push, (samples,) each.

        Samples after the divergence of a run are missing. KeyError for an unknown model or control
        point.
        """
        self.model(model)
        if probe not in self.record.probes:
            raise KeyError(f"{probe}: not among {', '.join(self.record.probes)}")
        rows = [row[2:] for row in self.curves if row.model == model and row.probe == probe]
        return Motion(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)
