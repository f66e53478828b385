"""The liver's fuzzy system: five aetiologies in, one stiffness out, everything in kPa."""

from functools import cache

from fuzzy.knowledge import SetRecord, elastography, parameters, rows
from fuzzy.rules import AETIOLOGIES, Consequent, Duplicates, OddCell, rule_base
from fuzzy.sets import FuzzySet, Kind
from fuzzy.system import System, Variable

OUTPUT = "stiffness"


@cache
def liver_system(
    *, footprint: float, odd_cell: OddCell, duplicates: Duplicates, consequent: Consequent
) -> System:
    """Table I over the elastography sets; centres are uncertain by +- footprint x centre."""
    inputs = tuple(_input(name, footprint) for name in AETIOLOGIES)
    output = _output(footprint)
    rules = rule_base(
        rows("table1.csv"),
        inputs,
        output,
        odd_cell=odd_cell,
        duplicates=duplicates,
        consequent=consequent,
    )
    return System(inputs, output, rules)


def _input(name: str, footprint: float) -> Variable:
    """An aetiology whose outer sets stay at 1 beyond their centres.

    A reading beyond the last centre is then fully in that set, and the system cannot forget its
    answer near the ends of the scale as it would with plain Gaussians.
    """
    records = _records(name)
    last = len(records) - 1
    kinds: dict[int, Kind] = {0: "left-shoulder", last: "right-shoulder"}
    sets = tuple(_set(r, kinds.get(i, "gaussian"), footprint) for i, r in enumerate(records))
    return Variable(name, parameters()["input_low"], parameters()["input_high"], sets)


def _output(footprint: float) -> Variable:
    sets = tuple(_set(record, "gaussian", footprint) for record in _records(OUTPUT))
    return Variable(OUTPUT, parameters()["output_low"], parameters()["output_high"], sets)


def _records(variable: str) -> list[SetRecord]:
    return [record for record in elastography() if record.variable == variable]


def _set(record: SetRecord, kind: Kind, footprint: float) -> FuzzySet:
    spread = footprint * record.centre
    return FuzzySet(record.name, kind, (record.centre, record.sd), spread)
