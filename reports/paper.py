"""What the paper prints and a report sets beside its own numbers, and the sources of a report."""

from __future__ import annotations

from study.results import Results
from study.robustness.paper import TABLE_III, elastography_sources, table_i

__all__ = ["TABLE_I", "TABLE_III", "TABLE_III_SPREAD", "sources"]

TABLE_I = table_i()
TABLE_III_SPREAD = max(TABLE_III.values()) - min(TABLE_III.values())
"""Between the highest and the lowest of Table III."""

OF_EVERY_RUN = (
    "Tan, Dhillon and Sidhu, Fuzzy Estimation of Liver Stiffness in Modelling Liver Deformation: "
    "the paper that is studied",
    "Basafa and Farahmand 2011: the benchmark, as the paper prints it",
    "Golec et al. 2020, doi:10.1007/s00371-019-01663-0: springs of a cubic lattice with volume "
    "terms",
    "Roache 1994, J. Fluids Eng. 116:405: the grid convergence index",
    "ISO/TS 18571: objective rating of time histories",
    "Witowski and Stander 2012, doi:10.2514/6.2012-5580: partial curve mapping",
    "Künsch 1989, doi:10.1214/aos/1176347265: the jackknife of blocks",
)


def sources(results: Results) -> list[str]:
    """What a report rests on, a line each; those of elastography where a fuzzy system estimates."""
    read = elastography_sources() if results.record.fuzzy.systems else []
    return [*OF_EVERY_RUN, *(_cited(*one) for one in read)]


def _cited(citation: str, identifier: str) -> str:
    """A citation with what finds it, where the citation does not say that itself."""
    return citation if identifier in citation else f"{citation}, {identifier}"
