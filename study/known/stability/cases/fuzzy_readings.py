"""Fuzzy systems with readings and sets at the extremes.

Answers are held to systems that need no policy (a wider universe, an end of it), to closed forms of
the centroid, to type-1 where the footprint is none, and to a search over all switch points where it
is wide.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import estimate
from fuzzy.liver.system import liver_system
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.inference import infer
from fuzzy.systems.interval_type2 import bounds_of_firing
from fuzzy.systems.kinds import SYSTEMS
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.quadrature import sampled
from fuzzy.systems.sets import (
    Footprint,
    FuzzySet,
    lower_membership,
    membership,
    upper_membership,
)
from fuzzy.systems.system import FuzzySystem, Rule, Term, Variable, memberships, union
from study.known.case import Case, Family
from study.known.finding import Finding, beside, value

Floats = NDArray[np.float64]

LOW = FuzzySet("low", "trimf", (0.0, 5.0, 10.0))
HIGH = FuzzySet("high", "trimf", (10.0, 15.0, 30.0))
TOP, MIDDLE = 30.0, 15.0
AREAS, CENTRES = np.array([5.0, 10.0]), np.array([5.0, 55.0 / 3.0])
"""Areas and centres of the two output sets."""
ROUNDING, INTEGRATED = 1e-12, 1e-8
KPA = 1e3
READINGS = {"hcv": 9.5e3, "hbv": 6e3, "ald": 20e3, "cld": 8e3, "nafld": 7e3}
FAMILY = Family("fuzzy", __name__, quick=True)


def cases() -> Iterator[Case]:
    """Cases of readings by policy, footprints, firing, widths, silence and units."""
    for kind in SYSTEMS:
        yield from _policies(kind)
        yield from _widths(kind)
        for reading in (0.5, 1.999, 75.001, 150.0):
            title = f"{reading:g} kPa, off the scale: {kind}"
            yield FAMILY.case(title, "off_scale", {"kind": kind, "reading": reading}, ROUNDING)
        yield FAMILY.case(
            f"one aetiology, the rest silent: {kind}", "alone", {"kind": kind}, ROUNDING
        )
    for footprint in ("uncertain-mean", "uncertain-spread", "scaled"):
        settings = {"footprint": footprint}
        yield FAMILY.case(f"footprint of 0, {footprint}", "without_footprint", settings, ROUNDING)
        yield FAMILY.case(
            f"footprint at its largest, {footprint}", "with_largest", settings, ROUNDING
        )
    for name, parts in (
        ("a mean anywhere", {"mean": 100.0}),
        ("a spread of almost all", {"spread": 0.999999}),
        ("a lower set of almost nothing", {"scale": 1e-9}),
        ("a lag of almost 1", {"lag": 0.999}),
    ):
        yield FAMILY.case(f"footprint with {name}", "wide", {"footprint": parts}, ROUNDING)
    yield from _odd_widths()
    yield from _refusals()


def _policies(kind: str) -> Iterator[Case]:
    for reading in (10.0, 14.0, 1e300, -2.0, -1e300):
        settings = {"kind": kind, "reading": reading}
        yield FAMILY.case(
            f"reading {reading:g} of 0-10, clamp: {kind}", "clamped", settings, ROUNDING
        )
    for reading in (14.0, -2.0):
        settings = {"kind": kind, "reading": reading}
        yield FAMILY.case(
            f"reading {reading:g} of 0-10, matlab: {kind}", "as_it_is", settings, ROUNDING
        )
    for given, policy, says in (
        (14.0, "raise", "outside 0-10"),
        (-2.0, "raise", "outside 0-10"),
        (None, "clamp", "finite reading"),
        (None, "matlab", "finite reading"),
    ):
        title = f"reading {'not a number' if given is None else f'{given:g}'}, {policy}: {kind}"
        yield FAMILY.case(title, "asked", {"kind": kind, "reading": given, "policy": policy}, says)
    yield FAMILY.case(
        f"no rule fires, matlab: {kind}", "silent", {"kind": kind, "policy": "matlab"}, ROUNDING
    )
    settings = {"kind": kind, "policy": "clamp"}
    yield FAMILY.case(f"no rule fires, clamp: {kind}", "silent", settings, "no rule fires")


def _widths(kind: str) -> Iterator[Case]:
    yield FAMILY.case(f"all rules fire: {kind}", "all_fire", {"kind": kind}, INTEGRATED)
    for sd in (1e-3, 1e-6, 1e-12):
        settings = {"kind": kind, "sd": sd, "off": 0.0}
        yield FAMILY.case(
            f"at the middle of a set of sd {sd:g}: {kind}", "narrow", settings, INTEGRATED
        )
        settings = {"kind": kind, "sd": sd, "off": 0.5}
        yield FAMILY.case(f"beside a set of sd {sd:g}: {kind}", "narrow", settings, "no rule fires")
    for sd in (1e-2, 1e-6):
        settings = {"kind": kind, "sd": sd, "sampling": "exact"}
        title = f"output set of sd {sd:g}, exact: {kind}"
        yield FAMILY.case(title, "narrow_output", settings, INTEGRATED)
    settings = {"kind": kind, "sd": 1e-6, "sampling": "matlab"}
    title = f"output set of sd 1e-06 between samples: {kind}"
    yield FAMILY.case(title, "narrow_output", settings, "no mass on the 101 samples")


def _odd_widths() -> Iterator[Case]:
    """Sets without width are spikes, and the sign of a width does not count, as in Octave."""
    for title, sd, off in (
        ("at the centre of a set without width", 0.0, 0.0),
        ("beside the centre of a set without width", 0.0, 1e-9),
        ("beside the centre of a set of negative width", -1.0, 0.5),
    ):
        yield FAMILY.case(title, "member", {"sd": sd, "off": off}, ROUNDING)


def _refusals() -> Iterator[Case]:
    for reading in (0.0, -1.0, 0.4, 151.0, 9500.0, None):
        message = "finite positive" if reading is None or reading <= 0 else "beyond any liver"
        title = f"estimate from {'nothing finite' if reading is None else f'{reading:g} kPa'}"
        yield FAMILY.case(title, "estimated", {"reading": reading}, message)
    yield FAMILY.case(
        "estimate from an unknown aetiology", "estimated", {"reading": 9.5, "name": "flu"}, "flu"
    )
    for title, function, settings, says in (
        ("a footprint of all its width", "wide", {"footprint": {"spread": 1.0}}, "spread"),
        ("a footprint below 0", "wide", {"footprint": {"mean": -1.0}}, "mean"),
        ("a footprint factor of 4", "factor", {"factor": 4.0}, "footprint_factor"),
        ("ten samples", "few", {"samples": 10}, "samples = 10"),
    ):
        yield FAMILY.case(title, function, settings, says)


def clamped(kind: str, reading: float) -> Finding:
    """The answer is that at the nearest end, and it is noted unless nothing was done."""
    end = min(max(reading, 0.0), 10.0)
    found = _infer(_ramp(), reading, kind)
    if bool(found.notes) != (end != reading):
        return Finding("error", message=f"notes {found.notes}")
    return value(float(_infer(_ramp(), end, kind).value[0]), float(found.value[0]))


def as_it_is(kind: str, reading: float) -> Finding:
    """The answer is that of a system whose universe holds the reading, and it is noted."""
    found = _infer(_ramp(), reading, kind, out_of_range="matlab")
    if not found.notes:
        return Finding("error", message="nothing noted")
    wide = replace(_ramp(), inputs=(replace(_ramp().inputs[0], low=-20.0, high=20.0),))
    return value(float(_infer(wide, reading, kind).value[0]), float(found.value[0]))


def asked(kind: str, reading: float | None, policy: str) -> Finding:
    """An answer to a reading that a policy is to refuse."""
    given = float("nan") if reading is None else reading
    return value(0.0, float(_infer(_ramp(), given, kind, out_of_range=policy).value[0]))


def silent(kind: str, policy: str) -> Finding:
    """Where nothing fires MATLAB has the middle of the universe, which is said to be no more."""
    found = _infer(_ramp(sd=1e-3), 5.0, kind, out_of_range=policy)
    if not any("no more than the middle" in note for note in found.notes):
        return Finding("error", message="the middle, in silence")
    return value(MIDDLE, float(found.value[0]))


def all_fire(kind: str) -> Finding:
    """Both sets at full height: the centroid of both together, of Sugeno the mean of two."""
    found = _infer(_ramp(sd=1e12), 3.0, kind, sampling="exact")
    whole = CENTRES.mean() if kind == "sugeno" else AREAS @ CENTRES / AREAS.sum()
    return value(float(whole), float(found.value[0]))


def narrow(kind: str, sd: float, off: float) -> Finding:
    """The only set that fires is the first: its centroid."""
    return value(float(CENTRES[0]), float(_infer(_ramp(sd), off, kind, sampling="exact").value[0]))


def narrow_output(kind: str, sd: float, sampling: str) -> Finding:
    """A narrow output set has its centroid in its middle."""
    output = Variable("y", 0.0, TOP, (FuzzySet("at", "gaussmf", (sd, 5.0)),))
    system = replace(_ramp(), output=output, rules=(Rule((Term(0, 0),), 0),))
    return value(5.0, float(_infer(system, 0.0, kind, sampling=sampling).value[0]))


def off_scale(kind: str, reading: float) -> Finding:
    """An estimate from a reading [kPa] beyond the instrument's scale is that at its end."""
    end = min(max(reading, 2.0), 75.0)
    found, at_end = (estimate({"hcv": KPA * x}, kind) for x in (reading, end))
    if not any("clamped" in note for note in found.notes):
        return Finding("error", message="nothing noted")
    return value(at_end.estimate, found.estimate, "Pa")


