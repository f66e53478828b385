"""The rule base of the liver or of a file: read, audited, and written to another file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from fuzzy.liver.stiffness import UNIT
from fuzzy.liver.system import liver_system
from fuzzy.systems.options import InferenceOptions
from fuzzy.systems.system import FuzzySystem
from study.estimation.request import SHAPES, flag_of, settings_of
from study.system.folders import check_file


def rule_base(path: Path | None, given: Mapping[str, Any]) -> tuple[FuzzySystem, str]:
    """The system of a file, or the liver's; and the unit of its readings where it is known."""
    if path is None:
        return liver_system(settings_of(given)), UNIT
    from fuzzy.systems.files import read_rule_base

    options = {one.name for one in fields(InferenceOptions)}
    for key in given:
        if key not in options:
            raise ValueError(
                f"{flag_of(key)}: shapes the liver's rules only; leave it out with --rule-base"
            )
    return read_rule_base(path), ""


def _refuse_idle(given: Mapping[str, Any], out: Path | None) -> None:
    """ValueError for a setting that neither the audit nor the file depends on."""
    if "absent" in given:
        raise ValueError("--absent: is of a patient, not of the rules; leave it out")
    for key in SHAPES:
        if key in given and (out is None or out.suffix.lower() == ".fis"):
            raise ValueError(
                f"{flag_of(key)}: only a .json file holds it; leave it out or write one"
            )


def rule_base_lines(
    path: Path | None, given: Mapping[str, Any], out: Path | None, *, sugeno: bool
) -> Sequence[str]:
    """Audit a rule base, the liver's if there is no `path`, or write it to `out`."""
    from fuzzy.systems.audit import audit, audit_lines
    from fuzzy.systems.conversion import sugeno_of, type_1_of
    from fuzzy.systems.files import write_rule_base

    system, _ = rule_base(path, given)
    _refuse_idle(given, out)
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
