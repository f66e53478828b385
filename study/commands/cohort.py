"""`cohort`: every fuzzy knowledge base judged on virtual patients, beside plain baselines."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import Whole

PATIENTS = 20_000
SEED = 1


def cohort(*, patients: Whole = PATIENTS, seed: Whole = SEED, out: Path | None = None) -> None:
    """Assess every fuzzy system on virtual patients of known stiffness, beside baselines.

    Parameters
    ----------
    patients
        Number of patients; 100000 take some twenty seconds.
    seed
        Seed of the random numbers; the same seed gives the same patients.
    out
        Table to write as well (CSV), by estimator, aetiology and stage.
    """
    from study.estimation.cohort import cohort_lines, judged, write_cohort

    if out is not None and not out.parent.is_dir():
        raise ValueError(f"--out {out}: there is no folder {out.parent}; make it first")
    study = judged(patients, seed)
    if out is not None:
        write_cohort(study.rows, out)
    print("\n".join(cohort_lines(study)))
