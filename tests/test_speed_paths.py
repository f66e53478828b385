"""What was made fast: the same forces and steps as plain numpy, no outdated kernels, the table."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array

import msm
from msm.assembly import arrays
from msm.explicit import symplectic_euler, velocity_verlet
from msm.forces import internal_forces
from msm.lattice import CORNERS
from study.system import compiled
from tests.benchmarks import bench_lattice, field_error, grid_in_c
from tests.benchmarks.bench_lattice import FRACTION, LAW, cube, free, moved
from tests.benchmarks.bench_order import cuthill_mckee, numbered

TABLE = bench_lattice.read()
ROUNDING = 1e-12
"""Of sums of some twenty terms in another order, relative to the largest: 2e-16 each."""


def difference(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


@pytest.fixture(scope="module")
def net():
    """A cube with a foundation that couples nodes, and an uneven load and damping."""
    free_net = free(cube(300))
    count, rng = len(free_net.mass), np.random.default_rng(1)
    corner = csr_array(rng.random((count, 4)) * (np.arange(count) < count // 3)[:, None])
    held = csr_array(corner @ corner.T)
    return free_net._replace(
        row=held.indptr.astype(np.uint32),
        column=held.indices.astype(np.uint32),
        value=held.data,
        load=rng.standard_normal((count, 3)),
        gamma_1=rng.random(count),
    )


def plain_forces(net, u):
    """Springs, cells and foundation, all at once."""
    count = len(u)
    force = -csr_array((net.value, net.column, net.row), shape=(count, count)) @ u
    i, j = net.ends.T.astype(int)
    span = net.rest + u[j] - u[i]
    length = np.linalg.norm(span, axis=1)
    pull = net.scale * LAW.k * (length / net.length - 1.0)
    along = pull[:, None] * span / length[:, None]
    np.add.at(force, i, along)
    np.add.at(force, j, -along)
    slopes = (2.0 * CORNERS - 1.0) / (4.0 * net.spacing)
    f = np.eye(3) + np.einsum("cad,ae->cde", u[net.cells], slopes)
    j_f = np.linalg.det(f)
    cofactor = j_f[:, None, None] * np.linalg.inv(f).transpose(0, 2, 1)
    stress = (net.bulk * (j_f - 1.0))[:, None, None] * cofactor
    np.add.at(force, net.cells.astype(int), -np.einsum("cde,ae->cad", stress, slopes))
    return force


def test_the_forces_are_those_of_plain_numpy(net):
    u, force = moved(net), np.empty_like(net.load)
    internal_forces(LAW, net, u, force)
    assert difference(force, plain_forces(net, u)) < ROUNDING


def test_one_wrong_corner_of_one_cell_is_seen(net):
    """Negative control."""
    cells = net.cells.copy()
    cells[7, [0, 7]] = cells[7, [7, 0]]
    u, force = moved(net), np.empty_like(net.load)
    internal_forces(LAW, net._replace(cells=cells), u, force)
    assert difference(force, plain_forces(net, u)) > 1e-3


def test_a_step_of_symplectic_euler_is_the_written_one(net):
    u, v, dt = moved(net), np.random.default_rng(2).standard_normal(net.load.shape), 1e-3
    c = net.gamma_0 + net.gamma_1 * np.linalg.norm(u, axis=1)
    a = (plain_forces(net, u) + 0.3 * net.load) / net.mass[:, None]
    after = (v + dt * a) / (1.0 + dt * c / net.mass)[:, None]
    moved_on = u + dt * after
    symplectic_euler(LAW, net, np.array([[0.3]]), dt, u, v)
    assert difference(v, after) < ROUNDING
    assert difference(u, moved_on) < ROUNDING


def test_a_step_of_velocity_verlet_is_the_written_one(net):
    u, v, dt = moved(net), np.random.default_rng(3).standard_normal(net.load.shape), 1e-3
    mass = net.mass[:, None]
    c = (net.gamma_0 + net.gamma_1 * np.linalg.norm(u, axis=1))[:, None]
    kick = 0.5 * dt * (plain_forces(net, u) + 0.3 * net.load) / mass
    half = (v + kick) / (1.0 + 0.5 * dt * c / mass)
    moved_on = u + dt * half
    c = (net.gamma_0 + net.gamma_1 * np.linalg.norm(moved_on, axis=1))[:, None]
    push = plain_forces(net, moved_on) + 0.7 * net.load - c * half
    after = half + 0.5 * dt * push / mass
    velocity_verlet(LAW, net, np.array([[0.3, 0.7]]), dt, u, v)
    assert difference(u, moved_on) < ROUNDING
    assert difference(v, after) < ROUNDING


@pytest.fixture(scope="module")
def liver():
    """The built-in liver on a coarse lattice: its network, step [s] and law."""
    case = field_error.liver((0.02,))
    one = bench_lattice.liver(case, field_error.lattice(case, 0.02), 0.45)
    return one.assembly.lattice, arrays(*one[:2]), FRACTION * one.critical, one.material.law


def steps_in_c(folder, liver, lanes, change=None):
    """What the benchmark says of C beside the list of springs."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    lattice, net, dt, law = liver
    changed = net if change is None else change(net)
    try:
        in_c = bench_lattice.in_c(folder, law, changed, dt, lattice, lanes)
    except subprocess.CalledProcessError as error:
        if b"4 lanes want AVX2" not in error.stderr:  # what grid.c says where there are none
            raise
        pytest.skip(f"the processor has no {lanes} lanes in C")
    return bench_lattice.differences([bench_lattice.on_list(law, net, dt), in_c])


