"""`report`: the PDF and the page of a results folder or a bundle, made again; or the reference."""

from __future__ import annotations

import os
import sys
from contextlib import nullcontext
from pathlib import Path

from study.commands.flags import EXIT_FAILED_CHECK, Switch


def report(
    target: Path | None = None,
    *,
    html: bool = True,
    out: Path | None = None,
    reference: Switch = False,
    fresh: Switch = False,
) -> None:
    """Rebuild report.pdf and report.html from a results folder or a bundle, without simulating.

    Figures drawn before from the same results are taken from the user's store, except for a
    bundle: its figures are drawn again, and the exit code is 1 if its reports change by a byte.

    Parameters
    ----------
    target
        Results folder of an earlier run, or an archive of liver-study bundle.
    html
        Whether to make report.html.
    out
        Folder to unpack a bundle into, by default its name without the ending, in the current
        folder; with --reference the file to write, by default liver-study-reference.pdf.
    reference
        Make the document of all measurements beforehand instead: benchmarks, verification,
        validation, trade-off, stability and ranking.
    fresh
        Draw all figures again.
    """
    if reference:
        for flag, given in (("--no-html", not html), ("--fresh", fresh)):
            if given:
                raise ValueError(f"{flag}: has no effect with --reference; leave it out")
        _reference(target, out)
        return
    if target is None:
        raise ValueError("report: give a results folder or a bundle, or --reference")
    from reports.bundle import is_archive

    if is_archive(target):
        if fresh:
            raise ValueError("--fresh: the figures of a bundle are always drawn anew; leave it out")
        _of_bundle(target, out or Path(target.stem), html=html)
        return
    if out is not None:
        raise ValueError("--out: is for a bundle; the reports of a folder are made in it")
    from study.stages.cached_arrays import using_store
    from study.stages.store import user_store

    with using_store(user_store(), readable=not fresh):
        made = _of_folder(target, html=html)
    print("\n".join(str(path) for path in made))


def _reference(target: Path | None, out: Path | None) -> None:
    from reports.measured import NAME, make_measured
    from study.system.folders import check_file

    if target is not None:
        raise ValueError(f"--reference: describes no run; omit {target}")
    path = out or Path(NAME)
    check_file(path)
    make_measured(path)
    print(path)


def _of_folder(folder: Path, *, html: bool) -> list[Path]:
    from study.system.folders import claimed

    # Where its parent may not be written the folder cannot be replaced meanwhile, nor locked.
    free = os.access(folder.absolute().parent, os.W_OK)
    with claimed(folder) if free else nullcontext():
        return make(folder, report=True, page=html)


def _of_bundle(archive: Path, folder: Path, *, html: bool) -> None:
    """Unpack, make, and say whether the bytes are those of the archive."""
    from reports.bundle import changed, unpack

    unpacked = unpack(archive, folder)
    made = _of_folder(folder, html=html)
    other = changed(unpacked, made)
    for path in made:
        known = path.name in unpacked.reports
        told = "other bytes than" if path.name in other else "the same bytes as"
        print(f"{path}: {told} in {archive}" if known else f"{path}: not in {archive}")
    if other:
        print(
            "liver-study: other versions or another renderer made them; compare "
            "environment/installed.txt of the archive",
            file=sys.stderr,
        )
        sys.exit(EXIT_FAILED_CHECK)


def make(folder: Path, *, report: bool, page: bool) -> list[Path]:
    """Make the requested reports of a results folder and return their paths.

    Without plotly there is no HTML page, which a message says. ResultsError for an unusable folder.
    """
    made = []
    if report:
        from reports.report import NAME, make_report

        make_report(folder)
        made.append(folder / NAME)
    if page:
        from reports.page import write
        from study.system.folders import tell

        if write.is_drawable():
            write.make_page(folder)
            made.append(folder / write.NAME)
        else:
            tell(write.MISSING)
    return made
