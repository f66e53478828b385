"""Scores over the reference spacing h_0, which the paper does not print.

Table II is of forces, so the modulus that it stands for, 2.5 K_1 / h_0^2, is chosen with h_0 alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from study.models import basafa
from study.models.estimates import estimates
from study.models.model import SILENT
from study.models.table import point_models_of
from study.robustness.rows import AtSpacing
from study.scene import Scene
from study.scene.problem import point_problem_of
from study.similarity.score import scores

SPACINGS = np.geomspace(2e-3, 8e-3, 41)
"""[m] From a benchmark of 31 kPa to one of 2.0 kPa."""


def over_spacing(scene: Scene) -> Iterator[AtSpacing]:
    """Scores of each fuzzy system at each of SPACINGS, all else as in a scene of a single point.

    The benchmark does not depend on the estimates, nor they on h_0. ValueError for a scene without
    the benchmark or without fuzzy systems.
    """
    if not (scene.is_point and {"basafa", "msm"} <= set(scene.models)):
        raise ValueError("scene: give a single point with basafa and msm among its models")
    found = estimates(scene)
    for h_0 in SPACINGS:
        at = replace(scene, damping=replace(scene.damping, reference_spacing=float(h_0)))
        problem = point_problem_of(at)
        models = point_models_of(at, found)
        motions = {
            model.name: problem.response.motion(model.run(problem, SILENT).trajectory, 0)
            for model in models
        }
        benchmark = basafa.modulus(at)
        for system, estimate in found.items():
            for one in scores(motions[f"msm-{system}"], motions["basafa"]):
                yield AtSpacing(
                    float(h_0),
                    benchmark,
                    system,
                    estimate.estimate,
                    one.curve,
                    one.measure,
                    one.value,
                )