@pytest.mark.parametrize("volume", [True, False])
@pytest.mark.parametrize("lanes", bench_lattice.WIDTHS)
def test_the_c_of_the_benchmark_takes_the_same_steps(liver, tmp_path, lanes, volume):
    lattice, net, dt, law = liver
    if not volume:
        net = net._replace(cells=net.cells[:0], bulk=net.bulk[:0])
    assert steps_in_c(tmp_path, (lattice, net, dt, law), lanes)[1] < bench_lattice.SAME


def test_a_c_that_leads_elsewhere_is_refused(liver, tmp_path):
    """Negative control: one spring of 2 000 by a millionth."""

    def one_spring(net):
        scale = net.scale.copy()
        scale[700] *= 1.0 + 1e-6
        return net._replace(scale=scale)

    for lanes in bench_lattice.WIDTHS[:1]:
        with pytest.raises(ValueError, match=f"C with {lanes} lanes leads to another state"):
            steps_in_c(tmp_path, liver, lanes, one_spring)


def test_c_refuses_what_it_does_not_compute(liver):
    lattice, net, dt, law = liver
    diagonal = net.ends.copy()
    diagonal[0, 1] = diagonal[-1, 1]
    for changed in (
        net._replace(beta=1e-3),
        net._replace(gamma_1=np.ones_like(net.gamma_1)),
        net._replace(ends=diagonal),
    ):
        with pytest.raises(ValueError, match=r"grid\.c knows"):
            grid_in_c.stepper(None, 4, lattice, changed, law, dt)


def test_the_table_of_kernels_agrees_with_itself():
    table = bench_lattice.read_kernels()
    assert {k.kernel for k in table} == {"list", "grid", "C"}
    assert {(round(k.spacing_m, 6), k.volume_term) for k in table} == {
        (round(h, 6), term) for h in bench_lattice.KERNEL_SPACINGS for term in (True, False)
    }
    lists = {(k.spacing_m, k.volume_term): k for k in table if k.kernel == "list"}
    in_c = {(k.spacing_m, k.volume_term, k.lanes): k for k in table if k.kernel == "C"}
    for k in table:
        # Written to six digits.
        alone = lists[k.spacing_m, k.volume_term]
        assert k.times_list == pytest.approx(alone.step_us / k.step_us, rel=1e-5)
        assert k.ns_per_spring == pytest.approx(1e3 * k.step_us / k.springs, rel=1e-5)
        assert k.real_time >= k.real_time_median
        assert k.apart < bench_lattice.SAME
        if k.lanes > 1:
            c = in_c[k.spacing_m, k.volume_term, k.lanes]
            assert k.over_c == pytest.approx(k.step_us / c.step_us, rel=1e-5)


