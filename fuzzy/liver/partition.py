"""Sets that partition the scale of stiffness, and systems of them that follow the reading.

Neighbouring sets cross at one half, and the centres are evenly spaced on a logarithmic scale, on
which the spread of readings does not depend on the stiffness. A set is a Gaussian with a width for
each flank; the outermost ones stay at 1. The consequent of a rule is the expected stiffness of a
liver with readings at the centres of its sets: exp(shift + power * mean of ln consequent), over the
sets of its antecedent. Shift and power, by number of diseases, compensate the bias of the centroid
of several clipped sets. With many readings a set has a core of membership 1 about its centre. With
AND by min, each of the hundreds of rules of neighbouring sets fires with the least of its degrees;
without a core they outweigh the rule whose centres match the readings. All in kPa.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, lru_cache, partial
from itertools import combinations, groupby, product
from math import exp, hypot, inf, log, sqrt
from typing import NamedTuple

from fuzzy.liver.bases import KNOWLEDGE
from fuzzy.liver.knowledge import (
    OUTPUT,
    SetRecord,
    Severity,
    output_records,
    parameters,
    rows,
)
from fuzzy.liver.readings import READINGS, disease_sets
from fuzzy.liver.settings import FOOTPRINTS, NO_READING, LiverSettings
from fuzzy.liver.table1 import AETIOLOGIES, Cell
from fuzzy.systems.sets import Footprint, FuzzySet
from fuzzy.systems.system import FuzzySystem, Rule, Term, Variable

HALF_WIDTH = sqrt(2.0 * log(2.0))
"""Distance, in standard deviations, at which a Gaussian is one half."""


class PlacedSet(NamedTuple):
    """One set of an input [kPa]: centre, crossing with the next set, and its own consequent."""

    name: str
    centre: float
    crossing: float
    consequent: float


class Combination(NamedTuple):
    """Combination of the consequents of the sets of several diseases into that of their rule.

    `core`: fraction of the distance to the next crossing over which a set has membership 1, for a
    patient with so many readings.
    """

    shift: float
    power: float
    core: float = 0.0

    def consequent(self, members: Sequence[float]) -> float:
        """Consequent [kPa], within the range that the output's universe represents without bias."""
        p = parameters()
        return self.within(tuple(map(log, members)), p["concluded_low"], p["concluded_high"])

    def within(self, logarithms: Sequence[float], low: float, high: float) -> float:
        """Consequent [kPa] from logarithms of the members' consequents, within a range [kPa]."""
        expected = exp(self.shift + self.power * sum(logarithms) / len(logarithms))
        return min(max(expected, low), high)


class Placement(NamedTuple):
    """A whole knowledge base: sets by aetiology, combinations by number of diseases."""

    sets: Mapping[str, tuple[PlacedSet, ...]]
    combinations: Mapping[int, Combination]


@cache
def placement(knowledge: str) -> Placement:
    """The knowledge base of a given name, as written by `fuzzy.liver.derivation`."""
    placed = [row for row in rows("partition.csv") if row["knowledge"] == knowledge]
    return Placement(
        {
            name: tuple(
                PlacedSet(
                    row["set"],
                    float(row["centre_kpa"]),
                    float(row["crossing_kpa"] or "inf"),
                    float(row["consequent_kpa"]),
                )
                for row in found
            )
            for name, found in groupby(placed, lambda row: row["aetiology"])
        },
        {
            int(row["diseases"]): Combination(
                float(row["shift"]), float(row["power"]), float(row["core"])
            )
            for row in rows("combination.csv")
            if row["knowledge"] == knowledge
        },
    )


def reading_noise() -> float:
    """Relative standard deviation of one reading: that of the exam and that between operators."""
    return hypot(parameters()["exam_noise"], parameters()["operator_noise"])


def footprint_half_width(settings: LiverSettings, readings: int) -> float:
    """Relative half-width of the footprint of every input set, by number of readings.

    Errors of several readings of one liver are independent, so the uncertainty decreases.
    """
    return settings.footprint_factor * parameters()["band"] * reading_noise() / sqrt(readings)


def following_system(
    placed: Placement, settings: LiverSettings, present: tuple[str, ...] = AETIOLOGIES
) -> FuzzySystem:
    """The system of a placement, in kPa, for a patient with readings of the aetiologies `present`.

    Rules on the most diseases outweigh those on fewer, which are for patients with fewer
    readings. ValueError if no cell of Table I has only diseases that are present.
    """
    reading = settings.base.reading
    own = placed is placement(settings.knowledge)
    completed = settings.base.completed
    made = (
        _kept(settings.knowledge, present)
        if own
        else _concluded(placed, antecedents(present, reading, completed=completed))
    )
    rules, levels = made
    p, core = parameters(), placed.combinations[_most(rules)].core
    return FuzzySystem(
        inputs=tuple(
            _input(name, placed.sets[name], core, partial(_footprint, settings, len(present)))
            for name in AETIOLOGIES
        ),
        output=Variable(OUTPUT, p["output_low"], p["output_high"], tuple(map(_output_set, levels))),
        rules=rules,
        name=f"liver-{settings.knowledge}",
    )


@lru_cache(maxsize=64)
def _kept(knowledge: str, present: tuple[str, ...]) -> tuple[tuple[Rule, ...], tuple[int, ...]]:
    """Cached rules of a knowledge base, tens of thousands for all five aetiologies."""
    base = KNOWLEDGE[knowledge]
    cells = antecedents(present, base.reading, completed=base.completed)
    return _concluded(placement(knowledge), cells)


def _most(rules: Sequence[Rule]) -> int:
    """Diseases of the rules with the largest weight."""
    return max(len(rule.antecedents) for rule in rules)


