"""A run that is interrupted and continued is the run that was not."""

import dataclasses
import importlib

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array

from msm import checkpoint as states
from msm import model
from msm.assembly import Assembly, Material
from msm.calibration import reference_stiffness
from msm.checkpoint import Checkpoint
from msm.damping import NodalDamping
from msm.explicit import symplectic_euler
from msm.lattice import build, node_volumes
from msm.laws import Basafa, Hooke
from msm.model import (
    AUTOMATIC,
    Automatic,
    Counts,
    Fixed,
    LatticeStepper,
    Rate,
    critical_time_step,
    run,
)
from msm.springs import connect
from msm.timestep import LOOK
from msm.volume import volume_term
from study.organ.block import block_mesh
from study.organ.occupancy import MeshBody
from study.problem.trajectory import Observation

E, H, RHO, SAMPLES = 5e3, 0.01, 1054.0, 41
STIFFENING = Basafa(8.0, 1600.0, 0.2)
MEASURED = {"wall"}


class Killed(Exception):  # noqa: N818 - not an error of the program
    """Stands for a kill of the program."""


def press(nu=0.25, force=0.5, law=STIFFENING):
    """A block on a soft ground, pushed on its top until its springs stiffen."""
    size = (4 * H, 4 * H, 4 * H)
    lattice = build(MeshBody(block_mesh(size, H)), np.zeros(3), np.array(size), H)
    z = lattice.nodes[:, 2]
    top = z > size[2] - 1e-9
    load = np.outer(top / top.sum() * force, [0.2, 0.0, -1.0])
    ground = csr_array(diags_array(np.where(z < 1e-9, E * H, 0.0)))
    body = Assembly(lattice, connect(lattice), RHO * node_volumes(lattice), ground, load)
    return body, Material(law, volume_term(lattice, E, nu), NodalDamping(4.0))


def ramp(times):
    return np.minimum(times / 0.2, 1.0)