def test_the_committed_grid_is_more_than_twice_as_fast_as_the_list_of_springs():
    table = [k for k in bench_lattice.read_kernels() if k.kernel == "grid"]
    widest = [k for k in table if k.lanes == max(k.lanes for k in table)]
    assert len(widest) == 2 * len(bench_lattice.KERNEL_SPACINGS)
    assert min(k.times_list for k in widest) > 2.0


def motion(lattice, start):
    """Displacement [m] after some steps, from the velocities `start`."""
    net = free(lattice)
    u, v = np.zeros_like(start), start.copy()
    symplectic_euler(LAW, net, np.ones((50, 1)), 5e-4, u, v)
    return u


def test_the_numbers_of_the_nodes_do_not_change_the_motion():
    lattice = cube(1000)
    rng = np.random.default_rng(4)
    start = rng.standard_normal((len(lattice.nodes), 3))
    order = rng.permutation(len(lattice.nodes))
    again = motion(numbered(lattice, order), start[order])
    # Sums in another order, over 50 steps.
    assert difference(again, motion(lattice, start)[order]) < 1e-10


def reach(lattice):
    """Mean distance of the ends of a spring in the numbering of the nodes."""
    ends = bench_lattice.connect(lattice).ends
    return float(np.abs(np.diff(ends, axis=1)).mean())


def test_the_lattice_is_built_in_an_order_as_near_as_that_of_reverse_cuthill_mckee():
    """Which is why nothing renumbers it."""
    built = cube(8000)
    shuffled = np.random.default_rng(5).permutation(len(built.nodes))
    best = reach(numbered(built, cuthill_mckee(built)))
    assert reach(built) < 1.5 * best
    assert reach(numbered(built, shuffled)) > 5 * best  # negative control


CALLED = "import numba\n\n@numba.njit\ndef f(x):\n    return x + {}\n"
CALLING = """
import numba
from kernels.called import f

@numba.njit(cache=True)
def g(x):
    return f(x)
"""
REMEDY = "from pathlib import Path\nfrom study.system.compiled import drop_outdated\n{}\n"
ASK = "from kernels.calling import g; print(g(1))"


def answer(folder, constant, remedy):
    """What a process prints whose kernel calls one of another file, which adds the constant."""
    package = folder / "kernels"
    package.mkdir(exist_ok=True)
    (package / "__init__.py").write_text(REMEDY.format(remedy))
    (package / "called.py").write_text(CALLED.format(constant))
    calling = package / "calling.py"
    if not calling.exists():
        calling.write_text(CALLING)
    paths = os.pathsep.join([str(folder), str(Path(__file__).parents[1])])
    kept = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    found = subprocess.run(
        [sys.executable, "-c", ASK],
        capture_output=True,
        check=True,
        text=True,
        env=kept | {"PYTHONPATH": paths},
    )
    return int(found.stdout)


def test_a_kernel_is_compiled_anew_when_another_file_changes(tmp_path):
    remedy = "drop_outdated(Path(__file__).parent)"
    assert answer(tmp_path, 10, remedy) == 11
    # Negative control: numba alone does not notice. Should it come to, the remedy can go.
    assert answer(tmp_path, 2000, "") == 11
    assert answer(tmp_path, 2000, remedy) == 2001


@pytest.fixture
def package(tmp_path):
    """A package of one source with kernels and bytecode kept, just looked at."""
    (tmp_path / "laws.py").write_text("K = 1\n")
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws" / "hooke.py").write_text("K = 10\n")
    kept = tmp_path / "__pycache__"
    kept.mkdir()
    compiled.drop_outdated(tmp_path)
    for name in ("laws.f-1.py311.nbi", "laws.f-1.py311.1.nbc", "laws.cpython-311.pyc"):
        (kept / name).touch()
    return tmp_path


def kernels(package):
    return sorted(file.suffix for file in (package / "__pycache__").glob("laws.*"))


def test_kernels_of_unchanged_sources_are_kept(package):
    compiled.drop_outdated(package)
    assert kernels(package) == [".nbc", ".nbi", ".pyc"]


