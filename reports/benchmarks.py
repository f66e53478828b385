"""Benchmarks of the lattice, measured once; none of the figures is of the run reported.

The tables come with the program (`reports/data`), each a row per case under the names of its
columns; the benchmark that writes a table says what they mean.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from importlib import resources
from importlib.resources.abc import Traversable

from reports.differences import resolved
from reports.digits import DASH, Table, count, fixed, percent, significant

FOLDER = resources.files("reports").joinpath("data")
VOLUME_TERM = {"False": "springs", "True": "springs and volume term"}
MILLI = 1e3

Line = dict[str, str]


def benchmarks() -> dict[str, object] | None:
    """Benchmarks of the lattice as tables by name.

    None where no table was delivered; one that is missing is left out.
    """
    shapes: dict[str, Callable[[list[Line]], object]] = {
        "field_error": field_error,
        "real_time": real_time,
        "large_strain": large_strain,
        "peers": peers,
    }
    found = {name: shape(lines) for name, shape in shapes.items() if (lines := read(name))}
    return found or None


def read(name: str, folder: Traversable | None = None) -> list[Line]:
    """Lines of a table by the names of its columns; none if it is missing.

    Without a folder, of the tables that come with the program.
    """
    file = (folder or FOLDER).joinpath(f"{name}.csv")
    if not file.is_file():
        return []
    return list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))


def field_error(lines: list[Line]) -> dict[str, object]:
    """Field error of the lattice over its spacing, a row per body, Poisson ratio and kind.

    Where the volume term changes nothing, as at Poisson ratio 1/4, one row stands for both.
    """
    groups: dict[tuple[str, ...], dict[str, Line]] = {}
    for line in lines:
        key = (line["body"], line["nu"], line["volume_term"])
        groups.setdefault(key, {})[line["spacing_m"]] = line
    spacings = list(dict.fromkeys(line["spacing_m"] for line in lines))
    rows: Table = []
    for (body, nu, volume_term), found in groups.items():
        numbers = _errors([found.get(spacing) for spacing in spacings])
        if not rows or [body, nu, *numbers] != [*rows[-1][:2], *rows[-1][3:]]:
            rows.append([body, nu, VOLUME_TERM[volume_term], *numbers])
    return {"spacings": [_spacing(spacing) for spacing in spacings], "rows": rows}


def _errors(row: list[Line | None]) -> list[str]:
    """Error at each spacing, their order, and the error of the reference."""
    known = [line for line in row if line is not None]
    own = float(known[0]["reference_error"])
    return [
        *(DASH if line is None else resolved(float(line["error"]), own) for line in row),
        fixed(float(known[0]["order"]), 1),
        percent(own),
    ]


def real_time(lines: list[Line]) -> Table:
    """Cost of the lattice by Poisson ratio and spacing, beside its error."""
    return [
        [
            line["nu"],
            _spacing(line["spacing_m"]),
            count(int(line["nodes"])),
            count(int(line["springs"])),
            significant(MILLI * float(line["step_s"])),
            significant(float(line["step_wall_us"])),
            significant(float(line["real_time_factor"]), 2),
            significant(float(line["real_time_factor_median"]), 2),
            percent(float(line["error"])),
        ]
        for line in lines
    ]


def large_strain(lines: list[Line]) -> Table:
    """Departure of the lattice from its linear self as the load grows."""
    return [
        [
            line["load_n"],
            percent(float(line["largest_strain_linear"])),
            percent(float(line["largest_strain"])),
            significant(MILLI * float(line["depth_linear_m"])),
            significant(MILLI * float(line["depth_m"])),
            percent(float(line["departure"])),
        ]
        for line in lines
    ]


def peers(lines: list[Line]) -> dict[str, object]:
    """Other engines beside the lattice: cost and error by count of nodes, engine, Poisson ratio."""
    groups: dict[tuple[str, ...], dict[str, Line]] = {}
    for line in lines:
        key = (line["engine"], line["version"], line["precision"], line["nu"])
        groups.setdefault(key, {})[line["nodes"]] = line
    nodes = list(dict.fromkeys(line["nodes"] for line in lines))
    own = {line["nu"]: percent(float(line["reference_error"])) for line in lines}
    rows = [[*key, *_cost_and_error(found, nodes)] for key, found in groups.items()]
    return {
        "nodes": [count(int(n)) for n in nodes],
        "rows": rows,
        "reference_error": ", ".join(f"{error} at {nu}" for nu, error in own.items()),
    }


def _cost_and_error(found: dict[str, Line], nodes: list[str]) -> list[str]:
    """Cost and error at each count of nodes, and the largest difference from the lattice."""
    row = [found.get(n) for n in nodes]
    return [
        *(_show(line, "relative_to_ours") for line in row),
        *(DASH if line is None else percent(float(line["field_error"])) for line in row),
        percent(max(float(line["from_ours"]) for line in found.values())),
    ]


def _show(line: Line | None, column: str) -> str:
    return DASH if line is None else significant(float(line[column]), 2)


def _spacing(metres: str) -> str:
    return f"{significant(MILLI * float(metres), 2)} mm"
