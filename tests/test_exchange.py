"""The finite-element problem in the files of other codes."""

import re
import shutil
import subprocess
from dataclasses import replace

import meshio
import numpy as np
import pytest
from scipy.sparse import coo_array

from fem_reference.elasticity import discretise
from fem_reference.exchange import calculix
from fem_reference.exchange.nodal import NodalProblem, nodal_problem
from fem_reference.solvers import solve_static
from study.commands import app
from study.handover import export as exporting
from study.handover.export import MESHES, ExportRequest, export
from study.models.finite_elements import reference_of
from study.results.folder import write
from study.results.records import ElementsRecord
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.system.progress import Silent
from tests.oracles.cases import build, ramp
from tests.report_samples import with_model

SMALL = ('organ.size=["60 mm", "40 mm", "30 mm"]', "tool.radius=15 mm", "tool.force=0.05 N")
QUICK = (*SMALL, "reference.element_size=20 mm", "time.samples=17")


@pytest.fixture(scope="module", params=["block-p1", "block-p2-wavy"])
def found(request) -> NodalProblem:
    return build(request.param).problem


# --- arrays --------------------------------------------------------------------------------------


def test_every_element_is_positive_and_its_edge_nodes_lie_in_the_middle_of_their_edges():
    given = build("block-p2").problem
    corner = given.nodes[given.elements[:, :4]]
    assert (np.linalg.det(corner[:, 1:] - corner[:, :1]) > 0.0).all()
    for place, (i, j) in enumerate([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], 4):
        middle = 0.5 * (corner[:, i] + corner[:, j])
        assert given.nodes[given.elements[:, place]] == pytest.approx(middle, abs=1e-15)
    assert not given.curved
    assert build("block-p2-wavy").problem.curved


def test_support_density_is_that_of_the_block_under_its_lower_face_alone():
    case = build("block-p2")
    below = case.problem.nodes[:, 2] == 0.0
    inside = below & (case.problem.nodes[:, :2] > 0.0).all(axis=1)
    inside &= (case.problem.nodes[:, :2] < [0.06, 0.04]).all(axis=1)
    density = case.problem.support_density
    assert inside.sum() > 10
    assert density[inside] == pytest.approx(case.foundation.stiffness, rel=1e-12)
    assert not density[~below].any()


def test_taylor_hood_is_refused_with_key_and_remedy(small_posed, small_scene):
    posed, tissue = small_posed, small_scene.tissue
    mesh = posed.geometry.mesh
    body = discretise(mesh, tissue, posed.foundation, posed.tool, "taylor-hood")
    with pytest.raises(ValueError, match=r"reference\.element: taylor-hood .*\"p2\""):
        nodal_problem(body, tissue, posed.foundation)


# --- CalculiX ------------------------------------------------------------------------------------


def cards(text):
    """Keyword lines with the data lines that follow each."""
    parts = re.split(r"^\*", text, flags=re.MULTILINE)[1:]
    return [(part.splitlines()[0], part.splitlines()[1:]) for part in parts]


def numbers(lines):
    return np.array([[float(value) for value in line.split(",")] for line in lines])


def foundation_of(text, size):
    """Support matrix of each direction, put together again from the springs."""
    entries, members = [[], [], []], {}
    for card, lines in cards(text):
        name = card.rpartition("ELSET=")[2]
        if card.startswith("ELEMENT"):
            members[name] = numbers(lines).astype(int)[:, 1:] - 1
            continue
        direction, constant = int(lines[0].split(",")[0]) - 1, float(lines[1])
        for nodes in members[name]:
            i, j = nodes[0], nodes[-1]
            entries[direction] += [(i, i, constant)]
            if i != j:
                entries[direction] += [(j, j, constant), (i, j, -constant), (j, i, -constant)]
    triples = [np.array(one).T for one in entries]
    return [
        coo_array((values, (rows.astype(int), columns.astype(int))), shape=(size, size)).tocsr()
        for rows, columns, values in triples
    ]