def watch(body, seconds=0.4):
    nodes = body.lattice.nodes
    times = np.linspace(0.0, seconds, SAMPLES)
    return Observation(times, nodes[[-1]], (SAMPLES // 2, SAMPLES - 1), nodes[:9], nodes[-9:])


def go(case, step=AUTOMATIC, **options):
    body, material = case
    return run(body, material, ramp, watch(body), step, **options)


def stopping_at(stops):
    """An observer that raises at each call of a sequence, once, and notes every sample told."""
    told, stops = [], set(stops)

    def on_sample(sample, u, v):
        told.append((sample, u.copy(), v.copy()))
        if len(told) in stops:
            raise Killed

    return told, on_sample


def go_on(case, path, stops, seconds=0.0, **options):
    """Run, interrupted and resumed until it ends; the run, what was told, how often it resumed."""
    told, on_sample = stopping_at(stops)
    for resumed in range(len(stops) + 1):
        point = Checkpoint(path, seconds, resume=True)
        try:
            return go(case, checkpoint=point, on_sample=on_sample, **options), told, resumed
        except Killed:
            pass
    raise AssertionError("interrupted more often than asked")


def assert_same(one, other):
    """To the bit, NaN included, but for the time it took."""
    for field in dataclasses.fields(one.trajectory):
        np.testing.assert_array_equal(
            getattr(one.trajectory, field.name), getattr(other.trajectory, field.name)
        )
    for field in dataclasses.fields(one):
        if field.name not in MEASURED | {"trajectory"}:
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


@pytest.fixture(scope="module")
def pressed():
    """The uninterrupted run, in which a stretch of several samples was repeated."""
    found = go(press())
    assert found.repeated_steps >= 50
    assert found.trajectory.status == "finished"
    return found


@pytest.mark.parametrize("seed", range(4))
def test_an_interrupted_run_continues_to_the_same_bits(pressed, seed, tmp_path):
    stops = np.random.default_rng(seed).choice(np.arange(2, SAMPLES), 4, replace=False)
    found, _, resumed = go_on(press(), tmp_path / "state.npz", stops)
    assert resumed == 4
    assert_same(found, pressed)


def test_it_may_be_interrupted_before_and_after_steps_were_undone(pressed, tmp_path):
    """At each sample from the last one kept before them to the first one kept after them."""
    told, on_sample = stopping_at(())
    go(press(), on_sample=on_sample)
    order = [sample for sample, _, _ in told]
    back = next(i for i in range(1, len(order)) if order[i] <= order[i - 1])
    assert order[back - 1] - order[back] >= 5
    for number, stop in enumerate(range(back - 6, back + 8)):
        found, again, _ = go_on(press(), tmp_path / f"{number}.npz", [stop])
        assert_same(found, pressed)
        assert [sample for sample, _, _ in again].count(order[back - 1]) >= 2


@pytest.mark.parametrize(
    ("case", "options"),
    [
        (press(0.49, 0.3, Hooke(reference_stiffness(E, H, 0.49))), {}),
        (press(0.45), {"integrator": "velocity-verlet", "step": Rate(900.0)}),
        (press(0.45), {"integrator": "runge-kutta-4", "step": Automatic(0.5)}),
        (press(), {"linear": True, "step": Fixed(0.4 / (SAMPLES - 1) / 10)}),
        (press(), {"step": Counts(np.arange(SAMPLES - 1) % 3 + 10)}),
        (press(0.45), {"integrator": "split-volume"}),
    ],
)
def test_so_it_is_for_every_way_of_choosing_the_step(case, options, tmp_path):
    plain = go(case, **options)
    found, _, resumed = go_on(case, tmp_path / "state.npz", [9, 23, 37], **options)
    assert resumed == 3
    assert plain.trajectory.status == "finished"
    assert_same(found, plain)


def test_a_run_that_is_lost_is_lost_alike_after_an_interruption(tmp_path):
    plain = go(press(force=4.0))
    assert plain.trajectory.status == "diverged"
    assert plain.repeated_steps > 0
    found, told, resumed = go_on(press(force=4.0), tmp_path / "state.npz", [7, 15])
    assert resumed == 2
    assert_same(found, plain)
    kept = ~np.isnan(plain.trajectory.displacement[:, 0, 0])
    assert told[-1][0] == np.flatnonzero(kept)[-1]  # where it stood in the end


def test_a_finished_run_is_not_run_again(pressed, tmp_path):
    point = Checkpoint(tmp_path / "state.npz", seconds=1e9, resume=True)
    go(press(), checkpoint=point)
    told, on_sample = stopping_at(())
    assert_same(go(press(), checkpoint=point, on_sample=on_sample), pressed)
    assert [sample for sample, _, _ in told] == [SAMPLES - 1]


def test_without_resume_a_state_is_left_unread_and_written_over(tmp_path):
    path = tmp_path / "state.npz"
    path.write_bytes(b"of something else")
    go(press(), checkpoint=Checkpoint(path, seconds=1e9))
    assert len(np.load(path)["stepper.u"]) == 125


def test_the_last_reported_sample_is_that_of_the_state(pressed):
    told, on_sample = stopping_at(())
    go(press(), on_sample=on_sample)
    final = {sample: (u, v) for sample, u, v in told}
    assert sorted(final) == list(range(SAMPLES))
    assert len(told) > SAMPLES
    probe = np.array([final[sample][0][-1] for sample in range(SAMPLES)])
    np.testing.assert_allclose(probe, pressed.trajectory.displacement[:, 0], rtol=1e-12, atol=1e-15)


def test_all_that_changes_in_a_run_is_in_its_state(monkeypatch):
    """Negative control of the table: an attribute that it leaves out is seen."""
    seen = {}

    def watched(parts):
        seen["parts"], seen["before"] = parts, snapshot(parts)
        return parts

    genuine = model._mutable_parts
    monkeypatch.setattr(model, "_mutable_parts", lambda *things: watched(genuine(*things)))
    monkeypatch.setattr(states, "write", lambda *_: None)
    go(press(), checkpoint=Checkpoint(None, seconds=1e9))
    changed = differences(seen["before"], snapshot(seen["parts"]))
    assert changed <= {(part, name) for part, names in states.CHANGING.items() for name in names}
    assert {("steps", "current"), ("tracker", "mode"), ("stepper", "u")} <= changed


def snapshot(parts):
    return {
        (part, name): np.array(value)
        for part, thing in parts.items()
        for name, value in vars(thing).items()
        if isinstance(value, bool | int | float | np.ndarray)
    }


def differences(before, after):
    return {key for key in after if not np.array_equal(before[key], after[key], equal_nan=True)}


@pytest.mark.parametrize("left_out", ["steps.current", "tracker.mode", "stepper.v"])
def test_a_state_that_lacks_a_part_is_noticed_by_these_tests(
    pressed, left_out, tmp_path, monkeypatch
):
    part, name = left_out.split(".")
    names = tuple(n for n in states.CHANGING[part] if n != name)
    monkeypatch.setitem(states.CHANGING, part, names)
    found, _, _ = go_on(press(), tmp_path / "state.npz", [35])
    with pytest.raises(AssertionError):
        assert_same(found, pressed)


def other_damping(case):
    body, material = case
    return body, dataclasses.replace(material, damping=NodalDamping(4.1))


def other_load(case):
    body, material = case
    load = body.load.copy()
    load[-1, 0] = np.nextafter(load[-1, 0], 1.0)
    return dataclasses.replace(body, load=load), material


@pytest.mark.parametrize(
    ("change", "options"),
    [
        (other_damping, {}),
        (other_load, {}),
        (lambda _: press(law=Basafa(8.0, 1600.0, 0.21)), {}),
        (lambda _: press(nu=0.3), {}),
        (lambda case: case, {"step": Automatic(0.7)}),
        (lambda case: case, {"integrator": "velocity-verlet"}),
        (lambda case: case, {"linear": True}),
    ],
)
def test_the_state_of_another_run_is_refused(change, options, tmp_path):
    point = Checkpoint(tmp_path / "state.npz", seconds=1e9, resume=True)
    go(press(), checkpoint=point)
    with pytest.raises(ValueError, match=r"another run.*run without --resume"):
        go(change(press()), checkpoint=point, **options)


def test_another_history_of_the_load_or_another_watch_is_refused(tmp_path):
    point = Checkpoint(tmp_path / "state.npz", seconds=1e9, resume=True)
    body, material = press()
    go((body, material), checkpoint=point)
    for factor, seen in (
        (np.zeros_like, watch(body)),
        (ramp, watch(body, 0.5)),
        (ramp, dataclasses.replace(watch(body), probes=body.lattice.nodes[[0]])),
    ):
        with pytest.raises(ValueError, match="another run"):
            run(body, material, factor, seen, checkpoint=point)


def test_a_state_of_another_program_is_refused(tmp_path, monkeypatch):
    point = Checkpoint(tmp_path / "state.npz", seconds=1e9, resume=True)
    go(press(), checkpoint=point)
    monkeypatch.setattr(model, "program", lambda *_: "later")
    with pytest.raises(ValueError, match="the program has changed"):
        go(press(), checkpoint=point)


@pytest.mark.parametrize("keep", [0, 10, 4000])
def test_a_damaged_state_is_refused(keep, tmp_path):
    point = Checkpoint(tmp_path / "state.npz", seconds=1e9, resume=True)
    go(press(), checkpoint=point)
    point.path.write_bytes(point.path.read_bytes()[:keep])
    with pytest.raises(ValueError, match=r"state\.npz: damaged state.*without --resume"):
        go(press(), checkpoint=point)


@pytest.mark.parametrize("seed", range(12))
def test_a_state_with_another_bit_somewhere_is_refused(seed, tmp_path):
    """Or it is one that nothing depends on, as the date in a zip, and what is read is the same."""
    path, rng = tmp_path / "state.npz", np.random.default_rng(seed)
    arrays = {"u": rng.standard_normal((4, 3)), "t": np.asarray(0.1)}
    states.write(path, "this", arrays)
    data = bytearray(path.read_bytes())
    data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)
    try:
        found = states.read(path, "this")
    except ValueError as error:
        assert "run without --resume" in str(error)  # noqa: PT017 - either is right
    else:
        assert all(np.array_equal(found[name], array) for name, array in arrays.items())


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"PK\x03\x04", b"\x93NUMPY\x01\x00", "array", "object"]
)
def test_a_file_that_is_no_state_is_refused(content, tmp_path):
    path = tmp_path / "state.npz"
    if content == "array":
        with path.open("wb") as file:
            np.save(file, np.zeros(3))
    elif content == "object":
        np.savez(path, identity=np.array({"a": 1}, dtype=object))
    else:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=r"state\.npz: damaged state.*without --resume"):
        states.read(path, "this")


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays: arrays | {"u": arrays["u"] + 1e-12},
        lambda arrays: arrays | {"u": arrays["u"].T},
        lambda arrays: {"t": arrays["t"]},
        lambda arrays: arrays | {"v": arrays["u"]},
    ],
)
def test_a_state_that_was_edited_is_refused(change, tmp_path):
    """With the name of the run that it was of."""
    path = tmp_path / "state.npz"
    states.write(path, "this", {"u": np.ones((4, 3)), "t": np.asarray(0.1)})
    with np.load(path) as file:
        marks = {name: file[name] for name in (states.IDENTITY, states.DIGEST)}
    np.savez(path, **marks, **change(states.read(path, "this")))
    with pytest.raises(ValueError, match=r"damaged state of a run \(its arrays"):
        states.read(path, "this")


