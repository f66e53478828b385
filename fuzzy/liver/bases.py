"""The knowledge bases that a fuzzy estimate can be made by, by name."""

from typing import NamedTuple


class KnowledgeBase(NamedTuple):
    """One knowledge base: how it treats a missing reading unless told, what it is, in words.

    `completed`: combinations of diseases that Table I has no cell for are cells too, as else a
    patient with just these readings is answered by several cells that know a part of them each, and
    which of them fires more changes with every reading: one raised may then lower the estimate.
    `follows`: its sets partition the scale of readings and stand in `partition.csv` under its name,
    so that the estimate follows the reading, on the cells of the `reading` of Table I. Otherwise
    sets are those of stages of fibrosis, and `reading`, `consequent` and `placement` of the
    settings say how they make rules.
    """

    follows: bool
    absent: str
    words: str
    reading: str = "R1"
    completed: bool = False


KNOWLEDGE: dict[str, KnowledgeBase] = {
    "severity": KnowledgeBase(
        False,
        "normal",
        "sets are the spread of patients at a stage of fibrosis, and a rule concludes a severity "
        "(mild, moderate, severe): the estimate hardly follows the reading",
    ),
    "paper-count": KnowledgeBase(
        True,
        "silent",
        "two sets an aetiology, three for HBV, are placed by optimisation so that the paper's 247 "
        "rules follow the reading as well as they can",
    ),
    "freed": KnowledgeBase(
        True,
        "silent",
        "seven sets an aetiology partition the instrument's scale on Table I's cells and the three "
        "combinations that it lacks, whatever the number of rules, and a rule concludes the "
        "stiffness expected of its readings",
        reading="R1-no-duplicates",
        completed=True,
    ),
}

STAGES_ONLY = ("reading", "consequent", "placement")
"""Settings that shape a knowledge base of stages; the others have sets and cells of their own."""
