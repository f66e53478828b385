"""Constants of the lattice are held from outside: what is kept of a body, what h_0 stands for."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from msm.lattice import build, node_volumes
from msm.laws import initial_stiffness
from msm.springs import connect
from study.models import basafa, table
from study.models.damping import nodal_damping
from study.models.tissue import of_modulus
from study.organ.occupancy import ImplicitBody
from study.scene import Scene
from study.scene.problem import point_problem_of

# --- cells that are kept ------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Boxes:
    """A union of boxes, each a lower and an upper corner."""

    boxes: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]

    def occupancy(self, x, y, z):
        at = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
        inside = [((at > low) & (at < high)).all(axis=-1) for low, high in self.boxes]
        return np.any(inside, axis=0)


def with_tongue(length, breadth, height):
    """A cube of one cell, and in the next cell a tongue of so many sixths of an edge."""
    end = (1 + length / 6, breadth / 6, height / 6)
    body = Boxes((((0, 0, 0), (1, 1, 1)), ((1, 0, 0), end)))
    return build(body, np.zeros(3), np.array([2.0, 1.0, 1.0]), 1.0)


@pytest.mark.parametrize(
    ("tongue", "kept"),
    [((5, 2, 1), False), ((6, 2, 1), True), ((2, 5, 1), False), ((2, 6, 1), True)],
)
def test_a_cell_is_kept_from_a_twentieth_full(tongue, kept):
    """Ten points of 216 are 4.6 %, twelve 5.6 %: the cell is left out, and kept."""
    lattice = with_tongue(*tongue)
    share = np.prod(tongue) / 216
    assert len(lattice.cells) == (2 if kept else 1)
    assert lattice.dropped == pytest.approx(0.0 if kept else share / (1.0 + share))


def fill_of_ball(spacing, cells):
    """Share of each cell within a ball of radius 1: heights above a fine grid in the plane.

    An independent measure: exact along z, by the midpoint rule in x and y.
    """
    fine, at = 24, -1.0 + spacing * np.arange(cells + 1)
    x = (np.arange(cells * fine) + 0.5) * spacing / fine - 1.0
    half = np.sqrt(np.clip(1.0 - x[:, None] ** 2 - x[None, :] ** 2, 0.0, None))
    low, high = (np.clip(end, at[:-1], at[1:]) for end in (-half[..., None], half[..., None]))
    heights = (high - low) / spacing
    return heights.reshape(cells, fine, cells, fine, cells).mean(axis=(1, 3))


@pytest.mark.parametrize("cells", [7, 10, 14, 19])
def test_what_is_kept_of_a_ball_is_what_its_shape_says(cells):
    """Number of cells, volume left out, and the emptiest cell, beside the ball's own shares."""
    spacing = 2.0 / cells
    ball = ImplicitBody(lambda p: (p**2).sum(axis=-1) - 1.0)
    lattice = build(ball, -np.ones(3), np.ones(3), spacing)
    share = fill_of_ball(spacing, cells)
    assert share.sum() * spacing**3 == pytest.approx(4 / 3 * np.pi, rel=2e-3)
    # The lattice counts points, 216 a cell: a share is known to some two hundredths.
    most, least = ((share >= 0.05 + off).sum() for off in (-0.02, 0.02))
    assert least <= len(lattice.cells) <= most
    assert lattice.dropped == pytest.approx(share[share < 0.05].sum() / share.sum(), abs=1e-3)
    assert lattice.dropped < 4e-3
    assert node_volumes(lattice).sum() == pytest.approx(4 / 3 * np.pi, rel=0.01)


def test_the_emptiest_cells_of_a_ball_are_just_a_twentieth_full():
    """Over several spacings: were the limit higher, none would be; lower, some would be emptier."""
    ball = ImplicitBody(lambda p: (p**2).sum(axis=-1) - 1.0)
    found = [
        build(ball, -np.ones(3), np.ones(3), spacing).fill.min()
        for spacing in np.linspace(0.1, 0.3, 15)
    ]
    assert 0.05 <= min(found) < 0.056


# --- what the reference spacing stands for -------------------------------------------------------

H_0 = (3e-3, 5.5e-3, 11e-3)
SPACINGS = (4e-3, 10e-3)


def scene_at(h_0, **tissue):
    scene = Scene()
    damping = dataclasses.replace(scene.damping, reference_spacing=h_0)
    return dataclasses.replace(
        scene, damping=damping, tissue=dataclasses.replace(scene.tissue, **tissue)
    )