def test_nodes_elements_and_load_are_those_of_the_problem(found):
    texts = calculix.files(found)
    mesh = dict(cards(texts["mesh.inp"]))
    assert numbers(mesh["NODE, NSET=ALL"])[:, 1:] == pytest.approx(found.nodes, rel=1e-13)
    kind = {4: "C3D4", 10: "C3D10"}[found.elements.shape[1]]
    elements = numbers(mesh[f"ELEMENT, TYPE={kind}, ELSET=BODY"])
    assert (elements[:, 1:] == found.elements + 1).all()
    load = np.zeros_like(found.load)
    for node, direction, value in numbers(texts["load.inp"].splitlines()):
        load[int(node) - 1, int(direction) - 1] = value
    assert load == pytest.approx(found.load, rel=1e-13)


def test_springs_add_up_to_the_foundation_s_matrix_in_every_direction(found):
    text = calculix.files(found)["foundation.inp"]
    largest = abs(found.support).max()
    for assembled in foundation_of(text, len(found.nodes)):
        # Fourteen digits in the file.
        assert abs(assembled - found.support).max() < 1e-12 * largest
    last = text.splitlines()[-1]
    wrong = text.replace(last, f"{1.001 * float(last):.13e}")
    assert any(
        abs(assembled - found.support).max() > 1e-12 * largest
        for assembled in foundation_of(wrong, len(found.nodes))
    )


def test_no_number_is_longer_than_the_twenty_characters_that_calculix_reads(found):
    extreme = replace(found, nodes=found.nodes * -1e-99)
    texts = [*calculix.files(found, ramp()).values(), *calculix.files(extreme).values()]
    fields = re.split(r"[,\n]", re.sub(r"^\*.*$", "", "".join(texts), flags=re.MULTILINE))
    assert max(len(field.strip()) for field in fields) == 20
    assert len(f"{-1e-100:.13e}") > 20


def test_the_load_history_goes_by_the_steps_and_starts_from_zero():
    deck = calculix.files(build("block-p1").problem, ramp())["dynamic.inp"]
    lines = dict(cards(deck))
    table = numbers(lines["AMPLITUDE, NAME=HISTORY"])
    assert table[0].tolist() == [0.0, 0.0]
    assert table[:, 1] == pytest.approx(ramp().factors)
    assert numbers(lines["DYNAMIC, DIRECT, ALPHA=-0.05"]).ravel() == pytest.approx([0.002, 0.04])


# --- VTU and the command -------------------------------------------------------------------------


def test_a_vtu_file_reads_back_with_its_curved_elements_and_fields(tmp_path):
    import pyvista as pv

    from fem_reference.exchange import vtu

    given = build("block-p2-wavy").problem
    displacement = np.random.default_rng(3).standard_normal(given.nodes.shape)
    path = tmp_path / "problem.vtu"
    path.write_text(vtu.text(given, displacement), encoding="utf-8")
    grid = pv.read(path)
    assert set(grid.celltypes) == {pv.CellType.QUADRATIC_TETRA}
    assert (grid.cells.reshape(-1, 11)[:, 1:] == given.elements).all()
    assert (np.asarray(grid.points) == given.nodes).all()
    assert (grid.point_data["displacement"] == displacement).all()
    assert (grid.point_data["load"] == given.load).all()
    assert (grid.point_data["support_density"] == given.support_density).all()


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("decks") / "out"
    request = ExportRequest(target="block", to="calculix", out=folder, overrides=QUICK)
    return export(request, Silent())


@pytest.mark.skipif(shutil.which("bash") is None, reason="the lines of the README are for bash")
def test_the_lines_in_the_readme_compare_with_what_calculix_prints(exported):
    rows = np.loadtxt(exported / "static.csv", delimiter=",", skiprows=1)
    assert difference_by_readme(exported, rows) < 1e-6
    assert difference_by_readme(exported, rows * [1.0, 1.001, 1.001, 1.001]) > 9e-4


