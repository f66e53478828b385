"""The figures that README.md and the pages quote, computed from the committed tables.

In a page a figure stands between two comments, which no reader sees:

    springs alone leave <!-- figure: springs-10mm -->24 %<!-- --> of the field

`python docs/figures.py` writes all of them anew; tests/test_docs.py fails where one differs. To add
a figure, add it to `figures`. A table of several lines is a figure too.
"""

import csv
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from statistics import median

HERE = Path(__file__).parent
ROOT = HERE.parent
MARK = re.compile(r"(<!-- figure: ([\w.-]+) -->)(.*?)(<!-- -->)", re.DOTALL)

Line = dict[str, str]
NAMES = {
    "fem": "finite elements",
    "basafa": "Basafa benchmark",
    "msm-mamdani": "lattice, Mamdani",
    "msm-sugeno": "lattice, Sugeno",
    "msm-interval-type-2": "lattice, interval type-2",
    "reading": "lattice, elastography reading",
}
LATTICES = {("0.25", "False"): "0.25, springs", ("0.45", "False"): "0.45, springs alone"} | {
    ("0.45", "True"): "0.45, with the volume term",
    ("0.49", "False"): "0.49, springs alone",
    ("0.49", "True"): "0.49, with the volume term",
}
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
PROBLEMS = (  # words, problem, quantity with the element, for quadratic and mixed elements
    ("thick sphere, nu 0.3", "thick sphere", "displacement, largest error, {}, nu 0.3"),
    ("thick sphere, nu 0.49", "thick sphere", "displacement, largest error, {}, nu 0.49"),
    ("thick sphere, nu 0.49999", "thick sphere", "displacement, largest error, {}, nu 0.49999"),
    ("bent bar, deflection", "bent bar", "deflection of the end [m], {}, nu {nu}"),
    ("tool on a half space, mean depth", "half space", "mean depth [m], {}, nu {other}"),
    ("torsion of a ball", "torsion in an eighth", "mean of two omega R / c_s, {}, nu {other}"),
)


def read(path: str) -> list[Line]:
    """Lines of a table by the names of its columns; a path from the root."""
    with (ROOT / path).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def measured(name: str) -> list[Line]:
    """A table that a benchmark of this study wrote."""
    return read(f"reports/data/{name}.csv")


def percent(share: float | str) -> str:
    """A share of one in per cent, to two digits and at most to a tenth."""
    value = 100 * float(share)
    return (
        f"{value:.0f} %" if value >= 20 else f"{value:.1f} %" if value >= 0.1 else f"{value:.1g} %"
    )


def tenths(share: float | str) -> str:
    """A share of one in per cent, to a tenth."""
    return f"{100 * float(share):.1f} %"


def two_digits(number: str) -> str:
    """A number to two digits, without an exponent."""
    return f"{float(f'{float(number):.2g}'):g}"


def count(number: float | str) -> str:
    """A count in groups of three digits."""
    return f"{int(number):,}".replace(",", " ")


def span(values: Iterable[float], form: Callable[[float], str] = "{:.1f}".format) -> str:
    """The least and the largest: "a to b", or "a" where they read the same."""
    ordered = sorted(values)
    least, largest = form(ordered[0]), form(ordered[-1])
    return largest if least == largest else f"{least.removesuffix(' %')} to {largest}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown, with an empty line before and after."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n\n"


def kilopascals(pascals: str) -> str:
    """A modulus in kPa, to a tenth."""
    return f"{float(pascals) / 1e3:.1f}"


def liver_run() -> Iterator[tuple[str, str]]:
    """The built-in liver, and what its estimates hang on."""
    lines = {line["model"]: line for line in read("docs/data/liver.csv")}
    fem = lines.pop("fem")
    own = float(fem["modulus_pa"])
    tuned = [float(line["modulus_pa"]) for name, line in lines.items() if name.startswith("msm")]
    yield "liver-unknowns", count(fem["unknowns"])
    yield "liver-own-error", tenths(fem["own_error"])
    yield (
        "liver-off",
        f"{max(100 * abs(modulus / own - 1) for modulus in tuned):.0f} %",
    )
    rows = sorted(lines.items(), key=lambda item: float(item[1]["field_difference"]))
    yield (
        "liver-run",
        table(
            ("model", "modulus [kPa]", "field error", "at the best-fit stiffness"),
            [
                (
                    NAMES["fem"],
                    kilopascals(fem["modulus_pa"]),
                    f"own error {tenths(fem['own_error'])}",
                    "",
                ),
                *([NAMES[name], *_estimate(line)] for name, line in rows),
            ],
        ),
    )
    choices: dict[str, list[float]] = {}
    for line in read("docs/data/sensitivity.csv"):
        choices.setdefault(line["choice"], []).append(float(line["rms_change_pa"]) / 1e3)
    yield "choice-system", span(choices["system"])
    for name in ("absent", "knowledge", "footprint_factor"):
        yield f"choice-{name}", f"{max(choices[name]):.1f}"


def _estimate(line: Line) -> list[str]:
    lower, upper = line["lower_pa"], line["upper_pa"]
    interval = f" ({kilopascals(lower)} to {kilopascals(upper)})" if lower else ""
    shares = (tenths(line[name]) for name in ("field_difference", "at_best_stiffness"))
    return [kilopascals(line["modulus_pa"]) + interval, *shares]