def modulus_by_energy(k, spacing):
    """Young's modulus [Pa] of full cells whose springs have stiffness k [N/m] times their weight.

    From the energy of a uniform uniaxial stress at the Poisson ratio 1/4 of central springs:
    E eps^2 / 2 per volume. It knows of no calibration.
    """
    size = np.full(3, 4 * spacing)
    lattice = build(Boxes((((0.0,) * 3, tuple(size)),)), np.zeros(3), size, spacing)
    springs = connect(lattice, flexion=0.2)
    eps = 1e-3
    strain = np.diag([eps, -eps / 4, -eps / 4])
    along = springs.rest / springs.rest_length[:, None]
    longer = np.einsum("si,ij,sj->s", along, strain, springs.rest)
    energy = 0.5 * (k * springs.weight * longer**2).sum()
    return 2.0 * energy / size.prod() / eps**2


@pytest.mark.parametrize("h_0", H_0)
@pytest.mark.parametrize("spacing", SPACINGS)
def test_the_benchmarks_modulus_is_that_of_its_springs(h_0, spacing):
    """K_1 is a force at strain 1, so K_1 / h_0 a stiffness, and the modulus 2.5 K_1 / h_0^2."""
    scene = scene_at(h_0)
    found = table.model(scene, "basafa").make(scene, SimpleNamespace(spacing=spacing))
    by_energy = modulus_by_energy(initial_stiffness(found.material.law), spacing)
    assert by_energy == pytest.approx(found.modulus, rel=1e-6)
    assert found.modulus == pytest.approx(2.5 * 0.05 / h_0**2, rel=1e-12)


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_the_benchmarks_modulus_goes_with_the_inverse_square_of_the_reference_spacing(factor):
    """A force over an area; its stiffness at h_0 itself is K_1 / h_0, whatever the lattice."""
    h_0 = 5.5e-3
    one, other = (
        table.model(scene, "basafa").make(scene, SimpleNamespace(spacing=scene_h))
        for scene, scene_h in ((scene_at(h), h) for h in (h_0, factor * h_0))
    )
    assert other.modulus == pytest.approx(one.modulus / factor**2, rel=1e-12)
    k = initial_stiffness(one.material.law), initial_stiffness(other.material.law)
    assert k == pytest.approx((0.05 / h_0, 0.05 / (factor * h_0)), rel=1e-12)


def test_the_sentence_on_the_benchmarks_modulus_says_the_same():
    said = " ".join(basafa.assumptions(scene_at(11e-3)))
    assert f"2.5 K_1 / h_0^2 = {2.5 * 0.05 / 11e-3**2 / 1e3:.2f} kPa" in said
    assert "h_0 = 11 mm" in said


@pytest.mark.parametrize("h_0", H_0)
def test_the_benchmarks_damping_is_that_of_a_node_at_the_reference_spacing(h_0):
    """gamma [N s/m] over the mass rho h_0^3, at every spacing of the lattice."""
    scene = scene_at(h_0, density=1000.0)
    for spacing in SPACINGS:
        model = table.model(scene, "basafa")
        damping = model.make(scene, SimpleNamespace(spacing=spacing)).material.damping
        assert damping.gamma_0 == pytest.approx(2.0 / (1000.0 * h_0**3), rel=1e-12)
        assert damping.gamma_1 == pytest.approx(1000.0 / (1000.0 * h_0**3), rel=1e-12)


@pytest.mark.parametrize("h_0", H_0)
def test_eq_2_is_taken_at_the_reference_spacing(h_0):
    """2 zeta sqrt(k/m), k = 0.4 E h_0 and m = rho h_0^3: the rate goes with 1 / h_0."""
    scene = scene_at(h_0, density=1000.0)
    rate = 2.0 * 0.9 * np.sqrt(0.4 * 7e3 / 1000.0) / h_0
    assert nodal_damping(scene, 7e3).gamma_0 == pytest.approx(rate, rel=1e-12)
    for spacing in SPACINGS:
        found = of_modulus(scene, SimpleNamespace(spacing=spacing), modulus=7e3)
        assert found.material.damping.gamma_0 == pytest.approx(rate, rel=1e-12)
        k = initial_stiffness(found.material.law)
        assert modulus_by_energy(k, spacing) == pytest.approx(7e3, rel=1e-6)


@pytest.mark.parametrize("h_0", H_0)
def test_a_point_hangs_on_a_spring_as_long_as_the_reference_spacing(h_0):
    """Its stiffness is K_1 / h_0; the mass that eq. (2) gives makes 2 zeta sqrt(k m) = gamma_0."""
    scene = dataclasses.replace(scene_at(h_0), models=("basafa",))
    scene = dataclasses.replace(scene, organ=dataclasses.replace(scene.organ, shape="point"))
    problem = point_problem_of(scene)
    (point,) = table.point_models_of(scene, {})
    found = point.make(problem)
    assert problem.rest_length == h_0
    assert initial_stiffness(found.law) == pytest.approx(0.05 / h_0, rel=1e-12)
    assert 2 * 0.9 * np.sqrt(problem.mass * 0.05 / h_0) == pytest.approx(2.0, rel=1e-12)
