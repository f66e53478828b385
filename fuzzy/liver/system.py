"""The liver's fuzzy system: five aetiologies in, one stiffness out, everything in kPa."""

from dataclasses import replace
from functools import lru_cache
from math import hypot

from fuzzy.liver.knowledge import (
    OUTPUT,
    SEVERITIES,
    SetRecord,
    input_records,
    output_records,
    parameters,
)
from fuzzy.liver.partition import following_records, following_system, placement
from fuzzy.liver.readings import disease_sets, reading_named
from fuzzy.liver.rules import rule_base
from fuzzy.liver.settings import FOOTPRINTS, NO_READING, LiverSettings
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.sets import Footprint, FuzzySet
from fuzzy.systems.system import FuzzySystem, Variable


def liver_system(settings: LiverSettings, present: tuple[str, ...] = AETIOLOGIES) -> FuzzySystem:
    """The fuzzy system of Table I over the elastography sets, in kPa.

    Only antecedents whose diseases are all `present` make rules; the inputs stay all five.
    ValueError for an unknown disease, or if no antecedent is left.
    """
    _require_known(present)
    return _built(replace(settings, options=InferenceOptions()), present)


@lru_cache(maxsize=128)
def _built(settings: LiverSettings, present: tuple[str, ...]) -> FuzzySystem:
    """Cached systems, since tens of thousands of rules take time to build."""
    if settings.base.follows:
        return following_system(placement(settings.knowledge), settings, present)
    records = _input_records(settings)
    severities = {
        name: [SEVERITIES.index(record.severity) for record in found]
        for name, found in records.items()
    }
    return FuzzySystem(
        inputs=tuple(_input(name, found, settings) for name, found in records.items()),
        output=_output(settings),
        rules=rule_base(_antecedents(settings, present), severities, settings.consequent),
        name=f"liver-{settings.reading}",
    )


def records_in_use(settings: LiverSettings) -> tuple[SetRecord, ...]:
    """Record behind every set of the system: inputs in the order of AETIOLOGIES, then output.

    A base that follows the reading has many output sets, all alike, and none is listed.
    """
    if settings.base.follows:
        return following_records(placement(settings.knowledge))
    inputs = _input_records(settings).values()
    return (*(record for found in inputs for record in found), *output_records())


def _input_records(settings: LiverSettings) -> dict[str, tuple[SetRecord, ...]]:
    counts = reading_named(settings.reading).counts
    return {
        name: input_records(name, count, settings.placement)
        for name, count in zip(AETIOLOGIES, counts, strict=True)
    }


def _require_known(present: tuple[str, ...]) -> None:
    unknown = [name for name in present if name not in AETIOLOGIES]
    if unknown:
        raise ValueError(f"aetiology {unknown[0]!r}: use one of {', '.join(AETIOLOGIES)}")


def _antecedents(settings: LiverSettings, present: tuple[str, ...]) -> list[tuple[str, ...]]:
    if not present:
        raise ValueError(NO_READING)
    cells = disease_sets(reading_named(settings.reading))
    found = [cell for cell in cells if {*cell} <= {*present}]
    if not found:
        raise ValueError(
            f"reading {settings.reading} has no rule on {' and '.join(present)} "
            "alone: give readings for more aetiologies, choose another reading, or set absent to "
            "normal"
        )
    return found


def _input(name: str, records: tuple[SetRecord, ...], settings: LiverSettings) -> Variable:
    """An input whose outer sets have membership 1 beyond their centres.

    A reading beyond the last centre is then fully in that set. With plain Gaussians no rule would
    fire near the ends of the scale.
    """
    first, *inner, last = records
    # The flat sides end so far out that no footprint moves their ends into the universe.
    far = parameters()["plausible_high"]
    sets = (
        FuzzySet(
            first.stage,
            "gauss2mf",
            (first.within_stage_sd, -far, first.within_stage_sd, first.centre),
            footprint(first, settings),
        ),
        *(_gaussian(record, record.stage, settings) for record in inner),
        FuzzySet(
            last.stage,
            "gauss2mf",
            (last.within_stage_sd, last.centre, last.within_stage_sd, far),
            footprint(last, settings),
        ),
    )
    return Variable(name, parameters()["input_low"], parameters()["input_high"], sets)


def _output(settings: LiverSettings) -> Variable:
    sets = tuple(_gaussian(record, record.severity, settings) for record in output_records())
    return Variable(OUTPUT, parameters()["output_low"], parameters()["output_high"], sets)


def _gaussian(record: SetRecord, name: str, settings: LiverSettings) -> FuzzySet:
    shape = (record.within_stage_sd, record.centre)
    return FuzzySet(name, "gaussmf", shape, footprint(record, settings))


def footprint(record: SetRecord, settings: LiverSettings) -> Footprint:
    """Footprint of the set that a record describes, as the settings choose.

    That the width of the flanks, or the height, is as uncertain as the centre is a choice of this
    study: the sources give the spread of centres only.
    """
    relative = relative_half_width(record, settings)
    return FOOTPRINTS[settings.footprint].footprint(relative, record.centre)


def relative_half_width(record: SetRecord, settings: LiverSettings) -> float:
    """Half-width of a footprint over the centre: between studies and operators, independent."""
    return settings.footprint_factor * hypot(record.between_study, record.between_operator)
