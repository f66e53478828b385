"""Error and cost of every model."""

import re
from collections.abc import Iterator

from docs.figures.formats import millimetres, percent, table, tenths
from docs.figures.tables import Line, measured

SHOWN = (  # contender, start of its configuration, words for it
    ("finite-elements", "element=p1 level=-2", "linear tetrahedra, coarsest mesh, 60 steps/s"),
    ("volume-springs", "spacing=0.02 ", "volume term, 20 mm"),
    ("volume-springs", "spacing=0.015 ", "volume term, 15 mm"),
    ("volume-springs", "spacing=0.01 ", "volume term, 10 mm"),
    ("volume-springs", "spacing=0.008 ", "volume term, 8 mm"),
    ("volume-springs", "spacing=0.006667 ", "volume term, 6.7 mm"),
    ("volume-springs", "spacing=0.005 ", "volume term, 5 mm"),
    ("finite-elements", "element=p2 level=-2 rate=60", "quadratic tetrahedra, coarsest mesh"),
    ("finite-elements", "element=p2 level=0 rate=60", "quadratic tetrahedra, the scene's mesh"),
    ("superposition", "vectors=ritz count=16 level=1", "16 Ritz vectors, this load only"),
    ("springs", "spacing=0.01 ", "springs alone, 10 mm"),
    ("basafa", "spacing=0.01 ", "benchmark, 10 mm"),
)
HEAD = (
    *("model", "field", "at the tool", "setup", "wall per simulated second"),
    *("60 Hz", "1 kHz"),
)
RATES = ("60hz", "1khz")


def tradeoff() -> Iterator[tuple[str, str]]:
    """Error and cost of every model, and the least error in real time under any load."""
    lines = measured("tradeoff")
    yield "tradeoff-count", str(len(lines))
    yield "tradeoff-own-error", tenths(lines[0]["field_error_bar"])
    for rate in RATES:
        free = [one for one in lines if one["any_load"] == one[f"real_time_{rate}"] == "True"]
        best = min((one for one in free if one["field_error"]), key=_field_error)
        error, bar = (100 * float(best[name]) for name in ("field_error", "field_error_bar"))
        yield f"best-{rate}", f"{error:.1f} ± {bar:.1f} %"
        yield f"best-{rate}-spacing", millimetres(_spacing(best))
    rows = [[words, *_cost(_configuration(lines, *key))] for *key, words in SHOWN]
    yield "tradeoff", table(HEAD, rows)


def _field_error(line: Line) -> float:
    return float(line["field_error"])


def _spacing(line: Line) -> float:
    """Of a lattice [m]. ValueError where the line is of another model, since the pages name one."""
    found = re.match(r"spacing=(\S+)", line["configuration"])
    if line["contender"] != "volume-springs" or found is None:
        raise ValueError(f"the best is {line['contender']}, but the text names a lattice")
    return float(found[1])


def _configuration(lines: list[Line], contender: str, start: str) -> Line:
    (found,) = (
        one
        for one in lines
        if one["contender"] == contender and f"{one['configuration']} ".startswith(start)
    )
    return found


def _cost(line: Line) -> list[str]:
    return [
        *(percent(line[name]) for name in ("field_error", "tool_error")),
        f"{float(line['setup_s']):.2g} s",
        f"{float(line['wall_per_s']):.2g} s",
        *("yes" if line[f"real_time_{rate}"] == "True" else "no" for rate in RATES),
    ]