def test_a_failure_while_writing_leaves_the_state_before(tmp_path, monkeypatch):
    point = Checkpoint(tmp_path / "state.npz", seconds=0.0, resume=True)
    go(press(), checkpoint=point)
    whole = point.path.read_bytes()

    def failing(file, **_):
        file.write(b"half")
        raise OSError("no space left")

    monkeypatch.setattr(np, "savez", failing)
    with pytest.raises(OSError, match="no space"):
        go(press(), checkpoint=dataclasses.replace(point, resume=False))
    assert point.path.read_bytes() == whole


def test_states_are_written_no_more_often_than_asked(tmp_path, monkeypatch):
    written = []
    clock = iter(range(10_000))
    monkeypatch.setattr(states.time, "perf_counter", lambda: float(next(clock)))
    monkeypatch.setattr(states, "write", lambda *_: written.append(1))
    go(press(), checkpoint=Checkpoint(tmp_path / "state.npz", seconds=1e9))
    assert len(written) == 1  # the last
    go(press(), checkpoint=Checkpoint(tmp_path / "state.npz", seconds=0.0))
    assert len(written) >= 5


def test_keeping_states_does_not_change_a_run(pressed, tmp_path):
    assert_same(go(press(), checkpoint=Checkpoint(tmp_path / "state.npz", seconds=0.0)), pressed)


