"""`rules`: a rule base audited, or written to a file."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import AS_DEFAULT, LiverReading, Switch
from study.commands.flags import given as given_flags


def rules(
    *,
    rule_base: Path | None = None,
    out: Path | None = None,
    sugeno: Switch = False,
    liver: LiverReading = AS_DEFAULT,
) -> None:
    """Audit a rule base (repeated, contradictory and idle rules, gaps), or write it to a file.

    Parameters
    ----------
    rule_base
        A .fis or .json file; by default the liver's rule base.
    out
        File to write the rule base to instead of the audit: .fis (type-1, MATLAB and Octave) or
        .json.
    sugeno
        Write a Sugeno system: constants in place of the output sets.
    """
    from study.estimation.rule_base import rule_base_lines

    lines = rule_base_lines(rule_base, given_flags(liver), out, sugeno=sugeno)
    print("\n".join(lines))
