"""Comparison of several runs as one page, which makes no network request."""

from __future__ import annotations

import html as markup
from collections.abc import Iterator, Sequence
from string import Template

from reports import several
from reports.appearance import other_look
from reports.digits import short, words
from reports.page.data import DASHES, OTHER_DASHES
from reports.page.write import head, inert, part, plotly, table
from reports.ranking import tool_probe
from reports.several import Compared
from reports.several_pdf import LOOKS_FROM, alternative, moved, shared_models
from study.results import Results

MILLI = 1e3
COLUMNS = 3
ROW = 20
"""Height of a row of panels [rem]."""
DIGITS = 6


def several_page(names: Sequence[str], runs: Sequence[Results], rows: Sequence[Compared]) -> bytes:
    """The page; the same runs and plotly give the same bytes."""
    names = [words(short(name, 24)) for name in names]
    labels = shared_models(runs)
    title = markup.escape(f"Comparison of runs: {', '.join(names)}")
    text = Template(part("several.html")).substitute(
        head=head(title),
        title=title,
        said=markup.escape(several.said(names, runs, rows)),
        height=f"{ROW * -(-len(labels) // COLUMNS)}rem",
        words=markup.escape(alternative(names, runs), quote=True),
        table=table(
            [*several.HEADER, *names, "verdict"],
            several.cells(rows),
            "Those that differ by more than their errors first",
        ),
        data=inert({"traces": list(_traces(names, runs, labels)), "layout": _layout(labels)}),
        plotly=plotly(),
    )
    return text.encode()


def _traces(
    names: Sequence[str], runs: Sequence[Results], labels: Sequence[str]
) -> Iterator[dict[str, object]]:
    """A line for each run in the panel of each model."""
    dashes = [*DASHES.values(), *OTHER_DASHES]
    seen = set()
    for panel, label in enumerate(labels, 1):
        for k, (name, run) in enumerate(zip(names, runs, strict=True)):
            if label not in moved(run):
                continue
            curve = run.curve(moved(run)[label], tool_probe(run))
            colour, dash = other_look(k + LOOKS_FROM).colour, dashes[k % len(dashes)]
            yield {
                "x": [float(f"{t:.{DIGITS}g}") for t in curve.time],
                "y": [float(f"{MILLI * u:.{DIGITS}g}") for u in curve.displacement],
                "xaxis": f"x{panel}",
                "yaxis": f"y{panel}",
                "name": name,
                "legendgroup": name,
                "showlegend": name not in seen,
                "mode": "lines",
                "line": {"color": colour, "dash": dash, "width": 2},
            }
            seen.add(name)


def _layout(labels: Sequence[str]) -> dict[str, object]:
    rows = max(1, -(-len(labels) // COLUMNS))
    axes: dict[str, object] = {}
    for panel in range(1, len(labels) + 1):
        axes[f"xaxis{panel}"] = {"title": {"text": "time [s]"}}
        axes[f"yaxis{panel}"] = {"title": {"text": "displacement [mm]"}}
    named = [_title(panel, label) for panel, label in enumerate(labels, 1)]
    grid = {"rows": rows, "columns": COLUMNS, "pattern": "independent", "ygap": 0.35}
    legend = {"orientation": "h", "y": 1.0, "yanchor": "top", "yref": "container"}
    return {
        **axes,
        "annotations": named,
        "grid": grid,
        "legend": legend,
        "hovermode": "x",
        "margin": {"l": 60, "r": 15, "t": 60, "b": 50},
    }


def _title(panel: int, label: str) -> dict[str, object]:
    """Name of a model above its panel."""
    return {
        "text": f"<b>{markup.escape(label)}</b>",
        "xref": f"x{panel} domain",
        "yref": f"y{panel} domain",
        "x": 0.0,
        "y": 1.0,
        "xanchor": "left",
        "yanchor": "bottom",
        "showarrow": False,
    }