def test_a_run_is_also_of_the_law_and_the_integrator_from_other_files(tmp_path, monkeypatch):
    """As numba wraps them; nothing changes with a function of the package."""
    monkeypatch.syspath_prepend(str(tmp_path))
    source = tmp_path / "elsewhere.py"
    source.write_text("import numba\n\n@numba.njit\ndef advance(x):\n    return x\n")
    advance = importlib.import_module("elsewhere").advance
    before = states.program(advance)
    assert states.program(advance, symplectic_euler) == before != states.program()
    source.write_text(source.read_text() + "# edited\n")
    assert states.program(advance) != before


# Step by step


def test_a_lattice_that_is_stepped_goes_where_the_run_goes():
    """By steps with looks or without, from rest and from rest again; times round differently."""
    body, material = press()
    found = run(body, material, ramp, watch(body), Fixed(1e-3)).trajectory.displacement[:, 0]
    stepper = LatticeStepper(body, material, ramp)
    assert stepper.limit_at_rest == pytest.approx(critical_time_step(body, material), rel=5e-3)
    for _ in range(200):
        stepper.take_step(1e-3)
    np.testing.assert_allclose(stepper.u[-1], found[20], rtol=1e-9)
    looked = stepper.tracker.limit(stepper.u)
    assert looked < 0.9 * stepper.limit_at_rest  # its springs have stiffened
    stepper.restart()
    assert (stepper.t, np.abs(stepper.u).max(), np.abs(stepper.v).max()) == (0.0, 0.0, 0.0)
    stepper.advance(150, 1e-3)
    stepper.advance(250, 1e-3)
    assert stepper.t == pytest.approx(0.4)
    np.testing.assert_allclose(stepper.u[-1], found[40], rtol=1e-9)
    assert np.abs(found[40] - found[20]).max() > 1e-3 * np.abs(found[20]).max()


def test_a_stepper_looks_at_the_limit_as_often_as_a_run():
    body, material = press()
    stepper = LatticeStepper(body, material, ramp)
    seen = []
    for _ in range(2 * LOOK + 1):
        stepper.take_step(1e-3)
        seen.append(stepper.unchecked)
    assert [step for step, unchecked in enumerate(seen, 1) if unchecked == 0] == [LOOK, 2 * LOOK]
