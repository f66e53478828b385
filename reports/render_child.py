"""Draw a job of `reports.renders` with VTK; run as a program, by itself, because VTK may crash."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

SHADING = {"ambient": 0.45, "diffuse": 0.6, "specular": 0.0}
DISTANCE = 10.0
"""Distance of the eye in heights of the picture; only clipping depends on it."""


def main(source: str, target: str) -> None:
    """Read the job file, draw each surface and write pixels and the renderer's name."""
    with np.load(source, allow_pickle=False) as file:
        job = dict(file.items())
    plotter = pv.Plotter(off_screen=True, window_size=[int(n) for n in job["window_size"]])
    plotter.set_background("white")
    _place_camera(plotter, job["view"], float(job["half_height"]))
    pixels = [
        _draw(plotter, points, colours, job["triangles"])
        for points, colours in zip(job["points"], job["colours"], strict=True)
    ]
    np.savez(target, pixels=np.stack(pixels), renderer=np.array(_renderer(plotter)))


def _place_camera(plotter: Any, view: NDArray[np.float64], half_height: float) -> None:
    centre, toward, up = view
    camera = plotter.camera
    camera.focal_point = centre
    camera.position = centre + DISTANCE * half_height * toward
    camera.up = up
    camera.parallel_projection = True
    camera.parallel_scale = half_height


def _draw(
    plotter: Any,
    points: NDArray[np.float64],
    colours: NDArray[np.uint8],
    triangles: NDArray[np.int64],
) -> NDArray[np.uint8]:
    surface = pv.PolyData.from_regular_faces(points, triangles)
    surface["colours"] = colours
    look = {"show_edges": True, "edge_color": "#303030", "edge_opacity": 0.18} | SHADING
    quietly = {"reset_camera": False, "render": False}  # each change would be rendered
    actor = plotter.add_mesh(surface, scalars="colours", rgb=True, **quietly, **look)
    plotter.reset_camera_clipping_range()
    plotter.render()
    pixels = np.array(plotter.screenshot(return_img=True))
    plotter.remove_actor(actor, render=False)
    return pixels


def _renderer(plotter: Any) -> str:
    """Class of the render window and the device that OpenGL reports."""
    window = plotter.render_window
    lines = window.ReportCapabilities().splitlines()
    device = [line.split(":", 1)[1].strip() for line in lines if "renderer string" in line]
    return ", ".join([str(window.GetClassName()), *device[:1]])


if __name__ == "__main__":
    main(*sys.argv[1:])