def alone(kind: str) -> Finding:
    """With the others silent, a reading goes by the rules on its own disease."""
    settings = LiverSettings(knowledge="severity", absent="silent")
    liver = liver_system(settings)
    one = AETIOLOGIES.index("hcv")
    rules = tuple(
        replace(rule, antecedents=tuple(term._replace(input=0) for term in rule.antecedents))
        for rule in liver.rules
        if all(term.input == one for term in rule.antecedents)
    )
    system = replace(liver, inputs=(liver.inputs[one],), rules=rules)
    found = estimate({"hcv": READINGS["hcv"]}, kind, settings).estimate
    expected = infer(system, np.array([[READINGS["hcv"] / KPA]]), kind).value[0]
    return value(float(expected) * KPA, found, "Pa")


def without_footprint(footprint: str) -> Finding:
    """Interval type-2 without a footprint is Mamdani's, and its interval a point."""
    settings = LiverSettings(knowledge="severity", footprint=footprint, footprint_factor=0.0)
    found = estimate(READINGS, "interval-type-2", settings)
    one = estimate(READINGS, "mamdani", settings).estimate
    return beside(np.full(3, one), np.array([found.estimate, *(found.interval or ())]))


def with_largest(footprint: str) -> Finding:
    """The liver's interval at the largest footprint, by a search."""
    settings = LiverSettings(knowledge="severity", footprint=footprint, footprint_factor=3.0)
    row = np.array([[READINGS[name] / KPA for name in AETIOLOGIES]])
    return _searched(liver_system(settings), row)


