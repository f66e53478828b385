"""What a run says of the requirements of its scene: the plan, and its own check of the error."""

from __future__ import annotations

from collections.abc import Iterator

from reports.digits import percent, words
from study.results import Results
from study.results.records import Check

PLANNED = "Planned: model: "
"""Start of the note that names the model of a plan and its expected error."""
CHECK = "require.error"


def error_checks(results: Results) -> list[Check]:
    """Checks of the run's own estimates against the error that its scene requires."""
    return [check for check in results.record.checks if CHECK in check.name]


def required_sentences(results: Results) -> Iterator[str]:
    """The model of the plan, and whether its error is what is required; none without a plan."""
    required = results.scene.require
    if required is None:
        return
    notes = [note for note in results.record.notes if note.startswith(PLANNED)]
    for note in notes:
        model = words(note.removeprefix(PLANNED)).rstrip(".")
        yield f"The plan for the requirements of the scene chose: {model}."
    checks = error_checks(results)
    for check in checks:
        verdict = "within" if check.passed else "more than"
        yield (
            f"By {check.meaning}, it is {percent(check.value)}, {verdict} the "
            f"{percent(check.limit)} required."
        )
    if required.error is not None and not checks:
        yield (
            "The run has no estimate of its own of this error, so that it rests on the expectation "
            f"of the plan; {percent(required.error)} is required. A run of the same scene without "
            "the table require, with fem among models, compares with finite elements."
        )
