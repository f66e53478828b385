"""Own measurements: files refused by line, a scene beside them, quantities fitted or refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from study.models.table import models_of
from study.problem.trajectory import empty_trajectory
from study.run.preparation import QUIET
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.validation import fit_table, table, user_scene
from study.validation.fitting import Free, _shifted, fit, free_of, solve
from study.validation.user_data import Curve, UserMarkers, read_curve, read_markers
from study.validation.user_scene import UserData

SCENE = [
    'organ.size=["60 mm", "60 mm", "40 mm"]',
    "reference.element_size=20 mm",
    "lattice.spacing=10 mm",
    "time.samples=17",
    'models=["fem"]',
]
MOVED = ("tool.shape=sphere", "tool.displacement=2 mm")
E = Free("tissue.youngs_modulus", "Pa", 100.0, 1e6, 9.5e3)
TIMES = np.linspace(0.1, 1.0, 12)


def curve(values, uncertainty=None, column="displacement_m"):
    spread = None if uncertainty is None else np.full(len(values), uncertainty)
    return Curve(column, TIMES, np.asarray(values), spread)


def compliant(values):
    """Displacement of a spring whose stiffness is in proportion to the modulus."""
    return 5.0 * TIMES / values[0]


def test_the_interval_holds_the_truth_as_often_as_it_says(rng):
    held, sigma = 0, 2e-5
    for _ in range(100):
        data = curve(compliant([6e3]) + rng.normal(0.0, sigma, len(TIMES)), sigma)
        (one,) = solve(compliant, data, [E]).fit.quantities
        held += one.low < 6e3 < one.high
    assert 88 <= held <= 100
    (one,) = solve(compliant, curve(compliant([6e3])), [E]).fit.quantities
    assert one.value == pytest.approx(6e3, rel=1e-5)


def test_the_interval_is_students_and_the_shift_that_of_the_models_own_error():
    """In the logarithm of a stiffness: the curve falls by as much as that rises."""
    sigma, data = 2e-5, compliant([6e3])
    found = solve(compliant, curve(data, sigma), [E])
    (one,) = found.fit.quantities
    half = student.ppf(0.975, len(TIMES) - 1) * sigma / np.linalg.norm(data)
    assert np.log([one.low / 6e3, one.high / 6e3]) == pytest.approx([-half, half], rel=0.03)
    (moved,) = _shifted(found, 0.01 * data, [E])
    assert moved.numerical == pytest.approx(60.0, rel=0.03)
    (moved,) = _shifted(solve(compliant, curve(data), [E]), 0.01 * data, [E])
    assert moved.numerical == pytest.approx(60.0, rel=0.03)


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e6])
def test_the_unit_of_a_quantity_has_no_part_in_its_interval(unit):
    """Of a model that rounds, which steps of a share of a logarithm would not see near 1."""
    sigma = 1e-2
    free = Free("tool.force", "N", 1e-4 * unit, 1e4 * unit, 1.3 * unit)
    found = solve(lambda v: np.round(TIMES * unit / v[0], 5), curve(TIMES, sigma), [free])
    (one,) = found.fit.quantities
    half = student.ppf(0.975, len(TIMES) - 1) * sigma / np.linalg.norm(TIMES)
    assert one.value == pytest.approx(unit, rel=1e-3)
    assert np.log(one.high / one.low) == pytest.approx(2.0 * half, rel=0.01)


def test_no_run_is_beyond_the_limits_of_a_quantity():
    ratio, seen = Free("tissue.poisson_ratio", "", 0.01, 0.49999, 0.49), []

    def predict(values):
        seen.append(values[0])
        return TIMES * (1.0 - values[0])

    solve(predict, curve(TIMES * 0.52, 1e-6), [ratio])
    assert max(seen) <= 0.49999 * (1.0 + 1e-12)
    assert len(seen) == len(set(seen))


def test_an_interval_widens_where_the_model_does_not_follow():
    off = compliant([6e3]) * (1.0 + 0.2 * np.sin(9.0 * TIMES))
    near, far = (
        solve(compliant, curve(values, 1e-5), [E]).fit for values in (compliant([6e3]), off)
    )
    assert near.chi < 0.01
    assert far.chi > 3.0
    wide = [one.quantities[0].high - one.quantities[0].low for one in (near, far)]
    assert wide[1] > 3.0 * wide[0]


def test_what_a_curve_does_not_determine_is_refused():
    other = Free("support.stiffness", "Pa/m", 1.0, 1e12, 1e6)
    with pytest.raises(ValueError, match="does not change with it"):
        solve(lambda _: TIMES, curve(TIMES), [E])
    with pytest.raises(ValueError, match="does not distinguish them"):
        solve(lambda v: 5.0 * TIMES / (v[0] * v[1]) * 1e6, curve(TIMES * 1e-3), [E, other])
    with pytest.raises(ValueError, match="goes beyond"):
        solve(compliant, curve(compliant([6e3]), 1.0), [E])
    # Below the range of a logarithm without a lower limit, but above the largest Poisson ratio.
    ratio = Free("tissue.poisson_ratio", "", 1e-7, 0.49999, 0.4)
    with pytest.raises(ValueError, match="goes beyond"):
        solve(lambda v: TIMES * (1.0 - v[0]), curve(TIMES * 0.6, 0.6), [ratio])
    with pytest.raises(ValueError, match="no value between"):
        solve(compliant, curve(compliant([1e8]), 1e-9), [E])
    with pytest.raises(ValueError, match="cannot determine"):
        solve(compliant, replace(curve([1.0]), times=TIMES[:1]), [E])


def test_models_that_there_are_not_are_refused():
    scene = read_scene("block")
    with pytest.raises(ValueError, match="--model nope: is not one of"):
        fit(scene, curve(TIMES), ["tissue.youngs_modulus"], "nope", QUIET)
    with pytest.raises(ValueError, match=r"organ\.shape"):
        fit(read_scene("paper"), curve(TIMES), ["tissue.youngs_modulus"], "fem", QUIET)


@pytest.mark.parametrize(
    ("model", "overrides", "message"),
    [
        ("corrected", MOVED, "--model corrected: .*corrected cannot follow rigid tools"),
        ("superposition", ('gravity={acceleration="9.81 m/s^2"}',), "cannot follow gravity"),
        ("reading", ("patient={}",), "reading needs a reading"),
        ("msm", (), "--model msm: is a kind of 3 models; name one system"),
    ],
)
def test_a_model_that_cannot_follow_the_scene_or_is_several_is_refused(model, overrides, message):
    scene = read_scene("block", (*SCENE, *overrides))
    column = "force_N" if overrides is MOVED else "displacement_m"
    given = curve(1e-3 * TIMES, column=column)
    with pytest.raises(ValueError, match=message):
        fit(scene, given, ["damping.ratio"], model, QUIET)


def test_a_choice_of_the_computation_and_a_curve_of_zeros_are_refused():
    scene = read_scene("block", SCENE)
    for key in ("lattice.spacing", "reference.element_size", "time.duration"):
        with pytest.raises(ValueError, match=f"{key}: is a choice of the computation"):
            free_of(scene, key)
    with pytest.raises(ValueError, match="zero throughout"):
        fit(scene, curve(0.0 * TIMES), ["tissue.youngs_modulus"], "fem", QUIET)


def test_only_positive_quantities_of_the_scene_are_free():
    scene = read_scene("block")
    assert free_of(scene, "tissue.youngs_modulus") == E
    none = ("tissue.colour", "tissue", "tool.place", "models", "lattice.springs", "time.samples")
    for key in none:
        with pytest.raises(ValueError, match="no positive quantity"):
            free_of(scene, key)


def write(path, header, rows):
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "rows", "message"),
    [
        ("time_s,displacement_m", ["0,0", "1,x", "2,1"], r":3: displacement_m: 'x' is no number"),
        ("time_s,displacement_m", ["0,0", "1,nan", "2,1"], r":3: displacement_m: 'nan'"),
        ("time_s,displacement_m", ["0,0", "1,1_0", "2,1"], r":3: displacement_m: '1_0'"),
        ("time_s,displacement_m", ["0,0", "1", "2,1"], r":3: 1 cells under 2 columns"),
        ("time_s,displacement_m", ["0,0", "1,1", "1,2"], r":4: time_s does not grow"),
        ("time_s,displacement_m", ["0,0", "", "1,1", "1,2"], r":5: time_s does not grow"),
        ("time_s,displacement_m", ["0,0", ",", "1,1"], r":3: time_s: the cell is empty"),
        ("time_s,displacement_m,displacement_m", ["0,0,1"] * 3, r":1: .*_m' appears twice"),
        ("time_s displacement_m", ["0 0"] * 3, r":1: .* separated by commas, semicolons or tabs"),
        ("Time_s,displacement_m", ["0,0"] * 3, r":1: .* among 'Time_s', .* name it time_s, in sec"),
        ("# tool,displacement_mm", ["0,0"] * 3, r":1: the column time_s is missing among '# tool'"),
        (
            "# by hand",
            ["time_s,force_N", "0,0"],
            r":2: 2 cells .* '# by hand' in line 1 on; remove",
        ),
        ("time_s,force_mN", ["0,0"] * 3, r":1: .* did you mean force_N\? Convert its numbers"),
        ("time_s,displacement_m", ["0,0"], r":2: 1 lines of numbers; give 3 or more"),
        ("time_s,displacement_m,force_N", ["0,0,0"], r":1: give one of the columns"),
        ("depth_m,force_N", ["0,0", "1,1", "2,2"], r":1: .* time_s is missing.*force over depth"),
        ("displacement_m", ["0", "1", "2"], r":1: the column time_s is missing"),
        ("time_s,depth", ["0,0"], r":1: column 'depth' is none of .* rename or remove it"),
        ("time_s,displacement_m,uncertainty", ["0,0,1", "1,1,0", "2,2,1"], r":3: uncertainty must"),
        # A name misspelt: its numbers would be left out, and the intervals with them.
        ("time_s,force_N,uncertanty", ["0,0,1"] * 3, r":1: .* did you mean uncertainty\?"),
        ("time_s,force_N,Uncertainty", ["0,0,1"] * 3, r":1: .* did you mean uncertainty\?"),
        ("time_s,force_N,sigma", ["0,0,1"] * 3, r":1: column 'sigma' is none of"),
        # Points would be decimal ones in one column, and of thousands in the next.
        ("time_s;force_N", ["0,0;0", "0,5;1.500", "1,0;2"], r":3: force_N: '1.500' stands beside"),
    ],
)
def test_a_curve_that_is_none_is_refused_by_line(tmp_path, header, rows, message):
    with pytest.raises(ValueError, match=message):
        read_curve(write(tmp_path / "c.csv", header, rows))


@pytest.mark.parametrize(
    "text",
    [
        "time_s;force_N\n0,0;0\n0,5;1,5e-3\n1,0;2\n",
        "time_s\tforce_N\r\n0\t0\r\n0,5\t0,0015\r\n1\t2\r\n",
        "sep=;\r\ntime_s;force_N;\r\n0;0;\r\n0,5;0,0015;\r\n1;2;\r\n",
        "\ufeff\n time_s , force_N\n0,0\n\n0.5,1.5e-3\n1,2\n,\n",
    ],
)
def test_a_curve_is_read_as_spreadsheets_write_it(tmp_path, text):
    path = tmp_path / "c.csv"
    path.write_bytes(text.encode())
    found = read_curve(path)
    assert found.times.tolist() == [0.0, 0.5, 1.0]
    assert found.values.tolist() == [0.0, 0.0015, 2.0]


def test_every_csv_file_of_a_folder_counts_but_hidden_ones(tmp_path):
    rows = ["0,0", "1,1", "2,2"]
    for name in ("PRESS.CSV", "lift.csv", "notes.txt"):
        write(tmp_path / name, "time_s,force_N", rows)
    (tmp_path / "._lift.csv").write_bytes(b"\x00\x05\xff")
    write(tmp_path / "Markers.csv", "x_m,y_m,z_m,ux_m,uy_m,uz_m", ["0,0,0,0,0,1"] * 3)
    found = user_scene.read_folder(tmp_path)
    assert sorted(found.curves) == ["PRESS", "lift"]
    assert found.unread == ("notes.txt",)
    assert len(found.markers.places) == 3
    write(tmp_path / "press.CSV", "time_s,force_N", rows)
    write(tmp_path / "PRESS.csv", "time_s,force_N", rows)
    with pytest.raises(ValueError, match=r"holds PRESS twice"):
        user_scene.read_folder(tmp_path)


def test_markers_outside_of_the_organ_are_refused_by_line(posed, tmp_path):
    """In millimetres, or of another frame: models would be extrapolated to them."""
    scene, _, _ = posed
    rows = ["0.03,0.03,0.02,0,0,0", "", "0.03,0.03,20,0,0,0", "0.03,0.03,0.04,0,0,0"]
    path = write(tmp_path / "markers.csv", "x_m,y_m,z_m,ux_m,uy_m,uz_m", rows)
    found = user_scene.comparisons(scene, UserData({}, read_markers(path)), QUIET)
    with pytest.raises(ValueError, match=r"line 4: \(0.03, 0.03, 20\) m lies outside the organ"):
        next(found)


def test_displacements_longer_than_the_organ_are_refused_by_line(posed, tmp_path):
    """Millimetres in a column of metres."""
    scene, _, _ = posed
    rows = ["0.03,0.03,0.02,0,0,0", "0.03,0.03,0.01,0,0,4", "0.03,0.03,0.04,0,0,0"]
    markers = read_markers(write(tmp_path / "markers.csv", "x_m,y_m,z_m,ux_m,uy_m,uz_m", rows))
    with pytest.raises(ValueError, match=r"markers.csv: line 3: a displacement of 4 m in an organ"):
        next(user_scene.comparisons(scene, UserData({}, markers), QUIET))
    curve = write(tmp_path / "c.csv", "time_s,displacement_m", ["0,0", "0.1,-4", "0.2,2"])
    data = UserData({"c": read_curve(curve)}, None)
    with pytest.raises(ValueError, match=r"displacement_m: line 3: a displacement of 4 m .* metr"):
        next(user_scene.comparisons(scene, data, QUIET))


def test_files_that_are_not_there_or_no_text_are_refused(tmp_path):
    with pytest.raises(ValueError, match="No such file"):
        read_curve(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="UTF-8"):
        read_curve(tmp_path / "b.csv")
    with pytest.raises(ValueError, match="no such folder"):
        user_scene.read_folder(tmp_path / "none")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="holds no CSV"):
        user_scene.read_folder(tmp_path / "empty")
    with pytest.raises(ValueError, match="column 'a' is none of x_m"):
        read_markers(write(tmp_path / "m.csv", "a,b", ["1,2"]))


@pytest.fixture(scope="module")
def posed():
    """A small scene, its problem, and the motion that it says itself."""
    scene = read_scene("block", SCENE)
    problem = problem_of(scene)
    (model,) = models_of(scene, {})
    return scene, problem, model.prepare(problem).simulate().trajectory


def own_curve(posed, uncertainty=1e-6):
    _, problem, motion = posed
    values = motion.displacement[:, 0] @ problem.tool.direction
    return Curve("displacement_m", problem.observation.times, values, np.full(17, uncertainty))


def test_a_scene_beside_its_own_motion_differs_by_nothing(posed):
    scene, problem, _ = posed
    found = user_scene.comparisons(scene, UserData({"tool": own_curve(posed)}, None), QUIET)
    (one,) = found
    assert one.found < 1e-12
    assert one.verdict == "not resolved"  # by the numerical error, larger than the uncertainty
    assert one.numerical > 0.0  # its own error is not nothing for that
    assert "own scene" in "\n".join(table.lines([one]))
    with pytest.raises(ValueError, match="is not one of tool, corner"):
        user_scene.probe_number(problem, "rim")
    force = replace(own_curve(posed), column="force_N")
    with pytest.raises(ValueError, match="driven by force"):
        user_scene.refuse_unanswered(problem, force)
    late = replace(own_curve(posed), times=own_curve(posed).times + 1.0)
    with pytest.raises(ValueError, match="is not within"):
        user_scene.refuse_unanswered(problem, late)


def test_a_force_is_that_with_which_the_first_moved_tool_is_pushed():
    """The body pushes a tool back that goes down: what is read of it is positive."""
    problem = problem_of(read_scene("block", (*SCENE, *MOVED)))
    times = problem.observation.times
    pushed_up = times[:, None, None] * np.array([0.5, 0.0, 2.0])
    motion = replace(empty_trajectory(problem.observation, 1), tool_force=pushed_up)
    given = Curve("force_N", times[2:5] + 0.01, np.ones(3), None)
    assert user_scene.seen(problem, motion, given, 0) == pytest.approx(2.0 * given.times)


def test_the_residual_of_markers_is_the_rms_of_their_distances():
    """An uncertainty is of each component, and the root mean square is of lengths."""
    moved, places = np.tile([3e-3, 0.0, 4e-3], (4, 1)), np.zeros((4, 3))
    markers = UserMarkers(places, 0.0 * moved, np.full(4, 1e-3))
    found = user_scene._of_markers(markers, "model", moved, None)
    assert found.found == pytest.approx(5e-3)
    assert found.uncertainty == pytest.approx(1e-3 * np.sqrt(3.0))


def test_a_modulus_is_recovered_and_its_error_stated(posed):
    scene, _, _ = posed
    started = replace(scene, tissue=replace(scene.tissue, youngs_modulus=8e3))
    found = fit(started, own_curve(posed, 1e-5), ["tissue.youngs_modulus"], "fem", QUIET)
    (one,) = found.quantities
    assert one.value == pytest.approx(9.5e3, rel=1e-3)
    assert one.low < 9.5e3 < one.high
    assert one.numerical > 0.0
    assert found.chi < 0.1
    text = "\n".join(fit_table.lines(found))
    assert "tissue.youngs_modulus = 9500 Pa" in text
    assert json.loads(fit_table.as_json(found))["quantities"][0]["key"] == "tissue.youngs_modulus"


def test_the_commands_refuse_with_exit_code_2(typed, tmp_path):
    path = write(tmp_path / "c.csv", "time_s,displacement_m", ["0,0", "1,x", "2,1"])
    for command in (
        ["fit", "block", "--curve", str(path), "--free", "tissue.youngs_modulus"],
        ["validate", "block", "--data", str(tmp_path)],
        ["validate", "--data", str(tmp_path)],
    ):
        done = typed(*command)
        assert done.returncode == 2
        assert "Traceback" not in done.stderr
