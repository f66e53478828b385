"""Studies of many runs: stability at extremes, rankings of models, stages of the default run."""

from collections.abc import Iterable, Iterator

from docs.figures.formats import count, seconds, table
from docs.figures.tables import Line, column, grouped, measured
from reports import organ_ranking, ranking_study

RUNS = {  # cases of the default run, by the names of figures
    "first": "after install",
    "fresh": "side by side",
    "alone": "one after another",
    "unchanged": "unchanged",
    "title": "other title",
    "reading": "other reading",
    "spacing": "other spacing",
}
MEMORY = {"first", "fresh"}
"""Those whose memory is stated too."""
COLLAPSES = (("springs", "springs"), ("volume", "nu 0.45"))
"""Names of figures, and kinds of lattices in the cases of collapse."""


def stability() -> Iterator[tuple[str, str]]:
    """Every model at its extremes."""
    lines = measured("stability")
    yield "stability-cases", str(len(lines))
    families = grouped(lines, lambda line: line["family"])
    rows = [
        (name, str(len(found)), str(sum(one["passed"] == "True" for one in found)))
        for name, found in families.items()
    ]
    yield "stability", table(("family", "cases", "passed"), rows)
    for name, kind in COLLAPSES:
        yield f"collapse-{name}", _collapse(families["collapse"], kind)


def _collapse(lines: list[Line], kind: str) -> str:
    """The most weights that a lattice bears, and the fewest under which it collapses."""
    diverged = {
        float(one["case"].split()[0]): one["outcome"] == "diverged"
        for one in lines
        if one["case"].endswith(f"its weight, {kind}: symplectic-euler")
    }
    borne = max(weight for weight, lost in diverged.items() if not lost)
    first = min(weight for weight, lost in diverged.items() if lost)
    return f"{borne:.0f} and {first:.0f}"


def ranking() -> Iterator[tuple[str, str]]:
    """What the study of the paper's unknowns found, a line a finding, as the report says it."""
    yield "ranking", _list(ranking_study.sentences())
    nearest = measured("ranking_nearest")
    claimed = [line for line in nearest if line["system"] == ranking_study.CLAIM]
    shares = [100.0 * share for share in column(claimed, "share")]
    yield "ranking-claim", f"{min(shares):.0f} to {max(shares):.0f} %"
    yield "ranking-draws", count(nearest[0]["draws"])


def organ() -> Iterator[tuple[str, str]]:
    """What the study of an organ found, a line a finding, as the report says it."""
    yield "organ-ranking", _list(organ_ranking.sentences())


def _list(sentences: Iterable[str]) -> str:
    """A list in Markdown, with an empty line before and after."""
    return "\n\n" + "\n".join(f"- {text}" for text in sentences) + "\n\n"


def run_stages() -> Iterator[tuple[str, str]]:
    """What the default run takes: at first, of kept stages, and after a change, by machine."""
    whole = [line for line in measured("run_stages") if line["stage"] == "whole"]
    cases = grouped(whole, lambda line: line["case"])
    for name, case in RUNS.items():
        yield f"run-{name}", seconds(column(cases[case], "wall_s"))
        if name in MEMORY:
            yield f"run-{name}-memory", f"{max(column(cases[case], 'memory_mb')) / 1e3:.1f} GB"
    machines = dict.fromkeys(line["machine"].partition(",")[0] for line in whole)
    yield "run-machines", " and ".join(machines)
