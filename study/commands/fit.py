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
    """Identify parameters of a scene from a measured curve, with confidence intervals.

    Nonlinear least squares on the motion of a model. Exit code 2 if the curve does not determine
    a parameter.

    Parameters
    ----------
    scene
        A built-in scene or a TOML file.
    curve
        Measured curve (CSV): time_s and displacement_m or force_N, and uncertainty if it is known.
    free
        Parameter to fit, for example tissue.youngs_modulus. May be repeated.
    model
        Model used for the fit: fem, tissue or another model of the scene.
    probe
        Control point of a displacement curve; by default the one nearest to the tool.
    out
        Folder for the fitted curve (fit.csv) and its plot (fit.svg, fit.pdf).
    overrides
        Override of a scene value, for example tool.force="2 N". May be repeated.
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
