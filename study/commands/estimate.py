"""`estimate`: stiffness from readings, or a table by any rule base."""

from __future__ import annotations

import sys
from pathlib import Path

from study.commands.flags import (
    AS_DEFAULT,
    AS_MATLAB,
    AsJson,
    Inference,
    LiverReading,
    NumberOrNone,
    Switch,
    WholeOrNone,
)
from study.commands.flags import given as given_flags


def estimate(
    *,
    hcv: NumberOrNone = None,
    hbv: NumberOrNone = None,
    ald: NumberOrNone = None,
    cld: NumberOrNone = None,
    nafld: NumberOrNone = None,
    inputs: Path | None = None,
    rule_base: Path | None = None,
    out: Path | None = None,
    system: list[str] | None = None,
    explain: Switch = False,
    row: WholeOrNone = None,
    figures: Path | None = None,
    surface: tuple[str, str] | None = None,
    as_json: AsJson = False,
    inference: Inference = AS_MATLAB,
    liver: LiverReading = AS_DEFAULT,
) -> None:
    """Estimate liver stiffness from elastography readings, or evaluate a table by any rule base.

    Parameters
    ----------
    hcv
        Reading in hepatitis C [kPa]; --absent says what becomes of one that is not given.
    hbv
        Reading in hepatitis B [kPa].
    ald
        Reading in alcoholic liver disease [kPa].
    cld
        Reading in cholestatic liver disease [kPa].
    nafld
        Reading in non-alcoholic fatty liver disease [kPa].
    inputs
        Table of readings (CSV, columns named as the inputs) instead of one patient.
    rule_base
        Fuzzy system (.fis or .json) instead of the liver's, for a table, or for the readings given
        here if its inputs have these names.
    out
        Table to write: that of --inputs with the column estimate, for type-2 also lower and upper.
    system
        mamdani, sugeno or interval-type-2; for one patient all three by default. May be repeated.
    explain
        Show the strongest rules, the sets, the output and the type-2 switch points.
    row
        Row of the table to explain, the first by default.
    figures
        Folder to draw sets, rules and output surfaces into, as SVG.
    surface
        The two readings of the output surfaces, hcv hbv by default.
    as_json
        Print JSON in SI units, of a rule base in its own, instead of a table.
    """
    from study.estimation.answer import answer
    from study.estimation.request import EstimationRequest

    given = {"hcv": hcv, "hbv": hbv, "ald": ald, "cld": cld, "nafld": nafld}
    found = answer(
        EstimationRequest(
            readings={name: value for name, value in given.items() if value is not None},
            systems=system or (),
            settings=given_flags(liver, inference),
            rule_base=rule_base,
            inputs=inputs,
            out=out,
            explain=explain,
            row=row,
            figures=figures,
            surface=surface,
            as_json=as_json,
        )
    )
    for note in found.notes:
        print(f"note: {note}", file=sys.stderr)
    print("\n".join(found.lines))
