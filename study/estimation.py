"""Fuzzy estimates at the command line: of one patient, or of a table by any rule base."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fuzzy.liver.knowledge import parameters
from fuzzy.liver.settings import LiverSettings
from fuzzy.liver.stiffness import (
    NORMAL_LIVER,
    PA_PER_KPA,
    UNIT,
    StiffnessEstimate,
    estimate,
    liver_row,
    patient_system,
)
from fuzzy.liver.system import liver_system
from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.inference import Inferred, infer
from fuzzy.systems.kinds import SYSTEMS, check_kind
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.system import FuzzySystem
from study.folders import check_file, check_folder, making, write_bytes

if TYPE_CHECKING:
    from fuzzy.systems.table import Blanks

PLAUSIBLE = (parameters()["plausible_low"], parameters()["plausible_high"])
"""Readings [kPa] beyond which a unit must be wrong."""
SHAPES = ("footprint", "footprint_factor")
"""Settings of the type-2 sets, which are drawn and written, too."""
ONLY_OF = dict.fromkeys((*SHAPES, "reducer"), "interval-type-2") | {"sugeno_aggregation": "sugeno"}
"""Settings that only one of the systems has."""


@dataclass(frozen=True, kw_only=True)
class EstimationRequest:
    """What the command line asked of `estimate`.

    `readings` [kPa] by aetiology; `systems` empty for all three; `settings` the given fields of
    LiverSettings and InferenceOptions by name; `row` of the table to explain, from 1.
    """

    readings: Mapping[str, float] = field(default_factory=dict)
    systems: Sequence[str] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    rule_base: Path | None = None
    inputs: Path | None = None
    out: Path | None = None
    explain: bool = False
    row: int | None = None
    figures: Path | None = None
    surface: tuple[str, str] | None = None
    as_json: bool = False


@dataclass(frozen=True)
class Answer:
    """Lines for the terminal, and notes on what was done to the readings."""

    lines: tuple[str, ...]
    notes: tuple[str, ...] = ()


def settings_of(given: Mapping[str, Any]) -> LiverSettings:
    """Settings with the given fields in place of the defaults. ValueError naming a wrong one."""
    names = {one.name for one in fields(InferenceOptions)}
    options = InferenceOptions(**{key: value for key, value in given.items() if key in names})
    liver = {key: value for key, value in given.items() if key not in names}
    return LiverSettings(**liver, options=options)


def answer(request: EstimationRequest) -> Answer:
    """Do what the request asks. ValueError for what does not fit together, with the remedy."""
    for name in request.systems:
        if name not in SYSTEMS:
            raise ValueError(f"--system {name}: use one of {', '.join(SYSTEMS)}")
        if request.systems.count(name) > 1:
            raise ValueError(f"--system {name}: named twice; leave one out")
    _refuse_idle(request)
    if request.figures is not None:
        check_folder(request.figures, "--figures")
    if request.inputs is not None:
        return _table(request, request.inputs)
    for flag, given in (("--out", request.out), ("--row", request.row)):
        if given is not None:
            raise ValueError(
                f"{flag}: only with a table of readings; give --inputs or leave it out"
            )
    if request.as_json and request.explain:
        raise ValueError("--explain: is a text; leave out --json")
    if request.surface is not None and request.figures is None:
        raise ValueError("--surface: only with --figures; give a folder or leave it out")
    return _patient(request) if request.rule_base is None else _by_file(request, request.rule_base)


def _refuse_idle(request: EstimationRequest) -> None:
    """ValueError for a setting that cannot change the answer."""
    given, systems = request.settings, request.systems or tuple(SYSTEMS)
    drawn = SHAPES if request.figures is not None else ()
    for key, system in ONLY_OF.items():
        if key in given and system not in systems and key not in drawn:
            raise ValueError(f"{_flag(key)}: only {system} has it; leave it out or add the system")
    if given.get("sampling") == "exact" and "samples" in given:
        raise ValueError("--samples: has no effect with exact sampling; leave it out")
    if "absent" in given and request.inputs is None and len(request.readings) == len(AETIOLOGIES):
        raise ValueError("--absent: no reading is absent; leave it out")


def _flag(key: str) -> str:
    return "--" + key.replace("_", "-")


# --- one patient -------------------------------------------------------------------------------


def _patient(request: EstimationRequest) -> Answer:
    settings = settings_of(request.settings)
    if not request.readings and settings.missing.silences:
        raise ValueError(
            "no reading is given: give one or more in kPa, such as --hcv 9.5, a table of them by "
            "--inputs, or --absent normal for a normal liver"
        )
    for name, value in request.readings.items():
        _check_plausible(value, f"--{name} {value:g}")
    readings = {name: PA_PER_KPA * value for name, value in request.readings.items()}
    found = [estimate(readings, name, settings) for name in request.systems or SYSTEMS]
    lines = [_as_json(found)] if request.as_json else [_line(one) for one in found]
    if request.explain:
        system = patient_system(readings, settings)
        lines += _explained(request, system, liver_row(readings)[0], tuple(SYSTEMS))
    if request.figures is not None:
        lines += _draw(request.figures, request, readings, settings)
    notes = dict.fromkeys(note for one in found for note in one.notes)
    return Answer(tuple(lines), tuple(notes))


def _check_plausible(kpa: float, where: str) -> None:
    low, high = PLAUSIBLE
    if not low <= kpa <= high:  # true for NaN too
        raise ValueError(f"{where}: no liver has that; give kPa, {low:g} to {high:g}")


def _line(found: StiffnessEstimate) -> str:
    bounds = [f"{bound / PA_PER_KPA:.2f}" for bound in found.interval or ()]
    return f"{found.system:16s} {found.estimate / PA_PER_KPA:7.2f} {UNIT}{_interval(bounds)}"


def _interval(bounds: Sequence[str]) -> str:
    return f"   [{', '.join(bounds)}]" if bounds else ""


def _as_json(found: Sequence[StiffnessEstimate]) -> str:
    return json.dumps({one.system: _numbers(one) for one in found}, indent=1)


def _numbers(found: StiffnessEstimate) -> dict[str, object]:
    numbers: dict[str, object] = {
        "estimate_pa": found.estimate,
        "quadrature_error_pa": found.quadrature_error,
        "method": found.method,
        "notes": list(found.notes),
    }
    return numbers | ({"interval_pa": list(found.interval)} if found.interval else {})


def _explained(
    request: EstimationRequest,
    system: FuzzySystem,
    x: NDArray[np.float64],
    kinds: Sequence[str],
) -> Iterator[str]:
    from fuzzy.systems.explain import explain
    from fuzzy.systems.explanation_text import explanation_lines

    unit = UNIT if request.rule_base is None else ""
    options = settings_of(request.settings).options
    for name in kinds if not request.systems else request.systems:
        yield ""
        yield from explanation_lines(explain(system, x, name, options, unit), unit)


# --- one patient, by a rule base of the user's -------------------------------------------------


def _by_file(request: EstimationRequest, path: Path) -> Answer:
    """Outputs of a rule base for one reading of each of its inputs, in its own units."""
    if request.figures is not None:
        raise ValueError("--figures: only of the liver's rules; leave it out with --rule-base")
    system, _ = _rule_base(path, request.settings)
    x = _own_readings(request.readings, system, path)
    kinds = tuple(request.systems) or tuple(kind for kind in SYSTEMS if _serves(system, kind))
    options = settings_of(request.settings).options
    found = {kind: infer(system, x[None], kind, options) for kind in kinds}
    if request.as_json:
        lines = [json.dumps({kind: _own_numbers(one) for kind, one in found.items()}, indent=1)]
    else:
        lines = [_own_line(kind, one) for kind, one in found.items()]
    if request.explain:
        lines += _explained(request, system, x, kinds)
    return Answer(
        tuple(lines), tuple(dict.fromkeys(n for one in found.values() for n in one.notes))
    )


def _own_readings(
    readings: Mapping[str, float], system: FuzzySystem, path: Path
) -> NDArray[np.float64]:
    """Readings (inputs,) in the order of the inputs. ValueError for one too many or too few."""
    names = [variable.name for variable in system.inputs]
    listed = f"the inputs of {path} are {', '.join(names)}"
    if not readings:
        raise ValueError(f"--rule-base: give its readings as a table, --inputs FILE.csv; {listed}")
    for name in readings:
        if name not in names:
            raise ValueError(f"--{name}: {listed}; leave it out")
    for name in names:
        if name not in readings:
            how = f"give --{name}" if name in AETIOLOGIES else "give a table, --inputs FILE.csv"
            raise ValueError(f"--rule-base: no reading of {name}; {how}; {listed}")
    return np.array([readings[name] for name in names])


def _serves(system: FuzzySystem, kind: str) -> bool:
    """Whether a rule base can be evaluated as this kind."""
    try:
        check_kind(system, kind)
    except ValueError:
        return False
    return True


def _own_line(kind: str, found: Inferred) -> str:
    bounds = [] if found.interval is None else [f"{bound:.6g}" for bound in found.interval[0]]
    return f"{kind:16s} {found.value[0]:9.6g}{_interval(bounds)}"


def _own_numbers(found: Inferred) -> dict[str, object]:
    numbers: dict[str, object] = {
        "estimate": float(found.value[0]),
        "method": found.method,
        "notes": list(found.notes),
    }
    interval = {} if found.interval is None else {"interval": found.interval[0].tolist()}
    return numbers | interval


# --- a table -----------------------------------------------------------------------------------


def _table(request: EstimationRequest, inputs: Path) -> Answer:
    from fuzzy.systems.table import evaluate_table

    _check_table(request)
    system, unit = _rule_base(request.rule_base, request.settings)
    options = settings_of(request.settings).options
    lines: list[str] = []
    notes: tuple[str, ...] = ()
    if request.out is not None:
        (kind,) = request.systems
        check_file(request.out)
        range_ = PLAUSIBLE if request.rule_base is None else (-np.inf, np.inf)
        blanks = _blanks(request)
        notes = evaluate_table(system, inputs, request.out, kind, options, unit, range_, blanks)
        lines.append(str(request.out))
    if request.explain:
        lines += _explained(request, *_table_row(request, inputs, system), request.systems)
    return Answer(tuple(lines), notes)


def _check_table(request: EstimationRequest) -> None:
    if request.readings:
        raise ValueError(f"--{next(iter(request.readings))}: the table gives the readings")
    for flag, given in (("--json", request.as_json), ("--figures", request.figures)):
        if given:
            raise ValueError(f"{flag}: only for one patient; leave it out with --inputs")
    if request.out is None and not request.explain:
        raise ValueError("--inputs: name the table to write, --out FILE.csv")
    if len(request.systems) != 1:
        raise ValueError(f"--inputs: name one --system, of {', '.join(SYSTEMS)}")
    if request.row is not None and not request.explain:
        raise ValueError("--row: only with --explain; leave it out")


def _rule_base(path: Path | None, given: Mapping[str, Any]) -> tuple[FuzzySystem, str]:
    """The system of a file, or the liver's; and the unit of its readings where it is known."""
    if path is None:
        return liver_system(settings_of(given)), UNIT
    from fuzzy.systems.files import read_rule_base

    options = {one.name for one in fields(InferenceOptions)}
    for key in given:
        if key not in options:
            raise ValueError(
                f"{_flag(key)}: shapes the liver's rules only; leave it out with --rule-base"
            )
    return read_rule_base(path), ""


