"""Requests of the command `validate`: which problems, which models, how fine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from study.scene.file import read_scene
from study.system.progress import Progress
from study.validation import cantilever, cube, cylinders, user_scene
from study.validation.comparison import Comparison
from study.validation.predictions import KINDS

Compare = Callable[[tuple[str, ...], int, Progress], Iterable[Comparison]]

PROBLEMS: dict[str, Compare] = {
    cylinders.NAME: cylinders.comparisons,
    cantilever.NAME: cantilever.comparisons,
    cube.NAME: cube.comparisons,
}
"""Measured bodies by name."""
QUICK, ALL = 2, 3
"""Numbers of meshes and spacings of each model."""


@dataclass(frozen=True, kw_only=True)
class ValidationRequest:
    """Problems and kinds of models by name, all by default; `quick`: two meshes, not three.

    ValueError for an unknown name.
    """

    names: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    quick: bool = False

    def __post_init__(self) -> None:
        """Refuse unknown names before anything is solved."""
        for name in self.names:
            if name.endswith(".toml"):
                raise ValueError(f"{name}: give --data too, a folder with your measurements of it")
        _refuse_unknown(self.names, PROBLEMS, "problem")
        _refuse_unknown(self.kinds, KINDS, "--models")

    def comparisons(self, progress: Progress) -> Iterator[Comparison]:
        """All measurements of the problems beside each model."""
        kinds = self.kinds or tuple(KINDS)
        for name in self.names or tuple(PROBLEMS):
            yield from PROBLEMS[name](kinds, QUICK if self.quick else ALL, progress)


def own_comparisons(
    scene: str | None,
    folder: Path,
    overrides: Sequence[str],
    probe: str | None,
    progress: Progress,
    tell: Callable[[str], None],
) -> Iterator[Comparison]:
    """A scene by name or file beside the measurements in a folder. ValueError if unsuitable.

    `tell` takes a note on what is in the folder besides.
    """
    if scene is None or scene in PROBLEMS:
        raise ValueError("--data: give the scene that was measured too, a name or a TOML file")
    data = user_scene.read_folder(folder)
    if data.unread:
        tell(f"--data {folder}: not read: {', '.join(data.unread)}; only CSV files are")
    return user_scene.comparisons(read_scene(scene, overrides), data, progress, probe)


def _refuse_unknown(names: Sequence[str], known: Iterable[str], what: str) -> None:
    for name in names:
        if name not in known:
            raise ValueError(f"{what}: {name} is not one of {', '.join(known)}")
        if names.count(name) > 1:
            raise ValueError(f"{what}: {name} is named twice; leave one out")


def all_answered(found: Sequence[Comparison]) -> bool:
    """Whether the finite elements gave a number for every measurement.

    A lattice that collapses is a result, and stands in the table.
    """
    elements = {kind.label for kind in KINDS.values() if kind.elements}
    return all(one.answered for one in found if one.model in elements)
