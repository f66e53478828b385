"""Make report.pdf of a results folder."""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from importlib import resources
from pathlib import Path
from threading import Event
from typing import Literal

import numpy as np

from reports import canvas
from reports.budget_figure import budget_figure
from reports.content import document
from reports.cut_figure import cut_figure
from reports.digits import unbroken
from reports.field_figures import Views, explain, field_figures, job, views
from reports.first_figure import first_figure
from reports.fuzzy_figures import sets_figure, surfaces_figure
from reports.letters import boxes, extra_files, extra_fonts, without_shape
from reports.motion_figures import motion_figures
from reports.renders import Pictures, render
from reports.rule_view import rule_figures
from reports.sensitivity_figure import sensitivity_figure
from reports.tool_force import force_figure
from study.results import Results, ResultsError
from study.results.folder import read
from study.results.records import Provenance
from study.stages.cached_arrays import cached_arrays, kept
from study.stages.job_pool import Job, available, job_pool
from study.stages.serialisation import Arrays
from study.stages.threads import allowed
from study.sweep.program import everything
from study.system.folders import FolderError, check_file, tell, write_bytes
from study.system.progress import Progress, Silent

NAME = "report.pdf"
TEMPLATE = "template.typ"
PARTS = ("style.typ", "paper.typ")
"""What a template includes."""
STANDARD: Literal["ua-1"] = "ua-1"
"""PDF/UA-1: tagged, with alternative texts, a language and a title."""
NO_GLYPH = re.compile(r'the text `"(.*?)"` could not be displayed with font', re.DOTALL)
"""What typst says of the first text that no font has letters for."""
PROCESSES = 2
"""Largest number of processes that draw plots: more would wait for the longest plot."""
RENDERER = "renderer"
"""Name of what rendered the pictures of the organ, beside its figures."""
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
"""Provenance of results of which figures alone are drawn: no figure shows it."""


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
    seen, plots = views(results), _drawn_of(results)
    if seen is None:
        return _kept_plots(plots), None
    organ = kept(*_named(seen), modules=(__name__,))
    if organ is None:
        figures, organ = _plots_and_organ(plots, seen)
    else:
        figures = _kept_plots(plots)
    scene, *others = (organ[str(i)].tobytes() for i in range(len(organ) - 1))
    figures |= {"scene": [scene], "fields": others}
    return figures, explain(seen) | {RENDERER: str(organ[RENDERER])}


def _plots_and_organ(plots: Results, seen: Views) -> tuple[Figures, Arrays]:
    """The plots, and the figures of the organ, whose pictures VTK renders meanwhile."""
    with ThreadPoolExecutor(1) as pool, _set_after_a_failure() as unwanted:
        waiting = pool.submit(render, job(seen), unwanted)
        figures = _kept_plots(plots)
        pictures = waiting.result()  # here, where a signal makes them unwanted
    return figures, _organ(seen, pictures)


def _named(seen: Views) -> tuple[str, Views, list[str], str]:
    """Name of the organ's figures, and all that they depend on."""
    return "organ drawn", seen, _more_fonts(), everything("reports")


def _more_fonts() -> list[str]:
    """Names of the fonts that figures take letters from which their own lack."""
    return [path.name for path in extra_files()]


def _organ(seen: Views, pictures: Pictures) -> Arrays:
    """The organ's figures by number, and what rendered them; flat ones are not kept."""

    def make() -> Arrays:
        figures = {
            str(i): np.frombuffer(svg, np.uint8)
            for i, svg in enumerate(field_figures(seen, pictures))
        }
        return figures | {RENDERER: np.array(pictures.renderer)}

    if pictures.pixels is None:  # VTK may be mended
        return make()
    name, *given = _named(seen)
    return cached_arrays(name, make, *given, modules=(__name__,))


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

    given = results, _more_fonts(), everything("reports")
    found = cached_arrays("plots", make, *given, modules=(__name__,))
    figures: Figures = {"motion": []}  # of a motion without a finite sample
    for name, svg in found.items():
        figures.setdefault(name.partition("/")[0], []).append(svg.tobytes())
    return figures


def _plots(results: Results) -> Figures:
    """All plots but pictures of the organ, drawn in two processes where there are processors."""
    drawings = _drawings(results)
    canvas.load()
    with job_pool(min(PROCESSES, allowed(available())), Silent()) as side_by_side:
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


def compile_pdf(content: dict[str, object], figures: Figures, name: str = TEMPLATE) -> bytes:
    """Tagged PDF of a template filled with text and figures.

    Letters that typst's own fonts lack are taken from those of `reports.letters`; where these lack
    them too, or are not installed, they are boxes, and the document and a line on stderr say which
    and what helps.

    Raises ValueError for a number that is not finite, RuntimeError for a template that does not
    compile, for example because it refers to a label that is missing.
    """
    names = {place: [f"{place}-{i}.svg" for i in range(len(svg))] for place, svg in figures.items()}
    content = content | {"figures": names, "boxes": ""}
    with tempfile.TemporaryDirectory(prefix="liver-study-") as folder:
        root = Path(folder)
        for part in (name, *PARTS):
            (root / part).write_bytes(template(part))
        for place, drawn in figures.items():
            for file, svg in zip(names[place], drawn, strict=True):
                (root / file).write_bytes(svg)
        text = _fill(root, content)
        for fonts in _fonts():
            with suppress(_NoGlyphError):
                return _compile(root / name, fonts)
        said = boxes(without_shape(text, partial(_refused, root, fonts)))
        tell(said)
        _fill(root, content | {"boxes": said})
        return _compile(root / name, fonts, standard=None)


def _fill(root: Path, content: Mapping[str, object]) -> str:
    """Write what a template prints; its text."""
    text = unbroken(json.dumps(content, allow_nan=False, ensure_ascii=False))
    (root / "content.json").write_text(text, encoding="utf-8")
    return text


def _fonts() -> list[list[Path]]:
    """Folders of fonts to try beside typst's own, so that most documents do with the first."""
    more = extra_fonts()
    return [[], more] if more else [[]]


class _NoGlyphError(Exception):
    """Some letters, as its text, have no shape in any font."""


def _compile(
    path: Path, fonts: list[Path], *, standard: Literal["ua-1"] | None = STANDARD
) -> bytes:
    import typst

    try:
        made = typst.compile(
            str(path),
            root=str(path.parent),
            ignore_system_fonts=True,
            font_paths=[str(folder) for folder in fonts],
            pdf_standards=standard or [],
        )
    except typst.TypstError as error:
        found = NO_GLYPH.search(str(error))
        if found is None:
            raise
        raise _NoGlyphError(found[1]) from None
    return bytes(made)


def _refused(root: Path, fonts: list[Path], letters: str) -> str | None:
    """Some of the letters that have no shape, None where all have one."""
    path = root / "letters.typ"
    apart = " ".join(letters)  # so that none is joined with its neighbour
    head = '#set document(title: "letters")\n#set text(font: "Libertinus Serif", lang: "en")\n'
    path.write_text(f"{head}#{json.dumps(apart, ensure_ascii=False)}\n", encoding="utf-8")
    try:
        _compile(path, fonts)
    except _NoGlyphError as error:
        return str(error)
    return None


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