@pytest.mark.parametrize("change", ["edited", "put back", "added", "removed", "deeper"])
def test_kernels_of_changed_sources_are_dropped(package, change):
    source = package / "laws.py"
    if change == "edited":
        source.write_text("K = 20\n")
    elif change == "put back":  # an older file, as a copy from elsewhere
        os.utime(source, (1e9, 1e9))
    elif change == "added":
        (package / "more.py").touch()
    elif change == "deeper":
        (package / "laws" / "hooke.py").write_text("K = 2\n")
    else:
        source.unlink()
    compiled.drop_outdated(package)
    assert kernels(package) == [".pyc"]


def test_a_folder_that_cannot_be_written_is_left_alone(tmp_path):
    (tmp_path / "__pycache__").write_text("not a folder")
    compiled.drop_outdated(tmp_path)
    assert (tmp_path / "__pycache__").read_text() == "not a folder"


def test_looking_for_outdated_kernels_reads_no_source(monkeypatch):
    """It is done at every start: sources are told by their size and time alone."""
    package = Path(msm.__file__).parent
    compiled.drop_outdated(package)
    opened, plain = [], Path.open

    def opening(path, *args, **kwargs):
        opened.append(path.name)
        return plain(path, *args, **kwargs)

    monkeypatch.setattr(Path, "open", opening)
    monkeypatch.setattr(Path, "unlink", lambda path, **_: pytest.fail(f"{path} is removed"))
    compiled.drop_outdated(package)
    assert opened == [compiled.STAMP]


def rows(nu, most_error):
    return [r for r in TABLE if r.nu == nu and r.error <= most_error]


@pytest.mark.parametrize(
    ("nu", "most_error", "times_real_time"),
    [(0.45, 0.05, 4.0), (0.45, 0.03, 2.0), (0.49, 0.05, 2.0), (0.49, 0.03, 1.0)],
)
def test_the_committed_speeds_meet_the_targets(nu, most_error, times_real_time):
    best = max(rows(nu, most_error), key=lambda r: r.real_time_factor_median)
    assert best.real_time_factor_median > times_real_time


def test_the_table_agrees_with_itself():
    keys = {(r.nu, round(r.spacing_m, 6)) for r in TABLE}
    assert len(TABLE) == len(keys) == len(bench_lattice.RATIOS) * len(bench_lattice.SPACINGS)
    for r in TABLE:
        # Written to six digits.
        assert r.step_s == pytest.approx(FRACTION * r.critical_step_s, rel=1e-5)
        assert r.wall_per_second == pytest.approx(1e-6 * r.step_wall_us / r.step_s, rel=1e-5)
        assert r.ns_per_spring == pytest.approx(1e3 * r.step_wall_us / r.springs, rel=1e-5)
        assert r.real_time_factor * r.wall_per_second == pytest.approx(1.0, rel=1e-5)
        assert r.real_time_factor >= r.real_time_factor_median


def test_the_errors_of_the_table_are_those_of_the_field_errors():
    others = {
        (r.nu, round(r.spacing_m, 6)): r
        for r in field_error.read()
        if r.body == "liver" and r.volume_term
    }
    shared = [(r, others.get((r.nu, round(r.spacing_m, 6)))) for r in TABLE]
    found = [(r, other) for r, other in shared if other is not None]
    assert len(found) == 6
    for r, other in found:
        assert r.nodes == other.nodes
        assert r.error == pytest.approx(other.error, rel=1e-4)


def test_the_critical_steps_of_the_table_are_what_the_code_gives():
    case = field_error.liver()
    assembly = field_error.lattice(case, 0.012)
    for nu in bench_lattice.RATIOS:
        (row,) = [r for r in TABLE if r.nu == nu and r.spacing_m == 0.012]
        assert (len(assembly.mass), len(assembly.springs.weight)) == (row.nodes, row.springs)
        found = bench_lattice.liver(case, assembly, nu).critical
        assert found == pytest.approx(row.critical_step_s, rel=2e-3)  # Lanczos stops at 1e-3
