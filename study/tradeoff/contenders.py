"""The contenders by name, and the settings of their configurations.

A contender is a model with a family of settings. Other models of a scene take part as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from msm.integrators import INTEGRATORS
from msm.stability import DEFAULT
from msm.stepper import WITH_TOOL_CONTACT
from study.models.model import Model
from study.models.table import MODELS, kind, model
from study.models.tissue import FRACTION, lacks_poisson_ratio
from study.problem.features import FEATURES
from study.scene import Scene

Settings = Mapping[str, str | float | int | bool]
"""Plain values by name, as `Model.varied` takes them."""

FRAME_RATE = 60.0
FAST = 250.0
"""Steps per second [Hz] beyond the frame rate, to show the time-step error."""


@dataclass(frozen=True)
class Contender:
    """A model by the name of its kind, and the settings with which it takes part.

    `always`: settings that all of them share; `unable`: names of `study.problem.features.FEATURES`
    that its steps do not support, though a run of its kind may.
    """

    model: str
    settings: Callable[[Scene], Iterator[Settings]]
    always: Settings = field(default_factory=dict)
    unable: frozenset[str] = frozenset()

    def lacks(self, scene: Scene) -> list[str]:
        """Names of the features of a scene that it does not support."""
        able = kind(self.model).supported_features - self.unable
        return [feature for feature in scene.features if feature not in able]


def is_moved(scene: Scene) -> bool:
    """Whether a scene has moved tools, so that the force is the criterion."""
    return "moved-tools" in scene.features


def fraction(scene: Scene) -> float:
    """Time step over the critical one: the scene's own where tools are moved."""
    return scene.lattice.step_fraction if is_moved(scene) else FRACTION


def lattice_settings(scene: Scene, times: float, **more: str | float | bool) -> Settings:
    """A lattice of `times` the scene's spacing, with the tissue's Poisson ratio."""
    spacing = times * scene.lattice.spacing
    return {"spacing": spacing, "volume_term": lacks_poisson_ratio(scene)} | more


def _springs(scene: Scene) -> Iterator[Settings]:
    """Springs alone, with Poisson ratio 1/4 whatever the tissue's."""
    for times in (2.0, 1.5, 1.0, 0.75):
        spacing = times * scene.lattice.spacing
        yield {"spacing": spacing, "volume_term": False, "step_fraction": fraction(scene)}


def _volume_springs(scene: Scene) -> Iterator[Settings]:
    """Springs with the volume term; none for a tissue whose ratio springs have anyway."""
    spacings = (2.0, 1.75, 1.5, 1.25, 1.0, 0.8, 2.0 / 3.0, 0.5)
    for times in spacings if lacks_poisson_ratio(scene) else ():
        yield lattice_settings(scene, times, step_fraction=fraction(scene))


def _single_precision(scene: Scene) -> Iterator[Settings]:
    """Steps in single precision, with the volume term where the tissue's ratio needs it."""
    for times in (1.0, 0.8, 2.0 / 3.0, 0.5) if may_be_single(scene) else ():
        yield lattice_settings(scene, times, precision="single", step_fraction=fraction(scene))


def may_be_single(scene: Scene) -> bool:
    """Whether single precision is available, which is implemented on the grid alone.

    Springs with individual rest lengths are stepped over the list.
    """
    loaded = "gravity" in scene.features and scene.gravity.given == "loaded"
    return INTEGRATORS[scene.lattice.integrator].on_grid is not None and not loaded


def _step_sizes(scene: Scene) -> Iterator[Settings]:
    """The default integrator at fixed rates and fractions; too long a fixed step diverges."""
    for rate in (500.0, 1000.0, 2000.0):
        yield lattice_settings(scene, 1.0, step_rate=rate)
    for fraction in (0.95, 0.4, 0.2):
        yield lattice_settings(scene, 1.0, step_fraction=fraction)


def _integrators(scene: Scene) -> Iterator[Settings]:
    """Every other integrator by spacing and, where nothing limits the step, by step."""
    for name, method in INTEGRATORS.items():
        if is_moved(scene) and name not in WITH_TOOL_CONTACT:
            continue
        for times in (2.0, 1.0) if name != DEFAULT else ():
            same = lattice_settings(scene, times, integrator=name)
            if np.isfinite(method.oscillation):
                yield {**same, "step_fraction": fraction(scene)}
            else:
                yield from ({**same, "step_rate": rate} for rate in (FRAME_RATE, FAST))


def _basafa(scene: Scene) -> Iterator[Settings]:
    """The benchmark, which has the stiffness of Table II and not that of the tissue."""
    for times in (2.0, 1.5, 1.0):
        yield {"spacing": times * scene.lattice.spacing, "step_fraction": fraction(scene)}