def difference_by_readme(folder, rows):
    """What its function says to a file of CalculiX with these displacements."""
    title = " displacements (vx,vy,vz) for set ALL and time  0.1000000E+01"
    lines = [f"{int(n):10d} {x:13.6E} {y:13.6E} {z:13.6E}" for n, x, y, z in rows]
    (folder / "static.dat").write_text("\n".join(["", title, "", *lines, ""]))
    text = (folder / "README.txt").read_text()
    function = text[text.index("same() {") : text.index("same static;")]
    command = ["bash", "-c", f"{function}\nsame static"]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    (folder / "static.dat").unlink()
    return float(done.stdout.split()[-1])


def test_an_export_says_what_it_holds_and_can_be_written_again(exported):
    names = {path.name for path in exported.iterdir()}
    parts = {"mesh.inp", "foundation.inp", "load.inp"}
    assert names == parts | {
        "README.txt",
        "static.inp",
        "static.csv",
        "dynamic.inp",
        "dynamic.csv",
    }
    text = (exported / "README.txt").read_text()
    assert all(name in text for name in names - {"README.txt"})
    (exported / "static.dat").write_text("of an earlier comparison")
    export(ExportRequest(target="block", to="vtu", out=exported, overrides=QUICK), Silent())
    assert {path.name for path in exported.iterdir()} == {"README.txt", "problem.vtu"}


def test_a_problem_that_memory_does_not_hold_is_refused_and_nothing_written(tmp_path, monkeypatch):
    monkeypatch.setattr(exporting, "available", lambda: 1e6)
    request = ExportRequest(target="block", to="calculix", out=tmp_path / "out", overrides=QUICK)
    with pytest.raises(ValueError, match=r"reference\.element_size: \d+ unknowns .* GiB"):
        export(request, Silent())
    assert not list(tmp_path.iterdir())


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "README.txt").write_text("mine")
    (tmp_path / "thesis.tex").write_text("mine too")
    with pytest.raises(ValueError, match=r"thesis\.tex, which no export wrote"):
        export(ExportRequest(target="block", to="vtu", out=tmp_path, overrides=QUICK), Silent())
    assert (tmp_path / "README.txt").read_text() == "mine"


def results_of(results, elements, folder):
    """A results folder of a reference with so many elements."""
    used = ElementsRecord(element="p2", elements=elements, unknowns=1, method="ritz-vectors")
    folder.mkdir()
    write(with_model(results, "fem", elements=used), folder)
    return ExportRequest(target=str(folder), to="vtu")


@pytest.mark.parametrize("level", [0, 1])
def test_results_are_exported_with_the_mesh_that_they_were_run_on(
    tmp_path, small_results, small_posed, level
):
    mesh = small_posed.geometry.level(level).mesh
    request = results_of(small_results, len(mesh.tetrahedra), tmp_path / "results")
    written = export(request, Silent())
    assert written == tmp_path / "results" / "export"
    text = (written / "README.txt").read_text(encoding="utf-8")
    assert f"{len(mesh.tetrahedra)} quadratic tetrahedra" in text
    with pytest.raises(ValueError, match=r"--set: .* exported as it was run"):
        export(replace(request, overrides=("tool.force=1 N",)), Silent())


def test_results_on_a_mesh_that_is_no_more_are_refused(tmp_path, small_results):
    request = results_of(small_results, 12345, tmp_path / "results")
    with pytest.raises(ValueError, match=r"have 12345 finite elements, .* run it again"):
        export(request, Silent())
    assert not (tmp_path / "results" / "export").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("block", "--to", "abaqus"), "--to abaqus: use one of calculix, vtu, lattice, gmsh"),
        (("paper", "--to", "vtu"), "organ.shape: a point has no finite elements"),
        (("no-such", "--to", "vtu"), "neither a file nor a built-in scene"),
        ((".", "--to", "vtu"), "no results here"),
    ],
)
def test_what_cannot_be_exported_is_refused(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=re.escape(message)):
        app(["export", *arguments], exit_on_error=False, result_action="return_value")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("to", MESHES)
