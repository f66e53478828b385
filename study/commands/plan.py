"""`plan`: what of a scene would be modelled, and why, before anything heavy runs."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import Overrides


def plan(scene: str = "liver", *, set_: Overrides = None, out: Path | None = None) -> None:
    """Say what of a scene is modelled for what it requires, what is left out, and why.

    A few seconds are spent on coarse lattices and coarse finite elements at rest. What a scene
    requires stands in its table `require`; `run` follows the same plan.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    set_
        Override of the scene, table.key=value, for example require.error="2 %".
    out
        Scene file to write, with the models and settings that were chosen.
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