def virtual_patients() -> Iterator[tuple[str, str]]:
    """Knowledge bases and baselines on virtual patients."""
    lines = [line for line in read("docs/data/cohort.csv") if line["aetiology"] == "all"]
    by = {(line["contender"], line["readings"]): line for line in lines}
    yield "cohort-patients", count(lines[0]["patients"])
    for name, contender, readings in (
        ("freed-one", "freed mamdani", "1"),
        ("reading-one", "baseline: reading", "1"),
        ("linear-one", "baseline: linear", "1"),
        ("freed-several", "freed mamdani", "2 or more"),
        ("mean-several", "baseline: mean of readings", "2 or more"),
        ("linear-several", "baseline: linear", "2 or more"),
    ):
        yield f"cohort-{name}", tenths(by[contender, readings]["relative_rms"])
    yield (
        "cohort",
        table(
            (
                "contender",
                "bias [kPa]",
                "1 reading",
                "2 or more",
                "displacement",
                "inside type-2 band",
            ),
            [
                [
                    name,
                    kilopascals(by[name, "all"]["bias"]),
                    *(tenths(by[name, some]["relative_rms"]) for some in ("1", "2 or more")),
                    tenths(by[name, "all"]["displacement_rms"]),
                    tenths(by[name, "all"]["coverage"]) if by[name, "all"]["coverage"] else "",
                ]
                for name in dict.fromkeys(line["contender"] for line in lines)
            ],
        ),
    )


def field_error() -> Iterator[tuple[str, str]]:
    """The lattice at rest against converged finite elements."""
    lines = [line for line in measured("field_error") if line["body"] == "liver"]
    groups: dict[tuple[str, str], list[Line]] = {}
    for line in lines:
        groups.setdefault((line["nu"], line["volume_term"]), []).append(line)
    yield "springs-quarter-10mm", percent(groups["0.25", "False"][1]["error"])
    yield "springs-10mm", percent(groups["0.45", "False"][1]["error"])
    yield "springs-best-10mm", percent(groups["0.45", "False"][1]["error_at_best_factor"])
    yield "volume-10mm", percent(groups["0.45", "True"][1]["error"])
    yield "volume-5mm", percent(groups["0.45", "True"][3]["error"])
    head = [f"{1e3 * float(line['spacing_m']):.2g} mm" for line in groups["0.25", "False"]]
    yield (
        "field-error",
        table(
            ("Poisson ratio", *head, "order", "reference's own error"),
            [[words, *_over_spacing(groups[key])] for key, words in LATTICES.items()],
        ),
    )


def _over_spacing(lines: list[Line]) -> list[str]:
    order = float(lines[0]["order"])
    return [
        *(percent(line["error"]) for line in lines),
        f"{order:.1f}" if order > 1 else "",
        tenths(lines[0]["reference_error"]),
    ]


def real_time() -> Iterator[tuple[str, str]]:
    """How fast the lattice with volume term steps, and where."""
    yield "real-time-on", _where(measured("real_time"))
    by_spacing: dict[str, dict[str, Line]] = {}
    for line in measured("real_time"):
        by_spacing.setdefault(line["spacing_m"], {})[line["nu"]] = line
    yield (
        "real-time",
        table(
            ("spacing", "nodes", "field error", "real-time factor, nu 0.45", "nu 0.49"),
            [
                (
                    f"{1e3 * float(spacing):.2g} mm",
                    count(at["0.45"]["nodes"]),
                    tenths(at["0.45"]["error"]),
                    *(f"{float(at[nu]['real_time_factor_median']):.1f}" for nu in ("0.45", "0.49")),
                )
                for spacing, at in by_spacing.items()
            ],
        ),
    )


def kernels() -> Iterator[tuple[str, str]]:
    """A step over the grid beside one over the list of springs and one in C."""
    lines = measured("lattice_kernels")
    grid = [one for one in lines if one["kernel"] == "grid" and one["volume_term"] == "True"]
    most = max(int(one["lanes"]) for one in grid)
    yield "kernels-on", _where(lines)
    yield "kernels-lanes", str(most)
    widest = [one for one in grid if int(one["lanes"]) == most]
    yield "grid-gain", span(float(one["times_list"]) for one in widest)
    yield "grid-over-c", span((float(one["over_c"]) for one in widest), "{:.2f}".format)


def _where(lines: list[Line]) -> str:
    """The machine of a table, and how busy it was."""
    (machine,) = {line["machine"].partition(",")[0] for line in lines}
    loads = [float(line["load"]) for line in lines]
    return f"{machine}, load {max(loads):.1f}"


def peers() -> Iterator[tuple[str, str]]:
    """Other engines on the same nodes."""
    lines = measured("peers")
    yield "peers-on", _where(lines)
    yield "newton-cost", _peer_cost(lines, "Newton SemiImplicit, springs")
    yield "newton-tetrahedra-cost", _peer_cost(lines, "Newton SemiImplicit, tetrahedra")
    yield "mujoco-cost", _peer_cost(lines, "MuJoCo flex trilinear, Euler")
    newton = [one for one in lines if one["engine"] == "Newton SemiImplicit, springs"]
    apart = max(float(one["from_ours"]) for one in newton)
    yield "newton-apart", f"{apart:.0e}".replace("e-0", "e-")
    most = max(int(one["nodes"]) for one in lines)
    yield "peers-nodes", count(most)
    yield (
        "peers",
        table(
            ("engine", "Poisson ratio", "relative time", "field error", "objection"),
            [
                [
                    one["engine"],
                    one["nu"],
                    two_digits(one["relative_to_ours"]),
                    tenths(one["field_error"]),
                    one["objection"].partition("; ")[2],  # the first is that of the engine
                ]
                for one in lines
                if int(one["nodes"]) == most
            ],
        ),
    )


def _peer_cost(lines: list[Line], engine: str) -> str:
    return span(float(one["relative_to_ours"]) for one in lines if one["engine"] == engine)