def _blanks(request: EstimationRequest) -> Blanks | None:
    """What a blank cell of the table means; None for a rule base that does not say."""
    if request.rule_base is not None:
        return None
    from fuzzy.systems.table import Blanks

    settings, normal = settings_of(request.settings), NORMAL_LIVER / PA_PER_KPA
    return Blanks(
        value=normal,
        system=lambda names: patient_system(dict.fromkeys(names, normal), settings),
        note=settings.missing.note.format(normal=normal),
    )


def _table_row(
    request: EstimationRequest, inputs: Path, system: FuzzySystem
) -> tuple[FuzzySystem, NDArray[np.float64]]:
    """The system that answers for the row to explain, and its readings."""
    from fuzzy.systems.table import read_readings

    blanks = _blanks(request)
    X = read_readings(inputs, system, blanks=blanks is not None)
    number = 1 if request.row is None else request.row
    if not 1 <= number <= len(X):
        raise ValueError(f"--row {number}: the table has rows 1 to {len(X)}")
    x = np.asarray(X[number - 1])
    if blanks is None or not np.isnan(x).any():
        return system, x
    named = (one.name for one, value in zip(system.inputs, x, strict=True) if np.isfinite(value))
    return blanks.system(tuple(named)), np.where(np.isnan(x), blanks.value, x)


