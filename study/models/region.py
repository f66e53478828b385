"""A lattice that is fine in a region of interest and coarse elsewhere.

Its cells are finest around the tools, along their paths, and around the requested control points.
Away from these they double in size, so that an organ takes a tenth of the nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from study.models.lattice import LatticeModel
from study.models.lattice_assumptions import layout, springs
from study.models.model import Estimates, ModelKind
from study.models.tissue import KIND as TISSUE
from study.models.tissue import of_modulus
from study.scene import Scene


def models(scene: Scene, _: Estimates) -> Iterator[LatticeModel]:
    """The one graded lattice of the tissue's modulus."""
    make = partial(of_modulus, modulus=scene.tissue.youngs_modulus)
    yield LatticeModel(
        name="region", label="MSM region of interest", scene=scene, make=make, graded=True
    )


def assumptions(scene: Scene) -> list[str]:
    """On where cells are small, and on the springs as for every lattice."""
    (found,) = models(scene, {})
    region, edge = scene.region, found.spacing
    size = (
        f"{1e3 * region.radius:.3g} mm"
        if region.radius is not None
        else f"as far as is needed at rest under the load, with small displacements, to be within "
        f"{100 * region.tolerance:.3g} % of a lattice of the finest cells throughout"
    )
    return [
        f"The region of interest has cells of {1e3 * edge:.3g} mm around the tools and "
        f"{', '.join(region.at) or 'no other place'}, {size}; beyond, they double "
        f"{region.levels - 1} times, each size twice as far as the one before. Where sizes meet, "
        "hanging nodes follow the larger cell. The contribution of motion in time and of large "
        "displacements to the difference from the finest cells throughout is not estimated.",
        *layout(scene),
        *springs(scene),
    ]


KIND = ModelKind(
    models=models,
    assumptions=assumptions,
    follows_law=True,
    any_load=False,  # cells are coarse away from the known places
    ignored_keys=("reference", "superposition", "basafa"),
    supported_features=TISSUE.supported_features,
)