def error_bar() -> Iterator[tuple[str, str]]:
    """How often the reference's stated error holds."""
    lines = measured("error_bar")
    too_small = [line for line in lines if float(line["true"]) > float(line["stated"])]
    factors = [float(line["true"]) / float(line["stated"]) for line in too_small]
    yield "errors-stated", str(len(lines))
    yield "errors-held", str(len(lines) - len(too_small))
    yield "errors-scenes", str(len({line["scene"] for line in lines}))
    yield "errors-worst", f"{max(factors):.1f}"


def error_bar_livers() -> Iterator[tuple[str, str]]:
    """How often the error stated on graded meshes holds."""
    lines = measured("error_bar_livers")
    factors = [float(line["true"]) / float(line["stated"]) for line in lines]
    yield "liver-errors-stated", str(len(lines))
    yield "liver-errors-held", str(sum(factor <= 1.0 for factor in factors))
    yield "liver-errors-shapes", str(len({line["shape"] for line in lines}))
    yield "liver-errors-worst", f"{max(factors):.2f}"


def large_strain() -> Iterator[tuple[str, str]]:
    """Linear elements and the lattice against neo-Hookean elements."""
    lines = [one for one in measured("large_strain_elements") if one["spacing_m"] == "0.00666667"]
    yield (
        "large-strain",
        table(
            ("largest strain", "linear elements", "nonlinear lattice, volume term, 6.7 mm"),
            [
                [percent(one[name]) for name in ("strain_elements", "linear", "lattice_cells")]
                for one in lines
            ],
        ),
    )


CERTIFICATE = "128"
"""Of a scene, unless it says otherwise."""


def certified() -> Iterator[tuple[str, str]]:
    """The error of a superposition and its bound, by damping, load and vectors."""
    rows: dict[tuple[str, ...], list[str]] = {}
    vectors: list[str] = []
    for line in measured("certified"):
        if line["certificate"] != CERTIFICATE:
            continue
        damping = f"{float(line['mass_per_s']):.3g} /s, {1e3 * float(line['stiffness_s']):g} ms"
        cells = f"{_at_most(line['error'], 100)} / {_at_most(line['bound'], 100)} %"
        rows.setdefault((line["damping"], damping, line["load"]), []).append(cells)
        vectors = list(dict.fromkeys([*vectors, line["vectors"]]))
    head = (
        "damping",
        "alpha, beta",
        "load",
        *(f"{count} vectors, error / bound" for count in vectors),
    )
    yield "certified", table(head, [[*key, *cells] for key, cells in rows.items()])


def _at_most(text: str, factor: float = 1.0) -> str:
    """A number to two digits, rounded up so that a bound stays one."""
    value = factor * float(text)
    if value == 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.2g}"


def tradeoff() -> Iterator[tuple[str, str]]:
    """Error and cost of every model."""
    lines = measured("tradeoff")
    yield "tradeoff-count", str(len(lines))
    yield "tradeoff-own-error", tenths(lines[0]["field_error_bar"])
    for rate in ("60hz", "1khz"):
        free = [one for one in lines if one["any_load"] == one[f"real_time_{rate}"] == "True"]
        best = min((one for one in free if one["field_error"]), key=_field_error)
        error, bar = (100 * float(best[name]) for name in ("field_error", "field_error_bar"))
        yield f"best-{rate}", f"{error:.1f} ± {bar:.1f} %"
        yield f"best-{rate}-spacing", f"{1e3 * _spacing(best):.2g} mm"
    yield (
        "tradeoff",
        table(
            (
                "model",
                "field",
                "at the tool",
                "setup",
                "wall per simulated second",
                "60 Hz",
                "1 kHz",
            ),
            [[words, *_cost(_configuration(lines, *key))] for *key, words in SHOWN],
        ),
    )


def _field_error(line: Line) -> float:
    return float(line["field_error"])


def _spacing(line: Line) -> float:
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
        *("yes" if line[f"real_time_{rate}"] == "True" else "no" for rate in ("60hz", "1khz")),
    ]


STRAINS = (("1 to 5 %", 0.0, 0.05), ("5 to 20 %", 0.05, 1.0))
"""Largest strain of the linear elements: words, above, up to."""
SMALL = STRAINS[0][2]


def corrected() -> Iterator[tuple[str, str]]:
    """The corrected lattice at random places of the tool, and what it costs."""
    places, costs = measured("corrected_places"), measured("corrected_cost")
    ratios = [float(one["error_20"]) / float(one["estimate_20"]) for one in places]
    coarser = [float(one["error_20"]) / float(one["coarser_20"]) for one in places]
    yield "corrected-count", str(len(places))
    yield "corrected-within", str(sum(ratio <= 2.0 for ratio in ratios))
    yield "corrected-ratios", span(ratios, "{:.2g}".format)
    yield "corrected-coarser", span(coarser, "{:.2g}".format)
    yield from _gains(places, costs)
    yield "corrected-places", table(PLACES_HEAD, [_places(places, *one) for one in STRAINS])
    yield "corrected-cost", table(COST_HEAD, map(_corrected_cost, costs))
    yield from _at_1_khz(costs)


TRAVELLING_HEAD = (
    *("largest strain", "places", "nonlinear part", "corrected, 20 mm", "15 mm", "10 mm", "8 mm"),
    *("corrected at rest only, 20 mm", "lattice alone, 10 mm", "5 mm", "10 mm, held to 5 mm"),
)
TRAVELLING_STRAINS = (("5 %", 0.0, 0.1), ("20 %", 0.1, 1.0))


