"""`fit`: quantities of a scene by a measured curve."""

from __future__ import annotations

from pathlib import Path

from study.commands.flags import AsJson, Overrides


def fit(
    scene: str,
    *,
    curve: Path,
    free: list[str],
    model: str = "fem",
    probe: str | None = None,
    out: Path | None = None,
    overrides: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Fit quantities of a scene to a measured curve, and say how well it determines them.

    Least squares by a model's motion. Refused, with exit code 2, if the curve leaves a quantity
    open.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    curve
        Measured curve (CSV): time_s and displacement_m or force_N, and uncertainty if it is known.
    free
        Quantity to fit, for example tissue.youngs_modulus. May be repeated.
    model
        Model of the scene that the curve is fitted with: fem, tissue or another of its models.
    probe
        Control point that a curve of displacement is of; by default the one nearest to the tool.
    out
        Folder to write the fitted curve (fit.csv) and its picture (fit.svg, fit.pdf) into.
    overrides
        Override of the scene, for example tool.force="2 N". May be repeated.
    as_json
        Print JSON instead of lines.
    """
    from study.scene.file import read_scene
    from study.system.folders import refuse_unwritable
    from study.system.progress import on_stderr
    from study.validation import fit_table, fitting
    from study.validation.user_data import read_curve

    if out is not None:
        refuse_unwritable(out, lambda _: None, "fit")
    measured, posed = read_curve(curve), read_scene(scene, overrides or ())
    with on_stderr() as progress:
        found = fitting.fit(posed, measured, free, model, progress, probe)
    print(fit_table.as_json(found) if as_json else "\n".join(fit_table.lines(found)))
    if out is not None:
        from reports.fit_figure import write_figure

        fit_table.write(found, out / fit_table.NAME)
        if not as_json:
            print("\n".join(map(str, [out / fit_table.NAME, *write_figure(out)])))
        else:
            write_figure(out)
