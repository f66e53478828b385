"""Mean deformation of cubic cells, compiled: gradients and inversion."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from msm.kernel import inner_kernel, kernel

Floats = NDArray[np.float64]

X, Y, Z = (cast("int", axis) for axis in np.arange(3))
"""Components. For literal integers numba would compile the callee once per value."""


@inner_kernel()
def gradient_of(cell: Any, u: Floats, d: int, to_gradient: float) -> tuple[float, float, float]:
    """Mean gradient over a cell of component d of u; corners as in msm.lattice.CORNERS."""
    u0, u1, u2, u3 = u[cell[0], d], u[cell[1], d], u[cell[2], d], u[cell[3], d]
    u4, u5, u6, u7 = u[cell[4], d], u[cell[5], d], u[cell[6], d], u[cell[7], d]
    return slopes(u0, u1, u2, u3, u4, u5, u6, u7, to_gradient)  # type: ignore[no-any-return] # numpy scalars


@inner_kernel()
def slopes(
    u0: Any, u1: Any, u2: Any, u3: Any, u4: Any, u5: Any, u6: Any, u7: Any, to_gradient: float
) -> Any:
    """Mean gradient over a cell of a field with these values at its corners."""
    u01, u23, u45, u67 = u0 + u1, u2 + u3, u4 + u5, u6 + u7
    x = u45 + u67 - u01 - u23
    y = u23 + u67 - u01 - u45
    z = u1 - u0 + u3 - u2 + u5 - u4 + u7 - u6
    return to_gradient * x, to_gradient * y, to_gradient * z


@inner_kernel()
def deformation(cell: Any, spacing: float, u: Floats) -> Any:
    """Rows of the mean deformation gradient F of a cell."""
    to_gradient = 0.25 / spacing
    xx, xy, xz = gradient_of(cell, u, X, to_gradient)
    yx, yy, yz = gradient_of(cell, u, Y, to_gradient)
    zx, zy, zz = gradient_of(cell, u, Z, to_gradient)
    return (xx + 1.0, xy, xz), (yx, yy + 1.0, yz), (zx, zy, zz + 1.0)


@inner_kernel()
def cross(a: Any, b: Any) -> Any:
    """Vector product of two rows."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner_kernel()
def dot(a: Any, b: Any) -> Any:
    """Scalar product of two rows."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel(makes_arrays=False)
def inverted_cells(cells: NDArray[np.int64], edges: Floats, u: Floats) -> int:
    """Number of cells (c, 8) that u [m] (n, 3) inverts: J <= 0 of the mean F.

    `edges` [m] (c,): edge lengths of the cells.
    """
    count = 0
    for c in range(cells.shape[0]):
        f, g, h = deformation(cells[c], edges[c], u)
        count += 0 if dot(f, cross(g, h)) > 0.0 else 1
    return count
