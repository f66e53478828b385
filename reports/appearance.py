"""Name and line of each model, the same on every page.

Colours of Okabe and Ito, which the colour-blind distinguish; dashes distinguish lines in print.
Mamdani is broad and pale so that type-2, which nearly coincides with it, shows on top.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from study.results import Results

SYSTEM_NAMES = {"mamdani": "Mamdani", "sugeno": "Sugeno", "interval-type-2": "Interval type-2"}
REFERENCE_NAMES = {
    "fem": "the finite-element reference",
    "hyperelastic": "the hyperelastic reference",
    "basafa": "the Basafa benchmark",
}

Dashes = str | tuple[float, tuple[float, ...]]
"""A line style as matplotlib takes it."""
Style = dict[str, Any]
"""Keyword arguments of a drawing function of matplotlib, which gives each a type of its own."""


@dataclass(frozen=True)
class Look:
    """Line of a model: `width` in points, `layer` above others; `label` in legends and tables."""

    colour: str
    dashes: Dashes
    width: float
    layer: float
    label: str = ""

    @property
    def line(self) -> Style:
        """Keyword arguments of `Axes.plot`."""
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "linewidth": self.width,
            "zorder": self.layer,
        }


SYSTEM_LOOKS = {
    "mamdani": Look("#56B4E9", "-", 2.6, 2.5),
    "sugeno": Look("#009E73", (0, (5, 1.2, 1, 1.2)), 1.2, 3.2),
    "interval-type-2": Look("#882255", (0, (2.2, 1.6)), 1.2, 3.3),
}
LOOKS = {
    "fem": Look("#000000", "-", 1.3, 3.0),
    "hyperelastic": Look("#5D3A9B", "-", 1.3, 3.0),
    "basafa": Look("#D55E00", (0, (7, 1.6)), 1.3, 3.1),
    "reading": Look("#B8860B", (0, (1, 1)), 1.4, 3.05),
    **{f"msm-{system}": look for system, look in SYSTEM_LOOKS.items()},
}
OTHER_COLOURS = ("#CC79A7", "#332288", "#661100", "#777777", "#0072B2")
OTHER_DASHES: tuple[Dashes, ...] = ((0, (9, 2, 1, 2)), (0, (4, 1, 4, 3)), "-", (0, (1, 1)))


def other_look(k: int) -> Look:
    """Look of the k-th model or system without one of its own; the first twenty all differ."""
    colour = OTHER_COLOURS[k % len(OTHER_COLOURS)]
    return Look(colour, OTHER_DASHES[k % len(OTHER_DASHES)], 1.2, 2.9)


def looks(results: Results) -> dict[str, Look]:
    """Look of each model of a run by its name, in order, with the label of its record."""
    models = results.record.models
    others = [model.name for model in models if model.name not in LOOKS]
    known = LOOKS | {name: other_look(k) for k, name in enumerate(others)}
    return {model.name: replace(known[model.name], label=model.label) for model in models}


def labels(results: Results) -> dict[str, str]:
    """Label of each model of a run by its name."""
    return {model.name: model.label for model in results.record.models}


def system_colour(system: str) -> str:
    """Colour of a fuzzy system wherever it is drawn, that of its model in the curves."""
    return SYSTEM_LOOKS.get(system, other_look(0)).colour


def system_name(system: str) -> str:
    """Name of a fuzzy system in a sentence."""
    return SYSTEM_NAMES.get(system, system)


def reference_name(results: Results, model: str) -> str:
    """Name of a reference where a sentence says against what a model is compared."""
    return REFERENCE_NAMES.get(model) or labels(results)[model]


SERIES_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9")
SERIES_MARKS = ("o", "s", "D", "^", "v", "P", "X", "*")


def series(names: Iterable[str]) -> dict[str, Style]:
    """Colour and mark, as keyword arguments of `Axes.plot`, of names in the order they appear."""
    return {
        name: {
            "color": SERIES_COLOURS[i % len(SERIES_COLOURS)],
            "marker": SERIES_MARKS[i % len(SERIES_MARKS)],
        }
        for i, name in enumerate(dict.fromkeys(names))
    }
