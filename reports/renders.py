"""Pictures of coloured surfaces: by VTK in a child process, or flat by matplotlib.

VTK may crash where OpenGL is missing, so it runs in a process of its own, first as it is set up,
then with each of the windows that need no screen. What drew the pictures is part of the report.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from threading import Event

import numpy as np
from numpy.typing import NDArray

from reports.camera import Camera

Floats = NDArray[np.float64]
Pixels = NDArray[np.uint8]

CHILD = Path(__file__).with_name("render_child.py")
WINDOW_VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
WINDOWS = (None, "vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
TIMEOUT = 60.0
"""Longest time [s] of one attempt."""
LOOK = 0.05
"""Seconds between two looks at whether a child has ended."""
WIDTH = 640
"""Width of a picture [pixel]."""


@dataclass(frozen=True)
class Job:
    """Surfaces to draw: `points` [m] (k, s, 3), `colours` (k, s, 3), `triangles` (t, 3)."""

    points: Floats
    colours: Pixels
    triangles: NDArray[np.int64]
    camera: Camera


@dataclass(frozen=True)
class Pictures:
    """Rendered surfaces: `pixels` (k, height, width, 3), or None where drawn flat."""

    renderer: str
    pixels: Pixels | None


FLAT = Pictures("matplotlib (flat triangles; VTK could not render here)", None)


def render(job: Job, unwanted: Event | None = None) -> Pictures:
    """Render a job in a child process, or say that it has to be drawn flat.

    Once the pictures are `unwanted` the child is killed.
    """
    unwanted = unwanted or Event()
    with tempfile.TemporaryDirectory(prefix="liver-study-") as folder:
        source, target = Path(folder) / "job.npz", Path(folder) / "pictures.npz"
        _write(job, source)
        for window in WINDOWS:
            if not unwanted.is_set() and _attempt(source, target, window, unwanted):
                with np.load(target, allow_pickle=False) as found:
                    return Pictures(f"VTK, {found['renderer']}", found["pixels"])
    return FLAT


def _write(job: Job, path: Path) -> None:
    camera = job.camera
    height = round(WIDTH * camera.half_height / camera.half_width)
    np.savez(
        path,
        points=job.points,
        colours=job.colours,
        triangles=job.triangles,
        window_size=np.array([WIDTH, max(height, 1)]),
        view=np.stack([camera.centre, camera.toward, camera.up]),
        half_height=np.array(camera.half_height),
    )


def _attempt(source: Path, target: Path, window: str | None, unwanted: Event) -> bool:
    """Whether a child drew the pictures; one that crashes or hangs did not."""
    environment = dict(os.environ)
    if window is not None:
        environment[WINDOW_VARIABLE] = window
    command = [sys.executable, "-P", str(CHILD), str(source), str(target)]
    try:
        child = subprocess.Popen(  # noqa: S603 - our own program and files
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
    except OSError:
        return False
    end = time.monotonic() + TIMEOUT
    while child.poll() is None:
        if unwanted.wait(LOOK) or time.monotonic() > end:
            child.kill()
            child.wait()
    return child.returncode == 0 and target.is_file()
