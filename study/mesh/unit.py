"""The length unit of a mesh file, which the file itself does not state."""

from __future__ import annotations

from study.mesh.kinds import FloatArray, MeshError

METRES = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
"""Metres per unit, by name."""

LIVER_VOLUME = (0.5e-3, 3.5e-3)
"""Volumes [m^3] taken for a liver's; a proposal without a source, wide enough for disease."""

_GUESSED = ("mm", "m")  # units common enough to be converted without being declared
_EXTENT = (1e-3, 1.0)  # smallest and largest side [m] of the box round an organ


def choose_unit(unit: str | None, volume: float) -> tuple[str, list[str]]:
    """Unit of a mesh with the given volume [file units^3], and notes.

    A declared unit wins. Without one the volume must be a liver's in millimetres or metres.

    Raises
    ------
    MeshError
        On an unknown name, and if the unit cannot be guessed.
    """
    if unit is not None:
        return _declared(unit, volume)
    fitting = _fitting(volume)
    for name in _GUESSED:
        if name in fitting:
            litres = f"{_litres(volume, name):.3g} L"
            return name, [f"unit {name} guessed: it makes the volume {litres}, a liver's"]
    suspicion = f" (perhaps {fitting[0]}, but that is not assumed)" if fitting else ""
    hint = as_liver(volume)
    low, high = (1e3 * bound for bound in LIVER_VOLUME)
    raise MeshError(
        f"the volume of {volume:.4g} file units cubed is no liver's ({low}-{high} L) in "
        f"millimetres or metres: unit unknown{suspicion}; declare `organ.unit` as one of "
        f"{', '.join(METRES)}{hint}"
    )


def check_unit_name(unit: str | None, volume: float | None = None) -> None:
    """Raise MeshError on a name that is not in the table, with what would suit the volume."""
    if unit is not None and unit not in METRES:
        names = ", ".join(METRES)
        hint = "" if volume is None else as_liver(volume)
        raise MeshError(f"`organ.unit` = {unit!r} is not one of {names}{hint}")


def as_liver(volume: float) -> str:
    """The units in which a volume [file units^3] would be a liver's, as the end of a message."""
    said = [f"as {name} it would be {_litres(volume, name):.3g} L" for name in _fitting(volume)]
    return f"; {', '.join(said)}, a liver's" if said else ""


def check_extent(extent: FloatArray, unit: str, volume: float) -> None:
    """Raise MeshError unless every side [m] of the bounding box is 1 mm to 1 m.

    `volume` [file units^3] indicates which unit would fit.
    """
    if not all(_EXTENT[0] <= side <= _EXTENT[1] for side in extent):
        sides = " x ".join(f"{side:.4g}" for side in extent)
        raise MeshError(
            f"the mesh measures {sides} m when read in {unit}; an organ has sides of "
            f"{_EXTENT[0]:g} to {_EXTENT[1]:g} m: correct `organ.unit`{as_liver(volume)}"
        )


def _declared(unit: str, volume: float) -> tuple[str, list[str]]:
    check_unit_name(unit, volume)
    if _is_liver(volume, unit):
        return unit, []
    low, high = (1e3 * bound for bound in LIVER_VOLUME)
    return unit, [
        f"WARNING: {_litres(volume, unit):.4g} L with the declared unit {unit} is no liver's "
        f"volume ({low}-{high} L){as_liver(volume)}"
    ]


def _fitting(volume: float) -> list[str]:
    return [name for name in METRES if _is_liver(volume, name)]


def _litres(volume: float, unit: str) -> float:
    return 1e3 * volume * METRES[unit] ** 3


def _is_liver(volume: float, unit: str) -> bool:
    return LIVER_VOLUME[0] <= volume * METRES[unit] ** 3 <= LIVER_VOLUME[1]