def travelling() -> Iterator[tuple[str, str]]:
    """A tool that travels: its stations, and corrected lattices under it."""
    used = [one for one in measured("travelling_stations") if float(one["apart"]) == 0.25]
    for name in ("spline", "hat"):
        yield f"travelling-{name}", percent(max(float(one[name]) for one in used))
    places = measured("travelling_places")
    yield "travelling-count", str(len({(one["at_x"], one["at_z"]) for one in places}))
    yield "travelling-vectors", span([float(one["vectors"]) for one in places], "{:.0f}".format)
    rows = [_travelling(places, *one) for one in TRAVELLING_STRAINS]
    yield "travelling-places", table(TRAVELLING_HEAD, rows)
    price = {
        (one["model"], _rounded(one["spacing_m"]), 0.0): float(one["per_second"])
        for one in measured("travelling_cost")
    }
    for words, (_, above, up_to) in zip(("small", "large"), TRAVELLING_STRAINS, strict=True):
        found = [one for one in places if above < float(one["strain"]) <= up_to]
        gains, own = (
            [gain for one in found if (gain := _gain(one, price, kind)) is not None]
            for kind in ("uniform", "own")
        )
        yield f"travelling-met-{words}", f"{len(gains)} of {len(found)}"
        yield f"travelling-gain-{words}", span(gains, "{:.2g}".format)
        yield f"travelling-own-gain-{words}", span(own, "{:.2g}".format)
    static = sum(float(one["static_20"]) > TOLERANCE for one in places)
    yield "travelling-static-missed", f"{static} of {len(places)}"
    graded = [one for one in measured("travelling_graded") if float(one["reach"]) < 1.0]
    yield "travelling-graded-count", str(len({(one["at_x"], one["at_z"]) for one in graded}))
    for words, (_, above, up_to) in zip(("small", "large"), TRAVELLING_STRAINS, strict=True):
        errors = [float(x["error"]) for x in graded if above < float(x["strain"]) <= up_to]
        yield f"travelling-graded-{words}", percent(max(errors))
    yield "travelling-graded-gain", span([float(one["gain"]) for one in graded], "{:.2g}".format)


def _travelling(lines: list[Line], words: str, above: float, up_to: float) -> list[str]:
    found = [line for line in lines if above < float(line["strain"]) <= up_to]
    columns = (
        *("nonlinear", "error_20", "error_15", "error_10", "error_8", "static_20"),
        *("uniform_10", "uniform_5", "own_10"),
    )
    return [words, str(len(found)), *(_median_and_worst(found, name) for name in columns)]


GRAVITY_HEAD = (
    *("scene", "large displacements", "corrected, 20 mm", "own estimate", "corrected, 10 mm"),
    *("own estimate", "lattice alone, 10 mm"),
)


def under_gravity() -> Iterator[tuple[str, str]]:
    """Corrected lattices under gravity and weights: the worst control point of each scene."""
    lines = measured("corrected_gravity")
    rows = []
    for scene in dict.fromkeys(one["scene"] for one in lines):
        coarse, fine = (
            [one for one in lines if (one["scene"], float(one["spacing_m"])) == (scene, spacing)]
            for spacing in (0.02, 0.01)
        )
        cells = [(coarse, "linear"), (coarse, "corrected"), (coarse, "told")]
        cells += [(fine, "corrected"), (fine, "told"), (fine, "alone")]
        worst = [max(float(one[name]) for one in of) for of, name in cells]
        rows.append([scene, *map(percent, worst)])
    yield "gravity-places", table(GRAVITY_HEAD, rows)
    both = [one for one in lines if one["neo_hooke_own"] != "nan"]
    for name in ("own", "linear", "corrected", "alone"):
        yield f"gravity-neo-{name}", percent(max(float(one[f"neo_hooke_{name}"]) for one in both))
    ratios = [float(one["corrected"]) / float(one["told"]) for one in lines]
    yield "gravity-ratios", span(ratios, "{:.1f}".format)


GRADED_HEAD = (
    *("largest strain", "places", "region for 2 %", "lattice of 10 mm", "8 mm"),
    *("corrected, 20 mm", "10 mm", "graded, to 0.6 radii", "to 1 radius"),
)


def graded() -> Iterator[tuple[str, str]]:
    """Regions of interest and graded corrected lattices at places of the tool, and their cost."""
    places, costs = measured("graded_places"), measured("corrected_cost")
    errors = [float(one["region_error"]) for one in places]
    yield "graded-count", str(len(places))
    yield "graded-kept", str(sum(error <= TOLERANCE for error in errors))
    yield "graded-worst", percent(max(errors))
    yield "graded-rest", span([float(one["region_apart"]) for one in places], percent)
    yield "graded-nodes", span([float(one["region_nodes"]) for one in places], "{:.0f}".format)
    near = [float(one["graded_near_nodes"]) for one in places]
    yield "graded-near-nodes", span(near, "{:.0f}".format)
    yield "graded-places", table(GRADED_HEAD, [_graded(places, *one) for one in STRAINS])
    gains = [float(one["region_gain"]) for one in places]
    yield "region-gain", span(gains, "{:.2g}".format)
    yield "region-gain-median", f"{median(gains):.2g}"
    yield from _graded_gains(places, costs)
    yield "multirate", table(RATES_HEAD, map(_rates, measured("multirate")))


def _graded_gains(places: list[Line], costs: list[Line]) -> Iterator[tuple[str, str]]:
    """As `_gains`, with graded corrected lattices, at the places where there are any."""
    found = {(one["at_x"], one["at_z"]): one for one in places}
    both = [found[at] | one for one in measured("corrected_places") if (at := _at(one)) in found]
    price, cells = _prices(costs), measured("graded_cells")
    yield "graded-cells-count", str(len({_at(one) for one in cells}))
    yield "graded-cells", table(CELLS_HEAD, map(_cells, cells))
    for words, (_, above, up_to) in zip(("small", "large"), STRAINS, strict=True):
        chosen = [one for one in both if above < float(one["strain"]) <= up_to]
        for kind in ("uniform", "own"):
            known = (_gain(one, price, kind, _at_place(cells, one, price)) for one in chosen)
            gains = [gain for gain in known if gain is not None]
            yield f"graded-gain-{words}-{kind}", f"{min(gains):.0f}"
            yield f"graded-gain-{words}-{kind}-median", f"{median(gains):.0f}"
        yield f"graded-gain-{words}-met", str(len(gains))


