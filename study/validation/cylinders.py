"""Silicone cylinders between plates: prediction of the force at 10 to 30 % from that at 1 to 5 %.

The modulus of each material is fitted to the increase of the force from 1 to 5 %; forces beyond are
predictions. The friction of the plates was not reported, so both conditions are computed. All
models scale with the modulus, so that one solution serves all materials.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from study.system.progress import Progress
from study.validation.bodies import BONDED, FACES, cylinder
from study.validation.comparison import Comparison, own_error
from study.validation.measured import Compression, compressions
from study.validation.predictions import KINDS, Kind, Prediction
from study.validation.specimen import Specimen

Floats = NDArray[np.float64]

NAME = "cylinders"
SLOPE = (0.01, 0.05)
PREDICTED = (0.1, 0.2, 0.3)
STRAINS = (*SLOPE, *PREDICTED)
MODULUS = 1e4
"""[Pa], of the one solution."""
LOAD_ZERO = 0.1
"""[N], zero error of the testing machine."""
FITTED = "modulus, to the increase of the force from 1 to 5 %"


def comparisons(kinds: tuple[str, ...], levels: int, progress: Progress) -> Iterator[Comparison]:
    """For all materials, by both conditions of the faces and each kind of model."""
    for faces in FACES:
        specimen = cylinder(faces)
        for name in kinds:
            with progress.stage(f"{NAME}, {faces}: {KINDS[name].label}"):
                curves = _curves(specimen, KINDS[name], faces, levels)
            for measured in compressions():
                yield from _of_material(measured, curves, KINDS[name], faces)


def _curves(
    specimen: Specimen, kind: Kind, faces: str, levels: int
) -> tuple[list[Prediction], list[float]]:
    """Predictions on meshes or spacings, coarse to fine, and their sizes."""
    whole = [mesh.size for mesh in specimen.meshes] if kind.elements else list(specimen.spacings)
    # Between sliding plates the strain is uniform, and elements of any size are exact.
    count = 2 if kind.elements and faces != BONDED else levels
    numbers = range(min(count, len(whole)))
    return [kind.solve(specimen, n, MODULUS, STRAINS) for n in numbers], [whole[n] for n in numbers]


def _of_material(
    measured: Compression, curves: tuple[list[Prediction], list[float]], kind: Kind, faces: str
) -> Iterator[Comparison]:
    answers, sizes = curves
    forces = [_padded(-answer.force) for answer in answers]
    rise = measured.at(SLOPE[1])[0] - measured.at(SLOPE[0])[0]
    scales = [rise / (force[1] - force[0]) for force in forces]
    for place, strain in enumerate(PREDICTED, len(SLOPE)):
        values = [scale * force[place] for scale, force in zip(scales, forces, strict=True)]
        force, deviation = measured.at(strain)
        if np.isnan(force):
            continue
        yield Comparison(
            problem=NAME,
            case=measured.material,
            faces=faces,
            model=kind.label,
            quantity=f"force at {100 * strain:.0f} %",
            unit="N",
            measured=force,
            uncertainty=float(np.hypot(deviation, LOAD_ZERO)),
            found=float(values[-1]),
            numerical=own_error(values, sizes),
            modulus=float(MODULUS * scales[-1]),
            fitted=FITTED,
            note=answers[-1].failure,
        )


def _padded(force: Floats) -> Floats:
    """Forces at all strains, nan where the model did not reach the strain."""
    return np.concatenate([force, np.full(len(STRAINS) - len(force), np.nan)])