def test_an_exported_mesh_holds_the_tetrahedra_of_the_reference(to, tmp_path):
    folder = export(ExportRequest(target="block", to=to, out=tmp_path / "out"), Silent())
    mesh = problem_of(read_scene("block")).geometry.mesh
    found = meshio.read(folder / MESHES[to][0], MESHES[to][1])
    (cells,) = (block.data for block in found.cells if block.type == "tetra")
    assert (cells == mesh.tetrahedra).all()
    assert found.points == pytest.approx(mesh.points, abs=1e-9)
    if to != "nastran":  # which the study writes and does not read
        scene = read_scene("block", (f"organ.mesh={folder / MESHES[to][0]}", "organ.unit=m"))
        again = problem_of(scene).geometry.mesh
        assert len(again.tetrahedra) == len(mesh.tetrahedra)
        assert (folder / "README.txt").read_text().count(f"{len(cells)} tetrahedra") == 1


# --- gravity, weights and several loads ----------------------------------------------------------

SECOND = (
    'tool=[{place={side="superior", at=[0.2, 0.5]}, force="0.05 N", radius="8 mm"}, '
    '{place={side="superior", at=[0.8, 0.5]}, force="0.03 N", radius="8 mm", '
    'history={kind="step"}}]'
)
HUNG = (
    'organ.size=["60 mm", "40 mm", "30 mm"]',
    "reference.element_size=10 mm",
    "reference.element=p2",
    "time.samples=17",
    "time.duration=1 s",
    'models=["fem"]',
    SECOND,
    "gravity.acceleration=9.81 m/s^2",
    "gravity.towards=right",
)
WEIGHT = 'weight=[{place={side="superior", at=[0.5, 0.5]}, mass="20 g", radius="15 mm"}]'


def forces_of(path):
    """Sum [N] (3,) of the nodal forces of a file."""
    found = np.zeros(3)
    for _, direction, value in numbers(path.read_text().splitlines()):
        found[int(direction) - 1] += value
    return found


