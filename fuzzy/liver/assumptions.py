"""Assumptions adopted where the paper is silent, one sentence each, for reports."""

from collections.abc import Iterable
from math import prod

from fuzzy.liver.knowledge import (
    OUTPUT,
    PLACEMENTS,
    SetRecord,
    elastography,
    output_records,
    parameters,
)
from fuzzy.liver.partition import footprint_half_width, placement, reading_noise
from fuzzy.liver.readings import READINGS, TableReading, disease_sets, reading_named, rule_count
from fuzzy.liver.rules import CONSEQUENTS
from fuzzy.liver.settings import FOOTPRINTS, LiverSettings
from fuzzy.liver.system import liver_system, records_in_use, relative_half_width
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.redundancy import dominated

PAPER_RULES = 247
REPEATED_TRIPLE = ("hbv", "cld", "nafld")

SIZES = {1: "one", 2: "two", 3: "three", 4: "four"}
DIAGONAL = {
    "single": "A disease with itself in Table I is one term: the disease alone.",
    "square": "A disease with itself in Table I is two terms on the same reading, and so every "
    "pair of its sets makes a rule.",
}
ODD_CELL = {
    "missing-triple": "is read as the triple ALD, CLD, NAFLD that the table otherwise lacks",
    "literal": "is read literally, with two NAFLD terms beside one of HCV in an antecedent",
    "pair": "is read as the pair HCV, NAFLD, which then enters twice",
    "drop": "is left out",
}
CHOLESTATIC = (
    "CLD is read as cholestatic liver disease, because chronic liver disease would contain the "
    "other four."
)
SCALE = (
    "Stiffness is the small-strain Young's modulus on the transient-elastography scale, not the "
    "shear modulus of MRE."
)
OUT_OF_RANGE = {
    "clamp": "are taken at its nearer end, with a note",
    "raise": "are refused",
    "matlab": "are used as they are, with a note; where no rule fires the answer is the middle "
    "of the output's universe, as in MATLAB",
}


def assumptions(settings: LiverSettings | None = None) -> tuple[str, ...]:
    """Every assumption and modelling choice in effect, one sentence each."""
    settings = settings or LiverSettings()
    if settings.base.follows:
        return (*_following_rules(settings), *_following_data(settings), *_inference(settings))
    return (*_rules(settings), *_data(settings), *_footprints(settings), *_inference(settings))


def _rules(settings: LiverSettings) -> tuple[str, ...]:
    reading = reading_named(settings.reading)
    return (
        _count(settings.reading, reading),
        DIAGONAL[reading.diagonal],
        f"Cell N-C x NAFLD of Table I, which names NAFLD twice, {ODD_CELL[reading.odd_cell]}.",
        f"The triple HBV, CLD, NAFLD, which the table marks twice, {_duplicates(reading)}.",
        f"Consequents are not in the paper: {CONSEQUENTS[settings.consequent].words} "
        "(mild < moderate < severe), a modelling choice without clinical evidence.",
        _dominance(settings),
        CHOLESTATIC,
    )


def _count(name: str, reading: TableReading) -> str:
    number = rule_count(reading)
    others = [x for x in READINGS if x != name and rule_count(READINGS[x]) == PAPER_RULES]
    verdict = (
        f"gives the paper's {PAPER_RULES} rules, but so do {len(others)} other readings here: the "
        "count does not determine which one the authors used"
        if number == PAPER_RULES
        else f"gives {number} rules where the paper counts {PAPER_RULES}"
    )
    return (
        f"Rules: reading {name}, the {len(disease_sets(reading))} cells of Table I with "
        f"{_listed(SIZES[size] for size in reading.sizes)} diseases expand to the full grid of "
        f"their sets; with {', '.join(map(str, reading.counts))} sets for "
        f"{', '.join(map(str.upper, AETIOLOGIES))} this {verdict}."
    )


