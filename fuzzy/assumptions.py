"""The readings adopted where the paper is silent, one sentence each, for reports."""

from collections.abc import Callable, Iterable

from fuzzy.knowledge import SetRecord, elastography, parameters
from fuzzy.liver import OUTPUT
from fuzzy.settings import Settings

ODD_CELL = {
    "missing-triple": "is read as the triple ALD, CLD, NAFLD that the table otherwise lacks",
    "literal": "is read literally, with two NAFLD terms in one antecedent",
}
DUPLICATES = {
    "keep": "keeps both copies of its 12 rules, which doubles their weight in the Sugeno sum only",
    "drop": "enters once, which leaves 12 rules fewer than the paper counts",
}
CONSEQUENT = {
    "max": "the severest antecedent governs the consequent",
    "mean": "the consequent is the mean severity of the antecedents, rounded up",
}
AGGREGATION = {
    "sum": "weighs every rule, as MATLAB does, so rules that share a consequent count repeatedly",
    "max": "weighs each output set once, by its strongest rule",
}


def assumptions(settings: Settings | None = None) -> tuple[str, ...]:
    """Every reading and modelling choice in force, one sentence each."""
    settings = settings or Settings()
    return (*_rules(settings), *_data(), *_inference(settings))


def _rules(settings: Settings) -> tuple[str, ...]:
    return (
        "Rules: reading R1, each of the 29 ones of Table I expands to the full grid of its sets; "
        "with 2, 3, 2, 2, 2 sets for HCV, HBV, ALD, CLD, NAFLD this gives the paper's 247 rules, "
        "but other readings reach 247 too.",
        f"Cell N-C x NAFLD of Table I, which names NAFLD twice, {ODD_CELL[settings.odd_cell]}.",
        f"The repeated triple HBV, CLD, NAFLD {DUPLICATES[settings.duplicates]}.",
        f"Consequents are not in the paper: {CONSEQUENT[settings.consequent]} "
        "(mild < moderate < severe), a modelling choice without clinical evidence.",
        "CLD is read as cholestatic liver disease, because chronic liver disease would contain the "
        "other four.",
    )


def _data() -> tuple[str, ...]:
    normal = parameters()["normal_liver"]
    return (
        "Stiffness is the small-strain Young's modulus on the transient-elastography scale, not "
        "the shear modulus of MRE.",
        "The set counts of HCV and HBV come from counting rules: at equal stage the data do not "
        "tell the two diseases apart (sporea2010).",
        f"Centres of {_names(lambda r: r.centre_kind == 'cut-off')} are published cut-offs between "
        "stages, used as centres for want of means.",
        f"Widths of {_names(_input_without_sd)} are derived: the ratio SD/mean of stage F2 (mild) "
        "or F4 (severe) in HBV and HCV times the centre, since no SD is published.",
        f"Centres of {_names(lambda r: r.source == 'papatheodoridi')} are weak: limits that "
        "exclude or diagnose stage F3 or worse, the upper one from all causes together.",
        "Output sets are the pooled stages F1 and F2 (mild), F3 (moderate) and F4 (severe) of HBV "
        "and HCV (sporea2010), for every aetiology.",
        f"No set describes a healthy liver: {normal:g} kPa counts as mild, whose output centre is "
        f"{_centre(OUTPUT, 'mild'):.1f} kPa, and wide severe sets still fire there, so the "
        "estimate for a healthy liver is far too stiff.",
        f"An aetiology without a reading is given the normal liver's {normal:g} kPa (fung2013).",
    )


def _inference(settings: Settings) -> tuple[str, ...]:
    p = parameters()
    return (
        "The lowest set of each input stays at 1 below its centre and the highest at 1 above; the "
        "output sets are plain Gaussians.",
        f"Inputs live on {p['input_low']:g}-{p['input_high']:g} kPa, the instrument's scale from a "
        f"weak source, and readings beyond are clamped; the output on {p['output_low']:g}-"
        f"{p['output_high']:g} kPa.",
        f"Mamdani: AND and implication min, aggregation max, centroid by sums over "
        f"{settings.samples} points.",
        "Sugeno: constants are the centroids of the whole output sets on the same points; the "
        f"weighted average {AGGREGATION[settings.sugeno_aggregation]}.",
        "Interval type-2: every centre, input and output, is uncertain by "
        f"+-{100 * settings.footprint:g} % (two operators differ by about 8 % either way, "
        "liv12551); exact Karnik-Mendel reduction; the estimate is the interval's middle.",
        "The type-1 width is the spread between patients of one stage; the footprint is the spread "
        "between operators; neither stands for the other.",
    )


def _input_without_sd(record: SetRecord) -> bool:
    return record.variable != OUTPUT and record.sd_kind == "derived"


def _names(chosen: Callable[[SetRecord], bool]) -> str:
    return _listed(f"{r.variable.upper()} {r.name}" for r in elastography() if chosen(r))


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _centre(variable: str, name: str) -> float:
    return next(r.centre for r in elastography() if (r.variable, r.name) == (variable, name))
