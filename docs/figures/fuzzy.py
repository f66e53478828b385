"""Estimates of stiffness by the fuzzy systems, on the built-in liver and on virtual patients."""

from collections.abc import Iterator

from docs.figures.formats import count, kilopascals, span, table, tenths
from docs.figures.tables import Line, column, grouped, read

MODELS = {
    "fem": "finite elements",
    "basafa": "Basafa benchmark",
    "msm-mamdani": "lattice, Mamdani",
    "msm-sugeno": "lattice, Sugeno",
    "msm-interval-type-2": "lattice, interval type-2",
    "reading": "lattice, elastography reading",
}
RUN_HEAD = ("model", "modulus [kPa]", "field error", "at the best-fit stiffness")
COHORT_HEAD = (
    *("contender", "bias [kPa]", "1 reading", "2 or more", "displacement"),
    "inside type-2 band",
)


def liver_run() -> Iterator[tuple[str, str]]:
    """The built-in liver, and what its estimates depend on."""
    lines = {line["model"]: line for line in read("docs/data/liver.csv")}
    fem = lines.pop("fem")
    true = float(fem["modulus_pa"])
    tuned = [float(line["modulus_pa"]) for name, line in lines.items() if name.startswith("msm")]
    yield "liver-unknowns", count(fem["unknowns"])
    yield "liver-own-error", tenths(fem["own_error"])
    yield "liver-off", f"{max(100 * abs(modulus / true - 1) for modulus in tuned):.0f} %"
    ordered = sorted(lines.values(), key=lambda line: float(line["field_difference"]))
    own_error = f"own error {tenths(fem['own_error'])}"
    reference = [MODELS["fem"], kilopascals(fem["modulus_pa"]), own_error, ""]
    yield "liver-run", table(RUN_HEAD, [reference, *map(_estimate, ordered)])
    choices = grouped(read("docs/data/sensitivity.csv"), lambda line: line["choice"])
    changes = {name: column(of, "rms_change_pa") for name, of in choices.items()}
    yield "choice-system", span(one / 1e3 for one in changes["system"])
    for name in ("absent", "knowledge", "footprint_factor"):
        yield f"choice-{name}", f"{max(changes[name]) / 1e3:.1f}"


def _estimate(line: Line) -> list[str]:
    lower, upper = line["lower_pa"], line["upper_pa"]
    interval = f" ({kilopascals(lower)} to {kilopascals(upper)})" if lower else ""
    shares = (tenths(line[name]) for name in ("field_difference", "at_best_stiffness"))
    return [MODELS[line["model"]], kilopascals(line["modulus_pa"]) + interval, *shares]


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
    contenders = dict.fromkeys(line["contender"] for line in lines)
    yield "cohort", table(COHORT_HEAD, [_contender(by, name) for name in contenders])


def _contender(by: dict[tuple[str, str], Line], name: str) -> list[str]:
    """Of a contender; `by` has its line for each number of readings."""
    every = by[name, "all"]
    return [
        name,
        kilopascals(every["bias"]),
        *(tenths(by[name, readings]["relative_rms"]) for readings in ("1", "2 or more")),
        tenths(every["displacement_rms"]),
        tenths(every["coverage"]) if every["coverage"] else "",
    ]
