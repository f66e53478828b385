"""The damping of a scene, as each of its models applies it."""

from __future__ import annotations

from msm.calibration import SPRING_POISSON_RATIO, reference_stiffness
from msm.damping import NodalDamping, eq_2
from study.problem.damping import RayleighDamping
from study.scene import Scene


def reference_damping(scene: Scene) -> RayleighDamping:
    """Damping of the finite elements: Rayleigh's, or eq. (2) at their modulus."""
    found = nodal_damping(scene, scene.tissue.youngs_modulus)
    return RayleighDamping(found.gamma_0, found.beta)


def nodal_damping(scene: Scene, modulus: float) -> NodalDamping:
    """Rayleigh's damping, or eq. (2) for springs of a modulus [Pa].

    Eq. (2) is evaluated for a node at the reference spacing, so that it does not depend on h.
    """
    if scene.damping.kind == "rayleigh":
        return NodalDamping(scene.damping.mass, beta=scene.damping.stiffness)
    k = reference_stiffness(modulus, scene.damping.reference_spacing, lattice_poisson_ratio(scene))
    return eq_2(scene.damping.ratio, k, reference_mass(scene))


def lattice_poisson_ratio(scene: Scene) -> float:
    """Poisson ratio of the tuned lattices: the tissue's with a volume term, else 1/4."""
    return scene.tissue.poisson_ratio if scene.lattice.volume_term else SPRING_POISSON_RATIO


def reference_mass(scene: Scene) -> float:
    """Mass [kg] of an inner node at the reference spacing."""
    return float(scene.tissue.density * scene.damping.reference_spacing**3)