CELLS_HEAD = (
    *("largest strain", "radius of the tool", "finest cells", "as far as", "nodes", "error"),
    *("predicted", "gain", "load"),
)


def _cells(one: Line) -> list[str]:
    """A grading at a place: lengths in mm."""
    lengths = [f"{1e3 * float(one[key]):.3g} mm" for key in ("radius_m", "finest_m", "reach_m")]
    errors = [percent(float(one[key])) for key in ("error", "foretold")]
    strain = percent(float(one["strain"]))
    load = "-" if one["load"] == "nan" else f"{float(one['load']):.0f}"
    return [strain, *lengths, one["nodes"], *errors, f"{float(one['gain']):.0f}", load]


def _at_place(
    cells: list[Line], place: Line, price: dict[tuple[str, float, float], float]
) -> list[float]:
    """Costs [s] of graded corrected lattices within the tolerance, measured at a place."""
    finest = price["uniform", 0.005, 0.0]
    kept = [one for one in cells if _at(one) == _at(place) and float(one["error"]) <= TOLERANCE]
    return [finest / float(one["gain"]) for one in kept]


def graded_rest() -> Iterator[tuple[str, str]]:
    """Predictions of graded corrected lattices, held against cells of 5 and of 2.5 mm."""
    lines = measured("graded_rest")
    yield "graded-rest-count", str(len({_at(one) for one in lines}))
    yield "graded-rest-rows", str(len(lines))
    for name in ("of_5_mm", "of_2_5_mm"):
        ratios = [float(one[name]) / float(one["foretold"]) for one in lines]
        yield f"graded-rest-{name.replace('_', '-')}", f"{median(ratios):.2g}"
        yield f"graded-rest-{name.replace('_', '-')}-largest", f"{max(ratios):.2g}"
    within = sum(float(one["of_2_5_mm"]) <= 2.0 * float(one["foretold"]) for one in lines)
    yield "graded-rest-within", str(within)


PREDICTED = {
    "geometry": ("large displacements left out", "nonlinear"),
    "remainder_20": ("the same on a corrected lattice of 20 mm", "error_20"),
    "remainder_15": ("15 mm", "error_15"),
    "remainder_10": ("10 mm", "error_10"),
    "near": ("graded, 5 mm to 0.6 radii", "graded_near_error"),
    "far": ("graded, 5 mm to 1 radius", "graded_error"),
    "alone_10": ("a lattice of 10 mm alone", "uniform_10"),
    "alone_5": ("5 mm alone", "uniform_5"),
    "mesh": ("elements' mesh, at rest", "mesh_found"),
}
"""By columns of `planned_places`: words, and the column of what was found."""
PREDICTED_HEAD = (
    "prediction of",
    "places",
    "error within twice",
    "error / prediction: median, largest",
)
CONTROL = ("static_20", "remainder_20")


TOOLS_HEAD = (
    *("quantity", "scenes", "lattices", "error within twice", "within prediction"),
    *("error / prediction: median, largest", "without a factor: within twice"),
    "from two lattices, without a factor: within twice",
)


def planned_tools() -> Iterator[tuple[str, str]]:
    """What a plan predicts under moved tools, and what two lattices would."""
    every = measured("planned_tools")
    lines = [one for one in every if float(one["found"]) > 1e-3]  # else a bonded tool holds it
    groups = dict.fromkeys(one["group"] for one in lines)
    drawn = {one["scene"] for one in lines if one["group"] == "random"}
    yield "planned-tools-scenes", str(len({one["scene"] for one in lines} - drawn))
    yield "planned-tools-random", str(len(drawn))
    quantities = dict.fromkeys(one["quantity"] for one in lines)
    rows = [_under_tools(lines, name, group) for name in quantities for group in groups]
    yield "planned-tools", table(TOOLS_HEAD, rows)
    for quantity in ("force", "at the tool"):
        chosen = [one for one in lines if one["quantity"] == quantity]
        by_two = [float(one["found"]) / float(one["by_two"]) for one in chosen]
        for name, factor in (("index", 3.0), ("bare", 1.0)):
            covered = f"{sum(one <= factor for one in by_two)} of {len(by_two)}"
            yield f"spacing-{name}-{quantity.replace(' ', '-')}", covered


def _under_tools(lines: list[Line], quantity: str, group: str) -> list[str]:
    """How often the error of a quantity is within the prediction, in a group of scenes."""
    from study.models.spacing_error import ESTIMATE

    chosen = [one for one in lines if (one["quantity"], one["group"]) == (quantity, group)]
    by_three, by_two = (
        [float(one["found"]) / float(one[name]) for one in chosen]
        for name in ("by_three", "by_two")
    )
    ratios = [one / ESTIMATE for one in by_three]
    within = [sum(one <= limit for one in ratios) for limit in (2.0, 1.0)]
    counts = [*within, sum(one <= 2.0 for one in by_three), sum(one <= 2.0 for one in by_two)]
    spread = f"{median(ratios):.2g}, {max(ratios):.2g}"
    return [quantity, group, *map(str, (len(ratios), *counts[:2])), spread, *map(str, counts[2:])]


