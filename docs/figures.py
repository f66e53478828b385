"""The figures that README.md and the pages quote, computed from the committed tables.

In a page a figure stands between two comments, which no reader sees:

    springs alone leave <!-- figure: springs-10mm -->24 %<!-- --> of the field

`python docs/figures.py` writes all of them anew; tests/test_docs.py fails where one differs. To add
a figure, add it to `figures`. A table of several lines is a figure too.
"""

import csv
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

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
    "reading": "lattice, the reading as it is",
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


def count(number: float | str) -> str:
    """A count in groups of three digits."""
    return f"{int(number):,}".replace(",", " ")


def span(values: Iterable[float], form: Callable[[float], str] = "{:.1f}".format) -> str:
    """The least and the largest: "a to b"."""
    least, *_, largest = sorted(values)
    return f"{form(least).removesuffix(' %')} to {form(largest)}"


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
            ("model", "modulus [kPa]", "difference of the field", "left at the best stiffness"),
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
            ("contender", "bias [kPa]", "1 reading", "2 or more", "displacement", "in the band"),
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
    """How fast the lattice with volume term steps."""
    by_spacing: dict[str, dict[str, Line]] = {}
    for line in measured("real_time"):
        by_spacing.setdefault(line["spacing_m"], {})[line["nu"]] = line
    yield (
        "real-time",
        table(
            ("spacing", "nodes", "field error", "times real time at 0.45", "at 0.49"),
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


def peers() -> Iterator[tuple[str, str]]:
    """Other engines on the same nodes."""
    lines = measured("peers")
    own = {line["nodes"]: line for line in lines if line["engine"].startswith("lattice")}

    def of(engine: str, nu: str | None = None) -> list[Line]:
        named = [line for line in lines if line["engine"].startswith(engine)]
        return [line for line in named if nu in (None, line["nu"])]

    def errors(engine: str) -> list[float]:
        found = of(engine, "0.45")
        return [
            float(one["field_error"]) / float(own[one["nodes"]]["field_error"]) for one in found
        ]

    newton = of("Newton SemiImplicit")
    explicit = [one for one in of("MuJoCo flex") if one["engine"].endswith("Euler")]
    yield "newton-cost", span(float(one["relative_to_ours"]) for one in newton)
    yield (
        "newton-apart",
        f"{max(float(one['from_ours']) for one in newton):.0e}".replace("e-0", "e-"),
    )
    yield "mujoco-cost", span((float(one["relative_to_ours"]) for one in explicit), "{:.0f}".format)
    yield "mujoco-trilinear-error", span(errors("MuJoCo flex trilinear"))
    yield "mujoco-full-error", span(errors("MuJoCo flex full"))


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


def figures() -> dict[str, str]:
    """Every figure by name, as it is printed."""
    fuzzy = (liver_run, virtual_patients)
    lattice = (field_error, real_time, peers, error_bar, error_bar_livers, large_strain, tradeoff)
    groups = (*fuzzy, *lattice, verification, stability, ranking)
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
