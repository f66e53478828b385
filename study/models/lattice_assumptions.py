"""Assumptions of spring lattices, as sentences for the report."""

from __future__ import annotations

from msm.laws import stiffness_at_rest
from study.scene import Scene, SpringLaw


def layout(scene: Scene) -> list[str]:
    """On how springs fill the organ, and on what their damping acts against."""
    return [
        _layout(scene),
        "Nodal damping acts against the ground, as in the paper, and so resists rigid motion.",
    ]


def _layout(scene: Scene) -> str:
    if scene.lattice.springs == "tetrahedra":
        return (
            "Springs run along the edges of the finite-element mesh, each with k = E V / L^2, V "
            "the volume of the tetrahedra around it (Van Gelder 1998). That is the modulus E only "
            "where edge directions are isotropic: modulus, Poisson ratio and anisotropy "
            "depend on the mesh, and refinement does not correct them."
        )
    return (
        "Face diagonals have sqrt(2) times the force constants of edges, and springs on the "
        "surface have the share of the cells that they belong to; otherwise the lattice would be "
        "anisotropic and up to 38 % too stiff."
    )


def springs(scene: Scene) -> list[str]:
    """On the law of tuned springs, their calibration and their damping."""
    return [
        f"{_law(scene)}; the estimate is read as Young's modulus E. " + _calibration(scene),
        _damping(scene),
    ]


def _law(scene: Scene) -> str:
    law = scene.lattice.law
    if law is None:
        return "The fuzzy-tuned springs are linear, eq. (1)"
    before, after = stiffness_at_rest(law.make(1.0))
    return (
        f"The fuzzy-tuned springs follow {_named(law)}, from the stiffness of the estimate: at "
        f"rest they have {after:g} times that in tension and {before:g} times that in compression"
    )


def _named(law: SpringLaw) -> str:
    """A law described by its support points, or by its constants."""
    points = [len(value) for value in law.parameters.values() if isinstance(value, tuple)]
    if points:
        return f"{points[0]} points of the scene, which the paper does not have"
    numbers = " and ".join(f"{key} = {value:g}" for key, value in law.parameters.items())
    return f"the law {law.kind} of the scene" + (f" with {numbers}" if numbers else "")


def _damping(scene: Scene) -> str:
    damping = scene.damping
    if damping.kind == "eq-2":
        return (
            f"Damping by eq. (2) with w = sqrt(k/m), zeta = {damping.ratio:g}, k and m taken at "
            "the reference spacing."
        )
    return (
        f"Rayleigh damping C = alpha M + beta K with alpha = {damping.mass:g} 1/s and beta = "
        f"{damping.stiffness:g} s in place of eq. (2), K each model's own stiffness, support "
        "included; the part beta K is a dashpot on each spring, cell and foundation and does not "
        "damp rigid motion of the body itself."
    )


def _calibration(scene: Scene) -> str:
    if scene.lattice.springs == "tetrahedra":
        return "There is no volume term, as in the paper."
    if not scene.lattice.volume_term:
        return (
            "k = 0.4 E h is the calibration of the cubic lattice, whose Poisson ratio is 1/4; "
            "there is no volume term, as in the paper."
        )
    return (
        "Springs of k = mu h represent the shear modulus mu; an energy of the volume of each cell, "
        "1/2 kappa V (J - 1)^2 with kappa = lambda - mu, which the paper does not have, the rest; "
        f"the Poisson ratio is the tissue's {scene.tissue.poisson_ratio:g}."
    )
