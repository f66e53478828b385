"""Name and line of each model, the same on every page.

Colours of Okabe and Ito, told apart by the colour-blind; the dashes tell the lines apart in print.
Mamdani is broad and pale so that type-2, which nearly coincides with it, shows on top.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

FUZZY_PREFIX = "msm-"
SYSTEM_NAMES = {"mamdani": "Mamdani", "sugeno": "Sugeno", "interval-type-2": "Interval type-2"}
REFERENCE_NAMES = {"fem": "the finite-element reference", "basafa": "the Basafa benchmark"}


@dataclass(frozen=True)
class Look:
    """`label` in legends and tables; `dashes` as matplotlib's line style; `width` in points."""

    label: str
    colour: str
    dashes: Any
    width: float
    layer: float

    @property
    def line(self) -> dict[str, Any]:
        """Keyword arguments of `Axes.plot`."""
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "linewidth": self.width,
            "zorder": self.layer,
        }


LOOKS = {
    "fem": Look("Finite elements", "#000000", "-", 1.3, 3.0),
    "basafa": Look("Basafa benchmark", "#D55E00", (0, (7, 1.6)), 1.3, 3.1),
    "msm-mamdani": Look("MSM Mamdani", "#56B4E9", "-", 2.6, 2.5),
    "msm-sugeno": Look("MSM Sugeno", "#009E73", (0, (5, 1.2, 1, 1.2)), 1.2, 3.2),
    "msm-interval-type-2": Look("MSM type-2", "#882255", (0, (2.2, 1.6)), 1.2, 3.3),
}


def look(model: str) -> Look:
    """Look of a model; one that is not known appears grey under its own name."""
    return LOOKS.get(model, Look(model, "#777777", ":", 1.2, 2.9))


def system_of(model: str) -> str | None:
    """Fuzzy system whose estimate a model was given, or None."""
    return model.removeprefix(FUZZY_PREFIX) if model.startswith(FUZZY_PREFIX) else None


def system_name(system: str) -> str:
    """Name of a fuzzy system in a sentence."""
    return SYSTEM_NAMES.get(system, system)


def reference_name(model: str) -> str:
    """Name of a model in "against ..."."""
    return REFERENCE_NAMES.get(model, look(model).label)


SERIES_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9")
SERIES_MARKS = ("o", "s", "D", "^", "v", "P", "X", "*")


def series(names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Colour and mark, as keyword arguments of `Axes.plot`, of names in the order they appear."""
    return {
        name: {
            "color": SERIES_COLOURS[i % len(SERIES_COLOURS)],
            "marker": SERIES_MARKS[i % len(SERIES_MARKS)],
        }
        for i, name in enumerate(dict.fromkeys(names))
    }
