"""The lattice: its error at rest, its cost, and other engines on the same nodes."""

from collections.abc import Iterator

from docs.figures.formats import count, millimetres, percent, span, table, tenths, two_digits
from docs.figures.tables import Line, column, grouped, machine_and_load, measured

LATTICES = {  # Poisson ratio and volume term, and words for them
    ("0.25", "False"): "0.25, springs",
    ("0.45", "False"): "0.45, springs alone",
    ("0.45", "True"): "0.45, with the volume term",
    ("0.49", "False"): "0.49, springs alone",
    ("0.49", "True"): "0.49, with the volume term",
}
REAL_TIME_HEAD = ("spacing", "nodes", "field error", "real-time factor, nu 0.45", "nu 0.49")
PEERS_HEAD = ("engine", "Poisson ratio", "relative time", "field error", "objection")
STRAIN_HEAD = ("largest strain", "linear elements", "nonlinear lattice, volume term, 6.7 mm")
NEWTON_SPRINGS = "Newton SemiImplicit, springs"


def field_error() -> Iterator[tuple[str, str]]:
    """The lattice at rest against converged finite elements."""
    lines = [line for line in measured("field_error") if line["body"] == "liver"]
    groups = grouped(lines, lambda line: (line["nu"], line["volume_term"]))
    yield "springs-quarter-10mm", percent(groups["0.25", "False"][1]["error"])
    yield "springs-10mm", percent(groups["0.45", "False"][1]["error"])
    yield "springs-best-10mm", percent(groups["0.45", "False"][1]["error_at_best_factor"])
    yield "volume-10mm", percent(groups["0.45", "True"][1]["error"])
    yield "volume-5mm", percent(groups["0.45", "True"][3]["error"])
    spacings = [millimetres(line["spacing_m"]) for line in groups["0.25", "False"]]
    head = ("Poisson ratio", *spacings, "order", "reference's own error")
    rows = [[words, *_over_spacing(groups[key])] for key, words in LATTICES.items()]
    yield "field-error", table(head, rows)


def _over_spacing(lines: list[Line]) -> list[str]:
    order = float(lines[0]["order"])
    return [
        *(percent(line["error"]) for line in lines),
        f"{order:.1f}" if order > 1 else "",
        tenths(lines[0]["reference_error"]),
    ]


def real_time() -> Iterator[tuple[str, str]]:
    """How fast the lattice with volume term steps, and on which machine."""
    lines = measured("real_time")
    yield "real-time-on", machine_and_load(lines)
    spacings = grouped(lines, lambda line: line["spacing_m"]).values()
    yield "real-time", table(REAL_TIME_HEAD, map(_real_time_factors, spacings))


def _real_time_factors(lines: list[Line]) -> list[str]:
    """Of a spacing."""
    by_nu = {line["nu"]: line for line in lines}
    first = by_nu["0.45"]
    return [
        millimetres(first["spacing_m"]),
        count(first["nodes"]),
        tenths(first["error"]),
        *(f"{float(by_nu[nu]['real_time_factor_median']):.1f}" for nu in ("0.45", "0.49")),
    ]


def kernels() -> Iterator[tuple[str, str]]:
    """A step over the grid beside one over the list of springs and one in C."""
    lines = measured("lattice_kernels")
    grid = [one for one in lines if one["kernel"] == "grid" and one["volume_term"] == "True"]
    most = max(int(one["lanes"]) for one in grid)
    widest = [one for one in grid if int(one["lanes"]) == most]
    yield "kernels-on", machine_and_load(lines)
    yield "kernels-lanes", str(most)
    yield "grid-gain", span(column(widest, "times_list"))
    yield "grid-over-c", span(column(widest, "over_c"), "{:.2f}".format)


def peers() -> Iterator[tuple[str, str]]:
    """Other engines on the same nodes."""
    lines = measured("peers")
    by_engine = grouped(lines, lambda line: line["engine"])
    yield "peers-on", machine_and_load(lines)
    for name, engine in (
        ("newton", NEWTON_SPRINGS),
        ("newton-tetrahedra", "Newton SemiImplicit, tetrahedra"),
        ("mujoco", "MuJoCo flex trilinear, Euler"),
    ):
        yield f"{name}-cost", span(column(by_engine[engine], "relative_to_ours"))
    apart = max(column(by_engine[NEWTON_SPRINGS], "from_ours"))
    yield "newton-apart", f"{apart:.0e}".replace("e-0", "e-")
    most = max(int(line["nodes"]) for line in lines)
    yield "peers-nodes", count(most)
    yield "peers", table(PEERS_HEAD, [_peer(one) for one in lines if int(one["nodes"]) == most])


def _peer(line: Line) -> list[str]:
    return [
        line["engine"],
        line["nu"],
        two_digits(line["relative_to_ours"]),
        tenths(line["field_error"]),
        line["objection"].partition("; ")[2],  # the first is that of the engine
    ]


def large_strain() -> Iterator[tuple[str, str]]:
    """Linear elements and the lattice against neo-Hookean elements."""
    lines = [one for one in measured("large_strain_elements") if one["spacing_m"] == "0.00666667"]
    columns = ("strain_elements", "linear", "lattice_cells")
    rows = [[percent(one[name]) for name in columns] for one in lines]
    yield "large-strain", table(STRAIN_HEAD, rows)