@pytest.fixture(scope="module")
def hung(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hung") / "out"
    return export(
        ExportRequest(target="block", to="calculix", out=folder, overrides=HUNG), Silent()
    )


def test_each_load_is_a_file_of_its_own_with_its_own_history(hung):
    assert forces_of(hung / "load.inp") == pytest.approx([0.0, 0.0, -0.05], abs=1e-12)
    assert forces_of(hung / "load.2.inp") == pytest.approx([0.0, 0.0, -0.03], abs=1e-12)
    deck = cards((hung / "dynamic.inp").read_text())
    first, second = (numbers(lines)[:, 1] for card, lines in deck if card.startswith("AMPLITUDE"))
    assert (first[-1], second[-1]) == (1.0, 1.0)
    assert second[1] == 1.0 > first[1] > 0.0
    included = [card for card, _ in deck if card.startswith(("CLOAD", "INCLUDE, INPUT=load"))]
    assert included == [
        "CLOAD, AMPLITUDE=HISTORY",
        "INCLUDE, INPUT=load.inp",
        "CLOAD, AMPLITUDE=HISTORY2",
        "INCLUDE, INPUT=load.2.inp",
    ]


def test_gravity_acts_on_the_tissue_at_rest_and_not_in_the_motion(hung):
    (line,) = dict(cards((hung / "static.inp").read_text()))["DLOAD"]
    assert line.startswith("BODY, GRAV, ")
    size, *direction = (float(part) for part in line.split(",")[2:])
    toward = problem_of(read_scene("block", HUNG)).gravity
    assert size * np.array(direction) == pytest.approx(toward)
    assert "GRAV" not in (hung / "dynamic.inp").read_text()
    assert "starts from rest under it" in (hung / "README.txt").read_text()


def test_what_we_get_at_rest_has_gravity_and_all_loads_in_it(hung):
    """The deck's rest by hand: our stiffness, forces of the files, weight of its elements."""
    found = np.loadtxt(hung / "static.csv", delimiter=",", skiprows=1)[:, 1:]
    scene = read_scene("block", HUNG)
    body = reference_of(scene).prepare(problem_of(scene)).body()
    whole = solve_static(body).reshape(-1, 3)
    assert np.abs(found - whole).max() < 1e-6 * np.abs(whole).max()  # straight elements: exact
    light = solve_static(replace(body, dead=None)).reshape(-1, 3)
    assert np.abs(found - light).max() > 0.1 * np.abs(whole).max()


def test_weights_hang_as_nodal_forces_and_leave_the_motion_out(tmp_path):
    request = ExportRequest(
        target="block", to="calculix", out=tmp_path / "out", overrides=(*HUNG, WEIGHT)
    )
    folder = export(request, Silent())
    toward = problem_of(read_scene("block", HUNG)).gravity
    assert forces_of(folder / "weights.inp") == pytest.approx(0.02 * toward, abs=1e-9)
    assert not (folder / "dynamic.inp").exists()
    assert "There is no motion" in (folder / "README.txt").read_text()
    assert "weights.inp" in (folder / "static.inp").read_text()
    (folder / "load.2.inp").write_text("of an earlier export")
    export(replace(request, to="vtu"), Silent())
    assert {path.name for path in folder.iterdir()} == {"README.txt", "problem.vtu"}


def test_a_vtu_file_has_every_load_and_the_weights(tmp_path):
    import pyvista as pv

    request = ExportRequest(
        target="block", to="vtu", out=tmp_path / "out", overrides=(*HUNG, WEIGHT)
    )
    grid = pv.read(export(request, Silent()) / "problem.vtu")
    assert grid.point_data["load"].sum(axis=0) == pytest.approx([0.0, 0.0, -0.05], abs=1e-12)
    assert grid.point_data["load_2"].sum(axis=0) == pytest.approx([0.0, 0.0, -0.03], abs=1e-12)
    assert np.linalg.norm(grid.point_data["weights"].sum(axis=0)) == pytest.approx(0.02 * 9.81)


def test_what_a_deck_cannot_hold_is_refused_with_the_reason(tmp_path):
    moved = ("tool.shape=sphere", "tool.displacement=2 mm")
    request = ExportRequest(target="block", to="calculix", out=tmp_path / "out", overrides=moved)
    with pytest.raises(ValueError, match="their force follows from contact"):
        export(request, Silent())
    assert not list(tmp_path.iterdir())


TRAVELS = (
    *HUNG[:6],
    'tool.place={side="superior", at=[0.3, 0.5]}',
    "tool.radius=12 mm",
    "tool.force=0.05 N",
    'tool.path=[{time="0 s", offset=[0,0,0]}, {time="0.4 s", offset=["15 mm",0,0]}]',
)
MEET = (*HUNG[:6], SECOND.replace("at=[0.8", "at=[0.3"))


@pytest.mark.parametrize(("given", "stays"), [(TRAVELS, 1.0), (MEET, 1.6)])
def test_loads_that_meet_have_a_history_at_each_node(given, stays, tmp_path):
    """Node by node the sum of all loads; at rest a tool that travels counts once."""
    request = ExportRequest(target="block", to="calculix", out=tmp_path / "out", overrides=given)
    folder = export(request, Silent())
    scene = read_scene("block", given)
    problem = problem_of(scene)
    assert forces_of(folder / "load.inp")[2] == pytest.approx(-0.05 * stays, rel=1e-9)
    motion = exporting.motion_of(scene, problem)
    body = reference_of(scene).prepare(problem).body()
    forces = (motion.factors @ body.loads.T).reshape(motion.count + 1, -1, 3)
    written = cards((folder / "histories.inp").read_text())
    assert len(written) == np.abs(forces).any(axis=0).sum()
    for card, lines in written:
        node, direction = map(int, card.removeprefix("AMPLITUDE, NAME=N").split("D"))
        own = numbers(lines)[:, 1]
        np.testing.assert_allclose(own, forces[:, node - 1, direction - 1], rtol=1e-9, atol=1e-15)
    deck = (folder / "dynamic.inp").read_text()
    assert deck.count("*CLOAD, AMPLITUDE=N") == len(written)
    assert "that at rest in full" in (folder / "README.txt").read_text()