def _finite_elements(_: Scene) -> Iterator[Settings]:
    """By element and mesh at one step per frame, and the coarsest with shorter steps."""
    meshes = (
        *(("p1", level) for level in (-2, -1, 0, 1)),
        *(("p2", level) for level in (-2, -1, 0)),
        *(("taylor-hood", level) for level in (-2, -1)),
    )
    for element, level in meshes:
        yield {"element": element, "level": level, "rate": FRAME_RATE}
    yield {"element": "p2", "level": -2, "rate": FAST}


def _superposition(_: Scene) -> Iterator[Settings]:
    """By kind and number of vectors, and by mesh."""
    subspaces = (
        *(("ritz", count, -1) for count in (4, 16)),
        *(("ritz", count, 0) for count in (2, 4, 8, 16, 24)),
        *(("ritz", 16, level) for level in (1, 2)),
        *(("modal", count, -2) for count in (10, 40)),
        ("ritz", 16, -2),
    )
    for vectors, count, level in subspaces:
        yield {"vectors": vectors, "count": count, "level": level}


def _corrected(scene: Scene) -> Iterator[Settings]:
    """By the spacing of the coarse lattice, the coarsest also on the scene's own mesh."""
    for times, level in ((2.0, 0), (2.0, 1), (1.5, 1), (1.0, 1), (0.8, 1)):
        spacing = times * scene.lattice.spacing
        yield {"spacing": spacing, "level": level, "step_fraction": FRACTION}


def _region(scene: Scene) -> Iterator[Settings]:
    """Graded lattices by the radius of their finest cells, in radii of the tool."""
    for times in (0.5, 1.0, 1.5, 2.0):
        finer = lattice_settings(scene, 0.5, step_fraction=FRACTION)
        yield {**finer, "radius": times * scene.tool.radius}


def _graded(scene: Scene) -> Iterator[Settings]:
    """Corrected graded lattices, on one mesh of the elements."""
    for times in (0.6, 1.0, 1.4):
        radius, spacing = times * scene.tool.radius, 0.5 * scene.lattice.spacing
        yield {"spacing": spacing, "radius": radius, "level": 1, "step_fraction": FRACTION}


CONTENDERS: dict[str, Contender] = {
    "springs": Contender("tissue", _springs),
    "volume-springs": Contender("tissue", _volume_springs),
    "single-precision": Contender("tissue", _single_precision),
    "step-sizes": Contender("tissue", _step_sizes),
    "integrators": Contender("tissue", _integrators),
    "basafa": Contender("basafa", _basafa),
    "finite-elements": Contender(
        "fem", _finite_elements, {"method": "tr-bdf2"}, unable=frozenset({"moved-tools"})
    ),
    "superposition": Contender("superposition", _superposition),
    "corrected": Contender("corrected", _corrected),
    "region": Contender("region", _region, unable=frozenset({"moved-tools"})),
    "corrected-graded": Contender("corrected", _graded, {"coarse": "graded"}),
}


@dataclass(frozen=True)
class Configuration:
    """A contender by name, with its settings."""

    contender: str
    settings: Settings

    @property
    def label(self) -> str:
        """The settings as text."""
        parts = (
            f"{key}={value:.4g}" if isinstance(value, float) else f"{key}={value}"
            for key, value in self.settings.items()
        )
        return " ".join(parts)

    @property
    def any_load(self) -> bool:
        """Whether it can follow a load whose place was unknown beforehand."""
        return kind(contender(self.contender).model).any_load

    def model(self, scene: Scene) -> Model:
        """The model of a scene with these settings."""
        entered = contender(self.contender)
        found, settings = model(scene, entered.model), {**entered.always, **self.settings}
        return found.varied(**settings) if settings else found


def contender(name: str) -> Contender:
    """The contender of a name, or the model of that name as it is.

    ValueError with the existing names; models of fuzzy estimates are the lattice at other moduli.
    """
    if name in CONTENDERS:
        return CONTENDERS[name]
    if name not in MODELS or kind(name).patient_specific:
        raise ValueError(
            f"contender {name}: there is none; choose from {', '.join(CONTENDERS)}, or a model of "
            "the scene that needs no estimate"
        )
    return Contender(name, lambda _: iter([{}]))


def contenders_of(scene: Scene) -> list[str]:
    """All contenders that support a scene, and its own models that need no estimate."""
    entered = {one.model for one in CONTENDERS.values()}
    own = [name for name in scene.models if name not in entered and not kind(name).patient_specific]
    return [name for name in (*CONTENDERS, *own) if not contender(name).lacks(scene)]


def configurations(scene: Scene, chosen: Sequence[str] = ()) -> list[Configuration]:
    """All configurations of the chosen contenders, or of all that a scene has.

    ValueError for a contender that does not support the scene.
    """
    for name in chosen:
        lacks = contender(name).lacks(scene)
        if lacks:
            raise ValueError(
                f"contender {name}: its steps do not follow "
                f"{' and '.join(FEATURES[feature] for feature in lacks)}; choose from "
                f"{', '.join(contenders_of(scene))}"
            )
    return [
        Configuration(name, settings)
        for name in chosen or contenders_of(scene)
        for settings in contender(name).settings(scene)
    ]
