"""Spring laws, Rayleigh damping and springs on tetrahedra as a scene asks for them."""

import dataclasses

import numpy as np
import pytest

from msm import model
from msm.checkpoint import Checkpoint
from msm.damping import NodalDamping
from msm.laws import Hooke, Piecewise, initial_stiffness
from msm.model import Automatic, Fixed, Material, critical_time_step, static_displacement
from study.mesh.tetrahedra import edges, mean_edge
from study.models import table
from study.models.damping import nodal_damping, reference_damping
from study.models.estimates import estimates
from study.models.lattice_assembly import assembled
from study.models.model import SILENT
from study.models.tissue import elastic, of_modulus
from study.problem.damping import RayleighDamping
from study.run.assumptions import assumptions
from study.run.check import describe_scene
from study.run.dimensionless import dimensionless
from study.scene.file import read_scene, write_scene
from study.scene.problem import problem_of
from tests.conftest import SMALL

E = 9.5e3
STIFFENING = "lattice.law={strain=[-0.3, 0, 0.01, 0.1], relative_tension=[-0.3, 0, 0.01, 0.6]}"
SOFT_BELOW = "lattice.law={strain=[-0.2, 0, 0.2], relative_tension=[-0.1, 0, 0.2]}"
RAYLEIGH = ("damping.kind=rayleigh", "damping.mass=30", "damping.stiffness=0.5 ms")
TETRAHEDRA = "lattice.springs=tetrahedra"
OPTIONS = {
    "law": (STIFFENING,),
    "law and volume term": (STIFFENING, "lattice.volume_term=true"),
    "rayleigh": RAYLEIGH,
    "tetrahedra": (TETRAHEDRA,),
    "all": (SOFT_BELOW, *RAYLEIGH, TETRAHEDRA, "lattice.geometry=linear"),
}


def scene_with(*overrides):
    alone = ('models=["msm"]', 'fuzzy.systems=["sugeno"]', "fuzzy.sensitivity_readings=0")
    return read_scene("block", (*SMALL, *alone, *overrides))


def posed_with(*overrides):
    scene = scene_with(*overrides)
    posed = problem_of(scene)
    return scene, posed, assembled(posed, scene.lattice)


def tuned(scene, mesh, modulus):
    """Springs of the fuzzy-tuned models for an estimate."""
    return of_modulus(scene, mesh, modulus=modulus)


def benchmark(scene, mesh):
    """Springs of the benchmark."""
    return table.model(scene, "basafa").make(scene, mesh)


