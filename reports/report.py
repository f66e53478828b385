"""Make report.pdf of a results folder."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from dataclasses import replace
from functools import partial
from importlib import resources
from pathlib import Path
from threading import Event
from typing import Literal, TypedDict

import numpy as np

from reports.budget_figure import budget_figure
from reports.content import document
from reports.cut_figure import cut_figure
from reports.field_figures import Views, explain, field_figures, job, views
from reports.first_figure import first_figure
from reports.fuzzy_figures import sets_figure, surfaces_figure
from reports.motion_figures import motion_figures
from reports.renders import Pictures, render_once
from reports.rule_view import rule_figures
from reports.sensitivity_figure import sensitivity_figure
from reports.tool_force import force_figure
from study.folders import FolderError, check_file, write_bytes
from study.progress import Progress, Silent
from study.results.folder import Results, ResultsError, read
from study.results.records import Provenance
from study.stages.flat import Arrays
from study.stages.lanes import Job, available, lanes
from study.stages.once import made_once
from study.stages.threads import allowed
from study.sweep.program import everything

NAME = "report.pdf"
TEMPLATE = "template.typ"
PARTS = ("style.typ", "paper.typ")
"""What a template includes."""
STANDARD: Literal["ua-1"] = "ua-1"
"""PDF/UA-1: tagged, with alternative texts, a language and a title."""
NO_GLYPH = "could not be displayed with font"
"""In what typst says of a text that no font of its own has letters for."""
PROCESSES = 2
"""That draw plots at most: more of them wait for the dearest."""
Figures = dict[str, list[bytes]]
Draw = Callable[[], Mapping[str, list[bytes] | bytes | None]]
Drawing = dict[str, str] | None
NOWHERE = Provenance(
    versions={},
    commit=None,
    platform="",
    processor=None,
    seed=None,
    scene_sha256="",
    mesh_sha256=None,
)
"""Of results that are drawn, which show none."""


def make_report(folder: Path) -> None:
    """Write report.pdf into a results folder.

    Raises ResultsError for a folder without results or with some that are not whole, see
    `study.results.folder.read`, or one that cannot be written, before anything is drawn.
    """
    results = read(folder)
    _check(folder / NAME)
    write_bytes(folder / NAME, pdf(results))


def pdf(results: Results) -> bytes:
    """The report of results in memory; the same results give the same bytes."""
    figures, drawing = draw(results)
    return compile_pdf(document(results) | {"drawing": drawing}, figures)


def draw(results: Results) -> tuple[Figures, Drawing]:
    """SVG figures by place in the document, and what the caption of the organ's pictures says.

    VTK renders in its own process while matplotlib draws the rest. What was drawn of the same
    motions before is taken from the store, if there is one.
    """
    seen = views(results)
    with ThreadPoolExecutor(1) as pool, _set_after_a_failure() as unwanted:
        pictures = (
            None
            if seen is None
            else pool.submit(copy_context().run, render_once, job(seen), unwanted)
        )
        figures = _kept_plots(_drawn_of(results))
        if pictures is not None:
            pictures.result()  # here, where a signal makes them unwanted
    if seen is None or pictures is None:
        return figures, None
    return _with_pictures(figures, seen, pictures)


@contextmanager
def _set_after_a_failure() -> Iterator[Event]:
    """An event that is set when the block ends by an exception, so that none waits for a thread."""
    event = Event()
    try:
        yield event
    except BaseException:
        event.set()
        raise


def _drawn_of(results: Results) -> Results:
    """Results without what no figure shows, so that none depends on it: title, times, sources."""
    scene = replace(results.scene, title="", renders=True, remarks=())
    models = tuple(replace(one, wall_s=None) for one in results.record.models)
    record = replace(
        results.record,
        title="",
        notes=(),
        warnings=(),
        assumptions=(),
        models=models,
        study_wall_s=None,
        stages=(),
        workers=1,
        provenance=NOWHERE,
    )
    return replace(results, scene=scene, record=record)


def _kept_plots(results: Results) -> Figures:
    """The plots as they were drawn of equal results by an equal program, or are drawn now."""

    def make() -> Arrays:
        return {
            f"{place}/{i}": np.frombuffer(svg, np.uint8)
            for place, drawn in _plots(results).items()
            for i, svg in enumerate(drawn)
        }

    found = made_once("plots", make, results, everything("reports"), modules=(__name__,))
    figures: Figures = {"motion": []}  # of a motion without a finite sample
    for name, svg in found.items():
        figures.setdefault(name.partition("/")[0], []).append(svg.tobytes())
    return figures


def _plots(results: Results) -> Figures:
    """All plots but pictures of the organ, drawn in two processes where there are processors."""
    drawings = _drawings(results)
    with lanes(min(PROCESSES, allowed(available())), Silent()) as side_by_side:
        for number, draw in enumerate(drawings):
            side_by_side.start(Job(str(number), partial(_drawn, draw)))
        found = side_by_side.results()
    drawn = {place: svg for one in found.values() for place, svg in one.items()}
    return {
        place: svg if isinstance(svg, list) else [svg]
        for place, svg in drawn.items()
        if svg is not None
    }


def _drawn(draw: Draw, _: Progress) -> Mapping[str, list[bytes] | bytes | None]:
    return draw()


def _drawings(results: Results) -> Iterator[Draw]:
    """Functions that draw plots by place, the dearest first."""
    yield lambda: {"motion": list(motion_figures(results)), "first": first_figure(results)}
    if results.fuzzy:
        yield lambda: {"rules": rule_figures(results)}
        yield lambda: {"surfaces": surfaces_figure(results), "sets": sets_figure(results)}
    yield lambda: {
        "sensitivity": sensitivity_figure(results.sensitivity),
        "budget": budget_figure(results),
        "tool_force": force_figure(results),
        "cut": cut_figure(results),
    }


def _with_pictures(
    figures: Figures, seen: Views, pictures: Future[Pictures]
) -> tuple[Figures, Drawing]:
    found = pictures.result()
    scene, *others = field_figures(seen, found)
    drawn = figures | {"scene": [scene], "fields": others}
    return drawn, explain(seen) | {"renderer": found.renderer}


class _How(TypedDict):
    """What typst is given besides the document."""

    root: str
    ignore_system_fonts: bool


def compile_pdf(content: dict[str, object], figures: Figures, name: str = TEMPLATE) -> bytes:
    """Tagged PDF of a template filled with text and figures.

    Raises ValueError for a number that is not finite, RuntimeError for a template that does not
    compile, for example because it refers to a label that is missing.
    """
    import typst

    names = {place: [f"{place}-{i}.svg" for i in range(len(svg))] for place, svg in figures.items()}
    text = json.dumps(content | {"figures": names}, allow_nan=False)
    with tempfile.TemporaryDirectory(prefix="liver-study-") as folder:
        root = Path(folder)
        (root / "content.json").write_text(text, encoding="utf-8")
        for part in (name, *PARTS):
            (root / part).write_bytes(template(part))
        for place, drawn in figures.items():
            for file, svg in zip(names[place], drawn, strict=True):
                (root / file).write_bytes(svg)
        path = str(root / name)
        how: _How = {"root": folder, "ignore_system_fonts": True}
        try:
            return bytes(typst.compile(path, pdf_standards=STANDARD, **how))
        except typst.TypstError as error:
            if NO_GLYPH not in str(error):
                raise
            # A name in a script that the fonts lack: tagged all the same, but for those letters.
            return bytes(typst.compile(path, **how))


def template(name: str = TEMPLATE) -> bytes:
    """Typst source of a document, or of a part of one."""
    return resources.files("reports").joinpath(name).read_bytes()


def _check(path: Path) -> None:
    """Refuse a report that could not be written, and remove what a killed program left of one."""
    try:
        check_file(path)
        for left in path.parent.glob(f".{path.name}.*"):
            left.unlink(missing_ok=True)
    except (FolderError, OSError) as error:
        raise ResultsError(str(error).replace("--out ", "")) from None
