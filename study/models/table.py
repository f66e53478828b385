"""The table of models, by the names that a scene gives them."""

from __future__ import annotations

from collections.abc import Iterator
from pkgutil import resolve_name
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from study.models.model import Estimates, Model, ModelKind, PointModel
    from study.scene import Scene

MODELS = {
    "fem": "study.models.finite_elements:KIND",
    "hyperelastic": "study.models.hyperelastic:KIND",
    "basafa": "study.models.basafa:KIND",
    "msm": "study.models.fuzzy_tuned:KIND",
    "reading": "study.models.reading:KIND",
    "tissue": "study.models.tissue:KIND",
    "region": "study.models.region:KIND",
    "superposition": "study.models.superposition:KIND",
    "corrected": "study.models.corrected:KIND",
}
"""Where each kind is defined; imported when it is used, since the models take long to import."""


def kind(name: str) -> ModelKind:
    """The kind of a name. ValueError with the existing names."""
    if name not in MODELS:
        raise ValueError(f"models: {name!r} is no model; there are {', '.join(MODELS)}")
    found: ModelKind = resolve_name(MODELS[name])
    return found


def named(scene: Scene) -> list[str]:
    """Names of the kinds in a scene, in the order of the table, which is the order of the runs."""
    return sorted(scene.models, key=list(MODELS).index)


def models_of(scene: Scene, estimates: Estimates) -> Iterator[Model]:
    """All models that a scene with an organ names. ValueError for two of the same name."""
    seen: set[str] = set()
    for name in named(scene):
        of_kind = kind(name)
        for found in of_kind.models(of_kind.relevant_part(scene), estimates):
            if found.name in seen:
                raise ValueError(f"models: {name} makes a second model named {found.name}")
            seen.add(found.name)
            yield found


def point_models_of(scene: Scene, estimates: Estimates) -> Iterator[PointModel]:
    """All models of a scene that is a single point. ValueError for one that needs an organ."""
    for name in named(scene):
        on_point = kind(name).on_point
        if on_point is None:
            raise ValueError(f"models: {name} needs an organ with a mesh; a point has none")
        yield from on_point(scene, estimates)


def model(scene: Scene, name: str) -> Model:
    """The single model of a kind. ValueError for a kind of several, such as fuzzy estimates."""
    found = list(kind(name).models(kind(name).relevant_part(scene), {}))
    if len(found) != 1:
        raise ValueError(
            f"models: {name} is a kind of several models; name a kind that is one model"
        )
    return found[0]


def references(scene: Scene) -> list[str]:
    """Names of the kinds in a scene that the others are compared with."""
    return [name for name in named(scene) if kind(name).is_reference]


def is_tuned(scene: Scene) -> bool:
    """Whether a scene has models that need fuzzy estimates."""
    return any(kind(name).is_tuned for name in named(scene))


def assumptions(scene: Scene) -> list[str]:
    """The assumptions of each kind in a scene, without repetition."""
    return list(
        dict.fromkeys(text for name in named(scene) for text in kind(name).assumptions(scene))
    )
