"""The knowledge bases of a fuzzy estimate, by name."""

from typing import NamedTuple


class KnowledgeBase(NamedTuple):
    """One knowledge base: its default treatment of a missing reading, and its description.

    `completed`: combinations of diseases without a cell in Table I get cells too. Otherwise several
    cells, each with some of the diseases, determine the estimate of a patient with these readings;
    their relative strengths vary with each reading, and a higher reading may lower the estimate.
    `follows`: the sets partition the scale of readings and are in `partition.csv` under its name,
    on the cells of the `reading` of Table I, so that the estimate follows the reading. Otherwise
    the sets are those of stages of fibrosis, and `reading`, `consequent` and `placement` of the
    settings determine the rules.
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
"""Settings of knowledge bases of stages only; the others have sets and cells of their own."""