def _duplicates(reading: TableReading) -> str:
    counts = dict(zip(AETIOLOGIES, reading.counts, strict=True))
    rules = prod(counts[disease] for disease in REPEATED_TRIPLE)
    if reading.duplicates == "keep":
        return f"enters twice: its {rules} rules weigh double in Sugeno's sum over rules only"
    return "enters once"


def _dominance(settings: LiverSettings) -> str:
    system = liver_system(settings)
    number = len(system.rules)
    left = number - len(dominated(system))
    return (
        f"With these consequents only {left} of the {number} rules can change an answer of Mamdani "
        f"or interval type-2: each of the other {number - left} is never stronger than a rule with "
        "the same consequent and a part, or the whole, of its antecedent. Only Sugeno's sum over "
        "rules counts them."
    )


def _following_rules(settings: LiverSettings) -> tuple[str, ...]:
    placed = placement(settings.knowledge)
    counts = ", ".join(str(len(placed.sets[name])) for name in AETIOLOGIES)
    reading = reading_named(settings.base.reading)
    number = len(liver_system(settings).rules)
    return (
        f"Knowledge base {settings.knowledge}: {settings.base.words}.",
        f"Rules: the {len(disease_sets(reading))} cells of reading {settings.base.reading} of "
        f"Table I expand to the full grid of their sets, {counts} for "
        f"{', '.join(map(str.upper, AETIOLOGIES))}: {number} rules where the paper counts "
        f"{PAPER_RULES}.",
        "Consequents are not in the paper: each is the stiffness expected of readings at the "
        "centres of the rule's sets, near their geometric mean, as readings of several aetiologies "
        "are of one liver.",
        "Rules on more diseases outweigh those on fewer, which are meant for patients with fewer "
        f"readings: a rule on one disease less weighs {parameters()['outweighed']:g} of it.",
        CHOLESTATIC,
    )


def _following_data(settings: LiverSettings) -> tuple[str, ...]:
    p = parameters()
    return (
        SCALE,
        "That a reading is the modulus, without a bias, is an assumption: no reading paired with a "
        "mechanical test of the same liver was found.",
        "Neighbouring input sets cross at one half; each is a Gaussian with a width for either "
        "flank. They represent levels of stiffness, not stages of fibrosis.",
        f"Output sets are Gaussians of {p['output_sd']:g} kPa, the same at every level, each "
        f"{100 * (p['output_ratio'] - 1):.0f} % above the one before.",
        _missing(settings),
        _band(settings),
    )


def _band(settings: LiverSettings) -> str:
    if settings.footprint_factor == 0:
        return "The footprint is switched off, so interval type-2 equals Mamdani."
    one, noise = footprint_half_width(settings, 1), reading_noise()
    words = FOOTPRINTS[settings.footprint].words.replace(", input and output,", "")
    return (
        f"Interval type-2: {words} {100 * one:.0f} % for one reading and by less for several, over "
        f"the root of their number: {one / noise:.2g} times the noise of one "
        f"reading, {100 * noise:.0f} %, which combines that of the exam (nhanes2017) and "
        "that between operators (fraquelli2007, liv12551). Input sets alone have it."
    )


def _data(settings: LiverSettings) -> tuple[str, ...]:
    used = records_in_use(settings)
    inputs = [record for record in used if record.aetiology != OUTPUT]
    normal = parameters()["normal_liver"]
    return (
        SCALE,
        "Two sets of an aetiology represent stages F2 and F4, three F2, F3 and F4, four F1 "
        "to F4; F1 and F2 count as mild, F3 as moderate, F4 as severe.",
        "The set counts of HCV and HBV follow from the number of rules: at equal stage the data do "
        "not distinguish the two diseases (sporea2010).",
        *_centres(settings, inputs),
        *_graded(inputs),
        "Output sets are the pooled stages F1 and F2 (mild), F3 (moderate) and F4 (severe) of HBV "
        "and HCV (sporea2010), for every aetiology and placement.",
        f"No set describes a healthy liver: {normal:g} kPa counts as mild, whose output centre is "
        f"{output_records()[0].centre:.1f} kPa, and wide severe sets still fire there, so the "
        "estimate for a healthy liver is far too stiff.",
        _missing(settings),
    )


