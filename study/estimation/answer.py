"""Fuzzy estimates at the command line: one patient, or a table by any rule base."""

from __future__ import annotations

from fuzzy.liver.table1 import AETIOLOGIES
from fuzzy.systems.kinds import SYSTEMS
from study.estimation.by_file import by_file
from study.estimation.patient import patient
from study.estimation.request import SHAPES, Answer, EstimationRequest, flag_of
from study.estimation.table import table
from study.system.folders import check_folder

ONLY_OF = dict.fromkeys((*SHAPES, "reducer"), "interval-type-2") | {"sugeno_aggregation": "sugeno"}
"""Settings that only one of the systems has."""


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
        return table(request, request.inputs)
    for flag, given in (("--out", request.out), ("--row", request.row)):
        if given is not None:
            raise ValueError(
                f"{flag}: only with a table of readings; give --inputs or leave it out"
            )
    if request.as_json and request.explain:
        raise ValueError("--explain: is a text; leave out --json")
    if request.surface is not None and request.figures is None:
        raise ValueError("--surface: only with --figures; give a folder or leave it out")
    return patient(request) if request.rule_base is None else by_file(request, request.rule_base)


def _refuse_idle(request: EstimationRequest) -> None:
    """ValueError for a setting that cannot change the answer."""
    given, systems = request.settings, request.systems or tuple(SYSTEMS)
    drawn = SHAPES if request.figures is not None else ()
    for key, system in ONLY_OF.items():
        if key in given and system not in systems and key not in drawn:
            raise ValueError(
                f"{flag_of(key)}: only {system} has it; leave it out or add the system"
            )
    if given.get("sampling") == "exact" and "samples" in given:
        raise ValueError("--samples: has no effect with exact sampling; leave it out")
    if "absent" in given and request.inputs is None and len(request.readings) == len(AETIOLOGIES):
        raise ValueError("--absent: no reading is absent; leave it out")
