"""What `import fem_reference` offers: its example, its names, its tables, its steppers."""

import dataclasses
import doctest

import numpy as np
import pytest

import fem_reference as fem
from fem_reference import memory
from fem_reference.model import DEFAULT
from study.problem.damping import RayleighDamping
from study.scene.file import SceneError, read_scene

DAMPING = RayleighDamping(mass=40.0, stiffness=4e-3)
STEP = 0.01


def load(times):
    """A ramp that is linear over the steps, then a rest."""
    return np.clip(np.asarray(times) / (5 * STEP), 0.0, 1.0)


@pytest.fixture(scope="module")
def coarse(small_posed):
    where = (small_posed.foundation, small_posed.tool)
    return fem.build(small_posed.geometry.level(-1).mesh, fem.Tissue(), *where)


def steps(motion, count):
    """Displacements of all unknowns at rest and after each step."""
    found = [motion.displacement]
    for _ in range(count):
        motion.take_step()
        found.append(motion.displacement)
    return np.array(found)


def test_the_example_of_the_package_runs_as_it_is_printed():
    found = doctest.testmod(fem)
    assert found.attempted > 5
    assert found.failed == 0


def test_every_name_offered_is_there():
    assert sorted(fem.__all__) == sorted(set(fem.__all__))
    assert all(hasattr(fem, name) for name in fem.__all__)


# --- one step at a time ------------------------------------------------------------------------


def test_a_subspace_stepped_is_its_superposition(coarse):
    from fem_reference.subspace import superposition

    subspace = fem.ritz_subspace(coarse, 6)
    y, _ = superposition(subspace, DAMPING, load, STEP * np.arange(13))
    found = steps(fem.SubspaceMotion(subspace, DAMPING, load, STEP), 12)
    scale = np.abs(found).max()
    assert np.abs(found - y @ subspace.vectors.T).max() < 1e-12 * scale
    undamped = steps(fem.SubspaceMotion(subspace, RayleighDamping(0.0), load, STEP), 12)
    assert np.abs(found - undamped).max() > 0.01 * scale  # negative control


def test_a_subspace_and_time_steps_move_the_body_alike(coarse):
    """Neither is exact: 24 vectors leave out little, and steps of 1 ms err little."""
    system = fem.Oscillator(coarse.mass, coarse.stiffness, coarse.load, DAMPING)
    stepped = steps(fem.SteppedMotion(system, load, STEP / 10), 120)[::10]
    ritz = steps(fem.SubspaceMotion(fem.ritz_subspace(coarse, 24), DAMPING, load, STEP), 12)
    modal = steps(fem.SubspaceMotion(fem.modal_subspace(coarse, 60), DAMPING, load, STEP), 12)
    assert np.abs(ritz - stepped).max() < 2e-3 * np.abs(stepped).max()
    assert np.abs(modal - stepped).max() < 2e-2 * np.abs(stepped).max()


def test_a_subspace_has_the_vectors_asked_for(coarse):
    assert [fem.ritz_subspace(coarse, n).load.size for n in (1, 4)] == [1, 4]
    assert fem.modal_subspace(coarse, 4).load.size == 5  # the static displacement beside them
    with pytest.raises(ValueError, match="give 1 or more"):
        fem.ritz_subspace(coarse, 0)


# --- an entry of a table is a choice everywhere ------------------------------------------------


def test_a_method_added_to_the_table_is_run_and_read(coarse, small_posed, monkeypatch):
    monkeypatch.setitem(fem.METHODS, "mine", fem.METHODS[DEFAULT])
    seen = small_posed.observation
    found = fem.run(coarse, DAMPING, load, seen, fem.Method("mine")).trajectory
    usual = fem.run(coarse, DAMPING, load, seen).trajectory
    assert (found.displacement == usual.displacement).all()
    assert read_scene("block", ["reference.method=mine"]).reference.method == "mine"


def test_a_law_added_to_the_table_is_solved_by_its_name(coarse, monkeypatch):
    """Twice as stiff, half as deep, but for the foundation."""
    usual = fem.LAWS["neo-hookean"]
    monkeypatch.setitem(fem.LAWS, "stiffer", lambda lame, shear: usual(2.0 * lame, 2.0 * shear))
    works = [
        coarse.load @ fem.solve_hyperelastic(coarse, fem.Tissue(), law).states[0].displacement
        for law in ("neo-hookean", "stiffer")
    ]
    assert 0.45 < works[1] / works[0] < 0.7


def test_an_element_added_to_the_table_is_built_and_reckoned_with(small_posed, monkeypatch):
    mine = dataclasses.replace(fem.ELEMENTS["p1"], bytes_per_unknown=1)
    monkeypatch.setitem(fem.ELEMENTS, "mine", mine)
    mesh, where = small_posed.geometry.mesh, (small_posed.foundation, small_posed.tool)
    found, linear = (fem.build(mesh, fem.Tissue(), *where, name) for name in ("mine", "p1"))
    assert (fem.solve_static(found) == fem.solve_static(linear)).all()
    assert memory.unknowns(mesh, "mine") == found.unknowns
    assert memory.needed(100, "mine", stepping=False) == 100


@pytest.mark.parametrize("law", ["neo-hookean", "st-venant-kirchhoff", "none"])
def test_a_scene_takes_the_laws_of_the_table_or_none(law):
    assert read_scene("block", [f"reference.large_strain={law}"]).reference.large_strain == law
    with pytest.raises(SceneError, match="'neo-hookean', 'st-venant-kirchhoff' or 'none'"):
        read_scene("block", [f"reference.large_strain={law}x"])