def planned() -> Iterator[tuple[str, str]]:
    """What a plan predicts at random places of the tool, against the error found there."""
    others = {_at(one): one for one in measured("corrected_places")}
    graded_ones = {_at(one): one for one in measured("graded_places")}
    lines = [
        graded_ones.get(_at(one), {}) | others[_at(one)] | one for one in measured("planned_places")
    ]
    yield "planned-count", str(len(lines))
    rows = [_predicted(lines, told, *known) for told, known in PREDICTED.items()]
    yield "planned-places", table(PREDICTED_HEAD, rows)
    ratios = [float(one[CONTROL[0]]) / float(one[CONTROL[1]]) for one in lines]
    yield "planned-control", str(sum(one <= 2.0 for one in ratios))
    sums = [(_found(one, "nonlinear"), _found(one, "mesh_found")) for one in lines]
    told = [float(one["geometry"]) + float(one["mesh"]) for one in lines]
    kept = sum(sum(a) <= 2.0 * b for a, b in zip(sums, told, strict=True))
    yield "planned-elements", str(kept)


def _predicted(lines: list[Line], told: str, words: str, found: str) -> list[str]:
    """How often the error found is within twice the prediction."""
    ratios = [_found(one, found) / float(one[told]) for one in lines if found in one]
    within = sum(one <= 2.0 for one in ratios)
    return [words, str(len(ratios)), str(within), f"{median(ratios):.2g}, {max(ratios):.2g}"]


def _found(line: Line, column: str) -> float:
    return float(line[column])


def _at(line: Line) -> tuple[str, str]:
    return line["at_x"], line["at_z"]


RATES_HEAD = (
    *("finest cells to", "steps of 5, 10 and 20 mm cells", "longest step", "gain"),
    "gain if the interface were free",
)


def _rates(line: Line) -> list[str]:
    numbers = (f"{float(line[name]):.2f}" for name in ("limit", "gain", "bound"))
    return [_mm(line["radius_m"]), line["rates"].replace("-", " : "), *numbers]


def _mm(length: str) -> str:
    return f"{1e3 * float(length):.2g} mm"


def _graded(lines: list[Line], words: str, above: float, up_to: float) -> list[str]:
    """Median and worst of each column over the places of a range of strain."""
    found = [line for line in lines if above < float(line["strain"]) <= up_to]
    columns = (
        *("region_error", "uniform_10", "uniform_8", "corrected_20", "corrected_10"),
        *("graded_near_error", "graded_error"),
    )
    return [words, str(len(found)), *(_median_and_worst(found, name) for name in columns)]


PLACES_HEAD = (
    *("largest strain", "places", "nonlinear part", "corrected, 20 mm", "15 mm", "10 mm", "8 mm"),
    *("corrected at rest only, 20 mm", "lattice alone, 10 mm", "5 mm"),
)


def _places(lines: list[Line], words: str, above: float, up_to: float) -> list[str]:
    """Median and worst of each column over the places of a range of strain."""
    found = [line for line in lines if above < float(line["strain"]) <= up_to]
    columns = (
        "nonlinear",
        "error_20",
        "error_15",
        "error_10",
        "error_8",
        "static_20",
        "uniform_10",
    )
    return [
        words,
        str(len(found)),
        *(_median_and_worst(found, name) for name in (*columns, "uniform_5")),
    ]


def _median_and_worst(lines: list[Line], column: str) -> str:
    values = [float(line[column]) for line in lines]
    return f"{percent(median(values))}, {percent(max(values))}"


TOLERANCE = 0.02
ALONE = {"20": 0.02, "15": 0.015, "10": 0.01, "8": 0.008, "7": 0.00667, "5": 0.005}
"""Spacings [m] by the ends of the names of columns."""


def _gains(places: list[Line], costs: list[Line]) -> Iterator[tuple[str, str]]:
    """What a lattice alone costs that is within the tolerance, over a corrected one that is."""
    price = _prices(costs)
    for words, (_, above, up_to) in zip(("small", "large"), STRAINS, strict=True):
        found = [one for one in places if above < float(one["strain"]) <= up_to]
        gains, own = (
            [gain for one in found if (gain := _gain(one, price, kind)) is not None]
            for kind in ("uniform", "own")
        )
        yield f"corrected-met-{words}", f"{len(gains)} of {len(found)}"
        yield f"corrected-gain-{words}", f"{min(gains):.0f}"
        yield f"corrected-gain-{words}-median", f"{median(gains):.0f}"
        yield f"corrected-own-gain-{words}", f"{min(own):.1f}"
        yield f"corrected-own-gain-{words}-median", f"{median(own):.0f}"
    missed = sum(float(one["uniform_5"]) > TOLERANCE for one in places)
    yield "corrected-alone-missed", str(missed)
    linear = [one for one in places if float(one["nonlinear"]) <= TOLERANCE]
    yield "linear-met-small", str(sum(float(one["strain"]) <= SMALL for one in linear))
    yield "linear-met-large", str(sum(float(one["strain"]) > SMALL for one in linear))
    cheap = price["superposition", 0.0, 0.0]
    yield "linear-gain", f"{price['uniform', ALONE['5'], 0.0] / cheap:.0f}"


def _prices(costs: list[Line]) -> dict[tuple[str, float, float], float]:
    """Of a simulated second [s], by model, spacing and radius."""
    names = ("spacing_m", "radius_m")
    return {
        (one["model"], *(_rounded(one[n]) for n in names)): float(one["per_second"])
        for one in costs
    }


GRADED = {"graded_near_error": 0.6, "graded_error": 1.0}
"""How far their finest cells reach, in radii of the tool, by the columns of their errors."""
GRADED_PRICED = (0.015, 0.025)
"""Radii [m] of those whose cost is known; a smaller one counts as the next larger."""