# --- figures and rule bases --------------------------------------------------------------------


def _draw(
    folder: Path, request: EstimationRequest, readings: Mapping[str, float], settings: LiverSettings
) -> Iterator[str]:
    """Write the figures into the folder; their paths."""
    from reports.fuzzy_figures import draw_sets, draw_surfaces
    from reports.rule_view import draw_rules
    from study.models.estimates import drawings

    systems, over = request.systems or tuple(SYSTEMS), request.surface or ("hcv", "hbv")
    arrays = drawings(settings, systems, readings, over)
    found = {name: estimate(readings, name, settings).estimate for name in systems}
    pictures = {"sets": draw_sets(arrays, found), "surfaces": draw_surfaces(arrays, over)}
    pictures |= {f"rules-{name}": draw_rules(arrays, name) for name in systems}
    paths = {folder / f"{name}.svg": picture for name, picture in pictures.items()}
    with making(folder):
        for path, picture in paths.items():
            write_bytes(path, picture)
    yield from map(str, paths)


def _refuse_idle_rules(given: Mapping[str, Any], out: Path | None) -> None:
    """ValueError for a setting that neither the audit nor the file depends on."""
    if "absent" in given:
        raise ValueError("--absent: is of a patient, not of the rules; leave it out")
    for key in SHAPES:
        if key in given and (out is None or out.suffix.lower() == ".fis"):
            raise ValueError(f"{_flag(key)}: only a .json file holds it; leave it out or write one")


def rule_base_lines(
    path: Path | None, given: Mapping[str, Any], out: Path | None, *, sugeno: bool
) -> Sequence[str]:
    """Audit a rule base, the liver's if there is no `path`, or write it to `out`."""
    from fuzzy.systems.audit import audit, audit_lines
    from fuzzy.systems.conversion import sugeno_of, type_1_of
    from fuzzy.systems.files import write_rule_base

    system, _ = _rule_base(path, given)
    _refuse_idle_rules(given, out)
    if out is None:
        if sugeno:
            raise ValueError("--sugeno: only with --out; constants are no part of the audit")
        return audit_lines(audit(system), system)
    check_file(out)
    lines = [str(out)]
    if out.suffix.lower() == ".fis" and system != type_1_of(system):
        system = type_1_of(system)
        lines.append("without footprints, which a .fis file cannot hold; .json can")
    write_rule_base(sugeno_of(system) if sugeno else system, out)
    return lines
