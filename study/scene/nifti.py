"""NIfTI images: their voxels, and where those are in the patient."""

from __future__ import annotations

import zlib
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MILLIMETRES = {"unknown": 1.0, "mm": 1.0, "meter": 1e3, "micron": 1e-3}
"""Units of space that an image may be in, of which it may leave out that of its affine."""
APART = 0.5
"""Largest distance between two places of one voxel, over its shortest edge."""


def read_image(path: Path) -> tuple[Floats, Floats]:
    """Voxels (i, j, k), and the affine (4, 4) that takes their numbers to millimetres in RAS.

    ValueError naming the file for one that is no image of a single volume of numbers, or that says
    not where it is, or two places.
    """
    try:
        import nibabel
        from nibabel.filebasedimages import ImageFileError
        from nibabel.spatialimages import HeaderDataError
    except ImportError:
        raise ValueError(
            "tissue.stiffness_map: needs nibabel, which is not installed; install "
            "liver-study[images]"
        ) from None
    damaged = (ImageFileError, HeaderDataError, OSError, EOFError, zlib.error)
    wrong = (ValueError, KeyError, OverflowError, MemoryError)  # numbers of a header
    try:
        image: Any = nibabel.load(path, mmap=False)
        if not isinstance(image, nibabel.Nifti1Pair):
            raise ImageFileError("another format, which may not state where its voxels are")
        frames = _frames(image)
        kind = image.get_data_dtype()
        voxels = np.asarray(image.dataobj) if kind.kind in "biuf" else np.empty(0)
    except FileNotFoundError:
        raise _fault(path, "no such file") from None
    except (*damaged, *wrong) as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise _fault(
            path, f"is no NIfTI image ({said}); name a whole .nii or .nii.gz file"
        ) from error
    if kind.kind not in "biuf":
        what = "complex numbers" if kind.kind == "c" else f"no numbers ({kind})"
        raise _fault(path, f"holds {what}; give a modulus, such as the storage modulus")
    volume = voxels.shape[:3]
    if len(volume) < 3 or voxels.size != np.prod(volume):
        raise _fault(path, f"has {voxels.ndim} axes of {voxels.shape}; give one volume")
    return voxels.reshape(volume).astype(np.float64), _frame(path, frames, volume)


def _frames(image: Any) -> list[Floats]:
    """The affines (4, 4) [mm] that the header states: sform, then qform, of which both may lack."""
    scale = np.diag([*[MILLIMETRES[image.header.get_xyzt_units()[0]]] * 3, 1.0])
    found = (image.get_sform(coded=True)[0], image.get_qform(coded=True)[0])
    return [scale @ np.asarray(one, dtype=float) for one in found if one is not None]


def _frame(path: Path, frames: list[Floats], volume: tuple[int, ...]) -> Floats:
    """The affine of an image. ValueError where it has none, or two that put it elsewhere."""
    if not frames:
        raise _fault(
            path, "says not where its voxels are: qform_code and sform_code are 0; write an affine"
        )
    for one in frames:
        if not np.isfinite(one).all() or abs(np.linalg.det(one[:3, :3])) < 1e-12:
            raise _fault(path, "has no usable affine; write one")
    corners = np.array([[*corner, 1.0] for corner in product(*((-0.5, n - 0.5) for n in volume))])
    apart = np.linalg.norm(corners @ (frames[0] - frames[-1]).T, axis=1).max()
    edge = np.linalg.norm(frames[0][:3, :3], axis=0).min()
    if apart > APART * edge:
        raise _fault(
            path,
            f"has two places: its sform and its qform are up to {apart:.3g} mm apart; keep the one "
            "of the frame that the organ's mesh lies in, and set the code of the other to 0",
        )
    return frames[0]


def _fault(path: Path, what: str) -> ValueError:
    return ValueError(f"tissue.stiffness_map.file: {path}: {what}")