def _gain(
    line: Line,
    price: dict[tuple[str, float, float], float],
    kind: str,
    further: Sequence[float] = (),
) -> float | None:
    """None where no corrected lattice is; at least so much where no lattice alone is.

    Graded ones count where their error was measured. `further`: costs [s] of others within the
    tolerance.
    """
    errors = {name: float(line.get(f"{kind}_{name}", 0.0)) for name in ALONE} | {"5": 0.0}
    alone = [price["uniform", ALONE[name], 0.0] for name, e in errors.items() if e <= TOLERANCE]
    both = [
        price["corrected", ALONE[name], 0.0]
        for name in ("20", "15", "10", "8")
        if float(line[f"error_{name}"]) <= TOLERANCE
    ]
    both += [
        price["corrected graded", 0.005, _priced(reach * float(line["radius_m"]))]
        for name, reach in GRADED.items()
        if name in line and float(line[name]) <= TOLERANCE
    ]
    both += further
    return min(alone) / min(both) if both else None


def _priced(radius: float) -> float:
    return min(one for one in GRADED_PRICED if radius < one * (1.0 + 1e-9))


def _rounded(spacing: str) -> float:
    return float(f"{float(spacing):.3g}")


COST_HEAD = ("lattice", "field", "at the tool", "processor time of a simulated second", "of a step")


def _corrected_cost(line: Line) -> list[str]:
    radius = float(line["radius_m"])
    sizes = f" to {_mm(line['radius_m'])}" if radius else ""
    named = line["model"]
    if float(line["spacing_m"]):
        named += f", {_mm(line['spacing_m'])}{sizes}"
    errors = (percent(line[name]) for name in ("field_error", "tool_error"))
    step = f"{float(line['step_us']):.0f} µs of {1e3 * float(line['step_s']):.2g} ms"
    return [named, *errors, f"{float(line['per_second']):.2g} s", step]


def _at_1_khz(lines: list[Line]) -> Iterator[tuple[str, str]]:
    """The most accurate of either kind of which a millisecond is computed within one."""
    for kind in ("uniform", "corrected"):
        able = [one for one in lines if one["model"] == kind and _millisecond(one) < 1e-3]
        best = min(able, key=_field_error)
        yield f"{kind}-1khz", percent(best["field_error"])
        yield f"{kind}-1khz-tool", percent(best["tool_error"])
        yield f"{kind}-1khz-spacing", f"{1e3 * float(best['spacing_m']):.2g} mm"


def _millisecond(line: Line) -> float:
    """Processor time [s] of the steps in a millisecond, which are shortened to divide it."""
    return math.ceil(1e-3 / float(line["step_s"])) * 1e-6 * float(line["single_us"])


def verification() -> Iterator[tuple[str, str]]:
    """The reference on problems with exact solutions."""
    lines = {(line["problem"], line["quantity"]): line for line in measured("verification")}
    yield "verification-findings", str(len(lines))
    rows = []
    for words, problem, quantity in PROBLEMS:
        p2 = lines[problem, quantity.format("p2", nu="0.3", other="0.45")]
        mixed = lines[problem, quantity.format("taylor-hood", nu="0.4999", other="0.4999")]
        rows.append([words, *(f"{100 * float(one['error']):.2g} %" for one in (p2, mixed))])
    yield "verification", table(("problem", "quadratic tetrahedra", "Taylor-Hood"), rows)
    orders = {
        "order-p2": ("manufactured, quadratic", "displacement, L2, p2, nu 0.3"),
        "order-mixed": ("manufactured, mixed", "displacement, L2, taylor-hood, nu 0.4999"),
    }
    for name, key in orders.items():
        yield name, f"{float(lines[key]['order']):.2f}"


def validation() -> Iterator[tuple[str, str]]:
    """Models beside measurements on silicone."""
    lines = measured("validation")
    models = list(dict.fromkeys(line["model"] for line in lines))
    forces = [f"force at {strain} %" for strain in (10, 20, 30)]
    rows = [
        [f"{model}, {faces}", *(_force(lines, model, faces, force) for force in forces)]
        for faces in ("bonded", "sliding")
        for model in models
    ]
    spread = [_median_of(lines, "uncertainty", models[0], "bonded", force) for force in forces]
    rows.append(["uncertainty of the measurement", *(f"{100 * one:.1f} %" for one in spread)])
    yield "validated-cylinders", table(("model, faces", "10 %", "20 %", "30 %"), rows)
    alone, free = (
        [line for line in lines if (line["quantity"], line["case"]) == (name, "weight alone")]
        for name in ("tip deflection, mean of markers", "frequency of free vibration")
    )
    tip, frequency = (
        f"{float(own[0]['measured']):.2f} ± {float(own[0]['uncertainty']):.2f}"
        for own in (alone, free)
    )
    yield (
        "validated-beam",
        table(
            ("model", "modulus fitted [kPa]", f"tip, measured {tip}", f"measured {frequency} Hz"),
            [
                [line["model"], f"{1e-3 * float(line['modulus_pa']):.0f}", _own(line), _own(other)]
                for line, other in zip(alone, free, strict=True)
            ],
        ),
    )
    yield "validated-cube", table(("model", "at 5 %", "at 18.25 %"), _beads(lines, models))
    yield from _headline(lines)


def _own(line: Line) -> str:
    """A model's number and its own error."""
    return f"{float(line['found']):.2f} ± {float(line['numerical']):.2f}"


def _median_of(lines: list[Line], column: str, model: str, faces: str, quantity: str) -> float:
    """Median over the materials of a column over the measured force."""
    wanted = (model, faces, quantity)
    return median(
        float(line[column]) / float(line["measured"])
        for line in lines
        if (line["model"], line["faces"], line["quantity"]) == wanted and line["found"]
    )