def _missing(settings: LiverSettings) -> str:
    normal = parameters()["normal_liver"]
    return f"An aetiology without a reading {settings.missing.words.format(normal=normal)}."


def _centres(settings: LiverSettings, inputs: list[SetRecord]) -> tuple[str, ...]:
    cut_offs = [record for record in inputs if record.placement == "cut-off"]
    centres = f"Centres of {_names(cut_offs)} are cut-offs between stages, used as centres"
    ratios = [record for record in inputs if record.sd_kind == "ratio"]
    return (
        f"{centres}{PLACEMENTS[settings.placement]}.",
        f"Widths of {_names(ratios)} are derived: the mean ratio SD/mean of the same stage in HBV "
        "and HCV (sporea2010) times the centre, since no SD is published.",
    )


def _graded(inputs: list[SetRecord]) -> Iterable[str]:
    weak = [record for record in inputs if record.sourced == "weak"]
    if weak:
        yield (
            f"Centres of {_names(weak)} are weak: limits that exclude or diagnose stage F3 or "
            "worse, the upper one from all causes together (papatheodoridi)."
        )
    none = [record for record in inputs if record.sourced == "no"]
    if none:
        yield (
            f"No source was found for the centre of {_names(none)}: it is put in the middle of its "
            "neighbours."
        )


def _footprints(settings: LiverSettings) -> tuple[str, ...]:
    if settings.footprint_factor == 0:
        return ("The footprint is switched off, so interval type-2 equals Mamdani.",)
    by_stage = {record.stage: record for record in elastography()}
    shares = ", ".join(
        f"{100 * relative_half_width(by_stage[stage], settings):.0f} % ({stages})"
        for stage, stages in (("F2", "F1, F2"), ("F3", "F3"), ("F4", "F4"))
    )
    times = "" if settings.footprint_factor == 1 else f"{settings.footprint_factor:g} times "
    return (
        f"Interval type-2: {FOOTPRINTS[settings.footprint].words} {shares}, {times}the published "
        "spread.",
        "The published spread combines, as independent, that between studies and that between "
        f"operators. Between studies it is the SD {_between_studies(by_stage)} of the centre at "
        "F2, F3, F4, from the ranges of HBV's cut-offs over 18 studies (chon2012) by the expected "
        "range of 18 normal values; fewer studies behind a range would make it larger. Between two "
        f"operators it is half their difference, {by_stage['F2'].between_operator:.2f} (liv12551).",
        "The spread between studies is published for HBV's cut-offs, that between operators for "
        "HCV; both are transferred to the other sets by stage. F4 cut-offs of other causes differ "
        "as much between sources: 12.5 and 22.6 kPa in ALD, 12.5 and 9.3 kPa in HCV.",
        "The type-1 width is the spread between patients of one stage; the footprint is the spread "
        "between studies and operators; neither replaces the other.",
    )


def _between_studies(by_stage: dict[str, SetRecord]) -> str:
    return ", ".join(f"{by_stage[stage].between_study:.2f}" for stage in ("F2", "F3", "F4"))


def _inference(settings: LiverSettings) -> tuple[str, ...]:
    system, p = liver_system(settings), parameters()
    return (
        "The lowest set of each input stays at 1 below its centre and the highest at 1 above, "
        "where the paper has plain Gaussians; the output sets are plain Gaussians.",
        f"Inputs range over {p['input_low']:g}-{p['input_high']:g} kPa, the instrument's scale "
        f"from a weak source; readings beyond {OUT_OF_RANGE[settings.options.out_of_range]}. The "
        f"output ranges over {p['output_low']:g}-{p['output_high']:g} kPa.",
        *(f"{kind.method(system, settings.options)}." for kind in SYSTEMS.values()),
    )


def _names(records: Iterable[SetRecord]) -> str:
    return _listed(f"{record.aetiology.upper()} {record.stage}" for record in records)


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
