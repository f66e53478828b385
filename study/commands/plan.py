"""`plan`: what of a scene would be modelled, and why, before anything heavy runs."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import Overrides


def plan(scene: str = "liver", *, set_: Overrides = None, out: Path | None = None) -> None:
    """Select the cheapest model that meets the requirements of a scene, with the reasons.

    The requirements are the table `require` of the scene. The plan also lists what is left out; it
    takes a few seconds for coarse lattices and coarse finite elements at rest. `run` follows it.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    set_
        Override of a scene value, table.key=value, for example require.error="2 %".
    out
        Scene file to write, with the selected models and settings.
    """
    from study.plan import plan as planning
    from study.run.suiting import read_suited
    from study.scene.file import write_scene
    from study.system.folders import check_file, write_text

    given = read_suited(scene, set_ or ())
    if out is not None:
        check_file(out)
    found = planning.plan(given)
    print("\n".join(planning.lines(found)))
    if out is not None:
        write_text(out, write_scene(found.scene))
        print(f"scene in {out}")
