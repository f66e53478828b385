"""Models beside measurements on silicone."""

from collections.abc import Iterator
from statistics import median

from docs.figures.formats import table
from docs.figures.tables import Line, measured

STRAINS = (10, 20, 30)
CYLINDERS_HEAD = ("model, faces", *(f"{strain} %" for strain in STRAINS))
CUBE_HEAD = ("model", "at 5 %", "at 18.25 %")


def validation() -> Iterator[tuple[str, str]]:
    """Compressed cylinders, a bent beam and a compressed cube."""
    lines = measured("validation")
    models = list(dict.fromkeys(line["model"] for line in lines))
    yield "validated-cylinders", table(CYLINDERS_HEAD, _cylinders(lines, models))
    yield "validated-beam", _beam(lines)
    yield "validated-cube", table(CUBE_HEAD, [_beads(lines, model) for model in models])
    yield from _headline(lines)


def _cylinders(lines: list[Line], models: list[str]) -> Iterator[list[str]]:
    forces = [f"force at {strain} %" for strain in STRAINS]
    for faces in ("bonded", "sliding"):
        for model in models:
            yield [f"{model}, {faces}", *(_force(lines, model, faces, force) for force in forces)]
    spread = (_median_share(lines, "uncertainty", models[0], "bonded", force) for force in forces)
    yield ["uncertainty of the measurement", *(f"{100 * one:.1f} %" for one in spread)]


def _force(lines: list[Line], model: str, faces: str, quantity: str) -> str:
    try:
        error = _median_share(lines, "found", model, faces, quantity) - 1.0
    except ValueError:  # of no material
        return "collapses"
    return f"{100 * error:+.1f} %"


def _median_share(lines: list[Line], column: str, model: str, faces: str, quantity: str) -> float:
    """Median over the materials of a column over the measured force."""
    wanted = (model, faces, quantity)
    return median(
        float(line[column]) / float(line["measured"])
        for line in lines
        if (line["model"], line["faces"], line["quantity"]) == wanted and line["found"]
    )


def _beam(lines: list[Line]) -> str:
    tips, frequencies = (
        [line for line in lines if (line["quantity"], line["case"]) == (name, "weight alone")]
        for name in ("tip deflection, mean of markers", "frequency of free vibration")
    )
    tip, frequency = (
        f"{float(own[0]['measured']):.2f} ± {float(own[0]['uncertainty']):.2f}"
        for own in (tips, frequencies)
    )
    head = ("model", "modulus fitted [kPa]", f"tip, measured {tip}", f"measured {frequency} Hz")
    rows = [
        [line["model"], f"{1e-3 * float(line['modulus_pa']):.0f}", _found(line), _found(other)]
        for line, other in zip(tips, frequencies, strict=True)
    ]
    return table(head, rows)


def _found(line: Line) -> str:
    """A model's number and its own error."""
    return f"{float(line['found']):.2f} ± {float(line['numerical']):.2f}"


def _beads(lines: list[Line], model: str) -> list[str]:
    """Residuals [mm] of the beads in the cube, with bonded and with sliding faces."""
    residuals = {
        (line["case"], line["faces"]): f"{float(line['found']):.2f}"
        for line in lines
        if (line["model"], line["quantity"]) == (model, "rms residual of the beads")
        and line["found"]
    }
    pairs = (
        [residuals.get((case, faces), "none") for faces in ("bonded", "sliding")]
        for case in ("5 %", "18.25 %")
    )
    return [model, *map(" / ".join, pairs)]


def _headline(lines: list[Line]) -> Iterator[tuple[str, str]]:
    """What README.md says of it."""
    model = "neo-Hookean FE"
    for strain in (10, 30):
        force = f"force at {strain} %"
        error = _median_share(lines, "found", model, "bonded", force) - 1.0
        spread = _median_share(lines, "uncertainty", model, "bonded", force)
        yield f"measured-{strain}", f"{100 * error:+.1f} ± {100 * spread:.1f} %"
    for name in ("springs alone", "springs and volume term"):
        _, _, at_most_strain = _beads(lines, name)
        yield f"beads-{name.split()[-1]}", f"{at_most_strain.partition(' / ')[0]} mm"
