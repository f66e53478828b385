"""`export`: the problem for another code."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import Overrides


def export(
    target: str,
    *,
    to: str,
    out: Path | None = None,
    set_: Overrides = None,
) -> None:
    """Export the finite-element problem or the lattices of a scene or of results to other codes.

    Parameters
    ----------
    target
        A built-in scene, a TOML file, or a results folder.
    to
        calculix (input decks, and this study's displacement to compare with), vtu (for ParaView),
        lattice (arrays, a stepper in NumPy, scenes for SOFA), or for the mesh alone gmsh, medit or
        nastran.
    out
        Folder to write; export in the results folder, or NAME-export here, by default.
    set_
        Override of a scene value, table.key=value. May be repeated.
    """
    from study.handover.export import ExportRequest
    from study.handover.export import export as write
    from study.system.progress import on_stderr

    with on_stderr() as progress:
        folder = write(ExportRequest(target=target, to=to, out=out, overrides=set_ or ()), progress)
    print(folder)
