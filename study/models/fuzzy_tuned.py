"""The fuzzy-tuned springs of the paper: one model for each fuzzy system's estimate of stiffness."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from fuzzy.liver.assumptions import assumptions as fuzzy_assumptions
from fuzzy.liver.stiffness import StiffnessEstimate
from study.models import user_rule_base
from study.models.control_point import PointSpring, oscillator_of
from study.models.estimates import settings
from study.models.lattice import SUPPORTED_FEATURES, LatticeModel
from study.models.lattice_assumptions import layout, springs
from study.models.model import Estimates, ModelKind
from study.models.tissue import of_modulus
from study.scene import Scene

LABELS = {"mamdani": "MSM Mamdani", "sugeno": "MSM Sugeno", "interval-type-2": "MSM type-2"}


def models(scene: Scene, estimates: Estimates) -> Iterator[LatticeModel]:
    """One lattice for each estimate, also run at both ends of its interval where it has one."""
    for system, found in estimates.items():
        central, *ends = (partial(of_modulus, modulus=modulus) for modulus in _moduli(found))
        yield LatticeModel(
            name=f"msm-{system}",
            label=LABELS.get(system, f"MSM {system}"),
            scene=scene,
            make=central,
            bounds=(ends[0], ends[1]) if ends else None,
            system=system,
        )


def on_point(scene: Scene, estimates: Estimates) -> Iterator[PointSpring]:
    """One oscillator for each estimate, by eqs. (1) and (2)."""
    for system, found in estimates.items():
        zeta = scene.damping.ratio
        central, *ends = (partial(oscillator_of, modulus, zeta) for modulus in _moduli(found))
        yield PointSpring(
            name=f"msm-{system}",
            label=LABELS.get(system, f"MSM {system}"),
            make=central,
            bounds=(ends[0], ends[1]) if ends else None,
            system=system,
        )


def _moduli(found: StiffnessEstimate) -> tuple[float, ...]:
    """The estimate [Pa], then the ends of its interval."""
    return (found.estimate, *(found.interval or ()))


def assumptions(scene: Scene) -> list[str]:
    """On the springs, then on the fuzzy systems."""
    on_organ = [] if scene.is_point else layout(scene)
    if scene.fuzzy.rule_base is not None:
        return [*on_organ, *springs(scene), *user_rule_base.assumptions(scene)]
    return [*on_organ, *springs(scene), *fuzzy_assumptions(settings(scene))]


KIND = ModelKind(
    models=models,
    on_point=on_point,
    assumptions=assumptions,
    is_tuned=True,
    patient_specific=True,
    follows_law=True,
    ignored_keys=("patient", "fuzzy", "reference", "superposition", "basafa"),
    supported_features=SUPPORTED_FEATURES,
)
