"""`cohort`: every fuzzy knowledge base judged on virtual patients, beside plain baselines."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import Whole

PATIENTS = 20_000
SEED = 1


def cohort(*, patients: Whole = PATIENTS, seed: Whole = SEED, out: Path | None = None) -> None:
    """Judge every fuzzy system on virtual patients whose stiffness is known, beside baselines.

    Parameters
    ----------
    patients
        How many are drawn; 100000 take some twenty seconds.
    seed
        Of the random numbers; the same seed draws the same patients.
    out
        Table to write too (CSV), by contender, aetiology and stage.
    """
    from study.estimation.cohort import cohort_lines, judged, write_cohort

    if out is not None and not out.parent.is_dir():
        raise ValueError(f"--out {out}: there is no folder {out.parent}; make it first")
    study = judged(patients, seed)
    if out is not None:
        write_cohort(study.rows, out)
    print("\n".join(cohort_lines(study)))
