"""The contenders by name, and what each enters with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from study.scene import Scene
from study.tradeoff.contender import Contender, Settings
from study.tradeoff.contenders import (
    basafa,
    finite_elements,
    integrators,
    springs,
    step_sizes,
    superposition,
    volume_springs,
)

# Imported by name, so that a stored result is known to be stale when one of them is edited.
CONTENDERS: dict[str, Contender] = {
    "springs": springs,
    "volume-springs": volume_springs,
    "step-sizes": step_sizes,
    "integrators": integrators,
    "basafa": basafa,
    "finite-elements": finite_elements,
    "superposition": superposition,
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


def contender(name: str) -> Contender:
    """The contender of a name. ValueError with those there are."""
    if name not in CONTENDERS:
        raise ValueError(f"contender {name}: there is none; choose from {', '.join(CONTENDERS)}")
    return CONTENDERS[name]


def configurations(scene: Scene, chosen: Sequence[str] = ()) -> list[Configuration]:
    """All configurations of the chosen contenders, or of all contenders."""
    return [
        Configuration(name, settings)
        for name in chosen or CONTENDERS
        for settings in contender(name).configurations(scene)
    ]