def wide(footprint: dict[str, float]) -> Finding:
    """The interval of two sets with a footprint on each side of the rules, by a search."""
    uncertain = Footprint(**footprint)
    low, high = (replace(one, footprint=uncertain) for one in (LOW, HIGH))
    system = replace(_ramp(), output=Variable("y", 0.0, TOP, (low, high)))
    return _searched(system, np.array([[4.0]]))


def estimated(reading: float | None, name: str = "hcv") -> Finding:
    """An estimate from one reading [kPa]."""
    given = float("nan") if reading is None else KPA * reading
    return value(0.0, estimate({name: given}, "mamdani").estimate)


def member(sd: float, off: float) -> Finding:
    """Membership so far off the centre of a Gaussian set of a width."""
    found = membership(FuzzySet("a", "gaussmf", (sd, 0.0)), np.array([off]))
    spike = float(off == 0.0)
    return value(float(np.exp(-0.5 * (off / sd) ** 2)) if sd else spike, float(found[0]))


def factor(factor: float) -> Finding:
    """Settings with a footprint of so many times the published one."""
    return value(0.0, LiverSettings(knowledge="severity", footprint_factor=factor).footprint_factor)


def few(samples: int) -> Finding:
    """Options with so many samples."""
    return value(0.0, float(InferenceOptions(samples=samples).samples))


def _searched(system: FuzzySystem, row: Floats) -> Finding:
    """Ends of the interval beside the least and largest centroid over all switch points."""
    lower_fired, upper_fired = bounds_of_firing(system, row)
    y = sampled(system.output, 101, "matlab").y
    low = union(lower_fired, memberships(system.output, y, lower_membership), system.operators)[0]
    high = union(upper_fired, memberships(system.output, y, upper_membership), system.operators)[0]
    found = infer(system, row, "interval-type-2").interval
    if found is None:
        return Finding("error", message="no interval")
    ends = []
    for before, after in ((high, low), (low, high)):
        curves = [np.concatenate([before[:k], after[k:]]) for k in range(len(y) + 1)]
        ends.append([curve @ y / curve.sum() for curve in curves if curve.sum() > 0.0])
    return beside(np.array([min(ends[0]), max(ends[1])]), found[0])


def _infer(system: FuzzySystem, reading: float, kind: str, **options: Any) -> Any:
    return infer(system, np.array([[reading]]), kind, InferenceOptions(**options))


def _ramp(sd: float = 4.0) -> FuzzySystem:
    """Low at 0 and high at 10, with sets that go on beyond."""
    x = Variable(
        "x", 0.0, 10.0, (FuzzySet("a", "gaussmf", (sd, 0.0)), FuzzySet("b", "gaussmf", (sd, 10.0)))
    )
    rules = tuple(Rule((Term(0, k),), k) for k in (0, 1))
    return FuzzySystem((x,), Variable("y", 0.0, TOP, (LOW, HIGH)), rules)