def _force(lines: list[Line], model: str, faces: str, quantity: str) -> str:
    try:
        off = _median_of(lines, "found", model, faces, quantity) - 1.0
    except ValueError:  # of no material
        return "collapses"
    return f"{100 * off:+.1f} %"


def _beads(lines: list[Line], models: list[str]) -> Iterator[list[str]]:
    left = {
        (line["model"], line["case"], line["faces"]): f"{float(line['found']):.2f}"
        for line in lines
        if line["quantity"] == "rms residual of the beads" and line["found"]
    }
    for model in models:
        pairs = (
            [left.get((model, case, faces), "none") for faces in ("bonded", "sliding")]
            for case in ("5 %", "18.25 %")
        )
        yield [model, *map(" / ".join, pairs)]


def _headline(lines: list[Line]) -> Iterator[tuple[str, str]]:
    """What README.md says of it."""
    model = "neo-Hookean FE"
    for strain in (10, 30):
        force = f"force at {strain} %"
        off = _median_of(lines, "found", model, "bonded", force) - 1.0
        spread = _median_of(lines, "uncertainty", model, "bonded", force)
        yield f"measured-{strain}", f"{100 * off:+.1f} ± {100 * spread:.1f} %"
    for name in ("springs alone", "springs and volume term"):
        (row,) = _beads(lines, [name])
        yield f"beads-{name.split()[-1]}", f"{row[2].partition(' / ')[0]} mm"


def stability() -> Iterator[tuple[str, str]]:
    """Every model at its extremes."""
    lines = measured("stability")
    yield "stability-cases", str(len(lines))
    families: dict[str, list[Line]] = {}
    for line in lines:
        families.setdefault(line["family"], []).append(line)
    yield (
        "stability",
        table(
            ("family", "cases", "passed"),
            [
                (name, str(len(found)), str(sum(one["passed"] == "True" for one in found)))
                for name, found in families.items()
            ],
        ),
    )
    for name, kind in (("springs", "springs"), ("volume", "nu 0.45")):
        lost = {
            float(one["case"].split()[0]): one["outcome"] == "diverged"
            for one in families["collapse"]
            if one["case"].endswith(f"its weight, {kind}: symplectic-euler")
        }
        borne = max(weight for weight, gone in lost.items() if not gone)
        first = min(weight for weight, gone in lost.items() if gone)
        yield f"collapse-{name}", f"{borne:.0f} and {first:.0f}"


def ranking() -> Iterator[tuple[str, str]]:
    """What the study of the paper's unknowns found, a line a finding, as the report says it."""
    from reports.ranking_study import CLAIM, sentences

    lines = "\n".join(f"- {text}" for text in sentences())
    yield "ranking", f"\n\n{lines}\n\n"
    nearest = read("reports/data/ranking_nearest.csv")
    shares = [100.0 * float(line["share"]) for line in nearest if line["system"] == CLAIM]
    yield "ranking-claim", f"{min(shares):.0f} to {max(shares):.0f} %"
    yield "ranking-draws", count(nearest[0]["draws"])


def organ() -> Iterator[tuple[str, str]]:
    """What the study of an organ found, a line a finding, as the report says it."""
    from reports.organ_ranking import sentences

    lines = "\n".join(f"- {text}" for text in sentences())
    yield "organ-ranking", f"\n\n{lines}\n\n"


def run_stages() -> Iterator[tuple[str, str]]:
    """What the default run takes: at first, of kept stages, and after a change, by machine."""
    whole = [line for line in measured("run_stages") if line["stage"] == "whole"]
    for name, case in (
        ("first", "after install"),
        ("fresh", "side by side"),
        ("alone", "one after another"),
        ("unchanged", "unchanged"),
        ("title", "other title"),
        ("reading", "other reading"),
        ("spacing", "other spacing"),
    ):
        lines = [line for line in whole if line["case"] == case]
        yield f"run-{name}", seconds(float(line["wall_s"]) for line in lines)
        if name in {"first", "fresh"}:
            memory = max(float(line["memory_mb"]) for line in lines)
            yield f"run-{name}-memory", f"{memory / 1e3:.1f} GB"
    names = dict.fromkeys(line["machine"].partition(",")[0] for line in whole)
    yield "run-machines", " and ".join(names)


def seconds(times: Iterable[float]) -> str:
    """Least and largest of some times [s]."""
    found = sorted(times)
    least, most = (f"{one:.0f}" if one >= 2.0 else f"{one:.1f}" for one in (found[0], found[-1]))
    return f"{least} s" if least == most else f"{least} to {most} s"


def figures() -> dict[str, str]:
    """Every figure by name, as it is printed."""
    fuzzy = (liver_run, virtual_patients)
    lattice = (field_error, real_time, kernels, peers, error_bar, large_strain)
    models = (error_bar_livers, certified, tradeoff, corrected, travelling)
    foreseen = (under_gravity, graded, graded_rest, planned, planned_tools)
    held = (verification, validation, stability, ranking, organ)
    groups = (*fuzzy, *lattice, *models, *foreseen, run_stages, *held)
    return {name: text for group in groups for name, text in group()}


def pages() -> list[Path]:
    """README.md and all pages."""
    return [ROOT / "README.md", *sorted(HERE.glob("*.md"))]


def updated(text: str, known: dict[str, str]) -> str:
    """The text of a page with its figures as they are known. ValueError for an unknown name."""

    def figure(found: re.Match[str]) -> str:
        if found[2] not in known:
            raise ValueError(f"figure {found[2]}: docs/figures.py knows none of this name")
        return found[1] + known[found[2]] + found[4]

    return MARK.sub(figure, text)


if __name__ == "__main__":
    computed = figures()
    for page in pages():
        page.write_text(updated(page.read_text(encoding="utf-8"), computed), encoding="utf-8")