def motion(posed, assembly, material, **options):
    return model.run(assembly, material, posed.factor, posed.observation, **options)


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_a_scene_with_the_option_reads_back_unchanged(options, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(write_scene(scene_with(*options)), encoding="utf-8")
    assert read_scene(str(path)) == scene_with(*options)


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_a_scene_with_the_option_runs_and_is_described(options, small_posed):
    """The numbers that do not depend on it stay; every check of the lattice passes."""
    scene = scene_with(*options)
    assembly = assembled(small_posed, scene.lattice)
    contender = tuned(scene, assembly.lattice, E)
    found = motion(small_posed, assembly, contender.material)
    assert found.trajectory.status == "finished"
    assert found.trajectory.displacement[:, 0, 2].min() < -1e-5
    assert found.inverted_cells == 0
    assert assembly.mass.sum() == pytest.approx(1054 * 0.06 * 0.04 * 0.03, rel=1e-9)
    assert assembly.load.sum(axis=0) == pytest.approx([0.0, 0.0, -0.05], abs=1e-12)


def test_without_options_there_is_no_law_no_stiffness_part_and_a_cubic_lattice(
    small_scene, small_posed
):
    assembly = assembled(small_posed, small_scene.lattice)
    contender = tuned(small_scene, assembly.lattice, E)
    assert contender.material.law == Hooke(0.4 * E * 0.01)
    assert contender.modulus == E
    assert contender.material.damping.beta == 0.0
    assert assembly.lattice.cells.shape[1] == 8
    assert reference_damping(small_scene) == RayleighDamping(
        nodal_damping(small_scene, E).gamma_0, 0.0
    )


# Spring laws


def test_a_law_scales_with_the_estimate():
    scene, _, assembly = posed_with(STIFFENING)
    laws = [tuned(scene, assembly.lattice, f * E).material.law for f in (1, 3)]
    k = 0.4 * E * 0.01
    assert laws[0].tensions == pytest.approx(k * np.array([-0.3, 0, 0.01, 0.6]))
    assert laws[1].tensions == pytest.approx(3 * laws[0].tensions)
    assert not isinstance(benchmark(scene, assembly.lattice).material.law, Piecewise)


@pytest.mark.parametrize(
    ("law", "same"),
    [
        ("{strain=[-0.1, 0, 0.1], relative_tension=[-0.1, 0, 0.1]}", True),
        ("{strain=[-0.1, 0, 0.1], relative_tension=[-0.101, 0, 0.101]}", False),
    ],
)
def test_tension_equal_to_strain_is_the_linear_spring(law, same):
    """Rounding over 700 steps; negative control: 1 % stiffer springs are seen."""
    scene, posed, assembly = posed_with(f"lattice.law={law}")
    found = [
        motion(posed, assembly, tuned(s, assembly.lattice, E).material)
        for s in (scene, scene_with())
    ]
    a, b = (run.trajectory.displacement for run in found)
    assert (np.abs(a - b).max() < 1e-9 * np.abs(b).max()) == same


def test_a_law_twice_as_stiff_is_the_linear_spring_of_twice_the_modulus():
    scene, _, assembly = posed_with("lattice.law={strain=[0, 1], relative_tension=[0, 2]}")
    doubled = tuned(scene, assembly.lattice, E)
    plain = tuned(scene_with(), assembly.lattice, 2 * E)
    assert doubled.modulus == pytest.approx(2 * E, rel=1e-12)
    assert initial_stiffness(doubled.material.law) == pytest.approx(plain.material.law.k)
    rest = [static_displacement(assembly, c.material) for c in (doubled, plain)]
    assert rest[0] == pytest.approx(rest[1], rel=1e-9)


def test_stiffening_is_felt_under_load_and_shortens_the_step():
    """Strains of 5 % and more lie on the steep piece, six times as stiff.

    The support is soft, so that the springs set the step.
    """
    heavy = ("tool.force=0.5 N", "support.stiffness=1 MPa/m")
    scene, posed, assembly = posed_with(STIFFENING, *heavy)
    stiff, linear = (
        motion(posed, assembly, tuned(s, assembly.lattice, E).material)
        for s in (scene, scene_with(*heavy))
    )
    depth = [-run.trajectory.displacement[:, 0, 2].min() for run in (stiff, linear)]
    assert linear.largest_strain > 0.05
    assert depth[0] < 0.97 * depth[1]
    assert stiff.critical_time_step == pytest.approx(linear.critical_time_step, rel=1e-6)
    assert stiff.smallest_step < 0.8 * linear.smallest_step
    assert stiff.margin > 1.0


def test_the_report_states_the_slopes_of_a_law_at_rest():
    scene = scene_with(SOFT_BELOW)
    text = " ".join(assumptions(scene, None))
    assert "1 times that in tension and 0.5 times that in compression" in text
    assert "eq. (1)" not in text
    assert "linear, eq. (1)" in " ".join(assumptions(scene_with(), None))


# Rayleigh damping


@pytest.mark.parametrize(
    ("gravity", "said"),
    [
        ((), "There is no gravity"),
        (("gravity.acceleration=9.81 m/s^2",), "that without load, from which the organ sags"),
        (
            ("gravity.acceleration=9.81 m/s^2", "gravity.given=loaded"),
            ": the given shape is that at rest under it",
        ),
    ],
)
def test_what_shape_is_given_is_said_as_the_scene_has_gravity(gravity, said):
    (sentence,) = (one for one in assumptions(read_scene("block", gravity), None) if said in one)
    assert sentence.endswith(".")


def test_rayleigh_reaches_springs_and_reference_alike_and_leaves_the_benchmark():
    scene, _, assembly = posed_with(*RAYLEIGH)
    found = tuned(scene, assembly.lattice, E).material.damping
    assert found == NodalDamping(30.0, beta=5e-4)
    assert reference_damping(scene) == RayleighDamping(30.0, 5e-4)
    found = benchmark(scene, assembly.lattice).material.damping
    assert found == benchmark(scene_with(), assembly.lattice).material.damping


@pytest.mark.parametrize(("share", "status"), [(0.98, "finished"), (1.03, "diverged")])
def test_the_step_is_kept_below_the_limit_that_dashpots_leave(share, status):
    """The limit is a third of the undamped one; negative control: 3 % above it, the run is lost."""
    scene, posed, assembly = posed_with("damping.kind=rayleigh", "damping.stiffness=3 ms")
    material = tuned(scene, assembly.lattice, E).material
    undamped = dataclasses.replace(material, damping=NodalDamping(0.0))
    limit = critical_time_step(assembly, material)
    assert limit < 0.35 * critical_time_step(assembly, undamped)
    interval = 30 * share * limit
    watch = dataclasses.replace(posed.observation, times=interval * np.arange(101))
    found = model.run(assembly, material, np.ones_like, watch, Fixed(share * limit))
    assert found.trajectory.status == status


def test_a_step_that_follows_the_limit_stays_below_it_with_dashpots():
    scene, posed, assembly = posed_with("damping.kind=rayleigh", "damping.stiffness=3 ms")
    material = tuned(scene, assembly.lattice, E).material
    found = motion(posed, assembly, material, step=Automatic(0.9))
    assert found.trajectory.status == "finished"
    assert found.margin > 1.0
    assert found.largest_step <= 0.9 * found.critical_time_step


def test_dashpots_slow_what_they_damp_and_not_where_it_comes_to_rest():
    """A second is many times beta (10 ms) and 1 / alpha. Measured: half as deep after a sample."""
    scene, posed, assembly = posed_with(
        "damping.kind=rayleigh", "damping.mass=40", "damping.stiffness=10 ms"
    )
    material = tuned(scene, assembly.lattice, E).material
    rest = static_displacement(assembly, material)
    weights = assembly.lattice.interpolation(posed.observation.probes)[0]
    found = model.run(assembly, material, np.ones_like, posed.observation, linear=True)
    scale = np.abs(weights @ rest).max()
    assert found.trajectory.displacement[-1] == pytest.approx(weights @ rest, abs=1e-3 * scale)
    early = np.abs(found.trajectory.displacement[1]).max()
    bare = Material(material.law, damping=NodalDamping(40.0))
    faster = model.run(assembly, bare, np.ones_like, posed.observation, linear=True)
    assert early < 0.6 * np.abs(faster.trajectory.displacement[1]).max()


@pytest.mark.parametrize("integrator", ["velocity-verlet", "implicit-euler", "split-volume"])
def test_integrators_without_a_stiffness_part_refuse_it(integrator):
    scene, posed, assembly = posed_with(*RAYLEIGH)
    material = tuned(scene, assembly.lattice, E).material
    with pytest.raises(ValueError, match=r"stiffness part.*damping\.stiffness"):
        motion(posed, assembly, material, integrator=integrator)


# Springs on tetrahedra


def test_springs_on_tetrahedra_run_along_the_edges_of_the_mesh():
    scene, posed, assembly = posed_with(TETRAHEDRA)
    mesh = posed.geometry.mesh
    assert assembly.lattice.nodes is mesh.points
    assert assembly.lattice.cells is mesh.tetrahedra
    np.testing.assert_array_equal(assembly.springs.ends, edges(mesh.tetrahedra))
    assert assembly.lattice.spacing == mean_edge(mesh)
    ratio = dimensionless(scene, posed).tool_radius_over_spacing
    assert ratio == pytest.approx(posed.tool.radius / mean_edge(mesh), rel=1e-15)
    assert "springs on the mesh" in " ".join(
        describe_scene("block", [*SMALL, TETRAHEDRA, "fuzzy.sensitivity_readings=0"])
    )


def test_the_benchmark_on_tetrahedra_has_the_modulus_of_its_table():
    """K_1 of an edge is carried to the mean edge of the mesh: 2.5 k_1 / h stays."""
    _, _, assembly = posed_with(TETRAHEDRA)
    h = assembly.lattice.spacing
    found = benchmark(scene_with(TETRAHEDRA), assembly.lattice)
    assert 2.5 * found.material.law.k1 / h == pytest.approx(found.modulus, rel=1e-12)


def test_a_run_on_tetrahedra_continues_to_the_same_bits(tmp_path):
    """Interrupted at sample 40, with a law and dashpots."""
    scene, posed, assembly = posed_with(TETRAHEDRA, STIFFENING, *RAYLEIGH)
    material = tuned(scene, assembly.lattice, E).material

    class Killed(Exception):  # noqa: N818 - not an error of the program
        pass

    def until(sample, *_):
        if sample == 40:
            raise Killed

    kept = Checkpoint(tmp_path / "state.npz", 0.0, resume=True)
    with pytest.raises(Killed):
        motion(posed, assembly, material, checkpoint=kept, on_sample=until)
    first = []
    resumed = motion(
        posed, assembly, material, checkpoint=kept, on_sample=lambda *s: first.append(s[0])
    )
    whole = motion(posed, assembly, material)
    assert first[0] > 0
    np.testing.assert_array_equal(resumed.trajectory.displacement, whole.trajectory.displacement)
    softer = dataclasses.replace(material, damping=NodalDamping(30.0, beta=4e-4))
    with pytest.raises(ValueError, match="state of another run"):
        motion(posed, assembly, softer, checkpoint=kept)


def test_inverted_tetrahedra_of_a_run_are_counted():
    _, posed, assembly = posed_with(TETRAHEDRA)
    material = elastic(assembly.lattice, 200.0, 0.25)
    pressed = dataclasses.replace(assembly, load=40 * assembly.load)
    found = motion(posed, pressed, dataclasses.replace(material, damping=NodalDamping(50.0)))
    assert found.inverted_cells > 0


def test_a_volume_term_on_tetrahedra_is_refused():
    _, _, assembly = posed_with(TETRAHEDRA)
    with pytest.raises(ValueError, match=r"lattice\.volume_term.*lattice\.springs"):
        elastic(assembly.lattice, E, 0.45)


def test_results_state_what_the_mesh_decides():
    """No Poisson ratio is claimed, and the mass of a node is that of the mesh."""
    scene, posed, assembly = posed_with(TETRAHEDRA)
    (found,) = table.models_of(scene, estimates(scene))
    run = found.prepare(posed).run(SILENT)
    assert run.record.name == "msm-sugeno"
    assert run.record.lattice.poisson_ratio is None
    assert run.record.lattice.node_mass_kg == pytest.approx(assembly.mass.mean())
    assert run.record.lattice.springs == len(edges(posed.geometry.mesh.tetrahedra))
    assert {check.name for check in run.checks} >= {"lattice: mass"}
    assert all(check.passed for check in run.checks)
    text = " ".join(assumptions(scene, None))
    assert "edges of the finite-element mesh" in text
    assert "cubic lattice" not in text