def _concluded(
    placed: Placement, cells: Sequence[Cell]
) -> tuple[tuple[Rule, ...], tuple[int, ...]]:
    """Rules of a placement on some cells, and the levels of their output sets."""
    concluded = list(_rules(placed, cells, max(map(len, cells))))
    levels = sorted({level for _, level, _ in concluded})
    index = {level: k for k, level in enumerate(levels)}
    return tuple(Rule(terms, index[level], weight=w) for terms, level, w in concluded), tuple(
        levels
    )


def antecedents(present: Sequence[str], reading: str, *, completed: bool = False) -> list[Cell]:
    """Cells of Table I all of whose diseases are present, or `completed` every combination of them.

    ValueError if there is none.
    """
    if not present:
        raise ValueError(NO_READING)
    found = [cell for cell in disease_sets(READINGS[reading]) if {*cell} <= {*present}]
    if completed:
        every = (c for size in range(1, len(present) + 1) for c in combinations(present, size))
        found = list(dict.fromkeys([*found, *every]))
    if not found:
        raise ValueError(
            f"no rule on {' and '.join(present)} alone: give a reading of another, or set absent "
            "to normal"
        )
    return found


def _rules(
    placed: Placement, cells: Sequence[Cell], most: int
) -> Iterator[tuple[tuple[Term, ...], int, float]]:
    """Antecedent, level of the output set and weight of every rule."""
    p = parameters()
    members = {name: _members(name, placed.sets[name]) for name in placed.sets}
    for cell in cells:
        combination = placed.combinations[len(cell)]
        weight = p["outweighed"] ** (most - len(cell))
        for chosen in product(*(members[name] for name in cell)):
            terms, logarithms = zip(*chosen, strict=True)
            expected = combination.within(logarithms, p["concluded_low"], p["concluded_high"])
            yield terms, level_of(expected), weight


def _members(name: str, sets: Sequence[PlacedSet]) -> tuple[tuple[Term, float], ...]:
    """Each set of an aetiology as a term, and the logarithm of its own consequent."""
    i = AETIOLOGIES.index(name)
    return tuple((Term(i, k), log(one.consequent)) for k, one in enumerate(sets))


def level_of(stiffness: float) -> int:
    """Number of the output set nearest to a stiffness [kPa]; the sets have a fixed ratio."""
    return round(log(stiffness) / log(parameters()["output_ratio"]))


def _output_set(level: int) -> FuzzySet:
    """A narrow Gaussian of the same width for all levels, so that their areas are equal."""
    centre = parameters()["output_ratio"] ** level
    return FuzzySet(f"about-{centre:.3g}", "gaussmf", (parameters()["output_sd"], centre))


def _footprint(settings: LiverSettings, readings: int, centre: float) -> Footprint:
    half_width = footprint_half_width(settings, readings)
    return FOOTPRINTS[settings.footprint].footprint(half_width, centre)


def _input(
    name: str, placed: Sequence[PlacedSet], core: float, footprint: Callable[[float], Footprint]
) -> Variable:
    p = parameters()
    crossings = [one.crossing for one in placed[:-1]]
    sets = tuple(
        _set(one, below, above, core, footprint(one.centre))
        for one, below, above in zip(placed, [None, *crossings], [*crossings, None], strict=True)
    )
    return Variable(name, p["input_low"], p["input_high"], sets)


def _set(
    one: PlacedSet,
    below: float | None,
    above: float | None,
    core: float,
    footprint: Footprint,
) -> FuzzySet:
    # The flat sides end so far out that no footprint moves their ends into the universe.
    far = parameters()["plausible_high"]
    left, right = ((1.0 - core) * width for width in flanks(one, below, above))
    first = -far if below is None else one.centre - core * (one.centre - below)
    last = far if above is None else one.centre + core * (above - one.centre)
    return FuzzySet(one.name, "gauss2mf", (left, first, right, last), footprint)


def flanks(one: PlacedSet, below: float | None, above: float | None) -> tuple[float, float]:
    """Standard deviations [kPa] of both flanks; a flat side repeats that of the other."""
    widths = [
        None if crossing is None else abs(crossing - one.centre) / HALF_WIDTH
        for crossing in (below, above)
    ]
    left, right = widths
    return (left or right or 1.0), (right or left or 1.0)


def following_records(placed: Placement) -> tuple[SetRecord, ...]:
    """Record of every input set, in the order of AETIOLOGIES: all placed by this study."""
    return tuple(
        _record(name, one, below)
        for name in AETIOLOGIES
        for one, below in zip(
            placed.sets[name], [None, *(s.crossing for s in placed.sets[name])], strict=False
        )
    )


def _record(aetiology: str, one: PlacedSet, below: float | None) -> SetRecord:
    noise = parameters()
    return SetRecord(
        aetiology=aetiology,
        stage=one.name,
        severity=_severity(one.consequent),
        placement="partition",
        centre=one.centre,
        centre_source="this-study",
        within_stage_sd=max(flanks(one, below, one.crossing if one.crossing < inf else None)),
        sd_kind="flank",
        sd_source="this-study",
        between_study=noise["exam_noise"],
        between_study_kind="exam",
        between_study_source="nhanes2017",
        between_operator=noise["operator_noise"],
        between_operator_kind="transferred",
        between_operator_source="fraquelli2007",
        n=None,
        sourced="no",
        note="",
    )


def _severity(stiffness: float) -> Severity:
    """The severity whose output set has its centre nearest to a stiffness [kPa]."""
    return min(output_records(), key=lambda one: abs(log(one.centre / stiffness))).severity
