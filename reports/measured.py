"""Measurements made beforehand, independent of any run, as a document: `report --reference`."""

from __future__ import annotations

from pathlib import Path

from reports.benchmarks import benchmarks
from reports.organ_ranking import organ_ranking
from reports.organ_ranking_figure import organ_figures
from reports.ranking_study import ranking_study
from reports.ranking_study_figure import ranking_figures
from reports.report import Figures, compile_pdf
from reports.robustness import robustness, robustness_figures
from reports.validation import validation
from reports.validation_figure import validation_figure
from reports.verification import verification
from study.system.folders import write_bytes

NAME = "liver-study-reference.pdf"
TEMPLATE = "measured.typ"
ALTERNATIVES = {
    "validation": "Models compared with measurements on silicone: force on cylinders, tip of a "
    "beam, beads in a cube; the numbers are in the two tables that follow",
    "tradeoff": "Error of the displacement field over the cost of a simulated second, and over the "
    "time of a frame; the best configurations are in the table that follows",
    "stability": "Number of cases by family and outcome, and the fraction of its tolerance that "
    "each used; the sentences above summarise it",
    "critical_step": "Largest stable step measured by bisection over the one predicted, less one, "
    "by case: points within the tolerance, which is shaded",
    "ranking": "Share of samples in which each fuzzy system is nearest to the benchmark, and total "
    "Sobol' indices of the unknowns; shares are in the table that follows",
    "ranking_spacing": "The nearest system by measure over the reference spacing, and two scores "
    "over it",
    "organ_ranking": "Share of samples of an organ in which each is nearest to the benchmark, and "
    "total Sobol' indices; shares are in the table that follows",
}
"""Alternative text of each figure, by its place."""


def make_measured(path: Path) -> None:
    """Write the document. FolderError or OSError where it cannot be written."""
    write_bytes(path, measured_pdf())


def measured_pdf() -> bytes:
    """The document; the same tables give the same bytes."""
    return compile_pdf(measured(), measured_figures(), TEMPLATE)


def measured() -> dict[str, object]:
    """The document's text by place; None where a table does not come with the program."""
    return {
        "benchmarks": benchmarks(),
        "verification": verification(),
        "validation": validation(),
        "robustness": robustness(),
        "ranking_study": ranking_study(),
        "organ_ranking": organ_ranking(),
        "alternatives": {place: [text] for place, text in ALTERNATIVES.items()},
    }


def measured_figures() -> Figures:
    """The figures of the document as SVG by place, without those whose table is missing."""
    drawn = {
        **robustness_figures(),
        "validation": validation_figure(),
        **ranking_figures(),
        **organ_figures(),
    }
    return {place: [svg] for place, svg in drawn.items() if svg is not None}
