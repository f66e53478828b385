"""The benchmark of Basafa and Farahmand as printed in the paper: eqs. (5)-(9) and Table II."""

from __future__ import annotations

from collections.abc import Iterator

from msm.damping import eq_9
from msm.lattice import LatticeMesh
from msm.laws import Basafa
from msm.model import Material
from study.models.control_point import PointSpring, SpringDashpot
from study.models.damping import reference_mass
from study.models.lattice import SUPPORTED_FEATURES, LatticeModel, SpringMaterial
from study.models.lattice_assumptions import layout
from study.models.model import Estimates, ModelKind
from study.problem.problem import PointProblem
from study.scene import Scene

NAME, LABEL = "basafa", "Basafa benchmark"


def models(scene: Scene, _: Estimates) -> Iterator[LatticeModel]:
    """The one lattice of Table II, whose stiffness is its own and not the tissue's."""
    yield LatticeModel(name=NAME, label=LABEL, scene=scene, make=_springs)


def on_point(scene: Scene, _: Estimates) -> Iterator[PointSpring]:
    """Eq. (6) on a spring as long as the reference spacing."""

    def make(problem: PointProblem) -> SpringDashpot:
        h_0, table = problem.rest_length, scene.basafa
        law = Basafa(table.k1 / h_0, table.k2 / h_0, table.x_c)
        return SpringDashpot(law, eq_9(table.gamma_0, table.gamma_1, problem.mass))

    yield PointSpring(name=NAME, label=LABEL, make=make)


def _springs(scene: Scene, mesh: LatticeMesh) -> SpringMaterial:
    """Scale Table II from the reference spacing h_0 to the lattice's spacing h.

    K (h / h_0)^2 preserves the modulus 2.5 K_1 / h_0^2, gamma (h / h_0)^3 the damping per mass.
    """
    h, h_0, table = mesh.spacing, scene.damping.reference_spacing, scene.basafa
    per_length = (h / h_0) ** 2 / h
    law = Basafa(table.k1 * per_length, table.k2 * per_length, table.x_c)
    damping = eq_9(table.gamma_0, table.gamma_1, reference_mass(scene))
    return SpringMaterial(modulus(scene), Material(law, damping=damping))


def modulus(scene: Scene) -> float:
    """Young's modulus [Pa] at small strain, from K_1 and the reference spacing."""
    return 2.5 * scene.basafa.k1 / scene.damping.reference_spacing**2


def assumptions(scene: Scene) -> list[str]:
    """On the law, its units and its scaling."""
    h_0 = scene.damping.reference_spacing
    return [
        *([] if scene.is_point else layout(scene)),
        "The benchmark is the law as the paper prints it in eqs. (5)-(9) and Table II; the article "
        "of Basafa and Farahmand was not reproduced.",
        "X in eq. (6) is the strain (L - L_0) / L_0: only so are the units of Table II consistent.",
        "A and B of eq. (7) are taken at X_c, which makes force and slope continuous there.",
        f"Table II holds at the reference spacing h_0 = {1e3 * h_0:.3g} mm; K_1 and K_2 scale with "
        "(h/h_0)^2 and gamma_0 and gamma_1 with (h/h_0)^3, so that refining the lattice does not "
        "change the material.",
        "With h_0 the benchmark's small-strain modulus is 2.5 K_1 / h_0^2 = "
        f"{modulus(scene) / 1e3:.2f} kPa: a consequence of the choice of h_0, not evidence for "
        "the benchmark.",
    ]


KIND = ModelKind(
    models=models,
    on_point=on_point,
    assumptions=assumptions,
    is_reference=True,
    ignored_keys=("reference", "superposition"),
    supported_features=SUPPORTED_FEATURES,
)
