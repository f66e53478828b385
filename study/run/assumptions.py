"""The readings adopted where the paper is silent or cannot be taken literally, as sentences."""

from __future__ import annotations

from fuzzy.assumptions import assumptions as fuzzy_assumptions
from msm.laws import stiffness_at_rest
from study.run.estimates import settings
from study.run.outcome import Outcome
from study.scene import Scene, SpringLaw


def assumptions(scene: Scene, outcome: Outcome) -> list[str]:
    """Every reading in force in a scene, one sentence each."""
    found = _benchmark(scene) if "basafa" in scene.models else []
    point = outcome.extra.get("control_point")
    found += _point(scene, point["mass_kg"]) if point else _organ(scene)
    if "msm" in scene.models:
        found += _springs(scene)
        found += fuzzy_assumptions(settings(scene))
    return [*found, *_similarity()]


def _benchmark(scene: Scene) -> list[str]:
    h_0, table = scene.damping.reference_spacing, scene.basafa
    modulus = 2.5 * table.k1 / h_0**2
    return [
        "The benchmark is the law as the paper prints it in eqs. (5)-(9) and Table II; the article "
        "of Basafa and Farahmand was not reproduced.",
        "X in eq. (6) is the strain (L - L_0) / L_0: only so are the units of Table II consistent.",
        "A and B of eq. (7) are taken at X_c, which makes force and slope continuous there.",
        f"Table II holds at the reference spacing h_0 = {1e3 * h_0:.3g} mm; K_1 and K_2 scale with "
        "(h/h_0)^2 and gamma_0 and gamma_1 with (h/h_0)^3, so that refining the lattice does not "
        "change the material.",
        f"With h_0 the benchmark's small-strain modulus is 2.5 K_1 / h_0^2 = {modulus / 1e3:.2f} "
        "kPa: a consequence of the choice of h_0, not evidence for the benchmark.",
    ]


def _point(scene: Scene, mass: float) -> list[str]:
    source = (
        "declared in the scene"
        if scene.organ.mass is not None
        else f"that for which eq. (2) at zeta = {scene.damping.ratio:g} with the benchmark's "
        "stiffness at rest meets gamma_0"
    )
    return [
        f"The control mass point weighs {mass:.4g} kg, {source}; the paper gives no mass.",
        f"Its one spring is as long as the reference spacing, "
        f"{1e3 * scene.damping.reference_spacing:.3g} mm.",
        f"Load ({scene.tool.force:g} N, {scene.tool.history.kind}) and time span are scene "
        "parameters; the paper gives none.",
    ]


def _organ(scene: Scene) -> list[str]:
    found = [
        "Organ, support, tool, load history and time span are scene parameters; the paper gives "
        "none.",
        f"The organ rests on an elastic foundation of {scene.support.stiffness:.3g} Pa/m over its "
        f"{scene.support.side} surface, the same field for every model and mesh, and so is the "
        "tool's traction.",
        "There is no gravity: the shape given is the shape at rest.",
    ]
    if set(scene.models) & {"basafa", "msm"}:
        found.append(_layout(scene))
        found.append(
            "Nodal damping acts against the ground, as in the paper, and so resists rigid motion."
        )
    if "fem" in scene.models:
        damping = (
            "the mass-proportional damping of eq. (2) at the reference modulus"
            if scene.damping.kind == "eq-2"
            else "the Rayleigh damping of the fuzzy-tuned models"
        )
        found.append(
            f"The finite-element reference is linear in strain and has {damping}. Comparison with "
            "it is code to code, not validation against an experiment."
        )
    return found


def _layout(scene: Scene) -> str:
    if scene.lattice.springs == "tetrahedra":
        return (
            "Springs run along the edges of the finite-element mesh, each with k = E V / L^2, V "
            "the volume of the tetrahedra round it (Van Gelder 1998). That is the modulus E only "
            "where edges point evenly in all directions: modulus, Poisson ratio and anisotropy "
            "are those of the mesh, and refining it does not cure them."
        )
    return (
        "Face diagonals have sqrt(2) times the force constants of edges, and springs on the "
        "surface carry the share of the cells they belong to; otherwise the lattice would be "
        "anisotropic and up to 38 % too stiff."
    )


def _springs(scene: Scene) -> list[str]:
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
    """A law as the points it goes through, or else as its numbers."""
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
        "included; the part beta K is a dashpot on each spring, cell and foundation and leaves "
        "rigid motion of the body itself free."
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
        "Springs of k = mu h carry the shear modulus mu, and one energy per cell in its volume, "
        "1/2 kappa V (J - 1)^2 with kappa = lambda - mu, which the paper does not have, the rest; "
        f"the Poisson ratio is the tissue's {scene.tissue.poisson_ratio:g}."
    )


def _similarity() -> list[str]:
    return [
        "The paper's similarity measure is unknown, so its Table III cannot be reproduced as a "
        "number; the measures here are stated with their formulas.",
        "Curves are the components along the tool's push.",
    ]
